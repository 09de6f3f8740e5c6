"""Checks whether this machine loads an FMU, by its file only or by a trial; each names a fix."""

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
"""The status, the message and, where one is needed, the fix that a check gives."""

PYTHON_VERSION = f"{sys.version_info.major}.{sys.version_info.minor}"
LIBRARY_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")
LIBPYTHON = f"libpython{PYTHON_VERSION}{getattr(sys, 'abiflags', '')}.so.1.0"
"""What a host that is not Python needs of this Python."""

MAX_LINKER_NAMES = 5
"""So many libraries or symbols that the linker misses are named."""

_PACKAGE_OF_MODULE = {"cv2": "opencv-python", "sklearn": "scikit-learn", "yaml": "pyyaml"}
"""Packages that are named otherwise than their module."""

_TRIAL_PROGRAM = """
import os, sys
from pathlib import Path
from grasp_cosim.fmi.load import load_here
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
    """The finding of a check; `text` is its message, `fix` a command or an instruction to copy."""

    check: str
    status: Status
    text: str
    fix: str | None


@dataclass(frozen=True, slots=True)
class Unpacked:
    """An unpacked FMU: what its description declares, and the binary that it must have here."""

    path: Path
    folder: Path
    declared: Interface
    binary: Path


def examine(fmu: Path, load: bool = False) -> list[Finding]:
    """Check an FMU as far as its file permits, which runs none of its code.

    With `load` it is loaded in a child process, too, and what it needs of this machine is checked.

    Raises:
        InputError: The file is no readable FMU.
    """
    with ScratchFolder() as scratch:
        unpacked = unpack(fmu, Path(scratch.name))
        verdicts: dict[str, Verdict | None]
        verdicts = {"fmu": description(unpacked), "binary": binary(unpacked)}
        if unpacked.declared.python:
            verdicts["script"] = script(unpacked)
        if load:
            trial_verdict = trial(unpacked)
            linker_output = linker(unpacked.binary)
            verdicts |= {
                "host": host(unpacked, linker_output),
                "libraries": libraries(linker_output, loads=trial_verdict[0] == "ok"),
                "trial": trial_verdict,
            }
        return [Finding(name, *verdict) for name, verdict in verdicts.items() if verdict]


def loads(findings: Iterable[Finding]) -> bool:
    """True if none of the findings is a problem."""
    return not any(f.status == "problem" for f in findings)


def findings_text(findings: Sequence[Finding], tried: bool) -> str:
    """The verdict, then one line for each finding, a fix below it."""
    reservation = "" if tried else ", judged by the file; --load tries"
    lines = [f"loads on this machine: {'yes' if loads(findings) else 'no'}{reservation}"]
    for finding in findings:
        lines.append(f"{finding.status:8s} {finding.check:12s} {finding.text}")
        if finding.fix:
            lines.append(f"{'':21s} fix: {finding.fix}")
    return "\n".join(lines)


def unpack(fmu: Path, folder: Path) -> Unpacked:
    """Unpack an FMU to a folder; InputError where it is none."""
    declared = describe(fmu)
    try:
        with zipfile.ZipFile(fmu) as archive:
            for name in archive.namelist():
                if "\\" in name or ":" in name:  # which FMPy does not load
                    raise ValueError(f"{name!r} in it has a backslash or a colon; must have none")
            archive.extractall(folder)
    except Exception as error:  # zipfile and its decompressors raise whatever they like
        raise unreadable(fmu, str(error).replace(f"{folder}/", "")) from error
    platform = folder / "binaries" / this_machine(declared.version)
    binary_file = platform / f"{declared.identifier}{LIBRARY_SUFFIX}"
    return Unpacked(fmu, folder, declared, binary_file)


def description(fmu: Unpacked) -> Verdict:
    """Check that an FMU of this FMI version and kind is run here."""
    language = "needs Python" if fmu.declared.python else "native, needs no Python"
    kind = ", ".join([f"FMI {fmu.declared.version}", *fmu.declared.kinds])
    text = f"{kind}, made by {fmu.declared.tool or 'an unknown tool'}; {language}"
    if obstacle := of_kind(fmu.declared):
        return "problem", f"{text}; {obstacle.reason}", obstacle.remedy
    if "CoSimulation" not in fmu.declared.kinds:
        text += "; run here by a solver, elsewhere ask the vendor for an export for co-simulation"
    if obstacle := of_loading(fmu.declared, ""):
        return "warning", f"{text}; {obstacle.reason}", obstacle.remedy
    return "ok", text, None


def binary(fmu: Unpacked) -> Verdict:
    """Check that there is a binary for this system and processor, of the name that it must have."""
    expected = fmu.binary.relative_to(fmu.folder).as_posix()
    platform = fmu.binary.parent.name
    if obstacle := of_binary(fmu.declared):
        return "problem", obstacle.reason, obstacle.remedy
    platforms = f"there is: {choices(fmu.declared.platforms)}; this machine: {platform}"
    if fmu.binary.is_file():
        return "ok", f"{expected}; {platforms}", None
    files = choices(sorted(path.name for path in fmu.binary.parent.glob("*")))
    return "problem", f"no {expected}, but {files}; {platforms}", f"build it again for {platform}"


def script(fmu: Unpacked) -> Verdict:
    """Check that the script of a Python FMU is there, parses here, and has what it imports."""
    resources = fmu.folder / "resources"
    name = _script_name(resources)
    if not (name and (resources / f"{name}.py").is_file()):
        reason = f"no script: resources/slavemodule.txt names {name or 'none'}"
        return "problem", reason, "build it again with pythonfmu"
    try:
        imported = sorted(_imports_from_outside(resources, name) - sys.stdlib_module_names)
    except (SyntaxError, ValueError) as error:
        reason = f"no Python {PYTHON_VERSION}: {error}"
        return "problem", reason, "correct it and build the FMU again"
    if missing := [module for module in imported if not _is_installed(module)]:
        fix = install_command(*(_PACKAGE_OF_MODULE.get(module, module) for module in missing))
        return "problem", f"imports what is neither packed nor installed: {choices(missing)}", fix
    text = f"resources/{name}.py imports, apart from the standard library: {choices(imported)}"
    return "ok", text, None


def _script_name(resources: Path) -> str:
    """The module that an FMU of pythonfmu names as its script; empty where it names none."""
    file = resources / "slavemodule.txt"  # which is elsewhere where a name has backslashes
    if not file.is_file():
        return ""
    return file.read_text("utf-8", "replace").partition("\n")[0]


def _is_installed(module: str) -> bool:
    """True if this Python finds a module of that name; what it has loaded does not count."""
    return any(finder.find_spec(module, None) for finder in sys.meta_path)


def _imports_from_outside(resources: Path, script_name: str) -> set[str]:
    """The modules that a script imports at once from outside of the FMU.

    An import that is allowed to fail, under try or if or in a function, does not count. SyntaxError
    or ValueError where the script does not parse.
    """
    with warnings.catch_warnings(action="ignore"):
        tree = ast.parse((resources / f"{script_name}.py").read_bytes(), f"{script_name}.py")
    names = set()
    for statement in tree.body:
        if isinstance(statement, ast.Import):
            names |= {alias.name for alias in statement.names}
        if isinstance(statement, ast.ImportFrom) and statement.module:
            names.add(statement.module)
    modules = {name.partition(".")[0] for name in names}
    return {module for module in modules if not _is_packed(resources, module)}


def _is_packed(resources: Path, module: str) -> bool:
    """True if an FMU has a module in its resources: a folder, or a file of any kind of module."""
    endings = ("", *all_suffixes())
    return any((resources / f"{module}{ending}").exists() for ending in endings)


def _run(*command: str, timeout: float = 20.0, cwd: Path | None = None) -> tuple[int | None, str]:
    """Exit code, None where it does not start or end in time, and output of a program."""
    try:
        process = subprocess.run(  # noqa: S603  an FMU's code runs: that is the trial
            command, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
            encoding="utf-8", errors="replace", cwd=cwd, timeout=timeout, check=False,
            env=os.environ | ({"TMPDIR": str(cwd)} if cwd else {}),
        )  # fmt: skip
    except (OSError, subprocess.TimeoutExpired):
        return None, ""
    return process.returncode, process.stdout


def linker(binary: Path) -> str:
    """The output of the dynamic linker on a binary outside of Python; empty where it has none."""
    return _run("env", "LC_ALL=C", "ldd", "-r", str(binary))[1]


def host(fmu: Unpacked, linker_output: str) -> Verdict | None:
    """Check what a host that is not Python needs for the binary of a Python FMU."""
    needs_python = re.search("undefined symbol: _?Py", linker_output)
    if "libpython" in linker_output or not needs_python:
        return None
    library = Path(sys.base_prefix, "lib", LIBPYTHON)
    fix = f"LD_PRELOAD={quote(str(library) if library.is_file() else LIBPYTHON)} HOST"
    if fmu.declared.ours:
        fix += ", or grasp-cosim build --native"
    text = "bound to no libpython: hosts that are not Python miss the symbol _Py_NoneStruct"
    return "warning", text, fix


_LINKER_ERRORS = {
    r"(\S+) => not found": (
        "not found",
        "install the packages that hold them; of what is packed next to the binary: patchelf "
        "--set-rpath '$ORIGIN' BINARY, and pack the FMU again",
    ),
    r"version `(\S+)' not found": ("not on this system", "build it again on this system"),
    "undefined symbol: (?!_?Py)(\\S+)": (
        "undefined symbols",
        "link the binary with the libraries that define them",
    ),
}
"""By the pattern of what the dynamic linker reports: our message and the fix.

