"""The published figures beside ours: the grasps of all their settings, and the deviations.

One way for both sources, the simulation and the experiments on the bench preset; what differs is in
SOURCES.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ...base.parallel import run_all
from ...system.description import System
from ..closing import close
from ..presets import CASES, start_in_si, with_case, with_si_values
from .claims import Evidence
from .grasps import Run, Runs, as_run
from .tables import Row, Setting, Source, published_rows

Job = tuple[System, Setting, int, Source]


@dataclass(frozen=True, slots=True)
class How:
    """How the figures of one source are run again.

    A grasp lasts `stop` s, or ends `after` s once both fingers touch; pictures end at `shown` s.
    """

    title: str
    stop: float
    after: float | None
    shown: float
    deviations: Callable[[Sequence[Row], Sequence[Mapping[str, Any]]], dict[str, float]]
    at_sensor_contact: bool


def compared(system: System, source: Source, workers: int, progress: bool) -> Evidence:
    """Run Cases 0, 1 and 2 in all published settings of a source.

    InputError where a finger does not reach the object, KeyboardInterrupt at Ctrl-C.
    """
    how, published = SOURCES[source], published_rows(source)
    settings = sorted({row.setting for row in published})
    jobs = [(system, setting, case, source) for setting in settings for case in CASES]
    found = run_all(_run, jobs, workers, progress, "evaluate")
    runs = {(run.setting, run.case): run for run in found}
    rows = [_compared(row, runs, how.at_sensor_contact) for row in published]
    return Evidence(runs, published, rows, how.deviations(published, rows), system)


def _run(job: Job) -> Run:
    """One grasp; the reflectances of a setting are shares of those of the system."""
    system, setting, case, source = job
    values = {
        "plant.initial_object_position": setting.x_m,
        "sensor_1.reflectance": setting.alpha_1 * start_in_si(system, "sensor_1.reflectance"),
        "sensor_2.reflectance": setting.alpha_2 * start_in_si(system, "sensor_2.reflectance"),
    }
    how = SOURCES[source]
    chosen = with_si_values(with_case(system, case), values, "evaluate:")
    chosen = chosen.with_experiment(stop=how.stop)
    return as_run(close(chosen, how.after), setting, case)


def _compared(row: Row, runs: Runs, at_sensor_contact: bool) -> dict[str, Any]:
    """The published figure with ours beside it and the difference, simulated less published."""
    run = runs[row.setting, row.case]
    simulated = run.apart if row.finger is None else run.times[row.finger - 1]
    found = {
        **row._asdict(),
        "simulated": simulated,
        "difference": simulated - row.published,
    }
    del found["setting"]
    if at_sensor_contact:
        first, second = run.times_at_sensor_contact
        ours = abs(second - first) if row.finger is None else (first, second)[row.finger - 1]
        found["simulated_at_0.37_mm"] = ours
        found["difference_at_0.37_mm"] = ours - row.published
    return found


def _rms(values: Sequence[float]) -> float:
    return math.sqrt(math.fsum(v * v for v in values) / len(values))


def simulation_rms(published: Sequence[Row], rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Root mean square of the differences in s, contact times and time differences apart."""
    return {
        f"{what}{suffix}": _rms([r[key] for r in chosen])
        for what, chosen in (
            ("contact_times", [r for r in rows if r["finger"]]),
            ("time_differences", [r for r in rows if not r["finger"]]),
        )
        for suffix, key in (("", "difference"), ("_at_0.37_mm", "difference_at_0.37_mm"))
    }


def bench_rms(published: Sequence[Row], rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Root mean square of the differences in s: contact times by table, then time differences.

    "contact_times" are those of the position rows and of equal colours; white on both sides,
    which is the position row of 0.03 m again, counts once.
    """
    groups: dict[str, list[float]] = {}
    for row, ours in zip(published, rows, strict=True):
        name = "time_differences"
        if row.finger is not None:
            alike = "positions" if row.table == "position" else "equal_colours"
            name = alike if row.setting.equal_colours else "mixed_colours"
        groups.setdefault(name, []).append(ours["difference"])
        if name in ("positions", "equal_colours") and row.condition != "white/white":
            groups.setdefault("contact_times", []).append(ours["difference"])
    return {name: _rms(values) for name, values in sorted(groups.items())}


SOURCES: Mapping[Source, How] = {
    # The slowest contact is at 2.7 s, and the layers settle with a time constant of 0.2 s.
    "simulation": How("Published simulation", 4.5, None, 3.0, simulation_rms, True),
    # Twice the slowest published contact; a grasp goes on for 1.5 s once both fingers touch.
    "experiment": How("Published experiments", 10.0, 1.5, 5.0, bench_rms, False),
}
