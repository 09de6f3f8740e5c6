"""Locks on files made for that, which go with the process that has them, however it ends."""

from contextlib import suppress
from pathlib import Path

SUFFIX = ".lock"
"""So the names of such files end."""


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
