"""The native twins of FMUs, which our own commands run in their place: the same bits, sooner.

A native FMU says in its sources of which content its Python twin is, and that is the GUID of the
latter. Those of the blocks that come with the package are built where they are asked for, once per
content, in the user's folder for what can be made again.
"""

import functools
import sys
import zipfile
import zlib
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext, suppress
from pathlib import Path

from c_compilers import CompilerError, cache

from ..folder import is_current, sources_hash, write_stamp
from ..shipped import SCRIPTS
from .build import build_native, chosen_names, planned
from .targets import here

UNREADABLE = (OSError, EOFError, ValueError, RuntimeError, zipfile.BadZipFile, zlib.error)
"""What reading a damaged archive may raise."""

HEAD = 20
"""Bytes of a binary that say which processor it is for."""


KEPT = "must have a home, or XDG_CACHE_HOME, that can be written to"
"""Where native FMUs are kept."""


class NoTwinsError(Exception):
    """There are no native FMUs here, and none can be built: why, and what helps, in one line."""


def is_twin(fmu: Path, content: str) -> bool:
    """Return True for a native FMU that runs here, and whose Python twin has this content hash."""
    with suppress(*UNREADABLE), zipfile.ZipFile(fmu) as archive:
        said = f'#define CONTENT "{content}"'.encode()
        sources = [n for n in archive.namelist() if n.startswith("sources/") and n.endswith(".c")]
        return any(said in archive.read(name) for name in sources) and _runs_here(archive)
    return False


def _runs_here(archive: zipfile.ZipFile) -> bool:
    """Return True if a binary is for this machine: linux64 may hold one for another processor."""
    places = tuple(f"binaries/{name}/" for name in (here().folder, here().tuple))
    binaries = [name for name in archive.namelist() if name.startswith(places)]
    with Path(sys.executable).open("rb") as python:
        ours = _processor(python.read(HEAD))
    return any(_processor(archive.read(name)[:HEAD]) == ours for name in binaries)


def _processor(head: bytes) -> bytes:
    """Return the processor that an ELF file is for; of other files nothing."""
    return head[18:20] if head.startswith(b"\x7fELF") else b""


def is_shipped(name: str) -> bool:
    """Return True for the name of an FMU that comes with this package, such as GripperPlant."""
    return (SCRIPTS / f"{name}.py").is_file()


@functools.cache
def shipped_twins(
    during: Callable[[str], AbstractContextManager[object]] = nullcontext,
) -> Path:
    """The folder of the native FMUs of the blocks that come with the package, built if need be.

    That is done in the context that `during` makes of a line that says so. NoTwinsError where it
    cannot be.
    """
    kept = cache.folder()
    sources = sources_hash()
    folder = kept / "fmus" / here().tuple / sources[:16] if kept else None
    if folder and is_current(folder, sources):
        return folder
    if not folder or not cache.writable(str(folder)):
        raise NoTwinsError(f"no folder to keep native FMUs in; {KEPT}")
    try:
        plan = planned()
        with during("compiling the native FMUs, once for these sources"):
            built = build_native(folder, plan, chosen_names())
        write_stamp(folder, sources, [fmu.path.name for fmu in built])
    except (ValueError, CompilerError) as error:
        raise NoTwinsError(str(error)) from error
    except OSError as error:
        raise NoTwinsError(f"{error.filename}: {error.strerror}; {KEPT}") from error
    return folder
