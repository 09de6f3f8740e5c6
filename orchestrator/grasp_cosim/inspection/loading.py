"""Whether this machine loads an FMU, as far as its file says, and the fix; or by a trial."""

from __future__ import annotations

import ast
import os
import re
import signal
import subprocess
import sys
import time
import warnings
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from importlib.machinery import all_suffixes
from pathlib import Path
from shlex import quote
from typing import Literal

from ..base.checks import install_command
from ..base.errors import choices
from ..base.scratch import ScratchFolder
from ..interface.interface import Interface
from ..interface.model_description import unreadable
from ..interface.obstacles import of_binary, of_kind, of_loading, this_machine
from ..interface.read import describe

Status = Literal["ok", "warning", "problem"]
Verdict = tuple[Status, str, str | None]
"""What a check says: status, text, and the fix where one is needed."""

VERSION = f"{sys.version_info.major}.{sys.version_info.minor}"
LIBRARY_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
LIBPYTHON = f"libpython{VERSION}{getattr(sys, 'abiflags', '')}.so.1.0"
"""What a host that is not Python needs of this Python."""

_PACKAGES = {"cv2": "opencv-python", "sklearn": "scikit-learn", "yaml": "pyyaml"}
"""Packages that are not called as their module."""

_TRIAL = """
import os, sys
from pathlib import Path
from grasp_cosim.fmi.process import load_here
from grasp_cosim.interface.read import read_interface
try:
    load_here("trial", read_interface(Path(sys.argv[1])), logging=True).close()
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
    """An unpacked FMU: what its description says, and the binary it would have to have here."""

    path: Path
    folder: Path
    declared: Interface
    binary: Path


def examine(fmu: Path, load: bool = False) -> list[Finding]:
    """Check an FMU as far as its file says, which runs none of its code.

    With `load` it is loaded in a child process, too, and what it needs of this machine is checked.
    InputError where fmu is no readable FMU.
    """
    with ScratchFolder() as scratch:
        unpacked = unpack(fmu, Path(scratch.name))
        verdicts: dict[str, Verdict | None]
        verdicts = {"fmu": description(unpacked), "binary": binary(unpacked)}
        if unpacked.declared.python:
            verdicts["script"] = script(unpacked)
        if load:
            tried = trial(unpacked)
            linked = linker(unpacked.binary)
            needs = libraries(linked, loads=tried[0] == "ok")
            verdicts |= {"host": host(unpacked, linked), "libraries": needs, "trial": tried}
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
        with zipfile.ZipFile(fmu) as archive:
            for name in archive.namelist():
                if "\\" in name or ":" in name:  # which FMPy does not load
                    raise ValueError(f"{name!r} in it has a backslash or a colon; must have none")
            archive.extractall(folder)
    except Exception as error:  # zipfile and its decompressors raise whatever they like
        raise unreadable(fmu, str(error).replace(f"{folder}/", "")) from error
    file = f"{found.identifier}{LIBRARY_SUFFIX}"
    return Unpacked(fmu, folder, found, folder / "binaries" / this_machine(found.version) / file)


def description(fmu: Unpacked) -> Verdict:
    """FMI version and kind."""
    source = "needs Python" if fmu.declared.python else "native, needs no Python"
    kind = ", ".join([f"FMI {fmu.declared.version}", *fmu.declared.kinds])
    text = f"{kind}, made by {fmu.declared.tool or 'an unknown tool'}; {source}"
    if obstacle := of_kind(fmu.declared):
        return "problem", f"{text}; {obstacle.reason}", obstacle.remedy
    if "CoSimulation" not in fmu.declared.kinds:
        text += "; run here by a solver, elsewhere ask the vendor for an export for co-simulation"
    if tied := of_loading(fmu.declared, ""):
        return "warning", f"{text}; {tied.reason}", tied.remedy
    return "ok", text, None


def binary(fmu: Unpacked) -> Verdict:
    """Check that there is a binary for this system and processor, of the name that it must have."""
    wanted, ours = fmu.binary.relative_to(fmu.folder).as_posix(), fmu.binary.parent.name
    if obstacle := of_binary(fmu.declared):
        return "problem", obstacle.reason, obstacle.remedy
    there = f"there is: {choices(fmu.declared.platforms)}; this machine: {ours}"
    if fmu.binary.is_file():
        return "ok", f"{wanted}; {there}", None
    files = choices(sorted(path.name for path in fmu.binary.parent.glob("*")))
    return "problem", f"no {wanted}, but {files}; {there}", f"build it again for {ours}"


def script(fmu: Unpacked) -> Verdict:
    """Check that the script of a Python FMU is there, parses here, and has what it imports."""
    resources, fix = fmu.folder / "resources", "build it again with pythonfmu"
    named = resources / "slavemodule.txt"  # which is elsewhere where a name has backslashes
    name = named.read_text("utf-8", "replace").partition("\n")[0] if named.is_file() else ""
    if not (name and (resources / f"{name}.py").is_file()):
        return "problem", f"no script: resources/slavemodule.txt names {name or 'none'}", fix
    try:
        outside = _outside(resources, name) - sys.stdlib_module_names
    except (SyntaxError, ValueError) as error:
        return "problem", f"no Python {VERSION}: {error}", "correct it and build the FMU again"
    finders = [f.find_spec for f in sys.meta_path]  # sys.modules may hold an earlier one
    if missing := sorted(n for n in outside if not any(find(n, None) for find in finders)):
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


def _run(*command: str, timeout: float = 20.0, cwd: Path | None = None) -> tuple[int | None, str]:
    """Exit code, None where it does not start or end in time, and output of a program."""
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
    return _run("env", "LC_ALL=C", "ldd", "-r", str(binary))[1]


def host(fmu: Unpacked, linked: str) -> Verdict | None:
    """What a host that is not Python needs for the binary of a Python FMU."""
    if "libpython" in linked or not re.search("undefined symbol: _?Py", linked):
        return None
    beside = Path(sys.base_prefix, "lib", LIBPYTHON)
    fix = f"LD_PRELOAD={quote(str(beside) if beside.is_file() else LIBPYTHON)} HOST"
    if fmu.declared.ours:
        fix += ", or grasp-cosim build --native"
    text = "bound to no libpython: hosts that are not Python miss the symbol _Py_NoneStruct"
    return "warning", text, fix


_LACKS = {
    r"(\S+) => not found": (
        "not found",
        "install the packages that hold them; of what is packed beside the binary: patchelf "
        "--set-rpath '$ORIGIN' BINARY, and pack the FMU again",
    ),
    r"version `(\S+)' not found": ("not on this system", "build it again on this system"),
    "undefined symbol: (?!_?Py)(\\S+)": (
        "undefined symbols",
        "link the binary with the libraries that define them",
    ),
}
"""What the dynamic linker says, that in our words, and the fix; the first goes before the rest."""


def libraries(linked: str, loads: bool) -> Verdict | None:
    """Check that the dynamic linker finds what the binary needs; loads says that it loads here."""
    if not re.search("=>|statically linked", linked):
        return None
    for pattern, (what, fix) in _LACKS.items():
        if names := dict.fromkeys(re.findall(pattern, linked)):
            text = f"{what}: {choices(names, 5)}"
            if loads:  # a host that has libm, say, has them
                return "warning", f"{text}; this host has them, others may not", fix
            return "problem", text, fix
    return "ok", "the dynamic linker finds all", None


def trial(fmu: Unpacked, timeout: float = 60.0) -> Verdict:
    """Load, instantiate and free the FMU in a child process, which gets timeout in s."""
    if of_kind(fmu.declared) or of_binary(fmu.declared) or not fmu.binary.is_file():
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
