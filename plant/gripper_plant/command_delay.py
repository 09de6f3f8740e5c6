"""A delay: what comes out is what went in tau seconds before, to the moment at which it changed.

What is on its way is a line of values, each until the moment at which it has come out. A change of
the value is met exactly in steps of tau/60 or longer; shorter ones are joined until they are as
long, by their mean.
"""

from typing import TYPE_CHECKING, NamedTuple

CELLS = 64
"""Values that are on their way, at most."""

SHORTEST = 1.0 / (CELLS - 4)
"""Of the delay, that of a value on its way: so all have space, even the first and the last one.
"""

if TYPE_CHECKING:
    Cells = tuple[float, ...]
else:
    Cells = tuple[(float,) * CELLS]


UNUSED: Cells = (0.0,) * CELLS


class Line(NamedTuple):
    """The values that are on their way, the first to come out at the left, and until when from now
    each comes out, in s; those that have come out, and cells that were never used, end at 0.
    """

    value: Cells
    end: Cells


def first(value: float, delay: float) -> Line:
    """The line where nothing else has gone in for ever."""
    return Line((value,) * CELLS, (*UNUSED[1:], delay))


def entered(line: Line, value: float, delay: float, h: float) -> Line:
    """The line with a value that goes in for h seconds from now on."""
    long = line.end[-1] - line.end[-2]
    end = delay + h
    if long < SHORTEST * delay:
        mean = (long * line.value[-1] + h * value) / (long + h)
        return Line((*line.value[:-1], mean), (*line.end[:-1], end))
    return Line((*line.value[1:], value), (*line.end[1:], end))


def later(line: Line, h: float) -> Line:
    """The line h seconds later."""
    return Line(line.value, tuple(max(0.0, end - h) for end in line.end))
