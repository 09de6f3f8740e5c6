"""The sampled closed loop against a solution in continuous time, and the blocks called directly.

The FMUs of the adaptive grasp are native ones, with the bits of Python's and a run in milliseconds.
"""

from dataclasses import replace
from functools import cache
from math import ceil

import numpy as np
import pytest
from grasp_controller import (
    contact_force,
    holding,
    impact_reduction,
    reflectance_ratio,
    series,
    simultaneous_contact,
)
from grasp_cosim import simulate
from grasp_cosim.grasp.metrics import FINGERS, first_contact
from grasp_cosim.metrics.metric import Signals
from gripper_plant import rigid
from hypothesis import Phase, assume, given
from hypothesis import strategies as st
from proximity_sensor import channel
from support.approach import pairs
from support.continuous import Adaptive, Grasp, solve
from support.direct import closed_loop
from support.grasps import CASES, adaptive_grasp, last, run, values_of
from support.marks import examples, slow

SLOW_CASES = (0, slow(1), slow(2))
STEP = 1e-4
"""s; the published controller runs at 10 kHz."""

STOP = 8.0
"""s; longer than any approach here."""

TOLERANCE, ADAPTIVE_TOLERANCE = 2e-3, 2e-4
"""s; for contact times at STEP."""

X_M = 0.03
"""m; the published position. Off centre each finger has a time of its own, and an error of its own:
at the centre one is the mirror image of the other.
"""

BUILD_UP = {0: 0.3, 1: 2.6, 2: 2.6}
"""s; moments at which both fingers touch and the force of the later one has not settled yet."""

SLOWEST = 3e-3
"""m/s; an error in time is one in position over the speed of approach: without a bound on the speed
there is none on the time. The ranges below keep nearly every approach faster.
"""

UNSHRUNK = {"phases": [Phase.generate]}
"""To shrink a failure takes minutes and tells no more than the numbers of a grasp do."""

BLACK_ON_WHITE = Grasp(reflectance=(0.57, 1.0), adaptive=Adaptive())
OFF_CENTRE = Grasp(reflectance=(0.3, 1.2), x_m=0.05, adaptive=Adaptive())


@cache
def reference(g, stop=STOP, to_the_end=False):
    return solve(g, stop, to_the_end=to_the_end)


def reference_times(g):
    return np.array(reference(g).contact_time, np.float64)


def near_in_order(steps, errors, off):
    """Sample and hold is of first order, whatever the order of the steps within the blocks."""
    for finger in np.array(errors).T:
        slope, _ = np.polyfit(np.log(steps), np.log(np.abs(finger)), 1)
        assert slope == pytest.approx(1.0, abs=off)


def fast_enough(g):
    """Grasps that crawl to the surface, or miss it, are left out."""
    assume(all(v is not None and v >= SLOWEST for v in reference(g).closing_speed))


# The published law


def blocks(g):
    """The parameters of the blocks for a grasp of the reference."""
    sensor_1, sensor_2 = (channel.Params(r, g.K, g.n, g.l_0) for r in g.reflectance)
    return {
        "plant": rigid.Params(g.m, g.x_init, g.W, g.x_m, g.alpha, g.beta),
        "sensor_1": sensor_1,
        "sensor_2": sensor_2,
        "controller": series.Params(
            simultaneous_contact.Params(g.case == 2, g.M_a2, g.D_a2, g.K_a2, g.K_s),
            impact_reduction.Params(g.case > 0, g.M_a1, g.D_a1, g.K_a1, g.D_p),
            contact_force.Params(g.D_i, g.K_i),
        ),
    }


@cache
def contact_times(g, step):
    columns = closed_loop(blocks(g), step, round(STOP / step), until_contact=True)
    signals = Signals(columns["time"], columns)
    contacts = [first_contact(signals, j) for j in FINGERS]
    return np.array([np.nan if c is None else c[0] for c in contacts])


