"""What can be made again, in a folder of the user: each thing under a name made of its content.

The name holds all that decides the thing, and what bears it was put there in one piece: there is
nothing else to compare. Where the folder cannot be written to, what is made stays where it is.
"""

import os
import shutil
import sys
from collections.abc import Iterable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from threading import get_ident

CACHES = {"win32": "AppData/Local", "darwin": "Library/Caches"}
"""Where a user's caches are below the home folder, on other systems than Linux."""


def folder() -> Path | None:
    """Return the folder of the user; None where there can be none.

    A relative path, which would be another folder in each, does not count, as the standard has it.
    """
    with suppress(RuntimeError):  # nobody's home
        base = Path(os.environ.get("XDG_CACHE_HOME", ""))
        base = base if base.is_absolute() else Path.home() / CACHES.get(sys.platform, ".cache")
        return base / "grasp-cosim" if base.is_absolute() else None
    return None


def writable(name: str) -> Path | None:
    """Return the folder of this name in that of the user; None where nothing can be put there."""
    if place := folder():
        with suppress(OSError):
            (place / name).mkdir(parents=True, exist_ok=True)
            return place / name if os.access(place / name, os.W_OK) else None
    return None


def key(parts: Iterable[str | bytes]) -> str:
    """Return a name made of these parts; other parts make another."""
    digest = sha256()
    for part in parts:
        data = part.encode() if isinstance(part, str) else part
        digest.update(b"%d\0" % len(data) + data)
    return digest.hexdigest()[:32]


def kept(name: str) -> Path | None:
    """Return the file or folder of this name, if it is there."""
    place = folder()
    return place / name if place and (place / name).exists() else None


def keep(made: Path, name: str) -> Path:
    """Put what was made there under this name and return it; as it is where that cannot be."""
    above = writable(str(Path(name).parent))
    if not above:
        return made
    place = above / Path(name).name
    part = above / f"{place.name}.{os.getpid()}.{get_ident()}.part"
    try:
        (shutil.copytree if made.is_dir() else shutil.copyfile)(made, part)
        part.rename(place)
    except OSError:  # no space, or another process was faster
        shutil.rmtree(part, ignore_errors=True)
        part.unlink(missing_ok=True)
    return place if place.exists() else made
