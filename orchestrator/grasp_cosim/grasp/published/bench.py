"""The published experiments, run on the bench preset: tables, figures, claims, report."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ...files import write_text
from ...parallel import run_all
from ...report.plot import new_figure, save
from ...system.description import System
from ..closing import close
from ..pictures import draw_colour_times, draw_contact_times
from ..presets import CASES, with_case
from .bench_claims import check_bench_claims, equal_colours
from .evaluate import compared, draw_signals, root_mean_square
from .grasps import Run, Runs, as_run, steady
from .report import bench_markdown, table_csv
from .tables import Row, Setting, experimental_rows

STOP = 10.0
"""s; twice the slowest published contact."""

AFTER = 1.5
"""s that a grasp goes on once both fingers touch; the layers settle with 0.2 s."""

SHOWN_UNTIL = 5.0
"""s; where the time axis of the figures ends."""


def evaluate_bench(system: System, out: Path, workers: int, progress: bool) -> dict[str, Any]:
    """Run Cases 0, 1 and 2 in all settings of both experimental tables; write everything to out.

    Writes contact_forces.png, target_position.png, contact_times.png, evaluation.csv,
    evaluation.json and report.md. Returns what evaluation.json holds.
    """
    new_figure(1.0, 1.0)  # says at once if matplotlib is missing
    published = experimental_rows()
    runs = run_settings(system, [row.setting for row in published], workers, progress)
    rows = [compared(row, runs) for row in published]
    rms = bench_rms(published, rows)
    report = {
        "rows": rows,
        "rms": rms,
        "claims": check_bench_claims(runs, published, rms, system),
        "runs": [
            {"condition": _label(r.setting), "case": r.case, **steady(r.metrics)}
            for r in runs.values()
        ],
    }
    draw_signals(runs, SHOWN_UNTIL, out)
    _draw_times(rows, out)
    write_text(out / "evaluation.csv", table_csv(rows))
    write_text(out / "evaluation.json", json.dumps(report, indent=2) + "\n")
    write_text(out / "report.md", bench_markdown(report, system))
    return report


def run_settings(system: System, settings: Sequence[Setting], workers: int, progress: bool) -> Runs:
    """The three cases in each of the settings, once each."""
    jobs = [(system, s, case) for s in sorted(set(settings)) for case in CASES]
    return {(r.setting, r.case): r for r in run_all(_run, jobs, workers, progress, "grasps")}


def bench_rms(published: Sequence[Row], rows: Sequence[dict[str, Any]]) -> dict[str, float]:
    """Root mean square of the differences in s: contact times by table, then time differences.

    "contact_times" are those of the position rows and of equal colours; white on both sides,
    which is the position row of 0.03 m again, counts once.
    """
    groups: dict[str, list[float]] = {}
    for row, ours in zip(published, rows, strict=True):
        again = row.condition == "white/white"
        if not equal_colours(row.setting):
            group = "mixed_colours"
        else:
            group = "positions" if row.table == "position" else "equal_colours"
        if row.finger is None:
            groups.setdefault("time_differences", []).append(ours["difference"])
            continue
        groups.setdefault(group, []).append(ours["difference"])
        if group != "mixed_colours" and not again:
            groups.setdefault("contact_times", []).append(ours["difference"])
    return {name: root_mean_square(values) for name, values in sorted(groups.items())}


def _run(job: tuple[System, Setting, int]) -> Run:
    system, setting, case = job
    values = {
        "plant.initial_object_position": setting.x_m,
        "sensor_1.reflectance": setting.alpha_1 * system.start("sensor_1.reflectance"),
        "sensor_2.reflectance": setting.alpha_2 * system.start("sensor_2.reflectance"),
    }
    result = close(with_case(system, case).with_values(values).with_experiment(stop=STOP), AFTER)
    return as_run(result, setting, case)


def _label(setting: Setting) -> str:
    x_m, alpha_1, alpha_2 = setting
    return f"{x_m:.2f} m" + ("" if alpha_1 == alpha_2 == 1.0 else f", {alpha_1:.2f}/{alpha_2:.2f}")


def _draw_times(rows: Sequence[dict[str, Any]], out: Path) -> None:
    figure = new_figure(11.0, 8.0)
    axes = figure.subplots(2, 2, sharey="row")
    for column, case in enumerate((1, 2)):
        draw_contact_times(axes[0, column], [r for r in rows if r["table"] == "position"], case)
        draw_colour_times(axes[1, column], [r for r in rows if r["table"] == "reflectance"], case)
    save(figure, out / "contact_times.png")
