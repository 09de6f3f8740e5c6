"""Exact times: what a number of seconds means, and how a run counts them."""

from fractions import Fraction

import numpy as np
import pytest
from grasp_cosim import InputError
from grasp_cosim.system.times import (
    NANOSECONDS,
    TimeGrid,
    first_step,
    in_nanoseconds,
    in_seconds,
    nearest_time,
    step_of,
    written,
)


def ns(p, q):
    """A fraction of a second in ns."""
    return Fraction(p, q) * NANOSECONDS


@pytest.mark.parametrize("q", [3, 7, 30, 60, 1024, 44_100, 48_000, 999_983])
@pytest.mark.parametrize("p", [1, 2, 1001])
def test_a_fraction_is_the_same_from_a_text_a_float_and_a_fraction(p, q):
    for given in (f"{p}/{q}", Fraction(p, q), p / q):
        time = in_nanoseconds("step", given)
        assert time == ns(p, q)
        assert in_seconds(time) == p / q
        assert in_nanoseconds("step", written(time)) == time


@pytest.mark.parametrize(
    ("given", "time"),
    [
        (0.0333, 33_300_000),
        (0.033333333, 33_333_333),
        (0.1 + 0.2, 300_000_000),  # a float of 12 digits
        ("3/10", 300_000_000),
        (0.0333333333333333, ns(1, 30)),  # as %.15g has it
        (0.0166666666666667, ns(1, 60)),
        (100_000 + 1 / 30, ns(3_000_001, 30)),
        (1e9, 10**18),
    ],
)
def test_a_number_means_whole_nanoseconds_or_a_simple_fraction(given, time):
    found = in_nanoseconds("step", given)
    assert found == time
    assert isinstance(found, int) == (found.denominator == 1)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (1.5e-9, "step = 1.5e-09 s: must be a whole number of nanoseconds, or a fraction like"),
        (0.0333333333, '; "1/30" is near'),
        ("1/1000003", "a denominator up to 1000000"),
        ("1/0", "step = '1/0' s: must be a number greater than 0, at most 1e+09, or a fraction"),
        ("-1/30", "must be a number greater than 0"),
        ("0.1/3", 'or a fraction like "1/30"'),
        ("1_0/30", 'or a fraction like "1/30"'),
    ],
)
def test_what_is_neither_is_refused_with_what_is_valid(given, said):
    with pytest.raises(InputError) as caught:
        in_nanoseconds("step", given)
    assert said in str(caught.value)


@pytest.mark.parametrize("seed", range(5))
def test_no_float_of_an_experiment_is_taken_for_a_fraction_by_chance(seed):
    """Of 2,000 random numbers to 1,000 s none is one, and those of whole ns are these."""
    draws = np.random.default_rng(seed)
    for value in (
        draws.uniform(0.0, 1000.0, 2000) * 10.0 ** draws.uniform(-6.0, 0.0, 2000)
    ).tolist():
        assert isinstance(nearest_time(value), int)
        assert nearest_time(round(value * 1e9) / 1e9) == round(value * 1e9)


def test_a_declared_step_is_never_taken_shorter():
    assert step_of(1 / 30) == step_of(0.0333333333) == ns(1, 30)
    assert step_of(0.001) == 1_000_000
    assert step_of(0.001 + 1.3e-10) == 1_000_001
    assert step_of(1e-12) == 1


@pytest.mark.parametrize("per_second", [30, 1024, 48_000, 1000])
@pytest.mark.parametrize("start", ["0", "-7/3", "1/7", "0.001"])
def test_labels_are_the_nearest_floats(per_second, start):
    begin, step = Fraction(start), Fraction(1, per_second)
    grid = TimeGrid.of(begin * NANOSECONDS, step * NANOSECONDS)
    steps = np.array([0, 1, 2, 3, 29, 30, 1001, 123_456_789])
    exact = [float(begin + k * step) for k in steps.tolist()]
    assert grid.times(steps).tolist() == exact


def test_whole_nanoseconds_are_counted_as_such():
    assert TimeGrid.of(5, 1000) == (5, 1000, NANOSECONDS)
    assert TimeGrid.of(0, ns(1, 1024)) == (0, 1_953_125, 2 * NANOSECONDS)


def test_the_first_point_at_or_after_a_time():
    third = ns(1, 3)
    points = [first_step(time, third) for time in (0, 1, third, third + 1, 10**9)]
    assert points == [0, 1, 1, 2, 3]
