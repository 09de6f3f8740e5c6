"""How far something is, on standard error: tqdm's bar; a line every 10 s where is no terminal.

In a notebook it is tqdm's widget, or its bar as text where there is no ipywidgets. What is over
sooner than can be read shows nothing, and does not load tqdm, which takes time.
"""

from __future__ import annotations

import logging
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from typing import TYPE_CHECKING, Any, Self

if TYPE_CHECKING:
    from .progress_bar import Bar

LOGGER = logging.getLogger(__name__)

DELAY = 0.5
"""s after which there is a bar on a terminal."""

EVERY = 10.0
"""s between two lines where there is no terminal."""


def in_notebook() -> bool:
    """True in a kernel of Jupyter, whose output is no terminal, and yet shows what moves."""
    shell: Any = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")


class Progress:
    """A context manager; update() says how much more is done, of `total` or of nobody knows what.

    Behind its `title` stands how far it is: "candidate: 1.25 of 3.00 s" for the unit "s", else
    "map: 11 of 36 runs"; without a unit nothing is counted.
    """

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

        `ticking` shows that time goes by, from a thread, also where update() is not called. Without
        a delay tqdm is loaded now, and not while what is shown goes on.
        """
        self.n, self.disable = initial, not shown
        self._lines = not (sys.stderr.isatty() or in_notebook())
        self._every, self._delay = (EVERY, EVERY) if self._lines else (0.1, delay)
        self._start = time.time()  # as tqdm does
        form = "{n:.2f} of {total:.2f} s" if unit == "s" else "{n} of {total} {unit}s"
        self._counted = f": {form if total else '{n} {unit}s'}" if unit else ""
        self._asked = {"desc": title, "total": total, "unit": unit, "initial": initial}
        self._postfix = ""
        self._bar: Bar | None = None
        self._making = threading.Lock()
        if shown and not (delay and self._delay):
            self._made()
        self._over = threading.Event()
        often = max(self._every, 1.0)
        self._ticker = threading.Thread(
            target=self._tick, args=(self._delay or often, often), daemon=True
        )
        if ticking and shown:
            self._ticker.start()

    def _made(self) -> Bar:
        """The bar of tqdm, made once."""
        with self._making:
            if self._bar is None:
                from .progress_bar import Bar, widget

                in_widget = in_notebook() and find_spec("ipywidgets")
                length = "{bar}" if in_widget else "{bar:24}"
                total = self._asked["total"]
                bar = f" {length}" if total and not self._lines else ","
                time_left = ", about {remaining} left" if total else ""
                self._bar = (widget() if in_widget else Bar)(
                    **self._asked,
                    lines=self._lines,
                    start=self._start,
                    delay=self._delay,
                    mininterval=self._every,
                    bar_format=f"{{desc}}{self._counted}{bar} {{elapsed}}{time_left}{{postfix}}",
                )
                self._bar.n = self.n
                self._bar.set_postfix_str(self._postfix, refresh=False)
        return self._bar

    def update(self, more: float = 1) -> None:
        """So much more is done."""
        self.n += more
        is_made = self._bar is not None  # tqdm may have no truth value
        if is_made or (not self.disable and time.time() >= self._start + self._delay):
            bar = self._made()
            bar.update(self.n - bar.n)

    def refresh(self) -> None:
        """Show it, now."""
        if not self.disable:
            self._made().refresh()

    def set_postfix_str(self, text: str, refresh: bool = True) -> None:
        """What stands behind it."""
        self._postfix = text
        if self._bar is not None:
            self._bar.set_postfix_str(text, refresh)

    def _tick(self, wait: float, every: float) -> None:
        while not self._over.wait(wait):
            self.refresh()
            wait = every

    def close(self) -> None:
        """End it; a bar that counts something stays."""
        self._over.set()
        if self._ticker.ident:
            self._ticker.join()
        if self._bar is not None:
            self._bar.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def write(line: str) -> None:
    """Write a line on standard error, now, above a bar that is there."""
    bars: Any = sys.modules.get(f"{__package__}.progress_bar")
    if bars and (sys.stderr.isatty() or in_notebook()):
        bars.Bar.write(line, file=sys.stderr)
    else:
        sys.stderr.write(line + "\n")
    sys.stderr.flush()


@contextmanager
def phase(activity: str) -> Iterator[None]:
    """Log at its end how long a part of the work took, at the level INFO."""
    began = time.perf_counter()
    yield
    LOGGER.info("%s: %.2f s", activity, time.perf_counter() - began)
