"""Whether this machine loads an FMU, as far as its file says, and the fix; or by a trial."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib.machinery import ModuleSpec
from itertools import islice
from pathlib import Path
from shlex import quote
from shutil import which
from typing import Literal
from xml.etree import ElementTree

from ..base.checks import install_command
from ..base.errors import choices
from ..base.scratch import ScratchFolder
from ..base.system_calls import forbids_programs
from ..fmi import fmpy
from ..interface.document import unreadable
from ..interface.interface import Interface
from ..interface.obstacles import (
    HEAD,
    of_binary,
    of_kind,
    of_loading,
    processor,
    this_machine,
)  # fmt: skip
from ..interface.read import describe
from .packed_imports import imports

Status = Literal["ok", "warning", "problem"]
Verdict = tuple[Status, str, str | None]
"""What a check says: status, text, and the fix where one is needed."""

LINUX = sys.platform == "linux"
VERSION = f"{sys.version_info.major}.{sys.version_info.minor}"
LIBPYTHON = f"libpython{VERSION}{getattr(sys, 'abiflags', '')}.so.1.0"
"""What a host that is not Python needs of this Python."""

_PACKAGES = {"cv2": "opencv-python", "sklearn": "scikit-learn", "yaml": "pyyaml"}
"""Packages that are not called as their module."""

_TRIAL = """
import os, sys
from pathlib import Path
from grasp_cosim.fmi.make_instance import load_here
from grasp_cosim.interface.read import read_interface
try:
    load_here("trial", read_interface(Path(sys.argv[1]))).close()
except Exception as error:
    print(error)
    os._exit(1)  # pythonfmu's binary reads freed memory where the process then ends as usual
print("freed")
"""


@dataclass(frozen=True, slots=True)
class Finding:
    """A finding of one check; fix is a command or an instruction to copy."""

    check: str
    status: Status
    text: str
    fix: str | None


def examine(fmu: Path, load: bool = False) -> list[Finding]:
    """Check an FMU as far as its file says, which runs none of its code.

    With `load` it is loaded in a child process, too, and what it needs of this machine is checked.
    InputError where fmu is no readable FMU.
    """
    with ScratchFolder() as scratch:
        unpacked = unpack(fmu, Path(scratch.name))
        if not load:
            here = islice(_machine(unpacked.python), 2)  # this Python, and where FMUs are unpacked
            wrong = [finding for finding in here if finding.status == "problem"]
            return [*wrong, *_findings(unpacked, CHECKS)]
        unpacked = replace(unpacked, linked=_linked(unpacked.binary))
        tried = trial(unpacked)
        unpacked = replace(unpacked, loads=tried[0] == "ok")
        found = _findings(unpacked, CHECKS | TRIED)
        return [*_machine(unpacked.python), *found, Finding("trial", *tried)]


def _findings(
    fmu: Unpacked, checks: Mapping[str, Callable[[Unpacked], Verdict | None]]
) -> list[Finding]:
    verdicts = {name: check(fmu) for name, check in checks.items()}
    return [Finding(name, *verdict) for name, verdict in verdicts.items() if verdict]


def loads(findings: Iterable[Finding]) -> bool:
    """True if none of the findings is a problem."""
    return not any(f.status == "problem" for f in findings)


def as_text(findings: Sequence[Finding], tried: bool) -> str:
    """The verdict, then one line for each finding, a fix below it."""
    said = "" if tried else ", as far as the file says; --load tries"
    verdict = f"loads on this machine: {'yes' if loads(findings) else 'no'}{said}"
    return "\n".join(
        [verdict]
        + [
            f"{f.status:8s} {f.check:12s} {f.text}" + (f"\n{'':21s} fix: {f.fix}" if f.fix else "")
            for f in findings
        ]
    )


def _machine(python: bool) -> Iterator[Finding]:
    """The checks without an FMU; python: also those that matter to Python FMUs only."""
    yield Finding("python", *interpreter(sys.version_info[:3], sys.maxsize))
    folder = Path(tempfile.gettempdir())
    noexec = forbids_programs(folder)
    yield Finding("temp folder", *temporary_folder(folder, noexec, python))
    if python and LINUX:
        yield Finding("libpython", *libpython(find_libpython()))
        yield Finding("python3", *python_on_path(which("python3")))
    if python:
        yield Finding("environment", *environment(os.environ))
    if python and LINUX and not HERE.startswith("x86-64"):
        text = f"{HERE}: pythonfmu has no binary for it; native twins run in the place of our FMUs"
        yield Finding("processor", "warning", text, "grasp-cosim build --native BLOCK")


def interpreter(version: tuple[int, ...], largest: int) -> Verdict:
    """The running Python: its version and sys.maxsize."""
    wide = largest > 2**32
    text = f"{'.'.join(map(str, version))}, {64 if wide else 32} bit, {sys.executable}"
    if version >= (3, 11) and wide:
        return "ok", text, None
    return "problem", f"{text}; must be 64 bit, 3.11 or newer", "install a 64 bit Python"


def temporary_folder(folder: Path, noexec: bool, python: bool) -> Verdict:
    """The folder where FMPy and most hosts unpack an FMU and load it from."""
    path = folder.as_posix().removeprefix(folder.drive)
    odd = "".join(dict.fromkeys(re.findall(r"[^\w/ .~-]", path, re.ASCII)))
    if noexec:
        text = f"{folder} is mounted with noexec: no FMU loads from there"
        return "problem", text, "mkdir -p ~/tmp && export TMPDIR=~/tmp"
    if python and odd:
        text = f"{folder}: a Python FMU crashes its host on {odd!r} in this path"
        return "problem", text, "export TMPDIR=/tmp"
    return "ok", f"{folder}, where FMUs are unpacked", None


def find_libpython() -> str | None:
    """The path of this Python's shared library."""
    beside = Path(sys.base_prefix, "lib", LIBPYTHON)
    if beside.is_file():
        return str(beside)
    known = _run("/sbin/ldconfig", "-p")[1]
    found = re.search(rf"^\s*{re.escape(LIBPYTHON)} .*=> (.+)$", known, re.MULTILINE)
    return found[1] if found else None


