"""The command sweep."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ...errors import InputError
from ...files import FMU_FOLDER, check_nature
from ...numerals import fixed
from ...report.sweep import draw_sweep
from ...sweep.limits import Reached, reached
from ...sweep.read import Made, read_studies, study_file
from ...sweep.sensitivity import Sensitivity
from ...sweep.store import Store
from ...sweep.study import STATISTICS, Pictures, Study
from ...sweep.sweep import RUNS, Sweep
from ...sweep.sweep import sweep as run_study
from ..completion import studies
from ..frame import (
    INTERRUPTED,
    NEGATIVE,
    PATH,
    check_outputs,
    chosen_metrics,
    fail,
    is_quiet,
    json_option,
    load_system,
    metrics_option,
    say,
    show,
    waiting,
    with_controller,
    with_preset,
)
from ..native import all_natively, many_runs_option
from ..options import controller_option


@click.command()
@click.argument("study", shell_complete=studies)
@controller_option
@click.option("--seed", type=click.IntRange(0), help="Draw other runs than the study's own seed.")
@click.option("--out", type=PATH, help="Folder of the runs; by default the study's name, here.")
@click.option(
    "--workers", type=click.IntRange(1), help="Processes; by default one for each processor."
)
@click.option("--scheduler", metavar="ADDRESS", help="Of a Dask cluster, like tcp://host:8786.")
@click.option("--plot", is_flag=True, help="Draw what the study asks for under [figures].")
@metrics_option
@many_runs_option
@json_option
def sweep(
    study: str,
    controller: str | None,
    seed: int | None,
    out: Path | None,
    workers: int | None,
    scheduler: str | None,
    plot: bool,
    metric_files: tuple[Path, ...],
    native: bool | None,
    as_json: bool,
) -> int:
    """Do all runs of STUDY, a .toml file or a built-in one.

    Built in: reflectance_map, grasp_sensitivity, bench_monte_carlo, and those of the adaptive
    controller, which docs/colour.md tells of.

    Finished runs are kept in the folder: the same command goes on where it was ended. Exit code 1:
    a limit that the study sets is missed, or every run failed.

    \b
    Example: grasp-cosim sweep reflectance_map --out map --plot
    """
    if workers is not None and scheduler is not None:
        raise InputError("--workers: must not come with --scheduler, whose workers there are")
    path, built_in = _file(study)
    folder = out or Path(path.stem if seed is None else f"{path.stem}-{seed}")
    fmus = FMU_FOLDER if built_in else None
    made = Made(load_system, with_preset, with_controller, fmus, controller)
    variants = read_studies(path, made, chosen_metrics(metric_files), seed)
    if plot and variants[0].pictures == Pictures():
        raise InputError(f"--plot: {path.name} has no [figures]; must say what to draw")
    check_outputs(folder, plot)
    if scheduler is not None and native is None:  # whose machines may be others
        native = False
    try:
        with all_natively([v.system for v in variants], native) as systems:
            done = [
                run_study(
                    replace(v, system=s), folder / v.variant, workers, scheduler, not is_quiet()
                )
                for v, s in zip(variants, systems, strict=True)
            ]
    except KeyboardInterrupt:
        kept = sum(Store(folder / v.variant).kept() for v in variants)
        of = f"{kept} of {sum(v.runs for v in variants)} runs are kept in {folder}"
        return fail(f"interrupted; {of}, the same command goes on", INTERRUPTED)
    if plot:
        with waiting("drawing"):
            for picture in draw_sweep(done, folder):
                say(f"drew {picture}")
    limits = reached(done)
    show(as_json, _as_json(path.name, folder, done, limits), _as_text(done, limits))
    failed = all(d.failed == d.study.runs for d in done)
    return NEGATIVE if failed or not all(limit.kept for limit in limits) else 0


def _file(study: str) -> tuple[Path, bool]:
    """The file of a study, given by its path or by its name, where it is a built-in one."""
    path = Path(study)
    check_nature(path, "study")
    if path.suffix == ".toml" and path.is_file():
        return path, False
    from ...grasp.presets import STUDIES

    return study_file(study, STUDIES), True


def _as_json(
    name: str, folder: Path, done: Sequence[Sweep], limits: Sequence[Reached]
) -> dict[str, Any]:
    """Of a study without variants, its summary; else those of the variants by name."""
    found = [limit.as_json() for limit in limits]
    if not done[0].study.variant:
        return {**done[0].as_json(), "limits": found}
    variants = {d.study.variant: d.as_json() for d in done}
    return {"study": name, "folder": str(folder), "variants": variants, "limits": found}


def _as_text(done: Sequence[Sweep], limits: Sequence[Reached]) -> str:
    lines = [line for d in done for line in _head(d)]
    wide = max(len(d.study.variant) for d in done) + 2 if len(done) > 1 else 0
    lines.append(f"{'':28s}{'':{wide}s}" + "".join(f"{h:>11s}" for h in ("runs", *STATISTICS)))
    summaries = [(d.study.variant, d.table.summary()) for d in done]
    for name in dict.fromkeys(name for _, summary in summaries for name in summary):
        for variant, summary in summaries:
            row = summary.get(name, {"runs": 0})
            numbers = (
                "-" if (n := row.get(h)) is None else f"{n:.4g}" for h in ("runs", *STATISTICS)
            )
            lines.append(
                f"{name:28s}{variant if wide else '':{wide}s}"
                + "".join(f"{n:>11s}" for n in numbers)
            )
    for d in done:
        for found in d.sensitivities:
            lines += _sensitivity_lines(found)
    return "\n".join([*lines, *(_limit_line(done[0].study, limit) for limit in limits)])


def _head(done: Sweep) -> list[str]:
    lines = [
        f"{done.study.name}: {len(done.outcomes)} runs, {done.resumed} of them done before, "
        f"{done.failed} failed; in {done.folder / RUNS}"
    ]
    error = next((o for o in done.outcomes if o.error is not None), None)
    if error is not None:
        lines.append(f"the first that failed, {error.index}: {error.error}")
    return lines


def _limit_line(study: Study, found: Reached) -> str:
    """Like "kept    adaptive: time_difference: greatest 0.02806 s, at most 0.03"."""
    limit = found.limit
    of = f"{found.variant}: " if found.variant else ""
    beside = f" from {limit.reference}" if limit.reference else ""
    value = "none" if found.value is None else f"{found.value:.4g}"
    unit = study.unit(found.column) or ""
    missing = f"; {found.missing} runs have none" if found.missing else ""
    return (
        f"{'kept' if found.kept else 'MISSED':8s}{of}{found.column}{beside}: {limit.statistic} "
        f"{value} {unit}, at most {limit.most:g}{missing}"
    )


def _sensitivity_lines(found: Sensitivity) -> list[str]:
    lines = [f"variance of {found.metric}, {found.rows} of {found.of} rows complete, 95 %:"]
    for i in found.parameters:
        first, total = (
            f"{fixed(value, 3, width=6)} ({fixed(low, 3)} to {fixed(high, 3)})"
            for value, (low, high) in ((i.first, i.first_interval), (i.total, i.total_interval))
        )
        lines.append(f"  {i.parameter:26s} alone {first:26s} in all {total}")
    return lines
