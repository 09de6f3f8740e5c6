"""How a gripper in tandem on an arm grasps: python -m benchmarks.tandem [COUNT]

Of each row COUNT grasps (100) are run natively in steps of 1 ms, drawn at random from seed 7:
objects up to 50 mm off the wrist, 40 to 90 mm wide, both faces of colours from 0.3 to 1.2; printed
is the worst of each figure. docs/how_to/tandem.md has the results.
"""

import math
import random
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from grasp_cosim import System, simulate, tandem_system
from grasp_cosim.fmu_export.build import build_block, planned
from grasp_cosim.tandem.system import SYSTEM

Value = float | bool | str

DOCS = Path(__file__).parents[1] / "docs"


class Row(NamedTuple):
    """What is otherwise than in tandem.toml, and how far apart, in s, contacts may be at most."""

    title: str
    apart: float
    values: Mapping[str, Value] = {}
    presets: tuple[str, ...] = ()
    free: bool = False
    late: int = 0
    """Steps by which positions come late."""


def wrist(bandwidth: float, delay: float = 0.0) -> dict[str, Value]:
    """A wrist of so many Hz whose command is so many s late, as the law counts on it."""
    given = {"wrist.bandwidth": bandwidth, "wrist.delay": delay}
    return {f"{name}.{key}": v for name in ("plant", "controller") for key, v in given.items()}


LIMITS: Mapping[str, Value] = {
    "plant.wrist.speed_limit": 0.25,
    "plant.wrist.acceleration_limit": 2.5,
}

ROWS = (
    Row("fixed", 0.005),
    Row("fixed, bench", 0.01, presets=("bench",)),
    Row("free, 20 to 50 g", 0.005, free=True),
    *(Row(f"wrist {hz:g} Hz", 0.005, wrist(hz)) for hz in (2.0, 3.0, 10.0, 20.0, 50.0)),
    *(Row(f"command {1e3 * s:g} ms late", 0.005, wrist(5.0, s)) for s in (0.02, 0.05, 0.1)),
    Row("3 Hz, 50 ms late", 0.005, wrist(3.0, 0.05)),
    *(Row(f"positions {n} ms late", 0.015, late=n) for n in (2, 5, 10, 20)),
    Row("0.25 m/s, 2.5 m/s2", 0.005, LIMITS),
    Row("speed servo, friction", 0.005, presets=("gripper",)),
    Row("arm, gripper, bench", 0.015, presets=("arm", "gripper", "bench")),
    Row("wrist not moved", math.inf, presets=("case_1",), free=True),
)


def late_system(folder: Path) -> System:
    """The system with docs/late_positions.py between the plant and the controller."""
    late = build_block(DOCS / "late_positions.py", folder, planned()).path
    fmus = tandem_system().component("plant", "").fmu.parent
    text = SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus.as_posix()}/')
    for name in ("position[1]", "position[2]", "velocity[1]", "velocity[2]"):
        direct = f'"plant.{name} -> controller.{name}"'
        through = f'"plant.{name} -> late.{name}", "late.late_{name} -> controller.{name}"'
        text = text.replace(direct, through)
    component = f'[components.late]\nfmu = "{late.as_posix()}"\n\n'
    first = "[components.sensor_1]"
    file = folder / "late.toml"
    file.write_text(text.replace(first, component + first), "utf-8")
    return System.load(file).natively()


def cases(row: Row, count: int) -> Iterator[dict[str, Value]]:
    """The values of so many grasps."""
    draw = random.Random(7)  # noqa: S311 - no secret
    for i in range(count):
        values: dict[str, Value] = {
            "plant.initial_object_position": draw.uniform(-0.05, 0.05),
            "plant.object_width": draw.uniform(0.04, 0.09),
            "sensor_1.reflectance": draw.uniform(0.3, 1.2),
            "sensor_2.reflectance": draw.uniform(0.3, 1.2),
            "plant.object_mass": draw.uniform(0.02, 0.05),
            "plant.object_fixed": not row.free,
        }
        if "bench" in row.presets:
            values |= {f"sensor_{j}.noise.seed": 2 * i + j for j in (1, 2)}
        yield {**values, **row.values}


def main(count: int = 100) -> None:
    """Print the worst of each row."""
    heads = ("last less first", "asked", "impact", "forces apart", "shift", "latest")
    print(f"{'gripper':24}" + "".join(f"{head:>16}" for head in heads))
    print(f"{'':24}" + "".join(f"{u:>16}" for u in ("s", "s", "mm/s", "N", "mm", "s")))
    with TemporaryDirectory() as folder:
        for row in ROWS:
            system = _system(row, Path(folder)).with_experiment(stop=5.0)
            found: list[Mapping[str, Any]] = [
                simulate(system.with_values(v)).metrics for v in cases(row, count)
            ]
            _print(row, found)


def _system(row: Row, folder: Path) -> System:
    system = tandem_system().with_presets(*row.presets)
    if not row.late:
        return system
    return late_system(folder).with_values({"late.steps": row.late})


def _print(row: Row, found: list[Mapping[str, Any]]) -> None:
    def worst(name: str) -> float:
        values = [m[name] for m in found]
        several = [v for value in values for v in (value if isinstance(value, list) else [value])]
        return math.inf if None in several else max(float(v) for v in several)

    numbers = (
        worst("time_difference"),
        row.apart,
        1e3 * worst("impact_velocity"),
        worst("force_difference"),
        1e3 * worst("object_shift"),
        worst("time_to_contact"),
    )
    print(f"{row.title:24}" + "".join(f"{number:16.4f}" for number in numbers), flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
