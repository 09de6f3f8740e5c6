"""The grasp of an object that gives, and of one that moves: what each layer spares it."""

from math import atan, tanh

import numpy as np
import pytest
from grasp_cosim import simulate
from grasp_cosim.grasp.metrics import CLOSING, FINGERS, IMPACT_WINDOW
from grasp_cosim.interface.interface import Value
from support.cases import CASES

Values = dict[str, Value]

SOFT = {
    "Kelvin-Voigt": {},
    "Hunt-Crossley": {"plant.hunt_crossley.enabled": True},
}
RUBBING = {
    f"plant.friction.{name}[{j}]": value
    for name, value in (("coulomb", 0.1), ("static", 0.15), ("viscous", 1.0))
    for j in (1, 2)
}


def grasped(grasp, fmu, case, stop, values):
    system = grasp.swap("plant", fmu).with_values({**CASES[case], **values})
    return simulate(system, step=1e-3, stop=stop)


@pytest.mark.parametrize("law", SOFT)
def test_a_soft_object_is_pressed_no_harder_than_it_is_held(grasp, fmus, law):
    """In Case 2; in Case 0 it takes an impact."""
    fmu = fmus / "GripperPlantCompliant.fmu"
    metrics = grasped(grasp, fmu, 2, 4.0, SOFT[law]).metrics
    peak, steady = metrics["peak_contact_force"], metrics["steady_contact_force"]
    assert peak == pytest.approx(steady, rel=1e-3)
    assert metrics["force_overshoot"] == pytest.approx([0.0, 0.0], abs=1e-3)
    impact = grasped(grasp, fmu, 0, 0.3, SOFT[law]).metrics["peak_contact_force"]
    assert max(impact) > 2.0 * max(steady)


@pytest.mark.slow
@pytest.mark.parametrize("values", [{}, RUBBING], ids=["smooth fingers", "fingers with friction"])
def test_case_2_shifts_a_light_object_far_less_than_case_1(grasp, fmus, values):
    fmu = fmus / "GripperPlantMovable.fmu"
    one, two = (grasped(grasp, fmu, case, 2.4, values).metrics["object_shift"] for case in (1, 2))
    assert one > 0.04
    assert two < 1e-4


@pytest.mark.slow
def test_case_1_topples_what_case_2_grasps(grasp, fmus):
    """On a rough floor, held near the top."""
    rough = {"plant.floor_friction": 0.8, "plant.contact_height": 0.08}
    fmu = fmus / "GripperPlantMovable.fmu"
    one, two = (grasped(grasp, fmu, case, 2.2, rough) for case in (1, 2))
    assert one.metrics["toppled"] is True
    assert one.metrics["object_tilt"] >= atan(0.07 / 0.1)  # W/H, its balance
    assert two.metrics["toppled"] is False
    assert two.metrics["object_tilt"] < 1e-3


@pytest.mark.slow
def test_unequal_reflectances_carry_a_free_object_away(grasp, fmus):
    """Layer 3 keeps a force f_s that nothing answers but the floor.

    The fingers' springs, 2·K_i, bear mu·m·g at a distance of the target from their middle; what
    that leaves of f_s drives the target, and all with it, against D_a2.
    """
    values = {"sensor_1.reflectance": 0.86}
    result = grasped(grasp, fmus / "GripperPlantMovable.fmu", 2, 3.0, values)
    f_s = 3.0 * tanh((1.0 - 0.86) / (1.0 + 0.86))
    distance = 0.3 * 0.05 * 9.80665 / (2.0 * 98.0)
    x = result["plant.object_position"]
    assert x[-201] - x[-1] == pytest.approx(0.2 * (f_s - 36.0 * distance) / 12.0, rel=1e-2)


@pytest.mark.slow
@pytest.mark.parametrize("case", [1, 2])
def test_the_impact_on_an_object_that_moves_is_as_fast_as_the_gap_closes(grasp, fmus, case):
    """In Case 1 the second finger gives way before the object that the first one pushes."""
    system = grasp.swap("plant", fmus / "GripperPlantMovable.fmu").with_values({**CASES[case]})
    result = simulate(system, step=2e-4, stop=2.0)
    metrics = result.metrics
    for j in FINGERS:
        free = np.arange(-6, 0) + int(np.flatnonzero(result[f"plant.contact[{j}]"])[0])
        t, gap = result.time[free], result[f"plant.gap[{j}]"][free]
        closes = np.polynomial.Polynomial.fit(t, gap, 2)
        assert metrics["impact_velocity"][j - 1] == pytest.approx(-closes.deriv()(t[-1]), rel=0.01)
        touch = min(closes.roots().real, key=lambda root: abs(root - t[-1]))
        assert metrics["time_to_contact"][j - 1] == pytest.approx(touch, abs=1e-5)
    own = result["plant.velocity[2]"][free[-1]]
    assert (own < 0.0) == (case == 1)
    assert metrics["impact_velocity"][1] > own + 3e-3


@pytest.mark.parametrize("plant", ["", "Compliant", "Movable"])
def test_the_impulse_of_an_impact_is_what_it_takes_from_the_finger(grasp, fmus, plant):
    """The momentum lost and what the actuator gives; a plant tells the last force of each step."""
    system = grasp.swap("plant", fmus / f"GripperPlant{plant}.fmu").with_values({**CASES[0]})
    result = simulate(system, step=1e-4, stop=0.3)
    for j in FINGERS:
        touch = result.metrics["time_to_contact"][j - 1]
        begin = int(np.flatnonzero(result[f"plant.contact[{j}]"])[0]) - 1
        rows = slice(begin, begin + round(IMPACT_WINDOW / 1e-4) + 1)
        ends = (result.time[begin], touch + IMPACT_WINDOW)
        before, after = np.interp(ends, result.time, CLOSING[j] * result[f"plant.velocity[{j}]"])
        driven = 1e-4 * CLOSING[j] * result[f"controller.force[{j}]"][rows].sum()
        expected = 0.5 * (before - after) + driven
        assert result.metrics["impact_impulse"][j - 1] == pytest.approx(expected, rel=0.02)


def test_a_soft_object_is_squeezed_as_far_as_its_springs_give(grasp, fmus):
    """k = 1 N/mm on either side; the last of its way takes the fingers a while."""
    metrics = grasped(grasp, fmus / "GripperPlantCompliant.fmu", 2, 4.0, {}).metrics
    assert metrics["squeeze"] == pytest.approx(sum(metrics["peak_contact_force"]) / 1e3, rel=5e-3)
    assert metrics["damaged"] is False
