"""Faults on a connection, each against NumPy; seeds, windows, and being asked more than once."""

import math

import numpy as np
import pytest
from grasp_cosim.master.fault_windows import Window, fault_functions
from grasp_cosim.system.faults import INITIAL
from grasp_cosim.system.parts import Fault, Port
from hypothesis import given
from hypothesis import strategies as st
from support.marks import examples

QUICK = examples(100)
STEP = 1_000_000
WIRE, OTHER = Port("controller", "intensity[1]"), Port("controller", "intensity[2]")
SIGNAL = np.sin(0.1 * np.arange(100)) + 1e-3 * np.arange(100)
"""No two values are equal."""


def fault(kind, start=0, end=None, *, target=WIRE, seed=0, **parameters):
    """A fault with a window in steps."""
    until = None if end is None else round(end * STEP)
    return Fault(target, kind, parameters, round(start * STEP), until, seed=seed)


def on_connection(*faults):
    """What a connection with these faults makes of a value."""
    windows = [Window(f, STEP) for f in faults]
    return fault_functions(windows, STEP)[faults[0].target]


def passed(function, values, steps=None):
    """What becomes of values at steps, by default 0, 1, 2, ..."""
    listed = np.asarray(values).tolist()
    numbers = range(len(listed)) if steps is None else steps
    return np.array([function(v, k) for v, k in zip(listed, numbers, strict=True)])


WITHIN = SIGNAL[20:50]


@pytest.mark.parametrize(
    ("kind", "given", "expected"),
    [
        ("stuck", {}, SIGNAL[20]),
        ("stuck", {"value": -3.0}, -3.0),
        ("bias", {"value": 0.25}, WITHIN + 0.25),
        ("saturation", {"low": -0.5}, np.maximum(WITHIN, -0.5)),
        ("saturation", {"high": 0.5}, np.minimum(WITHIN, 0.5)),
        ("saturation", {"low": -0.2, "high": 0.3}, np.clip(WITHIN, -0.2, 0.3)),
        ("quantisation", {"step": 0.25}, 0.25 * np.rint(WITHIN / 0.25)),
        ("delay", {"time": 0.007}, SIGNAL[13:43]),  # it knows what was passed before it began
        ("dropout", {"probability": 1.0}, SIGNAL[19]),
    ],
)
def test_what_a_fault_makes_of_values_in_its_window(kind, given, expected):
    whole = np.concatenate([SIGNAL[:20], np.broadcast_to(expected, 30), SIGNAL[50:]])
    assert (passed(on_connection(fault(kind, 20, 50, **given)), SIGNAL) == whole).all()


def test_a_boolean_is_stuck_as_a_number():
    assert repr(on_connection(fault("stuck", value=True))(0.0, 3)) == "1.0"


@QUICK
@given(st.floats(-1e6, 1e6), st.floats(1e-6, 1e3))
def test_quantisation(value, width):
    result = on_connection(fault("quantisation", step=width))(value, 0)
    assert result == np.rint(value / width) * width
    assert abs(result - value) <= 0.5 * width * (1 + 1e-9) + 1e-9 * abs(value)


@pytest.mark.parametrize("delay", [0, 1, 5, 7])
@pytest.mark.parametrize(("period", "phase"), [(1, 0), (3, 0), (3, 2)])
def test_a_delay_counts_base_steps_on_a_slow_connection_too(delay, period, phase):
    """The value is the one that was the newest so many base steps ago."""
    steps = np.arange(phase, 100, period)
    newest = np.searchsorted(steps, steps - delay, side="right") - 1
    values = SIGNAL[steps]
    function = on_connection(fault("delay", time=delay / 1000))
    assert (passed(function, values, steps.tolist()) == values[np.maximum(newest, 0)]).all()


def test_a_delay_starts_with_the_value_of_the_initialisation():
    function = on_connection(fault("delay", time=0.002))
    assert passed(function, [5.0, 1.0, 2.0, 3.0], [INITIAL, 0, 1, 2]).tolist() == [5, 5, 5, 1]


def lost(result, values):
    """Where a dropout made another value of one; no two neighbours in values are equal."""
    return np.asarray(result != values)


def test_a_dropout_holds_the_last_value_that_got_through():
    result = passed(on_connection(fault("dropout", probability=0.6, seed=4)), SIGNAL)
    through = ~lost(result, SIGNAL)
    assert 10 < through.sum() < 90
    assert through[0]
    newest = np.maximum.accumulate(np.where(through, np.arange(100), 0))
    assert (result == SIGNAL[newest]).all()


@pytest.mark.parametrize("share", [0.0, 1.0, 0.3])
def test_how_many_a_dropout_loses(share):
    """Of neighbours, too; those pairs overlap, so they are correlated."""
    n = 20_000
    values = np.arange(n, dtype=float)
    result = passed(on_connection(fault("dropout", probability=share)), values)
    hits = lost(result, values)[1:]
    assert abs(hits.mean() - share) <= 5 * math.sqrt(share * (1 - share) / n)
    variance = share**2 * (1 - share**2) + 2 * (share**3 - share**4)
    assert abs((hits[1:] & hits[:-1]).mean() - share**2) <= 5 * math.sqrt(variance / n)