def test_the_defaults_of_the_blocks_are_the_numbers_of_the_reference():
    defaults = [rigid.Params(), channel.Params(), channel.Params(), series.Params()]
    assert [*blocks(Grasp()).values()] == defaults
    p, h = reflectance_ratio.Params(), holding.Params()
    n, _ = p.diffusion_exponent
    learnt = (n, p.time_constant, p.weight_exponent, p.intensity_noise)
    known = (p.exponent_deviation, p.offset_deviation, p.gain_deviation, p.caution)
    l_0, _ = p.offset_distance
    held = (h.squeeze, h.speed, h.time_constant, h.gap, h.blind_time, l_0)
    assert Adaptive() == Adaptive(*learnt, p.prior_deviation, p.limit, *known, *held)


@pytest.mark.parametrize(
    ("case", "times", "speeds"),
    [
        (0, (0.100, 0.251), (0.531, 0.287)),
        (1, (1.224, 2.424), (0.0074, 0.0060)),
        (2, (1.887, 1.897), (0.0059, 0.0060)),
    ],
)
def test_the_reference_gives_the_known_grasps(case, times, speeds):
    """Pins the reference itself: an error made in the blocks as well would not show elsewhere."""
    solution = reference(Grasp(case=case, x_m=X_M))
    assert solution.contact_time == pytest.approx(times, abs=5e-4)
    assert solution.closing_speed == pytest.approx(speeds, rel=0.01)


@pytest.mark.parametrize("x_m", [0.0, X_M, 0.05])
@pytest.mark.parametrize("case", SLOW_CASES)
def test_contact_times(case, x_m):
    g = Grasp(case=case, x_m=x_m)
    assert contact_times(g, STEP) == pytest.approx(reference_times(g), abs=TOLERANCE)


@pytest.mark.parametrize("case", SLOW_CASES)
def test_contact_times_err_in_proportion_to_the_step(case):
    g = Grasp(case=case, x_m=X_M)
    steps = [2e-4, 4e-4, 8e-4, 1.6e-3, 3.2e-3]
    near_in_order(steps, [contact_times(g, step) - reference_times(g) for step in steps], 0.2)


@pytest.mark.parametrize("case", SLOW_CASES)
def test_the_force_builds_up_as_in_the_reference(case):
    g = Grasp(case=case, x_m=X_M)
    expected = reference(g, BUILD_UP[case], True)
    signals = closed_loop(blocks(g), STEP, round(BUILD_UP[case] / STEP))
    forces = [float(signals[f"plant.contact_force[{j}]"][-1]) for j in FINGERS]
    assert forces == pytest.approx(expected.contact_force, abs=1e-3)
    assert signals["controller.target_position"][-1] == pytest.approx(expected.target, abs=1e-6)


GRASPS = st.builds(
    Grasp,
    x_m=st.floats(-0.05, 0.05),
    W=st.floats(0.05, 0.1),
    m=pairs(0.25, 1.0),
    reflectance=pairs(0.9, 1.0),
    M_a2=st.floats(0.5, 2.0),
    D_a2=st.floats(8.0, 20.0),
    K_a2=st.floats(30.0, 60.0),
    K_s=st.floats(1.0, 4.0),
    M_a1=st.floats(0.5, 2.0),
    D_a1=st.floats(5.0, 20.0),
    K_a1=st.floats(25.0, 50.0),
    D_p=st.tuples(st.floats(0.4, 0.7), st.floats(-0.7, -0.4)),
    D_i=st.floats(10.0, 25.0),
    K_i=st.floats(60.0, 200.0),
)
"""Around the published numbers; a wide object and a stiff layer 2 arrive fast enough."""


@pytest.mark.parametrize("case", SLOW_CASES)
@examples(8, **UNSHRUNK)
@given(drawn=GRASPS)
def test_contact_times_of_any_grasp(case, drawn):
    """Steps four times as long, so four times the error, keep the same tolerance."""
    g = replace(drawn, case=case)
    fast_enough(g)
    assert contact_times(g, 4.0 * STEP) == pytest.approx(reference_times(g), abs=TOLERANCE)


# The adaptive law


def adaptive_run(natives, g, step, stop=None):
    """A run, else until a little after the later contact of the reference."""
    stop = ceil((max(reference_times(g)) + 0.02) / step) * step if stop is None else stop
    values = values_of(g.reflectance, g.x_m, g.W, g.m, g.K_i)
    return run(adaptive_grasp(natives), values, step, stop)