def libpython(path: str | None) -> Verdict:
    """The library with which a host that is not Python runs Python FMUs."""
    if path:
        return "ok", path, None
    text = f"no {LIBPYTHON}: hosts that are not Python cannot run Python FMUs"
    return "warning", text, f"sudo apt install libpython{VERSION}, or what your system calls it"


def python_on_path(python3: str | None) -> Verdict:
    """The python3 on the PATH: an embedded Python looks for its modules beside it."""
    code = "import sys; print('%d.%d.%d' % sys.version_info[:3])"
    version = _run(python3, "-c", code)[1].strip() if python3 else ""
    if version.startswith(f"{VERSION}."):
        return "ok", f"{version}, {python3}", None
    text = f"{version or 'none that starts'} on the PATH, not {VERSION}: hosts that are not Python"
    fix = f"export PATH={quote(str(Path(sys.executable).parent))}:$PATH"
    return "warning", f"{text} do not find the packages of this Python", fix


def environment(environ: Mapping[str, str]) -> Verdict:
    """PYTHONHOME and PYTHONPATH, which the Python in every host obeys."""
    home = environ.get("PYTHONHOME", "").partition(":")[0]
    if home and LINUX and not Path(home, f"lib/python{VERSION}").is_dir():
        text = f"PYTHONHOME={home} has no lib/python{VERSION}: a Python FMU ends its host"
        return "warning", text, "unset PYTHONHOME"
    for entry in filter(None, environ.get("PYTHONPATH", "").split(os.pathsep)):
        of = re.search(r"python(3\.\d+)", entry)
        if (of and of[1] != VERSION) or not (Path(entry).is_absolute() and Path(entry).exists()):
            text = f"PYTHONPATH holds {entry}: relative, not there, or of another Python"
            return "warning", text, "unset PYTHONPATH"
    return "ok", "PYTHONHOME and PYTHONPATH do no harm", None


