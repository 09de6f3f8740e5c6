"""The adaptive grasp as a whole: what holds for any faces, places, widths and masses.

The FMUs are native ones, with the bits of Python's and a run in milliseconds.
"""

from math import log, tanh
from pathlib import Path

import numpy as np
import pytest
from hypothesis import Phase, given
from hypothesis import strategies as st
from support.adaptive import adaptive_grasp, last, run, values_of
from support.approach import pairs
from support.examples import examples

STEP = 1e-3
"""s, ten times the paper's: nothing below depends on it."""

FINGER = (1, 2)

CARD = Path(__file__).parents[2] / "controller/README.md"

P_0 = 0.1
"""N, hold.squeeze."""


REFLECTANCES = pairs(0.3, 1.2)
PLACES = st.floats(-0.05, 0.05)
WIDTHS = st.floats(0.05, 0.1)
MASSES = pairs(0.25, 1.0)

a_few = examples(3, phases=[Phase.generate])  # to shrink a failure tells no more


def apart(result):
    t_1, t_2 = result.metrics["time_to_contact"]
    return float(t_1 - t_2)


@a_few
@given(REFLECTANCES, PLACES, WIDTHS, MASSES)
def test_the_mirrored_grasp_is_exactly_the_mirrored_grasp(natives, alpha, x_m, width, mass):
    grasp = adaptive_grasp(natives)
    a = run(grasp, values_of(alpha, x_m, width, mass), STEP, 2.6)
    b = run(grasp, values_of(alpha[::-1], -x_m, width, mass[::-1]), STEP, 2.6)
    for j in FINGER:
        for name in ("plant.position", "plant.velocity", "plant.contact_force", "controller.force"):
            assert np.array_equal(b[f"{name}[{3 - j}]"], -a[f"{name}[{j}]"])
        assert np.array_equal(
            b[f"controller.estimated_gap[{3 - j}]"], a[f"controller.estimated_gap[{j}]"]
        )
    assert np.array_equal(b["controller.target_position"], -a["controller.target_position"])
    assert np.array_equal(b["controller.hold"], a["controller.hold"])


@pytest.mark.parametrize(("noise", "within"), [(1e-12, 2e-5), (5e-4, 5e-3)])
@a_few
@given(REFLECTANCES, PLACES, st.floats(0.25, 4.0))
def test_scaling_both_reflectances_changes_nothing(natives, noise, within, alpha, x_m, factor):
    """But for rounding, to which the first millimetre is open; and for noise, if it is reckoned
    with: the darker, the later a line is believed.
    """
    sigma = {"controller.reflectance.intensity_noise": noise}
    dark = (factor * alpha[0], factor * alpha[1])
    a, b = (
        run(adaptive_grasp(natives), {**values_of(each, x_m), **sigma}, STEP, 2.6)
        for each in (alpha, dark)
    )
    assert apart(b) == pytest.approx(apart(a), abs=within)
    for j in FINGER:
        ways = a[f"plant.position[{j}]"]
        assert b[f"plant.position[{j}]"] == pytest.approx(ways, abs=5.0 * within)


@a_few
@given(REFLECTANCES, PLACES, WIDTHS, MASSES, st.floats(60.0, 200.0))
def test_the_forces_settle_at_half_the_width(natives, alpha, x_m, width, mass, stiffness):
    """Whatever has been learnt: of f_s is left, at rest, at most K_s·tanh(1)·P_0^2/(P_0^2 + P^2).

    It moves the target by that over K_a2 = 36 N/m, and layer 1 makes a force of it.
    """
    values = values_of(alpha, x_m, width, mass, stiffness)
    result = run(adaptive_grasp(natives), values, 2e-3, 9.0)
    press = 0.5 * stiffness * width
    left = stiffness * 3.0 * tanh(1.0) / 36.0 * P_0**2 / (P_0**2 + press**2)
    right, other = last(result, "plant.contact_force")
    assert right == pytest.approx(press, abs=left + 1e-6)
    assert other == pytest.approx(-press, abs=left + 1e-6)
    assert 0.5 * (right - other) == pytest.approx(press, abs=1e-6)
    assert last(result, "plant.velocity") == pytest.approx((0.0, 0.0), abs=1e-9)


