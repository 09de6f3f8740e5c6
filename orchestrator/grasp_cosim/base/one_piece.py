"""Files that are written in one piece: there is never half of one. Standard library only."""

from __future__ import annotations

import errno
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory

NO_FILES = ("dev", "proc")
"""The folders at the top of a system in which nothing is a file that may be replaced."""

OF_FILES = ("dev", "shm")
"""The folder in one of these that has ordinary files, which are kept in memory."""


def is_stream(path: Path) -> bool:
    """Return True for a device, a pipe or the like, also behind a link: it is written into."""
    if path.is_dir() or not path.exists():
        return False
    parts = path.absolute().parts
    among_devices = parts[1:2] in [(name,) for name in NO_FILES] and parts[1:3] != OF_FILES
    return not path.is_file() or among_devices


@contextmanager
def in_one_piece(path: Path) -> Iterator[Path]:
    """Yield a temporary name to write to; at the end it takes the place of the file at path.

    Folders above are made. A link stays, and the file that it names is replaced; a device or a pipe
    gets what was written. Who removes the temporary file has the one at path left as it was.
    OSError, which names path, where that fails, and at once for a folder.
    """
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, "is a folder; must be the name of a file", str(path))
    if is_stream(path):
        with (
            TemporaryDirectory(prefix="one_piece_") as folder,
            _temporary(path, Path(folder, "part")) as part,
        ):
            yield part
            if part.exists():
                with part.open("rb") as written, path.open("ab") as stream:
                    shutil.copyfileobj(written, stream)
        return
    target = Path(os.path.realpath(path))
    target.parent.mkdir(parents=True, exist_ok=True)
    with _temporary(path, target.with_name(f"{target.name}.{os.getpid()}.part")) as part:
        yield part
        if part.exists():
            part.replace(target)


@contextmanager
def _temporary(path: Path, part: Path) -> Iterator[Path]:
    """A temporary name that is not there at the end; what fails on it names path."""
    try:
        yield part
    except OSError as error:  # a write that fails does not say where, or where it is for now
        if error.errno is None or error.filename not in (None, part, str(part)):
            raise
        raise OSError(error.errno, os.strerror(error.errno), str(path)) from error
    finally:
        part.unlink(missing_ok=True)
