"""Filter, median, converter and sampling instants against scipy, numpy and exact arithmetic."""

from fractions import Fraction
from itertools import product
from math import ceil, pi
from statistics import median

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import electronics
from proximity_sensor.electronics import Adc, Ambient, Sampling
from support.marks import examples

QUICK = examples(100)

CUTOFFS = st.floats(1e-3, 0.49)
"""As a fraction of the sampling rate."""


def test_the_offset_drifts_from_the_calibration_on():
    p = Ambient(offset=0.25, calibration_error=0.5, drift=-0.125)
    volts = [electronics.ambient_voltage(p, t) for t in (-1.0, 0.0, 1.0, 4.0)]
    assert volts == [0.75, 0.75, 0.625, 0.25]
    assert electronics.ambient_voltage(Ambient(), 1e4) == 0.35


@QUICK
@given(CUTOFFS)
def test_the_filter_is_butterworths(part):
    """1 / sqrt(1 + (tan(pi·f) / tan(pi·part))^10): 1 at rest, -3 dB at the cutoff; and stable."""
    b, a, *sections = electronics.coefficients(part, 1.0)
    for f in (0.0, 0.5 * part, part, 0.5 * (part + 0.5)):
        z = np.exp(-2j * pi * f)
        h = b * (1.0 + z) / (1.0 + a * z)
        for b_0, a_1, a_2 in sections:
            h *= b_0 * (1.0 + z) ** 2 / (1.0 + a_1 * z + a_2 * z * z)
        expected = (1.0 + (np.tan(pi * f) / np.tan(pi * part)) ** 10) ** -0.5
        assert abs(h) == pytest.approx(expected, rel=1e-6)
    assert abs(a) < 1.0
    assert all(abs(a_2) < 1.0 and abs(a_1) < 1.0 + a_2 for _, a_1, a_2 in sections)


def test_the_median_puts_everything_in_order():
    """A comparison network that sorts all zeros and ones sorts everything."""
    for window in product((0.0, 1.0), repeat=10):
        assert electronics.median(window) == median(window)
    assert electronics.median((0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)) == 4.5


@QUICK
@given(st.integers(1, 24), st.floats(-20.0, 5.0), st.floats(0.1, 20.0), st.floats(-2.0, 2.0))
def test_the_converter_gives_the_nearest_of_its_levels(bits, low, span, part):
    p = Adc(True, bits, (low, low + span))
    step = (p.range[1] - low) / 2.0**bits
    v = low + part * span
    found = electronics.converted(p, v)
    code = (found - low) / step
    assert code == pytest.approx(round(code), abs=1e-6)
    assert -0.5 < code < 2.0**bits - 0.5
    nearest = min(max(v, low), low + (2.0**bits - 1.0) * step)
    assert abs(found - nearest) <= 0.5 * step * (1.0 + 1e-6)


def test_sixteen_bits_have_a_level_at_zero():
    assert electronics.converted(Adc(True), 1e-6) == 0.0
    assert electronics.converted(Adc(True), 1e6) == 10.0 - 20.0 / 2**16


@pytest.mark.parametrize("ends", [(5.0, 5.0), (5.0, -5.0)])
def test_a_range_without_an_inside_is_refused(ends):
    with pytest.raises(ValueError, match=r"^adc\.range = 5\.0, -?5\.0 V: the second must be above"):
        Adc(range=ends)


def counted(p, steps):
    """Samples within the steps, from an instant on, and the wait at their end."""
    total, wait = 0, 0.0
    for h in steps:
        n, wait = electronics.samples(p, wait, h)
        total += n
    return total, wait


@pytest.mark.parametrize(
    ("step", "rate"),
    [(1e-4, 1e4), (1e-3, 1e4), (1e-5, 1e4), (3e-4, 1e4), (1 / 3e4, 1e4), (1e-3, 44_100.0),
     (1e-4, 3333.0), (1 / 256, 1e4), (2.5e-5, 1e4), (7e-4, 1e3), (1e-6, 1e6)],
)  # fmt: skip
def test_equal_steps_miss_no_instant_and_add_none(step, rate):
    """The step and the rate as decimals or fractions: what they are meant to be."""
    periods = Fraction(step).limit_denominator(10**7) * Fraction(rate)
    p, total, wait = Sampling(rate), 0, 0.0
    for k in range(1, 5_001):
        n, wait = electronics.samples(p, wait, step)
        total += n
        assert total == -(-k * periods.numerator // periods.denominator)  # k * periods, rounded up
    assert wait == pytest.approx(float(total - 5_000 * periods), abs=1e-8)


@QUICK
@given(st.lists(st.integers(1, 5_000_000), min_size=1, max_size=40), st.floats(1.0, 1e6))
def test_any_steps_of_whole_nanoseconds(nanoseconds, rate):
    """Unless an instant is so near that rounding decides; then it counts as reached."""
    periods = Fraction(sum(nanoseconds), 10**9) * Fraction(rate)
    total, wait = counted(Sampling(rate), [n * 1e-9 for n in nanoseconds])
    near = abs(periods - Fraction(electronics.TOLERANCE) - round(periods)) < Fraction(1, 10**8)
    assert total == ceil(periods - Fraction(electronics.TOLERANCE)) or near
    assert wait == pytest.approx(float(total - periods), abs=1e-7)


def test_rounding_does_not_move_an_instant_and_a_damaged_state_has_no_endless_step():
    for off in (1e-9, -1e-9):
        assert electronics.due(off)
        assert electronics.samples(Sampling(1e4), off, 1e-4)[0] == 1
    assert not electronics.due(1e-5)
    assert electronics.samples(Sampling(1000.0), -1e12, 1e-3)[0] == 2
