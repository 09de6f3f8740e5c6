"""Gains that grasp faster, by SciPy's differential evolution: docs/how_to/friction_and_gains.md.

    .venv/bin/python docs/tune.py [GENERATIONS]

What stands in capitals is the problem; any system and any metrics may take its place.
"""

import sys
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt
from grasp_cosim import grasp_system, sweep
from scipy.optimize import NonlinearConstraint, differential_evolution

Array = npt.NDArray[np.float64]
Columns = Callable[[str], Array]
"""A metric by name: the greatest of its entries, for each run."""

SYSTEM = grasp_system().with_experiment(step=1e-3, stop=4.0)
POSITION, VISCOSITY = "plant.initial_object_position", "controller.impact_reduction.viscosity"

GAINS = [
    {"controller.impact_reduction.damping": 10.0},
    {"controller.impact_reduction.stiffness": 25.0},
    {f"{VISCOSITY}[1]": 0.6, f"{VISCOSITY}[2]": -0.6},
    {"controller.simultaneous_contact.damping": 12.0},
    {"controller.simultaneous_contact.stiffness": 36.0},
    {"controller.simultaneous_contact.gain": 3.0},
    {"controller.contact_force.damping": 14.0},
]
"""As published; those of one line keep their ratio. No mass: Eqs. (3) and (6) stay as they are
where all their coefficients are multiplied by one number. Nor K_i, the force to hold with: that is
the task.
"""

FACTOR = 3.0
"""Each gain may be so many times as large or as small."""

NOISY = {**SYSTEM.presets["bench"], **{f"plant.friction.coulomb[{j}]": 0.0 for j in (1, 2)}}
NOISY |= {f"plant.friction.{name}[{j}]": 0.0 for name in ("viscous", "inner") for j in (1, 2)}
CONDITIONS: list[dict[str, Any]] = [{POSITION: 0.0}, {**NOISY, POSITION: 0.02}, {POSITION: 0.05}]
"""The grasps that count, each at its worst; the second with the bench's sensors, noise and all."""

CHECKS: dict[str, dict[str, Any]] = {
    "object at 35 mm": {POSITION: 0.035},
    "50 mm, steps of 0.1 ms": {POSITION: 0.05, "experiment.step": 1e-4},
    "20 mm, 50 mm wide": {POSITION: 0.02, "plant.object_width": 0.05},
    "20 mm, brown and white": {POSITION: 0.02, "sensor_1.reflectance": 0.86},
    "20 mm, other noise": {
        **NOISY, POSITION: 0.02, "sensor_1.noise.seed": 11, "sensor_2.noise.seed": 12,
        "experiment.step": 1e-4,
    },
    "20 mm, bench, friction": {
        **SYSTEM.presets["bench"], POSITION: 0.02, "experiment.step": 1e-4, "experiment.stop": 6.0,
    },
}  # fmt: skip
"""What was not tuned for, but is run with what was found."""

LIMITS = ("impact_velocity", "time_difference", "force_overshoot")
"""Metrics that may not be greater than with the published gains."""

MEMBERS, GENERATIONS, SEED = 3, 46, 1
"""MEMBERS times the number of gains is a generation: 2,958 runs in all, a minute and a half."""


def grasp_time(column: Columns) -> Array:
    """What is to be least: the time until the force of the later finger has settled, in s."""
    each = [column(f"time_to_contact[{j}]") + column(f"settling_time[{j}]") for j in (1, 2)]
    return np.maximum(*each)


def gains(point: Array) -> dict[str, float]:
    """The gains at a point of the search, powers of FACTOR, to the digits that are printed."""
    pairs = zip(GAINS, FACTOR**point, strict=True)
    return {k: float(f"{f * v:.4g}") for gain, f in pairs for k, v in gain.items()}


def measured(points: Array, conditions: Sequence[dict[str, Any]]) -> Array:
    """Grasp time and limits, a row each, for every point, a column each, in every condition.

    A run that fails, or does not touch, has inf.
    """
    rows = [{**condition, **gains(point)} for condition in conditions for point in points.T]
    table = sweep(SYSTEM, rows)

    def column(name: str) -> Array:
        entries = [table[c] for c in table.metrics if c.partition("[")[0] == name or c == name]
        return np.asarray(np.max(entries, axis=0))

    found = np.array([grasp_time(column), *map(column, LIMITS)])
    return np.where(np.isnan(found), np.inf, found).reshape(len(found), len(conditions), -1)


class Search:
    """The worst of all conditions; a generation is run once, for what is least and the limits."""

    def __init__(self) -> None:
        self.known: dict[bytes, Array] = {}
        self.published = self.worst(np.zeros(len(GAINS)))[:, 0]

    def worst(self, points: Array) -> Array:
        """Grasp time and limits, a row each, at points, a column each."""
        each = points.reshape(len(GAINS), -1).T
        if new := {p.tobytes(): p for p in each if p.tobytes() not in self.known}:
            found = measured(np.array([*new.values()]).T, CONDITIONS).max(axis=1)
            self.known |= dict(zip(new, found.T, strict=True))
        return np.array([self.known[p.tobytes()] for p in each]).reshape(-1, 1 + len(LIMITS)).T

    def least(self, points: Array) -> Array:
        """The grasp time."""
        return np.asarray(self.worst(points)[0])

    def limits(self, points: Array) -> Array:
        """The limits as shares of what the published gains reach; where one is missing, 1000."""
        return np.minimum(self.worst(points)[1:] / self.published[1:, None], 1e3)


def tuned(generations: int) -> tuple[Array, Search]:
    """The best point that was found, and the search, with all that were tried."""
    search = Search()
    found = differential_evolution(
        search.least,
        [(-1.0, 1.0)] * len(GAINS),
        constraints=NonlinearConstraint(search.limits, -np.inf, 1.0),
        x0=np.zeros(len(GAINS)),
        popsize=MEMBERS,
        maxiter=generations,
        rng=SEED,
        vectorized=True,
        updating="deferred",
        polish=False,
    )
    return found.x, search


SHOWN = {"grasp time, s": 1, "impact, mm/s": 1e3, "apart, s": 1, "overshoot, %": 1e2}
"""How what is least and the limits are printed: in these units, by these factors."""


def main(generations: int = GENERATIONS) -> None:
    """Search, and print the gains next to the published ones."""
    best, search = tuned(generations)
    tried, published = len(search.known), np.zeros(len(GAINS))
    print(f"{tried} sets of gains, {tried * len(CONDITIONS)} runs, seed {SEED}")
    print(f"{'the worst of all conditions':42s}published    tuned")
    found = zip(SHOWN.items(), search.published, search.worst(best)[:, 0], strict=True)
    for (title, factor), before, now in found:
        print(f"{title:42s}{factor * before:9.3f}{factor * now:9.3f}")
    for name, value in gains(best).items():
        print(f"{name:42s}{gains(published)[name]:9g}{value:9g}")
    print("\nwhere it was not tuned: ", *(f"{title:18s}" for title in SHOWN))
    checks = measured(np.array([published, best]).T, [*CHECKS.values()])
    for name, pairs in zip(CHECKS, checks.transpose(1, 0, 2), strict=True):
        texts = (
            f"{f * a:.3f} -> {f * b:.3f}" for f, (a, b) in zip(SHOWN.values(), pairs, strict=True)
        )
        print(f"{name:24s}", *(f"{text:18s}" for text in texts))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
