"""How far something is, on standard error: tqdm's bar; a line every 10 s where is no terminal.

In a notebook it is tqdm's widget, or its bar as text where there is no ipywidgets. What is over
sooner than can be read shows nothing.
"""

import io
import logging
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from importlib.util import find_spec
from typing import Any

from tqdm import tqdm

LOGGER = logging.getLogger(__name__)

DELAY = 0.5
"""s after which there is a bar on a terminal."""

EVERY = 10.0
"""s between two lines where there is no terminal."""


class _Lines(io.StringIO):
    """Standard error for a bar that is drawn again and again: each time is a line."""

    def write(self, text: str) -> int:
        if line := text.strip():
            sys.stderr.write(f"{line}\n")
            sys.stderr.flush()
        return len(text)


def in_notebook() -> bool:
    """True in a kernel of Jupyter, whose output is no terminal, and yet shows what moves."""
    shell: Any = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


class Progress(tqdm):  # type: ignore[type-arg]  # subscripted, it is no class
    """A context manager; update() says how much more is done, of `total` or of nobody knows what.

    Behind its `title` stands how far it is: "candidate: 1.25 of 3.00 s" for the unit "s", else
    "map: 11 of 36 runs"; without a unit nothing is counted.
    """

    _begun = False
    _bar = "{bar:24}"

    def __new__(cls, *arguments: Any, **options: Any) -> "Progress":
        """A widget in a notebook that can show one."""
        kind = _widget() if in_notebook() and find_spec("ipywidgets") else cls
        bar: Progress = super().__new__(kind, *arguments, **options)
        return bar

    def __init__(
        self,
        title: str,
        total: float | None = None,
        *,
        shown: bool = True,
        unit: str = "run",
        initial: float = 0,
        delay: float = DELAY,
        ticking: bool = True,
    ) -> None:
        """Begin, with `initial` of `total` done before; on a terminal it shows after `delay` s.

        `ticking` shows that time goes by, from a thread, also where update() is not called.
        """
        lines = not (sys.stderr.isatty() or in_notebook())
        every, delay = (EVERY, EVERY) if lines else (0.1, delay)
        form = "{n:.2f} of {total:.2f} s" if unit == "s" else "{n} of {total} {unit}s"
        counted = f": {form if total else '{n} {unit}s'}" if unit else ""
        time_left = ", about {remaining} left" if total else ""
        bar = f" {self._bar}" if total and not lines else ","
        self._over = threading.Event()
        super().__init__(
            desc=title,
            total=total,
            unit=unit,
            initial=initial,
            file=_Lines() if lines else sys.stderr,
            disable=not shown,
            leave=bool(unit) and not lines,
            delay=delay,
            mininterval=every,
            miniters=0,
            bar_format=f"{{desc}}{counted}{bar} {{elapsed}}{time_left}{{postfix}}",
        )
        often = max(every, 1.0)
        self._ticker = threading.Thread(
            target=self._tick, args=(delay or often, often), daemon=True
        )
        if ticking and shown:
            self._ticker.start()
        self._begun = True

    def __del__(self) -> None:
        """End it, unless a Ctrl-C came before it had begun."""
        if self._begun:
            self.close()

    def _tick(self, wait: float, every: float) -> None:
        while not self._over.wait(wait):
            self.refresh()
            wait = every

    def close(self) -> None:
        """End it; a bar that counts something stays."""
        self._over.set()
        if self._ticker.ident:
            self._ticker.join()
        super().close()


Progress.set_lock(threading.RLock())  # tqdm's own is of multiprocessing, which may start a process


@cache
def _widget() -> type[Progress]:
    """Progress as the widget that tqdm has for notebooks."""
    from tqdm.notebook import tqdm_notebook  # only here: it looks for IPython

    return type("Widget", (Progress, tqdm_notebook), {"_bar": "{bar}"})


def write(line: str) -> None:
    """Write a line on standard error, now, above a bar that is there."""
    if sys.stderr.isatty() or in_notebook():
        Progress.write(line, file=sys.stderr)
    else:
        sys.stderr.write(line + "\n")
    sys.stderr.flush()


@contextmanager
def phase(activity: str) -> Iterator[None]:
    """Log at its end how long a part of the work took, at the level INFO."""
    began = time.perf_counter()
    yield
    LOGGER.info("%s: %.2f s", activity, time.perf_counter() - began)
