"""The adaptive grasp, sampled, against an independent solution of its equations in continuous time.

The FMUs are native ones, with the bits of Python's and a run in milliseconds.
"""

from dataclasses import replace
from functools import cache
from math import ceil

import numpy as np
import pytest
from grasp_controller import holding, reflectance_ratio
from hypothesis import Phase, assume, given
from hypothesis import strategies as st
from support.approach import pairs
from support.continuous import Adaptive, Grasp, solve
from support.grasps import adaptive_grasp, last, run, values_of
from support.marks import examples, slow

STEP = 1e-4
"""s; the published controller runs at 10 kHz."""

STOP = 8.0
"""s; longer than any approach here."""

TOLERANCE = 2e-4
"""s; for contact times at STEP."""

SLOWEST = 3e-3
"""m/s; an error in time is one in position over the speed of approach: none is slower here."""

BUILD_UP = 2.6
"""s; both fingers touch, and the force of the later one has not settled yet."""

BLACK_ON_WHITE = Grasp(reflectance=(0.57, 1.0), adaptive=Adaptive())
OFF_CENTRE = Grasp(reflectance=(0.3, 1.2), x_m=0.05, adaptive=Adaptive())


@cache
def _reference(g, stop=STOP, to_the_end=False):
    return solve(g, stop, to_the_end=to_the_end)


def _run(natives, g, step, stop):
    values = values_of(g.reflectance, g.x_m, g.W, g.m, g.K_i)
    return run(adaptive_grasp(natives), values, step, stop)


def _times(solution):
    t_1, t_2 = solution.contact_time
    assert t_1 is not None
    assert t_2 is not None
    return t_1, t_2


def _contacts(natives, g, step):
    """A run until a little after the later contact of the reference."""
    stop = max(_times(_reference(g))) + 0.02
    return _run(natives, g, step, ceil(stop / step) * step)


def _learnt(result):
    """beta and its standard deviation at the end."""
    ratio, deviation = (
        float(result[f"controller.reflectance_ratio{name}"][-1])
        for name in ("", "_standard_deviation")
    )
    return float(np.log(ratio)), deviation / ratio


def test_the_defaults_of_the_block_are_the_numbers_of_the_reference():
    p, h = reflectance_ratio.Params(), holding.Params()
    assert Adaptive() == Adaptive(
        p.diffusion_exponent,
        p.time_constant,
        p.weight_exponent,
        p.intensity_noise,
        p.prior_deviation,
        p.limit,
        h.squeeze,
        h.speed,
        h.time_constant,
    )


@pytest.mark.parametrize(
    ("g", "times", "beta"),
    [(BLACK_ON_WHITE, (1.885, 1.895), -0.5627), slow(OFF_CENTRE, (1.793, 1.822), -1.387)],
)
def test_the_reference_gives_the_known_grasps(g, times, beta):
    """Pins the reference itself: an error made in the blocks as well would not show elsewhere."""
    assert _times(_reference(g)) == pytest.approx(times, abs=1e-3)
    assert _reference(g).beta[0] == pytest.approx(beta, abs=1e-3)


@pytest.mark.parametrize(
    "g",
    [
        BLACK_ON_WHITE,
        OFF_CENTRE,
        slow(replace(BLACK_ON_WHITE, reflectance=(1.0, 1.0))),
        slow(replace(BLACK_ON_WHITE, reflectance=(1.2, 0.3), x_m=-0.03)),
        slow(replace(BLACK_ON_WHITE, reflectance=(1.0, 0.5), x_m=0.0, W=0.05)),
        slow(replace(BLACK_ON_WHITE, reflectance=(0.4, 0.9), x_m=-0.02, W=0.09)),
        slow(replace(BLACK_ON_WHITE, m=(0.25, 1.0))),
    ],
)
def test_contact_times_and_what_is_learnt(natives, g):
    result, solution = _contacts(natives, g, STEP), _reference(g)
    assert result.metrics["time_to_contact"] == pytest.approx(_times(solution), abs=TOLERANCE)
    assert _learnt(result) == pytest.approx(solution.beta, abs=2e-4)


@pytest.mark.slow
@pytest.mark.parametrize("g", [BLACK_ON_WHITE, OFF_CENTRE])
def test_contact_times_err_in_proportion_to_the_step(natives, g):
    steps = [2e-4, 4e-4, 8e-4, 1.6e-3]
    times = np.array([_contacts(natives, g, h).metrics["time_to_contact"] for h in steps])
    for finger in (times - _times(_reference(g))).T:
        slope, _ = np.polyfit(np.log(steps), np.log(np.abs(finger)), 1)
        assert 0.9 <= slope <= 1.1


@pytest.mark.slow
@pytest.mark.parametrize("g", [BLACK_ON_WHITE, OFF_CENTRE])
def test_the_force_builds_up_as_in_the_reference(natives, g):
    expected = _reference(g, BUILD_UP, True)
    result = _run(natives, g, STEP, BUILD_UP)
    assert last(result, "plant.contact_force") == pytest.approx(expected.contact_force, abs=1e-3)
    assert result["controller.target_position"][-1] == pytest.approx(expected.target, abs=1e-6)


GRASPS = st.builds(
    Grasp,
    x_m=st.floats(-0.05, 0.05),
    W=st.floats(0.05, 0.1),
    m=pairs(0.25, 1.0),
    reflectance=pairs(0.3, 1.2),
    K_i=st.floats(60.0, 200.0),
    adaptive=st.just(Adaptive()),
)


@pytest.mark.slow
@examples(
    20, phases=[Phase.generate]
)  # to shrink a failure tells no more than the numbers of a grasp do
@given(g=GRASPS)
def test_contact_times_of_any_grasp(natives, g):
    speeds = _reference(g).closing_speed
    assume(all(speed is not None and speed >= SLOWEST for speed in speeds))
    times = _contacts(natives, g, STEP).metrics["time_to_contact"]
    assert times == pytest.approx(_times(_reference(g)), abs=TOLERANCE)
