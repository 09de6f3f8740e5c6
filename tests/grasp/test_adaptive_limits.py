"""What the adaptive controller must reach over Latin hypercubes of grasps: docs/limits.md.

Faces of reflectance 0.3 to 1.2 each, an object 50 mm to either side, and what a row of the table
names besides. Other seeds draw other grasps.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from grasp_cosim import sweep
from grasp_cosim.grasp.presets import with_preset
from grasp_cosim.grasp.system import with_controller
from grasp_cosim.sweeps.rows import grid
from scipy.stats import qmc
from support import marks

SEED = 20241107
FACES = {
    "sensor_1.reflectance": (0.3, 1.2),
    "sensor_2.reflectance": (0.3, 1.2),
    "plant.initial_object_position": (-0.05, 0.05),
}
SMOOTH = {f"plant.friction.{kind}[{j}]": 0.0 for kind in ("coulomb", "viscous") for j in (1, 2)}
ROOM = {"sensor_1.ambient.enabled": True, "sensor_2.ambient.enabled": True}


@dataclass(frozen=True)
class Study:
    """Limits by metric and statistic; `more` varies one value at several places."""

    limits: Mapping[str, Mapping[str, float]]
    step: float = 1e-3
    bench: bool = False
    noise: bool = False
    settings: Mapping[str, Any] = field(default_factory=dict)
    more: Mapping[tuple[str, ...], tuple[float, float]] = field(default_factory=dict)


IDEAL = {
    "time_difference": {"greatest": 0.03},
    "force_difference": {"greatest": 0.01},
    "impact_velocity": {"greatest": 6.5e-3},
}
BENCH = {
    "time_difference": {"greatest": 0.04, "p95": 0.03},
    "force_difference": {"greatest": 0.10},
    "impact_velocity": {"greatest": 8e-3},
}
N = {("sensor_1.diffusion_exponent", "sensor_2.diffusion_exponent"): (1.0, 1.3)}
FREE = {"time_difference": {"greatest": 0.03}, "object_shift": {"greatest": 2e-3},
        "object_drift": {"greatest": 1e-5}}  # fmt: skip
OFFSET = ("sensor_1.ambient.calibration_error", "sensor_2.ambient.calibration_error")

STUDIES = {
    "ideal, 0.1 ms": Study(IDEAL, step=1e-4),
    "ideal, 1 ms": Study(IDEAL),
    "ideal, 2 ms": Study(IDEAL, step=2e-3),
    "bench, 0.1 ms": Study(BENCH, step=1e-4, bench=True, noise=True),
    "bench, 1 ms": Study(BENCH, bench=True, noise=True),
    "exponent, ideal": Study({"time_difference": {"greatest": 0.04}}, noise=True, more=N),
    "exponent, bench": Study(
        {"time_difference": {"greatest": 0.05}}, bench=True, noise=True, more=N
    ),
    "offset": Study(
        {"time_difference": {"greatest": 0.045}}, settings=ROOM, more={OFFSET: (-1e-3, 1e-3)}
    ),
    "drift": Study(
        {"time_difference": {"greatest": 0.045}},
        settings=ROOM,
        more={("sensor_1.ambient.drift",): (-5e-3, 5e-3)},
    ),
    "free object": Study(FREE, more={("plant.object_mass",): (0.02, 0.05)}),
}


def rows(study, runs):
    """The grasps of a study: one in each of `runs` equal slices of everything that varies."""
    varied = {**{(name,): span for name, span in FACES.items()}, **study.more}
    low, high = np.array(list(varied.values())).T
    cube = qmc.LatinHypercube(
        len(varied), rng=np.random.default_rng(SEED + marks.first_seed)
    ).random(runs)
    found = [
        {name: float(x) for names, x in zip(varied, row, strict=True) for name in names}
        for row in low + cube * (high - low)
    ]
    for k, row in enumerate(found if study.noise else ()):
        row |= {"sensor_1.noise.seed": 2 * k + SEED, "sensor_2.noise.seed": 2 * k + 1 + SEED}
    return found


def system_of(study, grasp, fmus, law="adaptive"):
    system = with_controller(grasp, law)
    if "object_shift" in study.limits:
        system = system.swap("plant", fmus / "GripperPlantMovable.fmu")
    if study.bench:
        system = with_preset(system, "bench").with_values(SMOOTH)
    return system.with_values(study.settings).with_experiment(step=study.step, stop=6.0)


def columns(table, metric):
    """All values of a metric, of each finger; a run without one has none that is finite."""
    return np.array([table[c] for c in table.metrics if c.partition("[")[0] == metric])


@pytest.mark.slow
@pytest.mark.campaign
@pytest.mark.parametrize("name", STUDIES)
def test_a_study_keeps_its_limits(name, grasp, fmus):
    study = STUDIES[name]
    table = sweep(system_of(study, grasp, fmus), rows(study, marks.part(200)))
    assert not table.errors
    for metric, limits in study.limits.items():
        values = columns(table, metric)
        assert np.isfinite(values).all(), metric
        for statistic, most in limits.items():
            reached = np.percentile(values, 95) if statistic == "p95" else values.max()
            assert reached <= most, (metric, statistic)


@pytest.mark.slow
def test_with_equal_faces_it_does_as_the_published_law(grasp, fmus):
    positions = [0.01 * k for k in range(-5, 6, 2)]
    faces = [0.3, 0.57, 0.86, 1.0, 1.2]
    varied = grid({"sensor_1.reflectance": faces, "plant.initial_object_position": positions})
    both = [{**row, "sensor_2.reflectance": row["sensor_1.reflectance"]} for row in varied]
    study = Study({}, step=1e-4)
    ours, published = (
        sweep(system_of(study, grasp, fmus, law), both) for law in ("adaptive", "published")
    )
    for name in ("time_to_contact[1]", "time_to_contact[2]", "time_difference"):
        np.testing.assert_allclose(ours[name], published[name], rtol=0.0, atol=2e-3)
