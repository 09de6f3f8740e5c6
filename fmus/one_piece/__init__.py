"""Files that are written in one piece: there is never half of one. Standard library only."""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

NO_FILES = ("dev", "proc")
"""The folders at the top of a system in which nothing is a file that may be replaced."""


def is_stream(path: Path) -> bool:
    """Return True for a device, a pipe or the like, also behind a link: it is written into."""
    special = path.absolute().parts[1:2] and path.absolute().parts[1] in NO_FILES
    return path.exists() and not path.is_dir() and bool(special or not path.is_file())


@contextmanager
def in_one_piece(path: Path) -> Iterator[Path]:
    """Yield a temporary name to write to; at the end it takes the place of the file at path.

    Folders above are made. A link stays, and the file that it names is replaced; a device or a pipe
    gets what was written. OSError, which names path, where that fails, and at once for a folder.
    """
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "is a folder; must be the name of a file", str(path))
    stream, target = is_stream(path), Path(os.path.realpath(path))
    if not stream:
        target.parent.mkdir(parents=True, exist_ok=True)
    folder = Path(tempfile.gettempdir()) if stream else target.parent
    part = folder / f"{path.name if stream else target.name}.{os.getpid()}.part"
    try:
        yield part
        if stream:
            with part.open("rb") as made, path.open("ab") as into:
                shutil.copyfileobj(made, into)
        else:
            part.replace(target)
    except OSError as error:  # a write that fails does not say where, or where it is for now
        if error.errno is None or error.filename not in (None, part, str(part)):
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
    finally:
        part.unlink(missing_ok=True)
