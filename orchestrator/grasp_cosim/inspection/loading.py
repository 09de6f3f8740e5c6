"""Whether this machine loads an FMU, as far as its file says, and the fix; or by a trial."""

from __future__ import annotations

import ast
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from importlib.machinery import ModuleSpec, all_suffixes
from pathlib import Path
from shlex import quote
from typing import Literal

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


@dataclass(frozen=True, slots=True)
class Unpacked:
    """An unpacked FMU: what its description says, and the binary it would have to have here.

    python is True if pythonfmu made it, in any version. linked is what the dynamic linker says of
    the binary outside of Python, and loads is True if the trial has loaded it.
    """

    path: Path
    folder: Path
    declared: Interface
    binary: Path
    python: bool
    linked: str = ""
    loads: bool = False


def examine(fmu: Path, load: bool = False) -> list[Finding]:
    """Check an FMU as far as its file says, which runs none of its code.

    With `load` it is loaded in a child process, too, and what it needs of this machine is checked.
    InputError where fmu is no readable FMU.
    """
    with ScratchFolder() as scratch:
        unpacked, last = unpack(fmu, Path(scratch.name)), {}
        if load:
            tried = trial(unpacked)
            linked = linker(unpacked.binary)
            unpacked = replace(unpacked, linked=linked, loads=tried[0] == "ok")
            last = {"host": host(unpacked), "libraries": libraries(unpacked), "trial": tried}
        verdicts = {name: check(unpacked) for name, check in CHECKS.items()} | last
        return [Finding(name, *verdict) for name, verdict in verdicts.items() if verdict]


def loads(findings: Iterable[Finding]) -> bool:
    """True if none of the findings is a problem."""
    return not any(f.status == "problem" for f in findings)


def as_text(findings: Sequence[Finding], tried: bool) -> str:
    """The verdict, then one line for each finding, a fix below it."""
    said = "" if tried else ", as far as the file says; --load tries"
    lines = [f"loads on this machine: {'yes' if loads(findings) else 'no'}{said}"]
    for f in findings:
        lines.append(f"{f.status:8s} {f.check:12s} {f.text}")
        lines += [f"{'':21s} fix: {f.fix}"] if f.fix else []
    return "\n".join(lines)


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
    python = any(p.exists() for p in made)
    python = python or (binary.is_file() and b"/slavemodule.txt" in binary.read_bytes())
    return Unpacked(fmu, folder, found, binary, python)


def temporary_folder(fmu: Unpacked) -> Verdict | None:
    """The folder where FMPy and most hosts unpack an FMU and load it from, where it does harm."""
    folder = Path(tempfile.gettempdir())
    path = folder.as_posix().removeprefix(folder.drive)
    odd = "".join(dict.fromkeys(re.findall(r"[^\w/ .~-]", path, re.ASCII)))
    if forbids_programs(folder):
        text = f"{folder} is mounted with noexec: no FMU loads from there"
        return "problem", text, "mkdir -p ~/tmp && export TMPDIR=~/tmp"
    if fmu.python and odd:
        text = f"{folder}: a Python FMU crashes its host on {odd!r} in this path"
        return "problem", text, "export TMPDIR=/tmp"
    return None


def description(fmu: Unpacked) -> Verdict:
    """FMI version and kind."""
    source = "needs Python" if fmu.python else "native, needs no Python"
    kind = ", ".join([f"FMI {fmu.declared.version}", *fmu.declared.kinds])
    text = f"{kind}, made by {fmu.declared.tool or 'an unknown tool'}; {source}"
    if obstacle := of_kind(fmu.declared):
        return "problem", f"{text}; {obstacle.what}", obstacle.remedy
    if "CoSimulation" not in fmu.declared.kinds:
        text += "; run here by a solver, elsewhere ask the vendor for an export for co-simulation"
    if tied := of_loading(fmu.declared, ""):
        return "warning", f"{text}; {tied.what}", tied.remedy
    return "ok", text, None


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


def binary(fmu: Unpacked) -> Verdict:
    """Check that there is a binary for this system and processor."""
    wanted, its = fmu.binary.relative_to(fmu.folder).as_posix(), _processor(fmu.binary)
    ours = fmu.binary.parent.name
    there = [path.relative_to(fmu.folder / "binaries") for path in fmu.folder.glob("binaries/*/*")]
    if its == HERE:
        folders = choices(sorted({path.parent.name for path in there}))
        return "ok", f"{wanted}, {its}; there is: {folders}; this machine: {ours}", None
    if its:
        fix = f"build it again for {HERE}"
        fix += ", or as a native FMU: grasp-cosim build --native" if fmu.python else ""
        return "problem", f"{wanted} is {its}; must be {HERE}", fix
    if obstacle := of_binary(fmu.declared):
        return "problem", obstacle.what, obstacle.remedy
    files = choices(sorted(map(Path.as_posix, there)))
    text = f"no {wanted}; there is: {files}; this machine: {ours}"
    return "problem", text, f"build it again for {ours}"


