"""Times: exact, from the file to the loop.

A time is a number of nanoseconds: a whole one, or a fraction where a step is 1/30 s or 1/1024 s. So
every float of seconds in a file, an FMU or a run.json means one time. The nearest float of that
time is the original. A run counts in whole numbers only: see TimeGrid.
"""

from __future__ import annotations

import math
import re
from contextlib import suppress
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..base.checks import EXACT, number, real
from ..base.errors import InputError
from ..base.quantity import Quantity, as_quantity, unwrapped
from ..base.si_units import known_unit
from ..interface.units import conversion, converted

Time = int | Fraction
"""An exact time in ns; a Fraction only where it is no whole number of them."""

TimeInput = float | str | Fraction | Quantity | tuple[float, str]
"""A time as callers give it: a number of s, a text like "1/30", a fraction, or with a unit, like
"1 ms".
"""

NANOSECONDS = 1_000_000_000
"""In a second."""

LONGEST = 1e9
"""s; a time in nanoseconds then fits into 64 bits."""

LARGEST_DENOMINATOR = 1_000_000
"""Of the fractions of a second that a float may mean."""

CHANCE = 1e-5
"""How often a float that means none may be that near to a fraction: the denominators of long times,
whose floats are coarse, are limited so far that it is less.
"""

DIGITS = 1e-12
"""The relative error of a float that other tools have written with fewer than all digits."""

NEAR = 1e-8
"""The relative distance within which a fraction is named that may have been meant."""

_FRACTION = re.compile(r"\s*([-+]?[0-9]{1,18})\s*/\s*([0-9]{1,18})\s*")


def in_seconds(time: Time) -> float:
    """The nearest float of a time in s."""
    return float(time / NANOSECONDS)


def seconds(time: Time) -> str:
    """A time in s as messages have it, to 9 digits."""
    return f"{in_seconds(time):.9g} s"


def written(time: Time) -> str:
    """A time in s as a setting that reads as the same: 0.001, or 1/30."""
    if time.denominator > 1:
        return str(Fraction(time) / NANOSECONDS)
    exact = in_seconds(time)
    short = f"{exact:.9g}"
    return short if float(short) == exact else repr(exact)


def in_nanoseconds(place: str, entry: Any, zero: bool = False, low: float = 0.0) -> Time:
    """The time that a number of s means, or a text like "1/30" or "0.1"; InputError for others.

    It is greater than low; with zero, it may be that.
    """
    span = f"from {low:g} to" if zero else "greater than 0, at most"
    must = f"a number {span} {LONGEST:g}"
    entry = unwrapped(entry)
    if quantity := as_quantity(entry):
        entry = _of_quantity(place, quantity)
    fraction = _fraction(entry)
    seconds_or_text = entry if fraction is None else float(fraction)
    if isinstance(entry, str):
        must += ', or a fraction like "1/30"'
        if fraction is None:
            with suppress(ValueError):
                seconds_or_text = real(entry)
    value = number(place, seconds_or_text, low, LONGEST, above=not zero, must=must, unit="s")
    time = _time_of_float(value)
    if fraction is not None and (time is None or time != fraction * NANOSECONDS):
        raise InputError(
            f"{place} = {entry} s: must be a whole number of nanoseconds, or a fraction with a "
            f"denominator up to {LARGEST_DENOMINATOR}, less for long times"
        )
    if time is None:
        near = _near_fraction(value, NEAR * abs(value))
        like = f'; "{near}" is near' if near else ', or a fraction like "1/30"'
        raise InputError(f"{place} = {entry!r} s: must be a whole number of nanoseconds{like}")
    return time


def nearest_time(value: float) -> Time:
    """The time that a float of s means, or the whole number of ns that is nearest to it."""
    time = _time_of_float(value)
    return round(value * NANOSECONDS) if time is None else time


def step_of(value: float) -> Time:
    """The time of a step in s that an FMU declares; never shorter than it says.

    What a float does not hold to 12 digits is taken for the fraction that is near, or rounded up.
    """
    time = _time_of_float(value)
    if time is None and (near := _near_fraction(value, NEAR * value)):
        time = _as_whole(near * NANOSECONDS)
    return max(1, math.ceil(value * NANOSECONDS)) if time is None else time