def noise(seed=1, target=WIRE, n=20_000):
    function = on_connection(fault("noise", target=target, seed=seed, standard_deviation=2.0))
    return passed(function, np.zeros(n))


def test_noise_of_another_seed_or_connection_or_beside_it_is_independent():
    x = noise()
    one = fault("noise", seed=1, standard_deviation=2.0)
    both = passed(on_connection(one, one), np.zeros(len(x)))
    for y in (noise(seed=2), noise(target=OTHER), both - x):
        assert abs(np.corrcoef(x, y)[0, 1]) < 5 / math.sqrt(len(x))


@pytest.mark.parametrize("given", [{"standard_deviation": 1.0}, {"probability": 0.5}])
def test_a_random_number_depends_on_the_step_alone(given):
    """Not on the window, on other faults, on the steps asked before, nor on their order."""
    one = fault("dropout" if "probability" in given else "noise", seed=3, **given)
    whole = on_connection(one)
    part = on_connection(
        Fault(WIRE, one.kind, one.parameters, 40 * STEP, 60 * STEP, seed=one.seed),
    )
    beside = on_connection(fault("bias", value=0.0), one)
    expected = passed(whole, SIGNAL)[41:60]
    hit = expected != SIGNAL[41:60]
    assert ((passed(part, SIGNAL)[41:60] != SIGNAL[41:60]) == hit).all()
    assert (passed(beside, SIGNAL)[41:60] == expected).all()
    if one.kind == "noise":
        assert (passed(part, SIGNAL)[41:60] == expected).all()
        steps = list(range(99, -1, -1))
        assert (passed(on_connection(one), SIGNAL[::-1], steps)[::-1][41:60] == expected).all()


def test_random_numbers_stay_the_same_from_release_to_release():
    function = on_connection(fault("noise", seed=7, standard_deviation=1.0))
    kept = [-0.7353820911792353, 0.8132515606280434, 0.7269561280503712, 0.6529768198539552]
    result = passed(function, np.zeros(4), [INITIAL, 0, 1, 1000])
    assert result == pytest.approx(kept, rel=1e-12)


@pytest.mark.parametrize(
    ("start", "end", "acts"),
    [
        (0, None, range(100)),
        (10, 20, range(10, 20)),
        (9.000001, 19.000001, range(10, 20)),
        (9.999999, 19.999999, range(10, 20)),
        (10.000001, 20.000001, range(11, 21)),
        (0, 1, range(1)),
        (99, 200, range(99, 100)),
    ],
)
def test_a_window_is_exact_to_the_step(start, end, acts):
    result = passed(on_connection(fault("bias", start, end, value=1.0)), np.zeros(100))
    assert np.flatnonzero(result).tolist() == list(acts)


@pytest.mark.parametrize(("start", "acts"), [(0, True), (1, False), (1e-6, False)])
def test_only_a_fault_from_0_acts_in_initialisation(start, acts):
    assert on_connection(fault("bias", start, value=1.0))(0.0, INITIAL) == float(acts)


def test_faults_of_a_connection_act_in_the_order_of_the_file():
    bias, limit = fault("bias", value=1.0), fault("saturation", high=0.5)
    assert on_connection(bias, limit)(0.0, 0) == 0.5
    assert on_connection(limit, bias)(0.0, 0) == 1.0
    assert on_connection(limit, bias)(2.0, 1) == 1.5


def test_each_connection_has_its_own_faults():
    faults = (fault("bias", value=1.0), fault("bias", value=2.0, target=OTHER))
    functions = fault_functions([Window(f, STEP) for f in faults], STEP)
    assert {port: f(0.0, 0) for port, f in functions.items()} == {WIRE: 1.0, OTHER: 2.0}


ALL = (
    fault("stuck", 3, 6),
    fault("stuck", 3, 6, value=2.0),
    fault("dropout", 2, 9, probability=0.5, seed=1),
    fault("bias", 2, 9, value=1.0),
    fault("noise", standard_deviation=1.0),
    fault("delay", time=0.003),
    fault("delay", 2, 8, time=0.001),
    fault("saturation", low=-5.0, high=5.0),
    fault("quantisation", step=0.5),
)
VALUES = st.lists(st.floats(-10.0, 10.0), min_size=13, max_size=13)


@QUICK
@given(
    st.lists(st.sampled_from(ALL), min_size=1, max_size=4),
    VALUES,
    st.lists(st.lists(st.floats(-10.0, 10.0), max_size=3), min_size=13, max_size=13),
)
def test_asked_again_at_a_step_it_answers_the_same(faults, values, before):
    """And what it was asked before at the same step leaves no trace."""
    once, often = on_connection(*faults), on_connection(*faults)
    for step, (value, others) in enumerate(zip(values, before, strict=True), INITIAL):
        for other in others:
            often(other, step)
        answers = {often(value, step) for _ in range(3)}
        assert answers == {once(value, step)}


@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan])
@pytest.mark.parametrize("one", ALL, ids=lambda f: f.kind)
def test_what_is_not_finite_is_not_hidden_by_an_exception(one, value):
    function = on_connection(one)
    results = [function(value, step) for step in range(12)]
    if one.kind not in ("saturation", "stuck"):
        assert not any(map(math.isfinite, results))
    if math.isnan(value) and one.kind == "saturation":
        assert all(map(math.isnan, results))
