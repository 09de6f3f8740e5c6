"""The published simulation, run again: table, figures, claims, report."""

import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...files import write_text
from ...master.simulation import simulate
from ...parallel import run_all
from ...report.plot import new_figure, save
from ...system.description import System
from ..pictures import draw_contact_forces, draw_contact_times, draw_targets
from ..presets import CASES, with_case
from .claims import check_claims
from .grasps import Run, Runs, as_run, steady
from .report import markdown, table_csv
from .tables import REFLECTANCE_X_M, Row, Setting, simulated_rows

STOP = 4.5
"""s; the slowest contact is at 2.7 s and the layers settle with a time constant of 0.2 s."""

SHOWN_UNTIL = 3.0
"""s; where the time axis of the figures ends."""


def evaluate(system: System, out: Path, workers: int, progress: bool) -> dict[str, Any]:
    """Run Cases 0, 1 and 2 over the published object positions and write everything to out.

    Writes contact_forces.png, target_position.png, contact_times.png, evaluation.csv,
    evaluation.json and report.md. Returns what evaluation.json holds.
    """
    new_figure(1.0, 1.0)  # says at once if matplotlib is missing
    published = simulated_rows()
    settings = sorted({row.setting for row in published})
    jobs = [(system, setting, case) for setting in settings for case in CASES]
    runs = {(r.setting, r.case): r for r in run_all(_run, jobs, workers, progress, "grasps")}
    rows = [{**compared(row, runs), **_at_sensor_contact(row, runs)} for row in published]
    report = {
        "rows": rows,
        "rms": _rms(rows),
        "claims": check_claims(runs, rows, system),
        "runs": [
            {"condition": r.setting.x_m, "case": r.case, **steady(r.metrics)} for r in runs.values()
        ],
    }
    _draw(runs, rows, out)
    write_text(out / "evaluation.csv", table_csv(rows))
    write_text(out / "evaluation.json", json.dumps(report, indent=2) + "\n")
    write_text(out / "report.md", markdown(report, system))
    return report


def _run(job: tuple[System, Setting, int]) -> Run:
    system, setting, case = job
    values = {"plant.initial_object_position": setting.x_m}
    result = simulate(with_case(system, case).with_values(values), stop=STOP)
    if not result.complete:
        raise KeyboardInterrupt
    return as_run(result, setting, case)


def compared(row: Row, runs: Runs) -> dict[str, Any]:
    """The published figure with ours beside it and the difference."""
    run = runs[row.setting, row.case]
    simulated = run.apart if row.finger is None else run.times[row.finger - 1]
    return {
        "table": row.table,
        "condition": row.condition,
        "case": row.case,
        "finger": row.finger,
        "published": row.published,
        "simulated": simulated,
        "difference": simulated - row.published,
    }


def _at_sensor_contact(row: Row, runs: Runs) -> dict[str, float]:
    first, second = runs[row.setting, row.case].times_at_sensor_contact
    ours = abs(second - first) if row.finger is None else (first, second)[row.finger - 1]
    return {"simulated_at_0.37_mm": ours, "difference_at_0.37_mm": ours - row.published}


def root_mean_square(values: Sequence[float]) -> float:
    """Of at least one number."""
    return math.sqrt(sum(v * v for v in values) / len(values))


def _rms(rows: list[dict[str, Any]]) -> dict[str, float]:
    """Root mean square of the differences in s, contact times and time differences apart."""
    return {
        f"{what}{suffix}": root_mean_square([r[key] for r in chosen])
        for what, chosen in (
            ("contact_times", [r for r in rows if r["finger"]]),
            ("time_differences", [r for r in rows if not r["finger"]]),
        )
        for suffix, key in (("", "difference"), ("_at_0.37_mm", "difference_at_0.37_mm"))
    }


def _draw(runs: Runs, rows: list[dict[str, Any]], out: Path) -> None:
    draw_signals(runs, SHOWN_UNTIL, out)
    times = new_figure(9.0, 4.0)
    left, right = times.subplots(1, 2, sharey=True)
    draw_contact_times(left, rows, 1)
    draw_contact_times(right, rows, 2)
    save(times, out / "contact_times.png")


def draw_signals(runs: Runs, until: float, out: Path) -> None:
    """The figures of contact forces and of the target, the object at REFLECTANCE_X_M."""
    shown = {r.case: r.result for r in runs.values() if r.result}
    pair = [(shown[1], "--", "Case 1"), (shown[2], "-", "Case 2")]
    where = f"object at {1e3 * REFLECTANCE_X_M:.0f} mm"
    forces = new_figure(7.2, 6.4)
    top, bottom = forces.subplots(2, 1, sharex=True)
    draw_contact_forces(top, pair)
    draw_contact_forces(bottom, [(shown[0], "-", "Case 0")])
    bottom.set_xlabel("time in s")
    bottom.set_xlim(0.0, until)
    top.set_title(f"Contact forces, {where}", fontsize=10)
    save(forces, out / "contact_forces.png")
    targets = new_figure(7.2, 4.0)
    axes = targets.subplots()
    draw_targets(axes, pair)
    axes.set_xlabel("time in s")
    axes.set_xlim(0.0, until)
    axes.set_title(f"Target position, {where}", fontsize=10)
    save(targets, out / "target_position.png")
