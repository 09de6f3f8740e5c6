"""The command sweep."""

from dataclasses import replace
from pathlib import Path

import click

from ...errors import InputError
from ...numerals import fixed
from ...report.sweep import draw_sweep
from ...sweep.read import read_study, study_file
from ...sweep.sensitivity import Sensitivity
from ...sweep.store import Store
from ...sweep.study import Pictures
from ...sweep.sweep import RUNS, Sweep
from ...sweep.sweep import sweep as run_study
from ...sweep.table import STATISTICS
from ..frame import (
    INTERRUPTED,
    NEGATIVE,
    PATH,
    check_outputs,
    chosen_metrics,
    fail,
    json_option,
    load_system,
    metrics_option,
    say,
    show,
    with_preset,
)
from ..native import many_runs_option, natively


@click.command()
@click.argument("study")
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
    out: Path | None,
    workers: int | None,
    scheduler: str | None,
    plot: bool,
    metric_files: tuple[Path, ...],
    native: bool | None,
    as_json: bool,
) -> int:
    """Do all runs of STUDY: a .toml file, or reflectance_map, grasp_sensitivity, bench_monte_carlo.

    Finished runs are kept in the folder: the same command goes on where it was ended.

    \b
    Example: grasp-cosim sweep reflectance_map --out map --plot
    """
    if workers is not None and scheduler is not None:
        raise InputError("--workers: must not come with --scheduler, whose workers there are")
    path = _file(study)
    folder = out or Path(path.stem)
    chosen = read_study(path, load_system, with_preset, chosen_metrics(metric_files))
    if plot and chosen.pictures == Pictures():
        raise InputError(f"--plot: {path.name} has no [figures]; must say what to draw")
    check_outputs(folder, plot)
    if scheduler is not None and native is None:  # whose machines may be others
        native = False
    try:
        with natively(chosen.system, native) as system:
            chosen = replace(chosen, system=system)
            done = run_study(chosen, folder, workers, scheduler, progress=True)
    except KeyboardInterrupt:
        kept = f"{Store(folder).kept()} of {chosen.runs} runs are kept in {folder}"
        return fail(f"interrupted; {kept}, the same command goes on", INTERRUPTED)
    drawn = draw_sweep(done, folder) if plot else []
    for picture in drawn:
        say(f"drew {picture}")
    show(as_json, done.as_json(), _as_text(done))
    return NEGATIVE if done.failed == chosen.runs else 0


def _file(study: str) -> Path:
    """The file of a study, given by its path or by the name of a built-in one."""
    path = Path(study)
    if path.suffix == ".toml" and path.is_file():
        return path
    from ...grasp.presets import STUDIES

    return study_file(study, STUDIES)


def _as_text(done: Sweep) -> str:
    lines = [
        f"{done.study.name}: {len(done.outcomes)} runs, {done.resumed} of them done before, "
        f"{done.failed} failed; in {done.folder / RUNS}"
    ]
    error = next((o for o in done.outcomes if o.error is not None), None)
    if error is not None:
        lines.append(f"the first that failed, {error.index}: {error.error}")
    lines.append(f"{'':28s}" + "".join(f"{head:>11s}" for head in ("runs", *STATISTICS)))
    for name, row in done.table.summary().items():
        numbers = ("-" if number is None else f"{number:.4g}" for number in row.values())
        lines.append(f"{name:28s}" + "".join(f"{number:>11s}" for number in numbers))
    for found in done.sensitivities:
        lines += _sensitivity_lines(found)
    return "\n".join(lines)


def _sensitivity_lines(found: Sensitivity) -> list[str]:
    lines = [f"variance of {found.metric}, {found.rows} of {found.of} rows complete, 95 %:"]
    for i in found.parameters:
        first, total = (
            f"{fixed(value, 3, width=6)} ({fixed(low, 3)} to {fixed(high, 3)})"
            for value, (low, high) in ((i.first, i.first_interval), (i.total, i.total_interval))
        )
        lines.append(f"  {i.parameter:26s} alone {first:26s} in all {total}")
    return lines
