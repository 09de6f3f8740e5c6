"""The published simulation, run again: table, figures, claims, report."""

import csv
import io
import json
import math
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..figures.plot import draw_contact_forces, draw_contact_times, draw_targets, new_figure, save
from ..grasp import CASES
from ..master.simulation import simulate
from ..recording.result import write_text
from ..study.metrics import FINGERS, time_at_gap
from ..study.parallel import run_all
from ..system.description import System
from .claims import Run, Runs, check_claims
from .report import markdown, table_csv

STOP = 4.5
"""s; the slowest contact is at 2.7 s and the layers settle with a time constant of 0.2 s."""

SHOWN, SHOWN_UNTIL = 0.03, 3.0
"""m and s; the object position of the figures, and where their time axis ends."""

SENSOR_CONTACT = 0.37e-3
"""m; the gap at which contact, were it declared there, would explain the published times best."""


def evaluate(system: System, out: Path, workers: int, progress: bool) -> dict[str, Any]:
    """Run Cases 0, 1 and 2 over the published object positions and write everything to out.

    Writes contact_forces.png, target_position.png, contact_times.png, evaluation.csv,
    evaluation.json and report.md. Returns what evaluation.json holds.
    """
    new_figure(1.0, 1.0)  # says at once if matplotlib is missing
    published = list(_published())
    conditions = sorted({row["condition"] for row in published})
    jobs = [(system, x_m, case) for x_m in conditions for case in CASES]
    runs = {(r.x_m, r.case): r for r in run_all(_run, jobs, workers, progress, "grasps")}
    rows = [_row(row, runs) for row in published]
    report = {
        "rows": rows,
        "rms": _rms(rows),
        "claims": check_claims(runs, rows, system),
        "runs": [{"condition": r.x_m, "case": r.case, **_steady(r.metrics)} for r in runs.values()],
    }
    _draw(runs, rows, out)
    write_text(out / "evaluation.csv", table_csv(rows))
    write_text(out / "evaluation.json", json.dumps(report, indent=2) + "\n")
    write_text(out / "report.md", markdown(report, system))
    return report


def _published() -> Iterator[dict[str, Any]]:
    """The simulated half of the published position table: a row per finger, one per difference."""
    text = files(__package__).joinpath("table_position.csv").read_text("utf-8")
    for line in csv.DictReader(io.StringIO(text)):
        if line["source"] != "simulation":
            continue
        for case in (1, 2):
            common = {"table": "position", "condition": float(line["x_m"]), "case": case}
            for finger in FINGERS:
                yield {
                    **common,
                    "finger": finger,
                    "published": float(line[f"case{case}_t{finger}"]),
                }
            yield {**common, "finger": None, "published": float(line[f"case{case}_dt"])}


def _run(job: tuple[System, float, int]) -> Run:
    system, x_m, case = job
    values = {**CASES[case], "plant.initial_object_position": x_m}
    result = simulate(system.with_values(values), stop=STOP)
    if not result.complete:
        raise KeyboardInterrupt
    moments = [time_at_gap(result.time, result.signals, j, SENSOR_CONTACT) for j in FINGERS]
    first, second = moments
    if first is None or second is None or None in result.metrics["time_to_contact"]:
        raise InputError(
            f"evaluate: x_m = {x_m} m, Case {case}: a finger does not reach the object"
        )
    target = result["controller.target_position"]
    beyond = (target - x_m) * math.copysign(1.0, x_m)
    shown = result if x_m == SHOWN else None
    return Run(x_m, case, dict(result.metrics), (first, second), float(beyond.max()), shown)


def _row(published: dict[str, Any], runs: Runs) -> dict[str, Any]:
    """The published row with our figures and the differences; finger None: time difference."""
    run = runs[published["condition"], published["case"]]
    finger = published["finger"]
    ours, sensor = run.metrics["time_to_contact"], run.times_at_sensor_contact
    simulated = abs(ours[1] - ours[0]) if finger is None else ours[finger - 1]
    at_gap = abs(sensor[1] - sensor[0]) if finger is None else sensor[finger - 1]
    return {
        **published,
        "simulated": simulated,
        "difference": simulated - published["published"],
        "simulated_at_0.37_mm": at_gap,
        "difference_at_0.37_mm": at_gap - published["published"],
    }


def _rms(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Root mean square of the differences in s, contact times and time differences apart."""
    return {
        f"{what}{suffix}": math.sqrt(sum(r[key] ** 2 for r in chosen) / len(chosen))
        for what, chosen in (
            ("contact_times", [r for r in rows if r["finger"]]),
            ("time_differences", [r for r in rows if not r["finger"]]),
        )
        for suffix, key in (("", "difference"), ("_at_0.37_mm", "difference_at_0.37_mm"))
    }


def _steady(metrics: dict[str, Any]) -> dict[str, Any]:
    """The metrics that are the same in every repetition."""
    return {k: v for k, v in metrics.items() if k not in ("wall_time", "real_time_factor")}


def _draw(runs: Runs, rows: list[dict[str, Any]], out: Path) -> None:
    shown = {r.case: r.result for r in runs.values() if r.result}
    pair = [(shown[1], "--", "Case 1"), (shown[2], "-", "Case 2")]
    forces = new_figure(7.2, 6.4)
    top, bottom = forces.subplots(2, 1, sharex=True)
    draw_contact_forces(top, pair)
    draw_contact_forces(bottom, [(shown[0], "-", "Case 0")])
    bottom.set_xlabel("time in s")
    bottom.set_xlim(0.0, SHOWN_UNTIL)
    top.set_title(f"Contact forces, object at {1e3 * SHOWN:.0f} mm", fontsize=10)
    save(forces, out / "contact_forces.png")
    targets = new_figure(7.2, 4.0)
    axes = targets.subplots()
    draw_targets(axes, pair)
    axes.set_xlabel("time in s")
    axes.set_xlim(0.0, SHOWN_UNTIL)
    axes.set_title(f"Target position, object at {1e3 * SHOWN:.0f} mm", fontsize=10)
    save(targets, out / "target_position.png")
    times = new_figure(9.0, 4.0)
    left, right = times.subplots(1, 2, sharey=True)
    draw_contact_times(left, rows, 1)
    draw_contact_times(right, rows, 2)
    save(times, out / "contact_times.png")