def steps_in(place: str, value: float, step: Time) -> int:
    """How many steps are in a time of `value` s; InputError where that is no whole number."""
    time = in_nanoseconds(place, value)
    if time < step or time % step:
        raise InputError(f"{place} = {value!r}: must be a whole number of {seconds(step)}")
    return int(time // step)


def first_step(time: Time, step: Time, start: Time = 0) -> int:
    """Return the number of the first communication point at or after a time."""
    return max(0, -int((start - time) // step))


def common(*times: Time) -> Time:
    """The longest time of which all of these are whole numbers."""
    per_ns = math.lcm(*(time.denominator for time in times))
    return _as_whole(Fraction(math.gcd(*(int(time * per_ns) for time in times)), per_ns))


def multiple(*times: Time) -> Time:
    """The shortest time that is a whole number of each of these."""
    per_ns = math.lcm(*(time.denominator for time in times))
    return _as_whole(Fraction(math.lcm(*(int(time * per_ns) for time in times)), per_ns))


class TimeGrid(NamedTuple):
    """The communication points of a run, in counts: point k is at start + k * step.

    A count is 1 ns, or the longest part of it of which start and step are whole numbers. Below
    2**53 of them the time of a point is the float nearest to it.
    """

    start: int
    step: int
    per_second: int

    @classmethod
    def of(cls, start: Time, step: Time) -> TimeGrid:
        """The grid of points from start on in the given steps."""
        per_ns = math.lcm(start.denominator, step.denominator)
        return cls(int(start * per_ns), int(step * per_ns), per_ns * NANOSECONDS)

    @property
    def per_nanosecond(self) -> int:
        """The counts in a nanosecond."""
        return self.per_second // NANOSECONDS

    @property
    def last(self) -> float:
        """The time in s until which it is exact; infinite for counts of 1 ns: nobody asks."""
        return math.inf if self.per_nanosecond == 1 else EXACT / self.per_second

    def times(self, steps: npt.NDArray[np.int64]) -> npt.NDArray[np.float64]:
        """The times of points in s."""
        times: npt.NDArray[np.float64] = (self.start + steps * self.step) / self.per_second
        return times


def _of_quantity(place: str, quantity: Quantity) -> float:
    """The time in s of a quantity; InputError where it is none of time."""
    unit, second = known_unit(quantity.unit), known_unit("s")
    if unit is None or second is None or conversion(unit, second) is None:
        raise InputError(f"{place} = {quantity}: must be in a unit of time, like ms")
    return converted(quantity.value, unit, second)


def _fraction(text: Any) -> Fraction | None:
    """The fraction of s that a text like "1/30" or a Fraction is; None where it is neither."""
    if isinstance(text, Fraction):
        return text
    parts = _FRACTION.fullmatch(text) if isinstance(text, str) else None
    if parts is None or not int(parts[2]):
        return None
    return Fraction(int(parts[1]), int(parts[2]))


def _time_of_float(value: float) -> Time | None:
    """The time that a float of s means; None where that is not clear.

    It is the whole number of ns, or else the fraction with a small denominator, whose nearest float
    it is; or else one of which it has 12 digits.
    """
    count = round(value * NANOSECONDS)
    if count / NANOSECONDS == value:
        return count
    fraction = _near_fraction(value, math.ulp(value))
    if fraction is not None and float(fraction) == value:
        return _as_whole(fraction * NANOSECONDS)
    if abs(count / NANOSECONDS - value) <= DIGITS * abs(value):
        return count
    fraction = _near_fraction(value, DIGITS * abs(value))
    return None if fraction is None else _as_whole(fraction * NANOSECONDS)


def _near_fraction(value: float, error: float) -> Fraction | None:
    """The fraction with a small denominator within an error of a value, if there is one."""
    max_denominator = int(min(LARGEST_DENOMINATOR, max(1.0, math.sqrt(CHANCE / error))))
    near = Fraction(value).limit_denominator(max_denominator)
    return near if near and abs(near - Fraction(value)) <= error else None


def _as_whole(time: Fraction) -> Time:
    """A time as an int where it is a whole number of ns."""
    return int(time) if time.denominator == 1 else time
