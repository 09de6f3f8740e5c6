"""The tube: whether curves are the same but for a shift in time, and how far apart else."""

import numpy as np
import pytest
from grasp_cosim.comparison.tube import Curve, deviation, tube
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from support.marks import examples

QUICK = examples(100)
STEP = 1e-3
NUMBERS = st.floats(-1e3, 1e3, width=32)
SAMPLES = arrays.arrays(np.float64, st.integers(1, 60), elements=NUMBERS)
HELD = st.booleans()
SHIFT = st.integers(0, 12)


def times(count, step_ns=1_000_000):
    """s, from 0 on."""
    return (np.arange(count) * step_ns / 1e9).astype(np.float64)


def sampled(values, held=False):
    return Curve(times(len(values)), values, held)


def by_hand(one, other, shift):
    """The deviation of curves on the same grid, for a shift of whole samples, by definition."""
    n = len(one.values)
    windows = [slice(max(i - shift, 0), i + shift + 1) for i in range(n)]
    after = min(shift, n - 1)

    def padded(values):
        if one.held:
            return np.pad(values, (0, after), mode="edge")
        return np.pad(values, (0, after), mode="reflect", reflect_type="odd")

    apart = [
        max(padded(a.values)[w].min() - b.values[i], b.values[i] - padded(a.values)[w].max(), 0.0)
        for a, b in ((one, other), (other, one))
        for i, w in enumerate(windows)
    ]
    return float(max(apart))


@st.composite
def pairs(draw):
    count = draw(st.integers(1, 60))
    held = draw(HELD)
    values = arrays.arrays(np.float64, count, elements=NUMBERS)
    return sampled(draw(values), held), sampled(draw(values), held)


@QUICK
@given(pairs(), SHIFT)
def test_it_is_symmetric_and_what_its_definition_says(both, shift):
    one, other = both
    there, back = deviation(one, other, shift * STEP), deviation(other, one, shift * STEP)
    assert (there.values == back.values).all()
    assert (there.reference == back.candidate).all() or (there.values == 0.0).any()
    assert there.values.max() == pytest.approx(by_hand(one, other, shift), abs=1e-9)


@QUICK
@given(SAMPLES, st.floats(0.0, 0.02), HELD)
def test_the_tube_holds_the_curve_between_samples_too(values, shift, held):
    """Anywhere within the shift of any time the curve is in the tube of that time."""
    whole = sampled(values, held)
    at = np.linspace(0.0, whole.time[-1], 37)
    allowed = tube(whole, at, shift)
    for fraction in (-1.0, -0.3, 0.0, 0.7, 1.0):
        taken = whole.at(at + fraction * shift)
        assert (allowed.low <= taken + 1e-6).all()
        assert (taken <= allowed.high + 1e-6).all()


def test_an_impact_that_comes_a_step_later_is_no_deviation_but_a_higher_one_is():
    time = times(200)
    impact = np.where(time < 0.1, 0.0, np.exp(-(time - 0.1) / 0.02))
    late = np.concatenate([np.zeros(2), impact[:-2]])
    assert np.abs(impact - late).max() == 1.0
    assert deviation(Curve(time, impact), Curve(time, late), 3 * STEP).values.max() == 0.0
    higher = deviation(Curve(time, impact), Curve(time, 1.25 * late), 3 * STEP)
    worst = higher.values.argmax()
    assert higher.values[worst] == pytest.approx(0.25)
    assert (higher.reference[worst], higher.candidate[worst]) == (1.0, 1.25)
    assert higher.time[worst] == time[102]


def test_a_late_curve_that_still_moves_at_the_end_is_inside():
    time = times(100)
    ramp = Curve(time, 5.0 * time)
    late = Curve(time, 5.0 * np.maximum(time - 0.002, 0.0))
    assert deviation(ramp, late, 0.002).values.max() == pytest.approx(0.0, abs=1e-12)
    assert deviation(ramp, late, 0.001).values.max() == pytest.approx(5.0 * 0.001)


def test_a_peak_between_samples_is_in_the_band_of_one_that_is_thinned():
    """An impact that decays, sampled at another part of its step, has another highest sample."""
    time = times(200)
    for part in (0.1, 0.5, 0.9):
        impacts = [
            np.where(time < start, 0.0, np.exp(np.minimum((start - time) / 0.02, 0.0)))
            for start in (0.1, 0.1 + part * STEP)
        ]
        one, other = (Curve(time, values) for values in impacts)
        hidden = max(deviation(one, one.thinned(i), 3 * STEP).values.max() for i in (0, 1))
        assert 0.0 < deviation(one, other, 3 * STEP).values.max() <= 2.0 * hidden