Of several that it reports the first of these is shown.
"""


def libraries(linker_output: str, loads: bool) -> Verdict | None:
    """Check that the dynamic linker finds what the binary needs.

    `loads` is true if the binary loads here.
    """
    if not re.search("=>|statically linked", linker_output):
        return None
    for pattern, (message, fix) in _LINKER_ERRORS.items():
        if names := dict.fromkeys(re.findall(pattern, linker_output)):
            text = f"{message}: {choices(names, MAX_LINKER_NAMES)}"
            if loads:  # a host that has libm, say, has them
                return "warning", f"{text}; this host has them, others may not", fix
            return "problem", text, fix
    return "ok", "the dynamic linker finds all", None


def trial(fmu: Unpacked, timeout: float = 60.0) -> Verdict:
    """Load, instantiate and free the FMU in a child process, which gets timeout in s."""
    if of_kind(fmu.declared) or of_binary(fmu.declared) or not fmu.binary.is_file():
        return "warning", "not loaded: of a kind that is not run here, or without a binary", None
    started = time.monotonic()
    arguments = ["-P", "-u", "-c", _TRIAL_PROGRAM, str(fmu.path.absolute())]
    code, output = _run(sys.executable, *arguments, timeout=timeout, cwd=fmu.folder)
    output = output.replace(f"{fmu.folder}/", "").replace(f"trial: {fmu.path.absolute()} ", "")
    lines = [line.strip() for line in output.splitlines() if line.strip()]
    last_line = lines[-1] if lines else ""
    if code is None:
        return "problem", f"does not load and instantiate within {timeout:g} s", None
    if code < 0:
        when = f"when instantiated; it says {last_line or 'nothing'}"
        if last_line == "freed":
            when = "after it was freed"
        return "problem", f"crashes with {signal.Signals(-code).name} {when}", None
    if code > 0 or last_line != "freed":
        reason = last_line.removeprefix("does not load: ") or "no reason given"
        obstacle = of_loading(fmu.declared, reason)
        return "problem", f"does not instantiate: {reason}", obstacle.remedy if obstacle else None
    return "ok", f"loads, instantiates and frees in {time.monotonic() - started:.1f} s", None
