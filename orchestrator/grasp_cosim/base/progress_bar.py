"""The bar of tqdm for progress.py, which loads this module only when there is something to show."""

import io
import sys
import threading
from functools import cache
from typing import Any

from tqdm import tqdm


class _Lines(io.StringIO):
    """Standard error for a bar that is drawn again and again: each time is a line."""

    def write(self, text: str) -> int:
        if line := text.strip():
            sys.stderr.write(f"{line}\n")
            sys.stderr.flush()
        return len(text)


class Bar(tqdm):  # type: ignore[type-arg]  # subscripted, it is no class
    """A bar that has been there since `start`, in s of time.time(); each time a line, or drawn."""

    _begun = False

    def __init__(self, *, lines: bool, start: float, **options: Any) -> None:
        """Make it; without a delay it shows at once."""
        super().__init__(
            file=_Lines() if lines else sys.stderr,
            leave=bool(options["unit"]) and not lines,
            miniters=0,
            **options,
        )
        self.start_t = start
        if options["delay"] > 0.0:
            self.last_print_t = start
        self._begun = True

    def __del__(self) -> None:
        """End it, unless a Ctrl-C came before it had begun."""
        if self._begun:
            self.close()


Bar.set_lock(threading.RLock())  # tqdm's own is of multiprocessing, which may start a process


@cache
def widget() -> type[Bar]:
    """The bar as the widget that tqdm has for notebooks."""
    from tqdm.notebook import tqdm_notebook  # only here: it looks for IPython

    return type("Widget", (Bar, tqdm_notebook), {})
