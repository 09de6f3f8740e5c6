"""Grasps in tandem as a whole: over hypercubes, in long holds, and beside the laws of two fingers.

Objects up to 50 mm off the wrist, 40 to 90 mm wide, both faces of reflectance 0.3 to 1.2. The FMUs
are native ones, with the bits of Python's and a run in milliseconds.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import ceil
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from grasp_cosim import System, simulate, sweep
from grasp_cosim.fmu_export.build import build_block, planned
from grasp_cosim.grasp.system import with_controller
from grasp_cosim.tandem.system import SYSTEM
from scipy.stats.qmc import LatinHypercube
from support import marks
from support.continuous import Grasp, solve
from support.grasps import calibrated
from support.marks import slow

LATE_POSITIONS = Path(__file__).parents[2] / "docs" / "late_positions.py"

SEED = 20261127

OBJECTS = {
    "sensor_1.reflectance": (0.3, 1.2),
    "sensor_2.reflectance": (0.3, 1.2),
    "plant.initial_object_position": (-0.05, 0.05),
    "plant.object_width": (0.04, 0.09),
    "plant.object_mass": (0.02, 0.05),
}


def wrist(hz=5.0, delay=0.0, **more):
    """A wrist as the plant has it and the law counts on it, and what only the plant has."""
    both = {"bandwidth": hz, "delay": delay}
    values = {f"{c}.wrist.{k}": v for c in ("plant", "controller") for k, v in both.items()}
    return values | {f"plant.wrist.{name}": value for name, value in more.items()}


@dataclass(frozen=True)
class Study:
    """The most that contacts are apart, in s, fingers hit, in m/s, and forces differ, in N."""

    apart: float = 5e-3
    impact: float = 8.5e-3
    forces: float = 0.25
    shift: float = 5e-5
    values: Mapping[str, Any] = field(default_factory=dict)
    presets: tuple[str, ...] = ("fixed",)
    step: float = 1e-3
    late: int = 0


FREE = {"presets": ()}

STUDIES = {
    "fixed": Study(),
    "free, 20 to 50 g": Study(**FREE),
    "bench": Study(0.01, forces=0.5, presets=("fixed", "bench")),
    "command 50 ms late": Study(values=wrist(delay=0.05)),
    "positions 10 ms late": Study(0.015, forces=0.5, late=10),
    "wrist 3 Hz": Study(values=wrist(3.0)),
    "wrist 50 Hz": Study(values=wrist(50.0)),
    "limits": Study(values=wrist(speed_limit=0.25, acceleration_limit=2.5)),
    "steps 5 ms": Study(step=5e-3),
    "speed servo": Study(presets=("fixed", "gripper")),
    "arm, gripper, bench": Study(0.015, 0.0105, forces=0.5, presets=("arm", "gripper", "bench")),
}


def rows(study, runs):
    """The objects of a study: one in each of `runs` equal slices of everything that varies."""
    low, high = np.array(list(OBJECTS.values())).T
    drawn = np.random.default_rng(SEED + marks.first_seed)
    cube = LatinHypercube(len(OBJECTS), rng=drawn).random(runs)
    found = [dict(zip(OBJECTS, map(float, row), strict=True)) for row in low + cube * (high - low)]
    for k, row in enumerate(found if "bench" in study.presets else ()):
        row |= {f"sensor_{j}.noise.seed": SEED + 2 * k + j for j in (1, 2)}
    return found


def system_of(study, natives, folder):
    system = late_system(natives, folder, study.late) if study.late else tandem(natives)
    system = system.with_presets(*study.presets).with_values(study.values)
    return system.with_experiment(step=study.step, stop=6.0)


def tandem(natives):
    return System.load(SYSTEM, natives)


def late_system(natives, folder, steps):
    """With so many steps between the encoders and the controller."""
    late = build_block(LATE_POSITIONS, folder, planned()).path
    text = SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{natives.as_posix()}/')
    for name in ("position[1]", "position[2]", "velocity[1]", "velocity[2]"):
        direct = f'"plant.{name} -> controller.{name}"'
        through = f'"plant.{name} -> late.{name}", "late.late_{name} -> controller.{name}"'
        text = text.replace(direct, through)
    component = f'[components.late]\nfmu = "{late.as_posix()}"\n\n'
    file = folder / "late.toml"
    file.write_text(text.replace("[components.sensor_1]", component + "[components.sensor_1]"))
    return System.load(file).natively().with_values({"late.steps": steps})


def worst(table, metric):
    """Of all runs and fingers; a run without one has none that is finite."""
    found = [table[c] for c in table.metrics if c.partition("[")[0] == metric]
    values = np.array(found, float)
    assert np.isfinite(values).all(), metric
    return values.max()


@pytest.mark.slow
@pytest.mark.campaign
@pytest.mark.parametrize("name", STUDIES)
def test_a_study_keeps_its_limits(name, natives, tmp_path):
    study = STUDIES[name]
    table = sweep(system_of(study, natives, tmp_path), rows(study, marks.part(200)))
    assert not table.errors
    assert worst(table, "time_difference") <= study.apart
    assert worst(table, "impact_velocity") <= study.impact
    assert worst(table, "force_difference") <= study.forces
    assert worst(table, "object_shift") <= study.shift


# Beside the continuous solution of two fingers, and in other steps


def object_at(g):
    """The fixed object and its faces, as of the reference."""
    return {
        "plant.initial_object_position": g.x_m,
        "plant.object_width": g.W,
        "sensor_1.reflectance": g.reflectance[0],
        "sensor_2.reflectance": g.reflectance[1],
    }


@pytest.mark.parametrize("g", [Grasp(), slow(Grasp(x_m=-0.05)), slow(Grasp(W=0.09, x_m=0.02))])
def test_on_a_fast_wrist_the_published_law_grasps_as_with_two_fingers(natives, g):
    """Where its force is measured; contacts and forces are those of Eqs. (1) to (9)."""
    published = with_controller(tandem(natives), "published").with_presets("fixed")
    fast = {"plant.wrist.bandwidth": 100.0, **object_at(g)}
    times = solve(g, 8.0).contact_time
    result = simulate(published.with_values(fast), step=1e-4, stop=ceil(max(times)) + 1.0)
    assert result.metrics["time_to_contact"] == pytest.approx(times, abs=3e-3)
    squeeze = 98.0 * 0.5 * g.W
    assert result.metrics["steady_contact_force"] == pytest.approx([squeeze] * 2, rel=0.03)


@pytest.mark.parametrize(
    "g", [Grasp(), slow(Grasp(x_m=-0.05, reflectance=(0.3, 1.2))), slow(Grasp(W=0.05))]
)
def test_the_steps_hardly_matter(natives, g):
    """Of 0.1 ms and of 1 ms: contacts at the same millisecond, the wrist at the same place."""
    system = tandem(natives).with_presets("fixed").with_values(object_at(g))
    fine, coarse = (simulate(system, step=h, stop=2.6) for h in (1e-4, 1e-3))
    times = fine.metrics["time_to_contact"]
    assert coarse.metrics["time_to_contact"] == pytest.approx(times, abs=1e-3)
    wrist_of = [r["plant.wrist_position"] for r in (fine, coarse)]
    assert wrist_of[1] == pytest.approx(wrist_of[0][::10], abs=3e-4)
    assert wrist_of[1][-1] == pytest.approx(g.x_m, abs=1e-5)


@pytest.mark.parametrize("unlike", [{"n": (1.1, 1.2)}, slow({"l_0": (5.5e-3, 4.5e-3)})])
@pytest.mark.parametrize("alpha", [(1.0, 1.0), (0.57, 1.0)])
def test_sensors_that_differ_do_as_equal_ones_by_their_calibration(natives, unlike, alpha):
    values = {f"sensor_{j}.reflectance": a for j, a in zip((1, 2), alpha, strict=True)}
    system = (
        tandem(natives).with_presets("fixed").with_values({**values, **calibrated(2, **unlike)})
    )
    metrics = simulate(system, step=1e-3, stop=6.0).metrics
    assert metrics["time_difference"] <= Study().apart
    assert max(metrics["impact_velocity"]) <= Study().impact
    assert metrics["force_difference"] <= Study().forces


@pytest.mark.slow
def test_a_hold_does_not_creep(natives):
    """With the electronics, on a fixed object of two colours: forces stay as they were."""
    values = {"sensor_1.reflectance": 0.57}
    held = tandem(natives).with_presets("fixed", "bench").with_values(values)
    result = simulate(held, step=1e-3, stop=20.0)
    command = result["controller.wrist_command"]
    assert np.ptp(command[5000:]) < 2e-5
    f_1, f_2 = (result[f"plant.contact_force[{j}]"] for j in (1, 2))
    assert np.abs(f_1 + f_2)[5000:].max() < 0.3
