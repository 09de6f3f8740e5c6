"""The grasp of an object that gives, and of one that moves: what each layer spares it."""

from math import tanh
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import Result, System, simulate
from grasp_cosim.grasp import CASES
from grasp_cosim.system.interface import Value

Values = dict[str, Value]

SOFT: dict[str, Values] = {
    "Kelvin-Voigt": {},
    "Hunt-Crossley": {"plant.hunt_crossley.enabled": True},
}
RUBBING: Values = {
    f"plant.friction.{name}[{j}]": value
    for name, value in (("coulomb", 0.1), ("static", 0.15), ("viscous", 1.0))
    for j in (1, 2)
}


def grasped(grasp: System, fmu: Path, case: int, stop: float, values: Values) -> Result:
    system = grasp.swap("plant", fmu).with_values({**CASES[case], **values})
    return simulate(system, step=1e-3, stop=stop)


@pytest.mark.parametrize("law", SOFT)
def test_a_soft_object_is_pressed_no_harder_than_it_is_held(
    grasp: System, fmus: Path, law: str
) -> None:
    """In Case 2; in Case 0 it takes an impact."""
    fmu = fmus / "GripperPlantCompliant.fmu"
    metrics = grasped(grasp, fmu, 2, 4.0, SOFT[law]).metrics
    peak, steady = metrics["peak_contact_force"], metrics["steady_contact_force"]
    assert peak == pytest.approx(steady, rel=1e-3)
    impact = grasped(grasp, fmu, 0, 0.3, SOFT[law]).metrics["peak_contact_force"]
    assert max(impact) > 2.0 * max(steady)


@pytest.mark.parametrize("values", [{}, RUBBING], ids=["smooth fingers", "fingers with friction"])
def test_case_2_shifts_a_light_object_far_less_than_case_1(
    grasp: System, fmus: Path, values: Values
) -> None:
    fmu = fmus / "GripperPlantMovable.fmu"
    one, two = (grasped(grasp, fmu, case, 2.4, values).metrics["object_shift"] for case in (1, 2))
    assert one > 0.04
    assert two < 1e-4


def test_case_1_topples_what_case_2_grasps(grasp: System, fmus: Path) -> None:
    """On a rough floor, held near the top."""
    rough: Values = {"plant.floor_friction": 0.8, "plant.contact_height": 0.08}
    fmu = fmus / "GripperPlantMovable.fmu"
    one, two = (grasped(grasp, fmu, case, 2.2, rough) for case in (1, 2))
    assert one["plant.toppled"][-1]
    assert not two["plant.toppled"][-1]
    assert np.abs(two["plant.tilt"]).max() < 1e-3


def test_unequal_reflectances_carry_a_free_object_away(grasp: System, fmus: Path) -> None:
    """Layer 3 keeps a force f_s that nothing answers but the floor.

    The fingers' springs, 2·K_i, bear mu·m·g at a distance of the target from their middle; what
    that leaves of f_s drives the target, and all with it, against D_a2.
    """
    values: Values = {"sensor_1.reflectance": 0.86}
    result = grasped(grasp, fmus / "GripperPlantMovable.fmu", 2, 3.0, values)
    f_s = 3.0 * tanh((1.0 - 0.86) / (1.0 + 0.86))
    distance = 0.3 * 0.05 * 9.80665 / (2.0 * 98.0)
    x = result["plant.object_position"]
    assert x[-201] - x[-1] == pytest.approx(0.2 * (f_s - 36.0 * distance) / 12.0, rel=1e-2)
