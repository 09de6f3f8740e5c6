"""Temporary folders that do not outlive their process, however it ends.

Each holds a file that its process has locked. A lock goes with its process: a folder whose lock is
free has been left behind by a kill, and the next process that needs a folder removes it.
"""

import fcntl
import os
import shutil
import tempfile
import time
import weakref
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Self

PREFIX = "grasp_scratch_"
"""So the names of our folders begin."""

LOCK, TO_BE = ".lock", ".lock.new"
"""The locked file, and its name until it is locked."""

YOUNG = 60.0
"""s; a folder without a lock that is not older may be about to get one."""


class ScratchFolder:
    """A temporary folder, removed at the end of its context, by cleanup() or with the process."""

    def __init__(self) -> None:
        """Make it, after removing those that were left behind."""
        sweep(tempfile.gettempdir())
        self.name = tempfile.mkdtemp(prefix=PREFIX)
        made = Path(self.name, TO_BE)
        lock = os.open(made, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        with suppress(OSError):  # a file system without locks: there nothing is swept
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            made.rename(Path(self.name, LOCK))
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
                    _remove_if_left(Path(entry.path))


def _remove_if_left(folder: Path) -> None:
    status = folder.lstat()
    if status.st_uid != os.getuid() or folder.is_symlink():
        return
    old = time.time() - status.st_mtime > YOUNG
    name = TO_BE if old and not (folder / LOCK).exists() else LOCK
    try:
        lock = os.open(folder / name, os.O_RDWR | os.O_NOFOLLOW | os.O_CLOEXEC)
    except FileNotFoundError:
        if old:
            _remove(folder)
        return
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        _remove(folder)
    finally:
        os.close(lock)


def _end(name: str, lock: int, owner: int) -> None:
    """Remove the folder, unless this process is a fork of its owner."""
    if os.getpid() == owner:
        _remove(Path(name))
    os.close(lock)


def _remove(folder: Path) -> None:
    """Remove all in it, then its lock: a kill meanwhile leaves what can be swept."""
    for entry in folder.iterdir() if folder.is_dir() else ():
        if entry.name not in (LOCK, TO_BE):
            shutil.rmtree(entry, ignore_errors=True)
    shutil.rmtree(folder, ignore_errors=True)