def script(fmu: Unpacked) -> Verdict | None:
    """Check that the script is there, parses here, and has what it imports."""
    if not fmu.python:
        return None
    resources, fix = fmu.folder / "resources", "build it again with pythonfmu"
    named = resources / "slavemodule.txt"
    name = named.read_text("utf-8", "replace").partition("\n")[0] if named.is_file() else ""
    if not (name and (resources / f"{name}.py").is_file()):
        return "problem", f"no script: resources/slavemodule.txt names {name or 'none'}", fix
    try:
        outside = _outside(resources, name) - sys.stdlib_module_names
    except (SyntaxError, ValueError) as error:
        return "problem", f"no Python {VERSION}: {error}", "correct it and build the FMU again"
    if missing := sorted(name for name in outside if not _spec(name)):
        fix = install_command(*(_PACKAGES.get(name, name) for name in missing))
        return "problem", f"imports what is neither packed nor installed: {choices(missing)}", fix
    text = f"resources/{name}.py imports, besides the standard library: {choices(sorted(outside))}"
    return "ok", text, None


def _outside(resources: Path, script: str) -> set[str]:
    """What a script imports at once from outside of the FMU.

    An import that is allowed to fail, under try or if or in a function, does not count. SyntaxError
    or ValueError where the script does not parse.
    """
    with warnings.catch_warnings(action="ignore"):
        tree = ast.parse((resources / f"{script}.py").read_bytes(), f"{script}.py")
    names = [alias.name for n in tree.body if isinstance(n, ast.Import) for alias in n.names]
    names += [n.module for n in tree.body if isinstance(n, ast.ImportFrom) and n.module]
    packed = ("", *all_suffixes())
    tops = {name.partition(".")[0] for name in names}
    return {t for t in tops if not any((resources / f"{t}{end}").exists() for end in packed)}


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


def _spec(name: str) -> ModuleSpec | None:
    """File this Python would import under a name; sys.modules may hold an earlier one."""
    return next(filter(None, (f.find_spec(name, None) for f in sys.meta_path)), None)


CHECKS: dict[str, Callable[[Unpacked], Verdict | None]] = {
    "temp folder": temporary_folder, "fmu": description, "binary": binary, "script": script,
    "modules": modules,
}  # fmt: skip
"""The checks of the file of an FMU; None where one does not apply."""


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


def linker(binary: Path) -> str:
    """Words of the dynamic linker on a binary outside of Python; empty where it cannot tell."""
    return _run("env", "LC_ALL=C", "ldd", "-r", str(binary))[1] if LINUX else ""


def host(fmu: Unpacked) -> Verdict | None:
    """What a host that is not Python needs for the binary of a Python FMU."""
    if "libpython" in fmu.linked or not re.search("undefined symbol: _?Py", fmu.linked):
        return None
    beside = Path(sys.base_prefix, "lib", LIBPYTHON)
    fix = f"LD_PRELOAD={quote(str(beside) if beside.is_file() else LIBPYTHON)} HOST"
    if "grasp-cosim" in (fmu.declared.tool or ""):
        fix += ", or grasp-cosim build --native"
    text = "bound to no libpython: hosts that are not Python miss the symbol _Py_NoneStruct"
    return "warning", text, fix


def libraries(fmu: Unpacked) -> Verdict | None:
    """Check that the dynamic linker finds what the binary needs."""
    if not re.search("=>|statically linked", fmu.linked):
        return None
    missing = re.findall(r"(\S+) => not found", fmu.linked)
    newer = dict.fromkeys(re.findall(r"version `(\S+)' not found", fmu.linked))
    symbols = re.findall(r"undefined symbol: (?!_?Py)(\S+)", fmu.linked)
    if missing and fmu.binary.with_name(missing[0]).exists():
        text = f"not found though packed: {choices(missing)}"
        fix = f"patchelf --set-rpath '$ORIGIN' {fmu.binary.name}, and pack the FMU again"
    elif missing:
        text, fix = f"not found: {choices(missing)}", "install the packages that hold them"
    elif newer:
        text, fix = f"not on this system: {choices(newer)}", "build it again on this system"
    elif symbols:
        text = f"undefined symbols: {choices(symbols, 5)}"
        fix = "link the binary with the libraries that define them"
    else:
        return "ok", "the dynamic linker finds all", None
    if fmu.loads:  # a host that has libm, say, has them
        return "warning", f"{text}; this host has them, others may not", fix
    return "problem", text, fix


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
