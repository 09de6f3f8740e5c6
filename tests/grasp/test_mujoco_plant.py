"""The grasp with a contact that MuJoCo computes: what our own plants say of it holds."""

from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import Result, System, simulate
from grasp_cosim.interface.interface import Value
from support.both_engines import needs_compiler
from support.cases import CASES
from support.packages import skip_where_it_cannot_run

FREE: dict[str, Value] = {"plant.object_fixed": False}


@pytest.fixture(autouse=True)
def mujoco() -> None:
    skip_where_it_cannot_run("GripperPlantMuJoCo")


def grasped(
    grasp: System,
    fmu: Path,
    case: int,
    values: dict[str, Value],
    step: float,
    stop: float,
) -> Result:
    system = grasp.swap("plant", fmu).with_values({**CASES[case], **values})
    return simulate(system, step=step, stop=stop)


@pytest.mark.slow
@pytest.mark.parametrize("case", [1, 2])
@pytest.mark.parametrize("x_m", [0.03, -0.02])
def test_the_forces_settle_where_those_of_our_plant_do(
    grasp: System, fmus: Path, case: int, x_m: float
) -> None:
    """At K_i·(W/2 - r), where the finger is sunk in by r = (1 - d)·d·T^2·F/m."""
    at: dict[str, Value] = {"plant.initial_object_position": x_m}
    ours, theirs = (
        grasped(grasp, fmus / f"{name}.fmu", case, at, 1e-3, 8.0).metrics["steady_contact_force"]
        for name in ("GripperPlant", "GripperPlantMuJoCo")
    )
    softness = (1.0 - 0.9999) * 0.9999 * 0.005**2 / 0.5
    assert theirs == pytest.approx([98.0 * 0.035 / (1.0 + 98.0 * softness)] * 2, rel=1e-9)
    assert theirs == pytest.approx(ours, abs=2e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "stop", "within"), [(0, 0.4, 5e-5), (1, 2.6, 1e-5), (2, 2.1, 1e-5)]
)
def test_the_fingers_touch_when_those_of_our_plant_do(
    grasp: System, fmus: Path, case: int, stop: float, within: float
) -> None:
    """Far within the 5 ms that are wanted; what is left is Euler's first order, see the card."""
    ours, theirs = (
        grasped(grasp, fmus / f"{name}.fmu", case, {}, 1e-4, stop).metrics
        for name in ("GripperPlant", "GripperPlantMuJoCo")
    )
    assert theirs["time_to_contact"] == pytest.approx(ours["time_to_contact"], abs=within)
    assert theirs["impact_velocity"] == pytest.approx(ours["impact_velocity"], rel=1e-3)
    assert theirs["peak_contact_force"] == pytest.approx(ours["peak_contact_force"], rel=0.03)


@pytest.mark.slow
def test_a_free_box_is_shifted_as_ours_is(grasp: System, fmus: Path) -> None:
    """By centimetres in Case 1; in Case 2 by what passes between the contacts, 0.02 mm and 0.03."""
    shifts = {
        (name, case): grasped(grasp, fmus / f"{name}.fmu", case, values, 1e-3, 2.4)
        for name, values in (("GripperPlantMovable", {}), ("GripperPlantMuJoCo", FREE))
        for case in (1, 2)
    }
    (ours_1, ours_2, theirs_1, theirs_2) = (
        result.metrics["object_shift"] for result in shifts.values()
    )
    assert theirs_1 == pytest.approx(ours_1, rel=5e-3)
    assert max(ours_2, theirs_2) < 5e-5
    x = [shifts[name, 1]["plant.object_position"] for name in ("GripperPlantMovable",
         "GripperPlantMuJoCo")]  # fmt: skip
    assert np.abs(x[1] - x[0]).max() < 2e-4


@pytest.mark.slow
def test_case_1_topples_what_case_2_grasps_here_too(grasp: System, fmus: Path) -> None:
    """On a rough floor, held near the top, as in test_plants.py."""
    rough: dict[str, Value] = {
        **FREE, "plant.floor_friction": 0.8, "plant.contact_height": 0.08,
    }  # fmt: skip
    fmu = fmus / "GripperPlantMuJoCo.fmu"
    one, two = (grasped(grasp, fmu, case, rough, 1e-3, 2.2) for case in (1, 2))
    assert one["plant.toppled"][-1]
    assert not two["plant.toppled"][-1]
    assert np.abs(two["plant.tilt"]).max() < 1e-3


@needs_compiler
def test_the_compiled_loop_gives_the_same_bits(grasp: System, fmus: Path) -> None:
    system = grasp.swap("plant", fmus / "GripperPlantMuJoCo.fmu").with_values(FREE)
    one, two = (
        simulate(system, step=1e-3, stop=0.3, engine=engine) for engine in ("python", "compiled")
    )
    for name in one.units:
        assert one[name].tobytes() == two[name].tobytes(), name
