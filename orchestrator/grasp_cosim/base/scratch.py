"""Locks on files, and temporary folders: both go with their process, however it ends.

A process has locked each of its folders, before it made it: one that is not locked has been left
behind by a kill, and the next process that needs one removes it.
"""

import os
import re
import shutil
import tempfile
import weakref
from contextlib import suppress
from functools import cache
from pathlib import Path
from secrets import token_hex
from typing import Self

from .system_calls import is_mine

SUFFIX = ".lock"
"""So the names of such files end."""

PREFIX = "grasp_cosim_scratch_2_"
"""So the names of our folders begin.

The number is that of the way they are locked: who changes that counts it up. A version that locks
otherwise would take our folders for left behind, and so would we take its.
"""


class Lock:
    """A lock that this process has from taken() to release(). Its file is there so long.

    After a kill the file stays, and is the next one's.
    """

    def __init__(self, file: Path) -> None:
        from filelock import FileLock  # only now: it takes time to load

        self._file = file
        self._lock = FileLock(file, timeout=0, thread_local=False, fallback_to_soft=False)

    def taken(self) -> bool:
        """Take it, or return False where another process has it.

        Where files cannot be locked, or not be made, everybody may take it, and none is `sure`.
        """
        from filelock import Timeout

        try:
            self._lock.acquire()
        except Timeout:
            return False
        except OSError:
            pass
        return True

    @property
    def sure(self) -> bool:
        """True while no other process can have it."""
        return self._lock.is_locked

    def release(self) -> None:
        """Let others have it."""
        with suppress(OSError):  # Windows, where release() removes it, and what was never made
            self._file.unlink()
        self._lock.release()


def without_scratch(text: str) -> str:
    """The text without the paths of our temporary folders: files are named as in their archive."""
    if PREFIX not in text:  # as nearly always
        return text
    folder = r"[\\/]".join(map(re.escape, re.split(r"[\\/]", tempfile.gettempdir())))
    pattern = rf"{folder}[\\/]({PREFIX}[^\\/\s]+[\\/])+([0-9a-f]{{64}}[\\/])?"
    return re.sub(rf"(file:///?)?{pattern}", "", text)


class ScratchFolder:
    """A temporary folder, removed at the end of its context, by cleanup() or with the process."""

    def __init__(self) -> None:
        """Make it, after removing those that were left behind."""
        sweep(tempfile.gettempdir())
        self.name, lock = _new_folder()
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


def lock_of(folder: Path) -> Lock:
    """The lock of a folder, which is there before it and after it."""
    return Lock(folder.with_name(f".{folder.name}{SUFFIX}"))


def _new_folder() -> tuple[str, Lock]:
    """A new folder, and the lock that we have of it."""
    folder = Path(tempfile.gettempdir(), PREFIX + token_hex(8))
    lock = lock_of(folder)
    lock.taken()
    folder.mkdir(0o700)
    return str(folder), lock


def _remove_if_left(folder: Path) -> None:
    if folder.is_dir() and not folder.is_symlink() and is_mine(folder):
        lock = lock_of(folder)
        if lock.taken() and lock.sure:
            _end(str(folder), lock, os.getpid())


def _end(name: str, lock: Lock, owner: int) -> None:
    """Remove the folder, unless this process is a fork of its owner."""
    if os.getpid() == owner:
        shutil.rmtree(name, ignore_errors=True)
        lock.release()