def learnt(result):
    """beta and its standard deviation at the end."""
    name = "controller.reflectance_ratio"
    ratio, deviation = (float(result[f"{name}{n}"][-1]) for n in ("", "_standard_deviation"))
    return float(np.log(ratio)), deviation / ratio


@pytest.mark.parametrize(
    ("g", "times", "beta"),
    [(BLACK_ON_WHITE, (1.885, 1.895), -0.5627), slow(OFF_CENTRE, (1.794, 1.823), -1.387)],
)
def test_the_reference_gives_the_known_adaptive_grasps(g, times, beta):
    assert reference_times(g) == pytest.approx(times, abs=1e-3)
    assert reference(g).beta[0] == pytest.approx(beta, abs=1e-3)


@pytest.mark.parametrize(
    "g",
    [
        BLACK_ON_WHITE,
        OFF_CENTRE,
        slow(replace(BLACK_ON_WHITE, reflectance=(1.0, 1.0))),
        slow(replace(BLACK_ON_WHITE, reflectance=(1.2, 0.3), x_m=-0.03)),
        slow(replace(BLACK_ON_WHITE, reflectance=(1.0, 0.5), x_m=0.0, W=0.05)),
        slow(replace(BLACK_ON_WHITE, m=(0.25, 1.0))),
    ],
)
def test_adaptive_contact_times_and_what_is_learnt(natives, g):
    result = adaptive_run(natives, g, STEP)
    times = result.metrics["time_to_contact"]
    assert times == pytest.approx(reference_times(g), abs=ADAPTIVE_TOLERANCE)
    assert learnt(result) == pytest.approx(reference(g).beta, abs=2e-4)


@pytest.mark.slow
@pytest.mark.parametrize("g", [BLACK_ON_WHITE, OFF_CENTRE])
def test_adaptive_contact_times_err_in_proportion_and_forces_build_up(natives, g):
    steps = [2e-4, 4e-4, 8e-4, 1.6e-3]
    times = [adaptive_run(natives, g, h).metrics["time_to_contact"] for h in steps]
    near_in_order(steps, times - reference_times(g), 0.1)
    expected = reference(g, BUILD_UP[2], True)
    result = adaptive_run(natives, g, STEP, BUILD_UP[2])
    assert last(result, "plant.contact_force") == pytest.approx(expected.contact_force, abs=1e-3)
    assert result["controller.target_position"][-1] == pytest.approx(expected.target, abs=1e-6)


ADAPTIVE_GRASPS = st.builds(
    Grasp,
    x_m=st.floats(-0.05, 0.05),
    W=st.floats(0.05, 0.1),
    m=pairs(0.25, 1.0),
    reflectance=pairs(0.3, 1.2),
    K_i=st.floats(60.0, 200.0),
    adaptive=st.just(Adaptive()),
)


@pytest.mark.slow
@examples(20, **UNSHRUNK)
@given(g=ADAPTIVE_GRASPS)
def test_contact_times_of_any_adaptive_grasp(natives, g):
    fast_enough(g)
    times = adaptive_run(natives, g, STEP).metrics["time_to_contact"]
    assert times == pytest.approx(reference_times(g), abs=ADAPTIVE_TOLERANCE)


# The co-simulated FMUs give the bits of the same blocks called directly.


@pytest.mark.parametrize(
    ("case", "step"), [(0, 1e-4), (1, 1e-3), (2, 1e-3), (2, 3.2e-3), slow(2, 1e-4)]
)
def test_the_fmus_give_the_bits_of_the_blocks(grasp, case, step):
    """The last at the published step, from free flight into contact."""
    steps = round((0.5 if case == 0 else 2.56) / step)
    ours = simulate(grasp.with_values(CASES[case]), step=step, stop=step * steps)
    direct = closed_loop(blocks(Grasp(case=case, x_m=X_M)), step, steps)
    outputs = [name for name in ours if "exchange_energy" not in name]
    assert set(direct) == {"time", *outputs}
    assert ours.time.tobytes() == direct["time"].tobytes()
    for name in outputs:
        expected = np.ascontiguousarray(direct[name]).astype(ours[name].dtype)
        assert np.ascontiguousarray(ours[name]).tobytes() == expected.tobytes(), name
