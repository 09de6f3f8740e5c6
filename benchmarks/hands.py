"""How hands of several fingers close on objects of any colour: python -m benchmarks.hands [COUNT]

Of each hand COUNT grasps (60) are run natively, with colours, places and seeds drawn at random from
seed 5; printed is the worst of each figure. The faces reflect 0.3, 0.6 or 1.2, the object of 35 mm
is up to 10 mm off the middle, unless a row states otherwise.
"""

import math
import random
import sys
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from grasp_cosim import System, hand_system, simulate
from grasp_cosim.hand.system import fmus_of

COLOURS, OFFSETS = (0.3, 0.6, 1.2), (0.0, 0.005, 0.01)
BOX = {f"plant.half_width[{k}]": 0.03 if k % 2 else 0.04 for k in (1, 2, 3, 4)}
LIGHT = {f"sensor_{k}.ambient.enabled": True for k in (1, 2, 3)}
AWRY = {f"sensor_{k}.ambient.calibration_error": 1e-3 for k in (1, 2, 3)}


class Hand(NamedTuple):
    """Its directions in degrees, or how many even ones; what else is otherwise."""

    title: str
    angles: tuple[float, ...] | int
    spread: float
    """s between the first and the last contact that are asked for at most."""
    law: str = "adaptive"
    values: Mapping[str, float | bool | str] = {}
    colours: tuple[float, ...] = COLOURS
    offsets: tuple[float, ...] = OFFSETS
    step: float = 1e-3
    bench: bool = False
    free: bool = False


HANDS = (
    Hand("3, published law, alike", 3, 0.012, "published", colours=(1.0,)),
    Hand("3", 3, 0.02),
    Hand("3 at 90/135/135", (0.0, 90.0, 225.0), 0.02),
    Hand("3, least weight 0.26", (0.0, 163.0, 200.0), 0.02),
    Hand("3, steps of 0.1 ms", 3, 0.02, step=1e-4),
    Hand("3, steps of 2 ms", 3, 0.02, step=2e-3),
    Hand("3, a disc", 3, 0.02, values={"plant.shape": "disc"}),
    Hand("3, 20 to 50 mm off", 3, 0.06, offsets=(0.02, 0.03, 0.04, 0.05)),
    Hand("4", 4, 0.025),
    Hand("4 at 20/100/200/290", (20.0, 100.0, 200.0, 290.0), 0.025),
    Hand("4, box of 60 x 80 mm", 4, 0.025, values=BOX),
    Hand("5", 5, 0.03),
    Hand("6", 6, 0.03),
    Hand("3, bench", 3, 0.025, bench=True),
    Hand("4, bench", 4, 0.04, bench=True),
    Hand("5, bench", 5, 0.04, bench=True),
    Hand("3, 1 mV off each", 3, 0.035, values={**LIGHT, **AWRY}),
    Hand(
        "3, +1, -1, 0 mV off", 3, 0.06,
        values={**LIGHT, "sensor_1.ambient.calibration_error": 1e-3,
                "sensor_2.ambient.calibration_error": -1e-3},
    ),
    Hand("3, one drifts 5 mV/s", 3, 0.045, values={**LIGHT, "sensor_1.ambient.drift": 5e-3}),
    *(
        Hand(f"3, true exponent {n}", 3, 0.02,
             values={f"sensor_{k}.diffusion_exponent": n for k in (1, 2, 3)})
        for n in (1.0, 1.2, 1.3)
    ),
    *(
        Hand(f"3, free prism of {1e3 * m:g} g", 3, 0.02, values={"plant.object_mass": m}, free=True)
        for m in (0.02, 0.05)
    ),
    Hand("3, free, turned by 3 deg", 3, 0.02, free=True,
         values={"plant.initial_object_angle": math.radians(3.0)}),
    Hand("4, free box", 4, 0.02, values=BOX, free=True),
)  # fmt: skip


def system_of(hand: Hand) -> System:
    """The hand as a system."""
    fingers, angles = (hand.angles, None) if isinstance(hand.angles, int) else (None, hand.angles)
    system = hand_system(fingers, angles, hand.law).with_experiment(step=hand.step, stop=4.0)
    count = fingers or len(angles or ())
    if hand.free:
        number = "" if count == 3 else str(count)
        system = system.swap("plant", fmus_of(count) / f"HandPlantMovable{number}.fmu").natively()
    return system.with_presets("bench") if hand.bench else system


def cases(hand: Hand, count: int, draw: random.Random) -> Iterator[dict[str, float | bool | str]]:
    """The values of so many grasps."""
    fingers = hand.angles if isinstance(hand.angles, int) else len(hand.angles)
    for i in range(count):
        off, at = draw.choice(hand.offsets), draw.uniform(0.0, 2.0 * math.pi)
        values: dict[str, float | bool | str] = {
            "plant.initial_object_position[1]": off * math.cos(at),
            "plant.initial_object_position[2]": off * math.sin(at),
        }
        for k in range(1, fingers + 1):
            values[f"sensor_{k}.reflectance"] = draw.choice(hand.colours)
            if hand.bench:
                values[f"sensor_{k}.noise.seed"] = 1 + fingers * i + k
        yield {**values, **hand.values}


def main(count: int = 60) -> None:
    """Print the worst of each hand."""
    heads = ("spread", "asked", "forces apart", "net force", "impact", "shift", "drift")
    print(f"{'hand':28}" + "".join(f"{head:>14}" for head in heads))
    print(f"{'':28}" + "".join(f"{u:>14}" for u in ("s", "s", "N", "N", "mm/s", "mm", "mm/s")))
    for hand in HANDS:
        system, draw = system_of(hand), random.Random(5)  # noqa: S311 - no secret
        found: list[Mapping[str, Any]] = [
            simulate(system.with_values(v)).metrics for v in cases(hand, count, draw)
        ]
        spreads = [m["time_difference"] for m in found]
        numbers = [
            math.inf if None in spreads else max(spreads),
            hand.spread,
            max(m["force_difference"] for m in found),
            max(m["net_force"] for m in found),
            1e3 * max(max(v or 0.0 for v in m["impact_velocity"]) for m in found),
            1e3 * max(m["object_shift"] for m in found),
            1e3 * max(m["object_drift"] for m in found),
        ]
        print(f"{hand.title:28}" + "".join(f"{number:14.4f}" for number in numbers), flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
