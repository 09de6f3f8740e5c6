"""Bands, given or derived, and the tube: how far apart curves are, but for a shift in time."""

import math

import numpy as np
import pytest
from grasp_cosim.base.errors import InputError
from grasp_cosim.comparison.bands import (
    BOTH,
    SHARE,
    SMALL,
    Band,
    Bands,
    Given,
    entry_for,
    metric_band,
    read_bands,
    signal_band,
)
from grasp_cosim.comparison.side import Side
from grasp_cosim.comparison.tube import Curve, deviation, tube
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from support.marks import examples

TIME = np.linspace(0.0, 1.0, 101, dtype=np.float64)
SINE = Curve(TIME, 2.0 + np.sin(2.0 * np.pi * TIME))
"""From 1 to 3."""


def written(folder, text):
    path = folder / "bands.toml"
    path.write_text(text, "utf-8")
    return path


@pytest.mark.parametrize(
    ("level", "nominal", "size"), [(5.0, None, 5.0), (0.0, None, 1.0), (1e-9, 0.01, 0.01)]
)
def test_a_signal_that_does_not_move_is_judged_by_its_size_or_nominal_value(level, nominal, size):
    flat = Curve(TIME, np.full(101, level))
    assert signal_band(flat, (), nominal, 0.0).width == pytest.approx(SMALL * size)


def test_what_numerics_change_is_allowed_twice_but_for_a_shift():
    assert signal_band(SINE, (), None, 0.1) == Band(pytest.approx(2.0 * SHARE), 0.1, "derived")
    other = [Curve(TIME, SINE.values + x) for x in (0.01, -0.03, 0.02)]
    assert signal_band(SINE, other, None, 0.0).width == pytest.approx(BOTH * 0.03)
    late = Curve(TIME, np.concatenate([SINE.values[:1], SINE.values[:-1]]))
    assert signal_band(SINE, [late], None, 0.0).width > 10 * SHARE
    assert signal_band(SINE, [late], None, 0.01).width == pytest.approx(2.0 * SHARE)


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        (Given(absolute=0.1), Band(0.1, 0.05, "given")),
        (Given(relative=0.1), Band(0.2, 0.05, "given")),
        (Given(absolute=0.1, relative=0.1, time=0.0), Band(0.3, 0.0, "given")),
        (Given(time=0.2), Band(2.0 * SHARE, 0.2, "given")),
        (Given(absolute=0.0), Band(0.0, 0.05, "given")),
        (Given(absolute=math.inf), Band(math.inf, 0.05, "given")),
    ],
)
def test_a_file_overrides_what_it_gives(given, expected):
    band = signal_band(SINE, (), None, 0.05, given)
    assert (band.time, band.source) == (expected.time, "given")
    assert band.width == pytest.approx(expected.width)


def test_the_band_of_a_metric():
    assert metric_band(2.0, (), 0.0).width == pytest.approx(2.0 * SHARE)
    assert metric_band(2.0, (), 0.5).width == 0.5  # a time, with the shift that is allowed
    assert metric_band(2.0, (2.1, None, 1.7), 0.0).width == pytest.approx(BOTH * 0.3)
    assert metric_band(0.0, (), 0.0).width == SMALL
    assert metric_band(None, (1.0,), 0.0).width == SMALL
    assert metric_band(-2.0, (), 0.0, Given(relative=0.1, absolute=0.1)).width == pytest.approx(0.3)


def test_an_exact_name_goes_before_the_first_pattern_that_fits():
    one, two, three, four = (Given(absolute=float(i)) for i in range(4))
    entries = {"*": one, "plant.*": two, "plant.gap[1]": three, "plant.gap[*]": four}
    assert entry_for(entries, "plant.gap[1]") is three
    assert entry_for(entries, "plant.gap[2]") is one
    assert entry_for({"plant.gap[*]": four, "*": one}, "plant.gap[2]") is four
    assert entry_for({"plant.gap[*]": four}, "plant.gap1") is None
    assert entry_for({"time_to_contact": two}, "time_to_contact[1]", "time_to_contact") is two


def test_a_file_is_read(tmp_path):
    text = """
        signals = { "plant.gap[1]" = { absolute = 1e-5, relative = 1e-3, time = 1e-3 } }
        [metrics]
        time_to_contact = { absolute = 2 }
        "peak*" = { absolute = inf }
    """
    bands = read_bands(written(tmp_path, text))
    assert bands.signals == {"plant.gap[1]": Given(1e-5, 1e-3, 1e-3)}
    assert bands.metrics == {"time_to_contact": Given(2.0), "peak*": Given(math.inf)}


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("signal = {}", r"bands.toml: unknown entry 'signal'; did you mean signals"),
        ('signals = { "*" = 0.1 }', r"\[signals\]: '\*' = 0.1: must be a table with one of"),
        ('signals = { "*" = {} }', r"must be a table with one of absolute, relative"),
        ('signals = { a = { abs = 1 } }', r"'a': unknown entry 'abs'; did you mean absolute"),
        ("metrics = { a = { time = 1 } }", r"unknown entry 'time'; valid: absolute, relative$"),
        ('signals = { a = { absolute = -1 } }', r"absolute = -1: must be a number of at least"),
        ('signals = { a = { time = inf } }', r"time = inf: must be a number of at least 0$"),
        ('signals = { a = { time = "1" } }', r"time = '1': must be a number"),
    ],
)  # fmt: skip
def test_a_wrong_file_is_one_line(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as caught:
        read_bands(written(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_a_pattern_for_nothing_is_an_error():
    bands = Bands("b.toml", {"plant.*": Given(0.1)}, {"time_*": Given(0.1)})
    bands.check(["plant.gap[1]"], ["time_to_contact[1]"])
    with pytest.raises(
        InputError, match=r"^b.toml: \[signals\]: nothing is called 'plant.\*'; val"
    ):
        bands.check(["plnt.gap[1]"], ["time_to_contact[1]"])
    with pytest.raises(InputError, match=r"^b.toml: \[metrics\]: nothing is called 'time_\*'"):
        bands.check(["plant.gap[1]"], ["tome_to_contact[1]"])


# The tube: whether curves are the same but for a shift in time, and how far apart else.

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
    low, high = tube(whole, at, shift)
    for fraction in (-1.0, -0.3, 0.0, 0.7, 1.0):
        taken = whole.at(at + fraction * shift)
        assert (low <= taken + 1e-6).all()
        assert (taken <= high + 1e-6).all()


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
        thinned = Side("", time, {"": one.values}, {}, {}).every_second()
        hidden = max(deviation(one, t.curves()[""], 3 * STEP).values.max() for t in thinned)
        assert 0.0 < deviation(one, other, 3 * STEP).values.max() <= 2.0 * hidden
