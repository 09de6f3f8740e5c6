"""The published figures beside ours: the simulation, and the experiments on the bench preset.

One pipeline for both: the settings of the published rows in every case, a row with both figures for
each published one, their deviations, the claims, pictures and a report. What differs is in SOURCES.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...files import of_any_format, remove, write_json, write_text
from ...metrics.metric import registered
from ...parallel import run_all
from ...progress import Progress
from ...recording.result import UNITS
from ...report.caption import Caption, about
from ...report.plot import headed, new_figure, one_legend, save
from ...sweep.store import Parts
from ...system.description import System
from ...system.made_of import changed
from ..closing import close
from ..pictures import draw_contact_forces, draw_contact_times, draw_targets
from ..presets import CASES, start_in_si, with_case, with_si_values
from .claims import Evidence, check_claims
from .grasps import Run, Runs, as_run
from .report import bench_markdown, controller_fmu, markdown, table_csv
from .store import FOLDER, Grasps, Job
from .tables import REFLECTANCE_X_M, Row, Source, published_rows

Deviations = Callable[[Sequence[Row], Sequence[Mapping[str, Any]]], dict[str, float]]

WRITTEN = ("report.md", "evaluation.json", "evaluation.csv")
PICTURES = ("contact_times", "target_position", "contact_forces")

BOOKKEEPING = ("wall_time", "real_time_factor")
"""What differs from one repetition of a grasp to the next."""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """How the figures of one source are run again.

    A grasp lasts `stop` s, or ends `after` s once both fingers touch; figures end at `shown` s,
    `title` is what they begin with.
    """

    title: str
    stop: float
    after: float | None
    shown: float
    deviations: Deviations
    at_sensor_contact: bool
    page: Callable[[Mapping[str, Any], System], str]


def evaluate(
    system: System,
    out: Path,
    workers: int,
    progress: bool,
    source: Source = "simulation",
    suffix: str = "png",
) -> dict[str, Any]:
    """Run Cases 0, 1 and 2 in all published settings of a source and write everything to `out`.

    Writes the PICTURES in the format that suffix names, evaluation.csv, evaluation.json and
    report.md. Returns what evaluation.json holds. A finished grasp is in a
    folder there until all are: after a kill the same call goes on.

    InputError without matplotlib or where another process is at it, KeyboardInterrupt at Ctrl-C.
    """
    new_figure(1.0, 1.0)  # says at once if matplotlib is missing
    how, published = SOURCES[source], published_rows(source)
    settings = sorted({row.setting for row in published})
    jobs = [(system, setting, case, source) for setting in settings for case in CASES]
    grasps = Grasps(Parts(out / FOLDER), jobs)
    with grasps.parts.locked():
        try:
            runs = {(r.setting, r.case): r for r in _all(grasps, workers, progress)}
        except KeyboardInterrupt:
            if not grasps.parts.kept():
                grasps.remove()
            raise
        rows = [_compared(row, runs, how.at_sensor_contact) for row in published]
        rms = how.deviations(published, rows)
        report = {
            "rows": rows,
            "rms": rms,
            "claims": check_claims(source, Evidence(runs, published, rows, rms, system)),
            "runs": [
                {
                    "condition": r.setting.x_m if source == "simulation" else r.setting.label,
                    "case": r.case,
                    **{k: v for k, v in r.metrics.items() if k not in BOOKKEEPING},
                }
                for r in runs.values()
            ],
            "units": _units(rows, next(iter(runs.values()))),
        }
        remove(out, *WRITTEN, *of_any_format(*PICTURES))
        said = Caption(f"{how.title}, {controller_fmu(system)}", about(changed(system)))
        with Progress("drawing", unit="", shown=progress):
            _draw_signals(runs, how.shown, out, said, suffix)
            _draw_times(rows, out, said, suffix)
        named = [{**r, "finger": r["finger"] or "difference"} for r in rows]
        write_text(out / "evaluation.csv", table_csv(named))
        write_json(out / "evaluation.json", report)
        page = how.page(report, system)
        write_text(out / "report.md", page.replace(".png)", f".{suffix})"))
        grasps.remove()
    return report


def _all(grasps: Grasps, workers: int, progress: bool) -> list[Run]:
    """The grasps, of which those that are finished are not done again, in the order of the jobs."""
    done = grasps.open()
    left = [i for i in range(len(grasps.jobs)) if i not in done]

    def keep(index: int, run: Run) -> None:
        grasps.keep(left[index], run)

    new = run_all(_run, [grasps.jobs[i] for i in left], workers, progress, "evaluate", keep)
    done.update(zip(left, new, strict=True))
    return [done[i] for i in sorted(done)]


def _units(rows: Sequence[Mapping[str, Any]], run: Run) -> dict[str, str | None]:
    """The unit of each entry of rows, rms and runs; a condition that is a number is a position."""
    times = [name for name, value in rows[0].items() if isinstance(value, float)]
    known = {**{m.name: m.unit for m in registered()}, **UNITS}
    own = {n: known[n] for n in run.metrics if n in known and n not in BOOKKEEPING}
    return {**dict.fromkeys([*times, "rms"], "s"), "condition": "m", **own}


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


def _draw_signals(runs: Runs, until: float, out: Path, said: Caption, suffix: str) -> None:
    """The figures of contact forces and of the target, the object at REFLECTANCE_X_M."""
    shown = {r.case: r.result for r in runs.values() if r.result}
    forces, targets = new_figure(7.2, 7.0), new_figure(7.2, 4.0)
    rows = forces.subplots(len(CASES), 1, sharex=True)
    for axes, case in zip(rows, CASES, strict=True):
        draw_contact_forces(axes, shown[case])
        axes.set_title(f"Case {case}", fontsize=10)
    lowest = targets.subplots()
    draw_targets(lowest, [(shown[1], "--", "Case 1"), (shown[2], "-", "Case 2")])
    for axes in (rows[-1], lowest):
        axes.set_xlabel("time in s")
        axes.set_xlim(0.0, until)
    for figure, what in ((forces, "contact forces"), (targets, "target position")):
        one_legend(figure)
        title = f"{said.title}: {what}, object at {1e3 * REFLECTANCE_X_M:.0f} mm"
        headed(figure, said._replace(title=title))
        save(figure, out / f"{what.replace(' ', '_')}.{suffix}")


def _draw_times(rows: Sequence[Mapping[str, Any]], out: Path, said: Caption, suffix: str) -> None:
    """The contact times of Cases 1 and 2 side by side, a row of axes for each table."""
    tables = list(dict.fromkeys(r["table"] for r in rows))
    figure = new_figure(9.0, 4.3) if len(tables) == 1 else new_figure(11.0, 8.3)
    axes = figure.subplots(len(tables), 2, sharey="row", squeeze=False)
    for table, pair in zip(tables, axes, strict=True):
        for case, one in enumerate(pair, start=1):
            draw_contact_times(one, [r for r in rows if r["table"] == table], case)
    one_legend(figure)
    headed(figure, said._replace(title=f"{said.title}: contact times, simulated and published"))
    save(figure, out / f"contact_times.{suffix}")


SOURCES: Mapping[Source, Evaluation] = {
    # The slowest contact is at 2.7 s, and the layers settle with a time constant of 0.2 s.
    "simulation": Evaluation(
        "Published simulation", 4.5, None, 3.0, simulation_rms, True, markdown
    ),
    # Twice the slowest published contact; a grasp goes on for 1.5 s once both fingers touch.
    "experiment": Evaluation(
        "Published experiments", 10.0, 1.5, 5.0, bench_rms, False, bench_markdown
    ),
}
