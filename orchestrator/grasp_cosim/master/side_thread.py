"""What goes on beside the loop while that runs without Python's lock: handing rows on."""

import os
import select
import signal
from collections.abc import Callable, Collection
from contextlib import suppress
from threading import Thread
from typing import Self

PAUSE = 20
"""ms between two times that rows are handed on."""

_OVER = 0
"""Through the pipe comes the number of a signal, or this."""


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
        self._reader, self._writer = os.pipe()
        os.set_blocking(self._writer, False)
        self._before: int | None = None
        with suppress(ValueError):  # in another thread than the main one there are no signals
            self._before = signal.set_wakeup_fd(self._writer, warn_on_full_buffer=False)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Have it end; raises the error of `act`."""
        if self._before is not None:
            signal.set_wakeup_fd(self._before)
        os.write(self._writer, bytes([_OVER]))
        self._thread.join()
        os.close(self._writer)
        os.close(self._reader)
        if self._error is not None:
            raise self._error

    def _run(self) -> None:
        with suppress(OSError):  # the loop's own would be inherited
            os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
            os.sched_setaffinity(0, self._cpus)
        said = select.poll()
        said.register(self._reader, select.POLLIN)
        while True:
            came = os.read(self._reader, 64) if said.poll(PAUSE) else b""
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