@pytest.mark.parametrize("alpha", [(0.1, 1.0), (1.0, 0.1)])
def test_the_hold_alone_settles_the_forces(natives, alpha):
    """Though nothing is learnt, and f_s would do for lifting a finger off: K_a2·W/2 = 1.26 N."""
    assert 3.0 * tanh((1.0 - 0.1) / (1.0 + 0.1)) > 1.26
    values = {**values_of(alpha), "controller.reflectance.prior_deviation": 0.0}
    result = run(adaptive_grasp(natives), values, 2e-3, 15.0)
    assert last(result, "plant.contact_force") == pytest.approx((3.43, -3.43), abs=6e-3)


@a_few
@given(REFLECTANCES, PLACES, WIDTHS, MASSES)
def test_there_is_no_force_before_contact(natives, alpha, x_m, width, mass):
    """Nor a hold, but for the first moments, in which the fingers pull and do not move yet."""
    result = run(adaptive_grasp(natives), values_of(alpha, x_m, width, mass), STEP, 2.6)
    times = result.metrics["time_to_contact"]
    for j in FINGER:
        free = result.time < times[j - 1] - STEP
        assert np.all(result[f"plant.contact_force[{j}]"][free] == 0.0)
        assert np.all(result[f"plant.gap[{j}]"][free] > 0.0)
    held = result["controller.hold"]
    assert np.max(held[(result.time > 0.05) & (result.time < min(times))]) < 0.02
    assert held[-1] > 0.9


# ---------------------------------------------------------------- where there is little to see


@pytest.mark.parametrize("alpha", [(0.0, 1.0), (1.0, 0.0), (0.0, 0.0)])
def test_a_blind_sensor(natives, alpha):
    """0 V tells nothing: what is learnt stays 1, and nothing is not a number."""
    result = run(adaptive_grasp(natives), values_of(alpha), STEP, 3.0)
    assert set(result["controller.reflectance_ratio"]) == {1.0}
    for name in ("controller.force[1]", "controller.force[2]", "controller.estimated_gap[1]"):
        assert np.all(np.isfinite(result[name]))


@pytest.mark.parametrize("volts", [0.2, 0.5])
@pytest.mark.parametrize("alpha", [(0.57, 1.0), (1.0, 0.57)])
def test_a_sensor_that_saturates(natives, alpha, volts):
    """What has been learnt until then stays learnt, and the forces settle equal."""
    values = values_of(alpha)
    for j in FINGER:
        values[f"sensor_{j}.adc.enabled"] = True
        values[f"sensor_{j}.adc.range[2]"] = volts
    result = run(adaptive_grasp(natives), values, STEP, 6.0)
    ratio = result["controller.reflectance_ratio"][-1]
    assert log(ratio) == pytest.approx(log(alpha[0] / alpha[1]), abs=0.05)
    assert last(result, "plant.contact_force") == pytest.approx((3.43, -3.43), abs=5e-3)


@pytest.mark.parametrize("gap", [1e-3, 3e-3])
@pytest.mark.parametrize("alpha", [(0.57, 1.0), (1.0, 0.57), (1.0, 1.0)])
def test_a_start_within_millimetres_of_a_face(natives, alpha, gap):
    """A finger that arrives before it has learnt anything still holds as firmly as the other."""
    result = run(adaptive_grasp(natives), values_of(alpha, 0.075 - gap), 2e-3, 9.0)
    assert None not in result.metrics["time_to_contact"]
    assert max(result.metrics["impact_velocity"]) < 8e-3
    assert last(result, "plant.contact_force") == pytest.approx((3.43, -3.43), abs=5e-3)
    assert np.all(np.abs(np.log(result["controller.reflectance_ratio"])) <= 2.5)


def test_the_card_says_what_is_learnt_of_black_and_white(natives):
    result = run(adaptive_grasp(natives), values_of((0.57, 1.0)), STEP, 2.0)
    first = int(min(result.metrics["time_to_contact"]) / STEP)
    learnt = result["controller.reflectance_ratio"][first]
    deviation = result["controller.reflectance_ratio_standard_deviation"][first]
    said = f"Black on white at the first contact: {learnt:.3f} with {deviation:.4f}."
    assert said in " ".join(CARD.read_text("utf-8").split())
