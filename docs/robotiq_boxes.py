"""A Robotiq 2F-85 grasps 20 free boxes, drawn at random: docs/robotiq_plant.py.

    .venv/bin/python docs/robotiq_boxes.py     # in the folder of the checkout; half a minute

A row is a box; per law the time from the first finger's contact to the last one's and the farthest
that the box was shifted; never is where one finger did not touch. The last row has the largest.
"""

import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from math import inf, isinf, isnan
from pathlib import Path
from random import Random

from grasp_cosim import System, sweep, tandem_system
from grasp_cosim.fmu_export.build import build_block
from robotiq_plant import HALF_STROKE

PLANT = Path(__file__).with_name("robotiq_plant.py")

Values = Mapping[str, float | bool]
"""In SI units, by their places in the system."""

BOXES, SEED = 20, 1

CLEARANCE = 0.002
"""m, from a pad to the box at the start, at least."""

STOP = 5.0
"""s; a box of 20 mm is touched after 3.6 s."""

LAWS: Mapping[str, Values] = {
    "learnt": {},
    "not learnt": {"controller.reflectance.prior_deviation": 0.0},
    "wrist not moved": {"controller.simultaneous_contact.enabled": False},
}
"""The law as it is; taking both faces to be alike; as grippers are used today."""


def built(folder: Path) -> System:
    """The gripper in tandem with this plant, whose FMU is built into a folder.

    ValueError, one line, where MuJoCo or the MJCF is missing.
    """
    plant = build_block(PLANT, folder).path
    return tandem_system().swap("plant", plant).with_experiment(stop=STOP)


def boxes(count: int = BOXES, seed: int = SEED) -> Iterator[Values]:
    """Width, place, mass and the colours of both faces, each as likely within its range.

    A box is up to 25 mm off the middle, as far as the open gripper permits.
    """
    rng = Random(seed)  # noqa: S311 - no secret
    for _ in range(count):
        width = rng.uniform(0.02, 0.05)
        farthest = min(0.025, HALF_STROKE - CLEARANCE - 0.5 * width)
        yield {
            "plant.object_width": width,
            "plant.initial_object_position": rng.uniform(-farthest, farthest),
            "plant.object_mass": rng.uniform(0.02, 0.05),
            "sensor_1.reflectance": rng.uniform(0.3, 1.2),
            "sensor_2.reflectance": rng.uniform(0.3, 1.2),
        }


def measured(system: System, rows: Sequence[Values]) -> list[tuple[float, float]]:
    """Time between the contacts in s, inf where there are not two, and shift in m, for each row."""
    table = sweep(system, rows)
    for error in table.errors.values():
        raise RuntimeError(error)
    pairs = zip(table["time_difference"], table["object_shift"], strict=True)
    return [(inf if isnan(apart) else float(apart), float(shift)) for apart, shift in pairs]


def main(folder: Path = PLANT.parents[1] / "fmus/build", count: int = BOXES) -> None:
    """Grasp them under each law, and print the table."""
    try:
        system = built(folder)
    except ValueError as error:
        sys.exit(f"robotiq_boxes.py: {error}")
    rows = [*boxes(count)]
    found = [measured(system.with_values(law), rows) for law in LAWS.values()]
    print("   box: mm      g     alpha  |  apart, ms / shift, mm")
    print(" width  place        1    2 " + "".join(f"| {law:^15} " for law in LAWS))
    for row, runs in zip(rows, zip(*found, strict=True), strict=True):
        width, place, mass, right, left = row.values()
        box = f"{1e3 * width:6.1f} {1e3 * place:5.1f} {1e3 * mass:4.0f}  {right:.2f} {left:.2f} "
        print(box + _cells(runs))
    print(f"{'the largest':28}" + _cells([_largest(runs) for runs in found]))


def _largest(runs: Sequence[tuple[float, float]]) -> tuple[float, float]:
    apart, shift = zip(*runs, strict=True)
    return max(apart), max(shift)


def _cells(runs: Iterable[tuple[float, float]]) -> str:
    return "".join(
        f"| {'never' if isinf(apart) else f'{1e3 * apart:.1f}':>6} / {1e3 * shift:6.3f} "
        for apart, shift in runs
    )


if __name__ == "__main__":
    main()
