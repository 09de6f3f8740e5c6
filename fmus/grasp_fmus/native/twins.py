"""The native twins of FMUs, which our own commands run in their place: the same bits, sooner.

A native FMU says in its sources of which content its Python twin is, and that is the GUID of the
latter. Those of the blocks that come with the package are built where they are asked for, once per
content, in the user's folder for what can be made again.
"""

import zipfile
from contextlib import suppress
from functools import cache
from pathlib import Path

from ..folder import is_current, sources_hash, write_stamp
from ..shipped import SCRIPTS
from .build import build_native, chosen_names
from .compilers import CompilerError, cache_folder
from .targets import here


class NoTwinsError(Exception):
    """There are no native FMUs here, and none can be built: why, and what helps, in one line."""


def is_twin(fmu: Path, content: str) -> bool:
    """Return True if the file is a native FMU whose Python twin has this content hash."""
    with suppress(OSError, ValueError, zipfile.BadZipFile), zipfile.ZipFile(fmu) as archive:
        sources = [n for n in archive.namelist() if n.startswith("sources/") and n.endswith(".c")]
        said = f'#define CONTENT "{content}"'.encode()
        return any(said in archive.read(name) for name in sources)
    return False


def is_shipped(name: str) -> bool:
    """Return True for the name of an FMU that comes with this package, such as GripperPlant."""
    return (SCRIPTS / f"{name}.py").is_file()


@cache
def shipped_twins() -> Path:
    """The folder of the native FMUs of the blocks that come with the package, built if need be.

    NoTwinsError where that cannot be.
    """
    kept = cache_folder()
    if kept is None:
        raise NoTwinsError(
            "no folder to keep native FMUs in; must have a home, or XDG_CACHE_HOME, that can be "
            "written to"
        )
    sources = sources_hash()
    folder = kept / "fmus" / here().tuple / sources[:16]
    if not is_current(folder, sources):
        try:
            built = build_native(folder, names=chosen_names())
            write_stamp(folder, sources, [fmu.path.name for fmu in built])
        except (ValueError, CompilerError, OSError) as error:
            raise NoTwinsError(str(error)) from error
    return folder
