"""Which of six delicate things survive a grasp and a lift, under three laws: delicate.md.

    .venv/bin/python docs/delicate_things.py     # in the folder of the checkout; half a minute

Below a force a thing slips, and above another one it is damaged. The grip force is the middle of
both by its logarithm. Position control has the same one.
"""

from collections.abc import Iterator
from math import sqrt
from pathlib import Path
from typing import Any, NamedTuple

from grasp_cosim import Result, System, delicate_system, simulate
from grasp_cosim.fmu_export.build import build_block

HERE = Path(__file__).parent

THINGS = ("tofu", "strawberry", "tomato", "egg", "marshmallow", "paper_cup")

LAWS = ("position control", "published", "grip force")
"""Position control that switches at contact; the published law without and with a grip force."""

GRAVITY = 9.80665
LIFT = 2.0
"""m/s^2, of the lift and of weight."""

STOP = 8.0
"""s: a thing is held for 2 s before the lift."""

BEGIN = 7.0
"""s, when the lift begins."""


class Window(NamedTuple):
    """Of a thing: the forces of a finger in N between which it neither slips nor is damaged."""

    slips_below: float
    damaged_above: float

    @property
    def middle(self) -> float:
        """The grip force, N, rounded as a person would set it."""
        return round(sqrt(self.slips_below * self.damaged_above), 2)


class Outcome(NamedTuple):
    """Of a thing under a law: what has happened, the forces in N, the impact in m/s, the time."""

    word: str
    peak_force: float
    steady_force: float
    impact: float
    time: float


def window(system: System, thing: str) -> Window:
    """Of a preset, in the lift; a limit of the squeeze counts by the relaxed sides."""
    values: dict[str, Any] = dict(system.presets[thing])
    weight = values["plant.object_mass"] * (GRAVITY + LIFT)
    limit = values.get("plant.force_limit")
    if limit is None:
        limit = 0.5 * values["plant.squeeze_limit"] * values["plant.side.stiffness"]
    return Window(weight / (2.0 * values["plant.fingertip_friction"]), limit)


def systems(system: System, thing: str, position_control: Path) -> dict[str, System]:
    """The system under each of the LAWS."""
    force = window(system, thing).middle
    chosen = system.with_presets(thing).with_values({"plant.lift.time": BEGIN})
    chosen = chosen.with_experiment(stop=STOP)
    return {
        "position control": chosen.swap("controller", position_control).with_values(
            {"controller.grip_force": force}
        ),
        "published": chosen,
        "grip force": chosen.with_values({"controller.contact_force.grip_force": force}),
    }


def outcome(run: Result) -> Outcome:
    """What a run comes to."""
    metrics: dict[str, Any] = dict(run.metrics)
    word = "damaged" if metrics["damaged"] else "dropped" if metrics["dropped"] else "survives"
    return Outcome(
        word,
        float(run.signals["plant.peak_force"][-1]),
        max(metrics["steady_contact_force"]),
        max(metrics["impact_velocity"]),
        max(metrics["time_to_contact"]),
    )


def compared(folder: Path) -> Iterator[tuple[str, Window, dict[str, Outcome]]]:
    """Each thing, its window, and its outcomes by law; the FMU is built into a folder."""
    position_control = build_block(HERE / "position_control.py", folder).path
    system = delicate_system()
    for thing in THINGS:
        runs = systems(system, thing, position_control)
        outcomes = {law: outcome(simulate(runs[law])) for law in LAWS}
        yield thing, window(system, thing), outcomes


def rows(folder: Path) -> Iterator[str]:
    """The rows of the table in delicate.md."""
    for thing, limits, outcomes in compared(folder):
        cells = [f"{o.word}, {o.peak_force:.2f} N" for o in outcomes.values()]
        window_cell = f"{limits.slips_below:.2f} to {limits.damaged_above:.2f} N"
        yield f"| {thing} | {window_cell} | {limits.middle:.2f} N | {' | '.join(cells)} |"


if __name__ == "__main__":
    for row in rows(HERE.parent / "fmus/build"):
        print(row)
