"""How far something is, on standard error: on a terminal a bar, else a line every 10 s.

What is over sooner than can be read shows nothing.
"""

import logging
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from tqdm import tqdm

LOGGER = logging.getLogger(__name__)

DELAY = 0.5
"""s after which there is a bar on a terminal."""

EVERY = 10.0
"""s between two lines where there is no terminal."""

SOBER = 1.0
"""s between the first sample and the last from which on they tell how long the rest takes."""


class Progress(tqdm):  # type: ignore[type-arg]  # subscripted, it is no class
    """A context manager; update() says how much more is done, of `total` or of nobody knows what.

    Named `what`: "candidate: 1.25 of 3.00 s" for the unit "s", else "map: run 12 of 36", the run
    that is at work; without a unit nothing is counted. Two samples are needed to tell how long the
    rest takes: the first says how long it took to begin, too.
    """

    def __init__(
        self,
        what: str,
        total: float | None = None,
        *,
        shown: bool = True,
        unit: str = "run",
        initial: float = 0,
        at_once: bool = False,
        ticking: bool = True,
    ) -> None:
        """Begin; with `initial` of `total` done before, `at_once` without a delay on a terminal.

        `ticking` shows that time goes by, from a thread, also where update() is not called.
        """
        self._lines = not sys.stderr.isatty()
        self._first = self._last = (0.0, -1.0)  # time in s and n of two samples
        self._delay = EVERY if self._lines else 0.0 if at_once else DELAY
        self._over = threading.Event()
        self._ticker: threading.Thread | None = None
        super().__init__(
            desc=what,
            total=total,
            unit=unit,
            initial=initial,
            disable=not shown,
            leave=bool(unit) and not self._lines,
            delay=self._delay,
            mininterval=EVERY if self._lines else 0.1,
            miniters=0,
            bar_format="{what} {bar:24} {took}" if total else "{what}, {took}",
        )
        if ticking and shown:
            self._ticker = threading.Thread(target=self._tick, daemon=True)
            self._ticker.start()

    def update(self, n: float | None = 1) -> bool | None:
        """Say that so many more are done."""
        self._last = time.monotonic(), self.n + (n or 0)
        if self._first[1] < 0:
            self._first = self._last
        return super().update(n)

    @property
    def left(self) -> float | None:
        """How long the rest takes, in s; None where that cannot be told yet."""
        took, done = (b - a for a, b in zip(self._first, self._last, strict=True))
        if not self.total or took < SOBER or done <= 0 or self.n >= self.total:
            return None
        since = time.monotonic() - self._last[0]
        return max(float((self.total - self.n) * took / done) - since, 0.0)

    @property
    def format_dict(self) -> Any:
        """What the format of a bar may have."""
        found = super().format_dict
        took = [span(found["elapsed"])]
        if (left := self.left) is not None:
            took.append(f"about {span(max(left, 1.0))} left")
        if self.postfix:
            took.append(str(self.postfix))
        count = self._count()
        what = f"{self.desc}: {count}" if count else self.desc
        return {**found, "what": what, "took": ", ".join(took)}

    def display(self, msg: str | None = None, pos: int | None = None) -> bool:  # type: ignore[override]
        """Draw the bar, or write a line, once the delay is over."""
        if hasattr(self, "start_t") and time.time() - self.start_t < self._delay:
            return False
        if not self._lines:
            return bool(super().display(msg, pos))
        if msg is None:
            self.fp.write("{what}, {took}\n".format(**self.format_dict))
            self.fp.flush()
        return False

    def close(self) -> None:
        """End it; a bar that counts something stays."""
        self._over.set()
        if self._ticker:
            self._ticker.join()
        super().close()

    def _count(self) -> str:
        if self.unit == "s":
            return f"{self.n:.2f} of {self.total:.2f} s"
        if self.total is None:
            return self.unit and f"{self.n} {self.unit}s"
        return f"{self.unit} {min(self.n + 1, self.total)} of {self.total}"

    def _tick(self) -> None:
        while not self._over.wait(1.0):
            now = time.time()  # tqdm's clock
            wait = EVERY if self._lines else 1.0
            if now - self.start_t >= self._delay and now - self.last_print_t >= wait:
                self.last_print_t = now
                self.refresh()


Progress.set_lock(threading.RLock())  # tqdm's own is of multiprocessing, which may start a process


def write(line: str) -> None:
    """Write a line on standard error, now, above a bar that is there."""
    if sys.stderr.isatty():
        Progress.write(line, file=sys.stderr)
    else:
        sys.stderr.write(line + "\n")
    sys.stderr.flush()


@contextmanager
def phase(what: str) -> Iterator[None]:
    """Log at its end how long a part of the work took, at the level INFO."""
    began = time.perf_counter()
    yield
    LOGGER.info("%s: %.2f s", what, time.perf_counter() - began)


def span(seconds: float) -> str:
    """A time as one says it: 8 s, 45 s, 3 min, 1.5 h."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
