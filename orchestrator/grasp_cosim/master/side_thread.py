"""What goes on beside the loop while that runs without Python's lock: handing rows on."""

import signal
import socket
from collections.abc import Callable, Collection
from contextlib import suppress
from threading import Thread
from typing import Self

from ..base.system_calls import be_ordinary

PAUSE = 0.02
"""s between two times that rows are handed on."""

_OVER = 0
"""Through the sockets comes the number of a signal, or this."""


class Aside:
    """A context in which another thread acts from time to time, at no special priority.

    halt is called where a signal arrives, whose handler could not run before the loop ends, or
    where `act` fails; its error is raised at the end.
    """

    def __init__(
        self, act: Callable[[], None], halt: Callable[[], None], cpus: Collection[int]
    ) -> None:
        """Cpus are those that the thread may run on."""
        self._act, self._halt, self._cpus = act, halt, cpus
        self._thread = Thread(target=self._run, daemon=True)
        self._error: BaseException | None = None

    @property
    def failed(self) -> bool:
        """True if `act` has raised."""
        return self._error is not None

    def __enter__(self) -> Self:
        self._reader, self._writer = socket.socketpair()
        self._writer.setblocking(False)
        self._reader.settimeout(PAUSE)
        self._before: int | None = None
        with suppress(ValueError):  # in another thread than the main one there are no signals
            self._before = signal.set_wakeup_fd(self._writer.fileno(), warn_on_full_buffer=False)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Have it end; raises the error of `act`."""
        if self._before is not None:
            signal.set_wakeup_fd(self._before)
        self._writer.send(bytes([_OVER]))
        self._thread.join()
        self._writer.close()
        self._reader.close()
        if self._error is not None:
            raise self._error

    def _run(self) -> None:
        be_ordinary(self._cpus)  # the loop's own would be inherited
        while True:
            came = b""
            with suppress(TimeoutError):
                came = self._reader.recv(64)
            if _OVER in came:
                return
            if came:
                self._halt()
            if self._error is None:
                try:
                    self._act()
                except BaseException as error:
                    self._error = error
                    self._halt()
