"""Ctrl-C and SIGTERM as the way to end a command that runs until then."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from .. import interruption


@contextmanager
def ended_by_signals(end: Callable[[], None]) -> Iterator[list[int]]:
    """SIGINT and SIGTERM call end, in the main thread; yields the list of those that came."""
    came: list[int] = []

    def remember(number: int, _: object) -> None:
        came.append(number)
        end()

    with interruption.handled(remember, *interruption.SIGNALS):
        yield came
