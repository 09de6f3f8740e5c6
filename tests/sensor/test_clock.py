"""The sampling instants, against exact arithmetic."""

from fractions import Fraction
from itertools import pairwise
from math import ceil
from random import Random

import pytest
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import clock
from proximity_sensor.clock import Params
from support.marks import examples

QUICK = examples(100)


def counted(p, steps):
    """Samples within the steps, from an instant on, and the wait at their end."""
    total, wait = 0, 0.0
    for h in steps:
        n, wait = clock.samples(p, wait, h)
        total += n
    return total, wait


@pytest.mark.parametrize(
    ("step", "rate"),
    [(1e-4, 1e4), (1e-3, 1e4), (1e-5, 1e4), (3e-4, 1e4), (1 / 3e4, 1e4), (1e-3, 44_100.0),
     (1e-4, 3333.0), (1 / 256, 1e4), (2.5e-5, 1e4), (7e-4, 1e3), (1e-6, 1e6)],
)  # fmt: skip
def test_equal_steps_miss_none_and_add_none(step, rate):
    """The step and the rate as decimals or fractions: what they are meant to be."""
    periods = Fraction(step).limit_denominator(10**7) * Fraction(rate)
    p, total, wait = Params(rate), 0, 0.0
    for k in range(1, 10_001):
        n, wait = clock.samples(p, wait, step)
        total += n
        assert total == -(-k * periods.numerator // periods.denominator)  # k * periods, rounded up
    assert wait == pytest.approx(float(total - 10_000 * periods), abs=1e-8)


@QUICK
@given(st.lists(st.integers(1, 5_000_000), min_size=1, max_size=40), st.floats(1.0, 1e6))
def test_any_steps_of_whole_nanoseconds(nanoseconds, rate):
    """Unless an instant is so near that rounding decides; then it counts as reached."""
    periods = Fraction(sum(nanoseconds), 10**9) * Fraction(rate)
    total, wait = counted(Params(rate), [n * 1e-9 for n in nanoseconds])
    expected = ceil(periods - Fraction(clock.TOLERANCE))
    near = abs(periods - Fraction(clock.TOLERANCE) - round(periods)) < Fraction(1, 10**8)
    assert total == expected or near
    assert wait == pytest.approx(float(total - periods), abs=1e-7)


@QUICK
@given(st.integers(1, 30), st.integers(0, 2**32), st.floats(1.0, 1e5))
def test_any_split_of_a_time_has_the_same_samples(parts, seed, rate):
    """Masters give steps as differences of rounded times, here of no particular size."""
    rng = Random(seed)
    times = [0.0, *sorted(rng.uniform(0.0, 0.1) for _ in range(parts - 1)), 0.1]
    steps = [b - a for a, b in pairwise(times) if b > a]
    whole, wait = counted(Params(rate), [0.1])
    split, wait_split = counted(Params(rate), steps)
    assert split == whole
    assert wait_split == pytest.approx(wait, abs=1e-9)


def test_rounding_does_not_move_an_instant():
    for off in (1e-9, -1e-9):
        assert clock.due(off)
        n, wait = clock.samples(Params(1e4), off, 1e-4)
        assert n == 1
        assert wait == pytest.approx(off, abs=1e-15)
    assert not clock.due(1e-5)


def test_a_state_that_was_damaged_has_no_endless_step():
    """Bytes of a state are guarded by no check sum: what waits since ever would be due for ever."""
    assert clock.samples(Params(1000.0), -1e12, 1e-3)[0] == 2
