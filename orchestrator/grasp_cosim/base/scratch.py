"""Temporary folders that do not outlive their process, however it ends.

Its process has locked each. A lock goes with its process: a folder that is not locked has been left
behind by a kill, and the next process that needs one removes it.
"""

import fcntl
import os
import re
import shutil
import tempfile
import weakref
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Self

PREFIX = "grasp_scratch_"
"""So the names of our folders begin."""

_OPEN = os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC


def without_scratch(text: str) -> str:
    """The text without the paths of our temporary folders: files are named as in their archive."""
    folder = re.escape(tempfile.gettempdir())
    return re.sub(rf"(file://)?{folder}/({PREFIX}[^/\s]+/)+([0-9a-f]{{64}}/)?", "", text)


class ScratchFolder:
    """A temporary folder, removed at the end of its context, by cleanup() or with the process."""

    def __init__(self) -> None:
        """Make it, after removing those that were left behind."""
        sweep(tempfile.gettempdir())
        self.name, lock = _made()
        self.cleanup = weakref.finalize(self, _end, self.name, lock, os.getpid())
        """Removes it; does nothing the second time."""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Remove it."""
        self.cleanup()


@cache
def sweep(folder: str) -> None:
    """Remove from the folder what ended processes of this user have left behind, once."""
    with suppress(OSError), os.scandir(folder) as entries:
        for entry in entries:
            if entry.name.startswith(PREFIX):
                with suppress(OSError):
                    _remove_if_left(entry.path)


def _made() -> tuple[str, int]:
    """A new folder, and the descriptor by which it is locked."""
    while True:
        name = tempfile.mkdtemp(prefix=PREFIX)
        with suppress(FileNotFoundError):
            lock = os.open(name, _OPEN)
            with suppress(OSError):  # a file system without locks: there nothing is swept
                fcntl.flock(lock, fcntl.LOCK_EX)
            if Path(name).exists():
                return name, lock
            os.close(lock)  # another process took it for one that was left


def _remove_if_left(name: str) -> None:
    lock = os.open(name, _OPEN)
    try:
        if os.fstat(lock).st_uid == os.getuid():
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(name, ignore_errors=True)
    finally:
        os.close(lock)


def _end(name: str, lock: int, owner: int) -> None:
    """Remove the folder, unless this process is a fork of its owner."""
    if os.getpid() == owner:
        shutil.rmtree(name, ignore_errors=True)
    os.close(lock)