def _processor(path: Path) -> str:
    """The processor for which a binary is made, from its ELF header; empty where it is missing."""
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        head = file.read(HEAD)
    if not LINUX:
        return "a binary"
    return f"{its}, {32 * head[4]} bit" if (its := processor(head)) else "no ELF file"


HERE = _processor(Path(sys.executable))
"""The processor of this Python."""


def _run(*command: str, timeout: float = 20.0, cwd: Path | None = None) -> tuple[int | None, str]:
    """Exit code, None where it does not start or end in time, and output of a program.

    In a folder of its own it has its temporary files there, too.
    """
    try:
        done = subprocess.run(  # noqa: S603  an FMU's code runs: that is the trial
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            encoding="utf-8", errors="replace", cwd=cwd, timeout=timeout, check=False,
            env=os.environ | ({"TMPDIR": str(cwd)} if cwd else {}),
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return None, ""
    return done.returncode, done.stdout


@dataclass(frozen=True, slots=True)
class Unpacked:
    """An unpacked FMU: what its description says, and the binary it would have to have here."""

    path: Path
    folder: Path
    declared: Interface
    binary: Path
    python: bool
    """True if pythonfmu made it, in any version."""
    linked: str = ""
    """Words of the dynamic linker on the binary outside of Python; empty if it cannot tell."""
    loads: bool = False
    """True if the trial has loaded it."""

    @property
    def tool(self) -> str:
        """What made it."""
        return self.declared.tool or "an unknown tool"


def unpack(fmu: Path, folder: Path) -> Unpacked:
    """Unpack an FMU to a folder; InputError where it is none."""
    found = describe(fmu)
    try:
        fmpy.extract(fmu, folder)
    except Exception as error:  # FMPy and zipfile raise whatever they like
        raise unreadable(fmu, str(error).replace(f"{folder}/", "")) from error
    file = f"{found.identifier}{fmpy.sharedLibraryExtension}"
    binary = folder / "binaries" / this_machine(found.version) / file
    made = [folder / "resources" / name for name in ("slavemodule.txt", "pythonfmu")]
    return Unpacked(
        fmu,
        folder,
        found,
        binary=binary,
        python=any(p.exists() for p in made)
        or (binary.is_file() and b"/slavemodule.txt" in binary.read_bytes()),
    )


def _linked(binary: Path) -> str:
    """Words of the dynamic linker on a binary outside of Python; empty where it cannot tell."""
    return _run("env", "LC_ALL=C", "ldd", "-r", str(binary))[1] if LINUX else ""


def description(fmu: Unpacked) -> Verdict:
    """FMI version and kind."""
    source = "needs Python" if fmu.python else "native, needs no Python"
    kind = ", ".join([f"FMI {fmu.declared.version}", *fmu.declared.kinds])
    text = f"{kind}, made by {fmu.tool}; {source}"
    if obstacle := of_kind(fmu.declared):
        return "problem", f"{text}; {obstacle.what}", obstacle.remedy
    if "CoSimulation" not in fmu.declared.kinds:
        text += "; run here by a solver, elsewhere ask the vendor for an export for co-simulation"
    if tied := of_loading(fmu.declared, ""):
        return "warning", f"{text}; {tied.what}", tied.remedy
    return "ok", text, None


def by_fmpy(fmu: Unpacked) -> Verdict | None:
    """Whether FMPy accepts the description, which hosts by it need."""
    try:
        fmpy.read_model_description(fmu.folder)
    except Exception as error:  # FMPy raises whatever it likes
        text = f"FMPy refuses modelDescription.xml: {' '.join(str(error).split())}"
        fix = "correct the description where the FMU is made"
        return "warning" if fmu.loads else "problem", text, fix
    return None


def binary(fmu: Unpacked) -> Verdict:
    """Check that there is a binary for this system and processor."""
    wanted, its = fmu.binary.relative_to(fmu.folder).as_posix(), _processor(fmu.binary)
    ours = fmu.binary.parent.name
    there = sorted(fmu.folder.glob("binaries/*/*"))
    if its == HERE:
        folders = choices(dict.fromkeys(path.parent.name for path in there))
        return "ok", f"{wanted}, {its}; there is: {folders}; this machine: {ours}", None
    if its:
        fix = f"build it again for {HERE}"
        fix += ", or as a native FMU: grasp-cosim build --native" if fmu.python else ""
        return "problem", f"{wanted} is {its}; must be {HERE}", fix
    fix = f"build it again for {ours}"
    if obstacle := of_binary(fmu.declared):
        again = fmu.python and not fmu.declared.sources
        fix += " (pythonfmu 0.7.0 does for linux64 and win64)"
        return "problem", obstacle.what, fix if again else obstacle.remedy
    files = choices(f"{path.parent.name}/{path.name}" for path in there)
    return "problem", f"no {wanted}; there is: {files}; this machine: {ours}", fix


def sources(fmu: Unpacked) -> Verdict | None:
    """Check that the sources are those that its build description names, and can be compiled."""
    folder = fmu.folder / "sources"
    build = folder / "buildDescription.xml"
    if not build.is_file():
        found = any(folder.glob("*.c"))
        return ("warning", "sources/ without buildDescription.xml", None) if found else None
    try:
        named = [e.get("name", "") for e in ElementTree.parse(build).iter("SourceFile")]  # noqa: S314 - of the FMU that is loaded
    except ElementTree.ParseError as error:
        return "problem", f"sources/buildDescription.xml: {error}", "correct it where it is made"
    missing = [name for name in named if not (folder / name).is_file()]
    if missing or not named:
        text = f"sources/buildDescription.xml names {choices(missing)}, which is not there"
        return "problem", text, "correct it where the FMU is made"
    compiler = next(filter(which, ("cc", "gcc", "clang", "cl")), None)
    able = f"{compiler} is here" if compiler else "no C compiler here"
    return "ok", f"sources/{choices(named)}, to compile for other machines; {able}", None


def host(fmu: Unpacked) -> Verdict | None:
    """Check that the binary of a Python FMU finds libpython in a host that is not Python."""
    bound = re.search(r"(libpython\S+) => (not found|\S+)", fmu.linked)
    path = find_libpython()
    if bound and bound[2] != "not found":
        return "ok", f"bound to {bound[1]}, found at {bound[2]}", None
    if bound:
        fix = "build it again with pythonfmu 0.7.0, which is bound to no version of Python"
        if path and Path(path).with_name(bound[1]).exists():
            fix = f"export LD_LIBRARY_PATH={quote(str(Path(path).parent))}"
        here = f"/{bound[1]}\n" in Path("/proc/self/maps").read_text()
        text = f"bound to {bound[1]}, which hosts that are not Python do not find"
        return "warning" if here else "problem", text if here else f"{text}, nor this one", fix
    if not re.search("undefined symbol: _?Py", fmu.linked):
        return None
    fix = f"LD_PRELOAD={quote(path or LIBPYTHON)} HOST"
    if "grasp-cosim" in fmu.tool:
        fix += ", or grasp-cosim build --native"
    text = "bound to no libpython: hosts that are not Python miss the symbol _Py_NoneStruct"
    return "warning", text, fix


def libraries(fmu: Unpacked) -> Verdict | None:
    """Check that the dynamic linker finds what the binary needs besides libpython."""
    if not re.search("=>|statically linked", fmu.linked):
        return None
    missing = re.findall(r"(\S+) => not found", fmu.linked)
    others = [name for name in missing if not name.startswith("libpython")]
    newer = dict.fromkeys(re.findall(r"version `(\S+)' not found", fmu.linked))
    symbols = re.findall(r"undefined symbol: (?!_?Py)(\S+)", fmu.linked)
    if others and fmu.binary.with_name(others[0]).exists():
        fix = f"patchelf --set-rpath '$ORIGIN' {fmu.binary.name}, and pack the FMU again"
        return "problem", f"not found though packed: {choices(others)}", fix
    if others:
        return "problem", f"not found: {choices(others)}", "install the packages that hold them"
    if newer:
        return "problem", f"not on this system: {choices(newer)}", "build it again on this system"
    if symbols and not missing:
        fix, text = (
            "link the binary with the libraries that define them",
            f"undefined symbols: {choices(symbols, 5)}",
        )
        if fmu.loads:  # a host that has libm, say, has them
            return "warning", f"{text}; this host has them, others may not", fix
        return "problem", text, fix
    return "ok", f"the dynamic linker finds all{' others' if missing else ''}", None


def script(fmu: Unpacked) -> Verdict | None:
    """Check that the script is there, parses here, and has what it imports, which parses too."""
    if not fmu.python:
        return None
    resources, fix = fmu.folder / "resources", "build it again with pythonfmu"
    named = resources / "slavemodule.txt"
    name = named.read_text("utf-8", "replace").partition("\n")[0] if named.is_file() else ""
    if not (name and (resources / f"{name}.py").is_file()):
        return "problem", f"no script: resources/slavemodule.txt names {name or 'none'}", fix
    outside, errors = imports(resources, name)
    if errors:
        return "problem", f"no Python {VERSION}: {errors[0]}", "correct it and build the FMU again"
    outside -= sys.stdlib_module_names
    if missing := sorted(name for name in outside if not _spec(name)):
        fix = install_command(*(_PACKAGES.get(name, name) for name in missing))
        return "problem", f"imports what is neither packed nor installed: {choices(missing)}", fix
    text = f"resources/{name}.py imports, besides the standard library: {choices(sorted(outside))}"
    return "ok", text, None


def modules(fmu: Unpacked) -> Verdict | None:
    """Check module names, for all Python FMUs of a host share sys.modules."""
    if not fmu.python:
        return None
    files = [*fmu.folder.glob("resources/*.py"), *fmu.folder.glob("resources/*/__init__.py")]
    names = {p.parent.name if p.stem == "__init__" else p.stem for p in files}
    for name in sorted(names - {"pythonfmu"}):
        spec = _spec(name)
        other = "the standard library" if name in sys.stdlib_module_names else spec and spec.origin
        if other:
            text = f"packs {name!r}, which is in {other} too: the first one imported serves both"
            return "warning", text, f"give {name!r} a name of its own and build the FMU again"
    return "ok", "no packed module has the name of another", None


def trial(fmu: Unpacked, timeout: float = 60.0) -> Verdict:
    """Load, instantiate and free the FMU in a child process, which gets timeout in s."""
    if of_kind(fmu.declared) or _processor(fmu.binary) != HERE:
        return "warning", "not loaded: of a kind that is not run here, or without a binary", None
    started = time.monotonic()
    arguments = ["-P", "-u", "-c", _TRIAL, str(fmu.path.absolute())]
    code, said = _run(sys.executable, *arguments, timeout=timeout, cwd=fmu.folder)
    said = said.replace(f"{fmu.folder}/", "").replace(f"trial: {fmu.path.absolute()} ", "")
    last = ["", *filter(None, map(str.strip, said.splitlines()))][-1]
    if code is None:
        return "problem", f"does not load and instantiate within {timeout:g} s", None
    if code < 0:
        when = f"when instantiated; it says {last or 'nothing'}"
        if last == "freed":
            when = "after it was freed"
        return "problem", f"crashes with {signal.Signals(-code).name} {when}", None
    if code or last != "freed":
        last = last.removeprefix("does not load: ") or "no reason given"
        tied = of_loading(fmu.declared, last)
        return "problem", f"does not instantiate: {last}", tied.remedy if tied else None
    return "ok", f"loads, instantiates and frees in {time.monotonic() - started:.1f} s", None


CHECKS: dict[str, Callable[[Unpacked], Verdict | None]] = {
    "fmu": description, "binary": binary, "sources": sources, "script": script, "modules": modules,
}  # fmt: skip
"""The checks of the file of an FMU; None where one does not apply."""

TRIED: dict[str, Callable[[Unpacked], Verdict | None]] = {
    "FMPy": by_fmpy, "host": host, "libraries": libraries,
}  # fmt: skip
"""Further ones, of an FMU that is loaded as well."""


def _spec(name: str) -> ModuleSpec | None:
    """File this Python would import under a name; sys.modules may hold an earlier one."""
    return next(filter(None, (f.find_spec(name, None) for f in sys.meta_path)), None)
