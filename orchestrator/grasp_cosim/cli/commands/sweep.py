"""The command sweep."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ...errors import InputError, choices
from ...files import check_nature
from ...numerals import fixed
from ...report.sweep import draw_sweep
from ...sweep.limits import Reached, reached
from ...sweep.read import Made, read_studies, study_file
from ...sweep.sensitivity import Sensitivity
from ...sweep.store import Store
from ...sweep.study import STATISTICS, Parameter, Pictures, Study
from ...sweep.sweep import RUNS, Sweep
from ...sweep.sweep import sweep as run_study
from ...sweep.vary import VARY, varied
from ...system.description import System
from ..frame import (
    INTERRUPTED,
    NEGATIVE,
    PATH,
    check_outputs,
    chosen_metrics,
    fail,
    format_option,
    is_quiet,
    json_option,
    load_system,
    metrics_option,
    say,
    show,
    title_option,
    waiting,
    with_controller,
    with_preset,
)
from ..options import (
    chosen_system,
    many_runs_option,
    natively,
    set_values,
    swap_option,
    system_options,
)

OF_VARY = {
    "--system": "system", "--of": "of", "--preset": "presets", "--case": "case",
    "--set": "settings", "--step": "step", "--stop": "stop", "--scheme": "scheme",
    "--swap": "swaps",
}  # fmt: skip
"""Options that a study without a file has, by their names, and what their values are called."""


@click.command()
@click.argument("study", required=False)
@click.option(
    "--vary",
    "varying",
    multiple=True,
    metavar="COMPONENT.VARIABLE=START:END:COUNT",
    help="In place of STUDY: so many values, or those of a list like 0.3,0.57,1.2, in the FMU's "
    "unit. Of several, every combination.",
)
@click.option("--system", type=PATH, help="With --vary: a .toml or .ssp file. Default: the grasp.")
@click.option(
    "--of",
    multiple=True,
    metavar="NAME",
    help="With --vary: a metric or signal that --plot draws; of a signal its last value.",
)
@system_options
@swap_option
@click.option("--seed", type=click.IntRange(0), help="Draw other runs than the study's own seed.")
@click.option(
    "--out", type=PATH, help="Folder of the runs; by default the study's name, or sweep, here."
)
@click.option(
    "--workers", type=click.IntRange(1), help="Processes; by default one for each processor."
)
@click.option("--scheduler", metavar="ADDRESS", help="Of a Dask cluster, like tcp://host:8786.")
@click.option(
    "--plot",
    is_flag=True,
    help="Draw what the study asks for under [figures], or --of over what --vary varies.",
)
@format_option
@title_option
@metrics_option
@many_runs_option
@json_option
def sweep(
    study: str | None,
    workers: int | None,
    scheduler: str | None,
    plot: bool,
    suffix: str,
    title: str,
    native: bool | None,
    as_json: bool,
    **given: Any,
) -> int:
    """Do all runs of STUDY, a .toml file or a built-in one.

    Built in: reflectance_map, grasp_sensitivity, bench_monte_carlo, and those of the adaptive
    controller. docs/studies.md tells of all, and how to write one's own.

    Without a file, --vary says what varies. Finished runs are kept in the folder: the same command
    goes on where it was ended. Exit code 1: a limit that the study sets is missed, or every run
    failed.

    \b
    Example: grasp-cosim sweep reflectance_map --out map --plot
    Without a file: grasp-cosim sweep --vary plant.initial_object_position=0:0.05:11 --case 1 --plot
    """
    if workers is not None and scheduler is not None:
        raise InputError("--workers: must not come with --scheduler, whose workers there are")
    name, folder, variants = _chosen(study, plot, given)
    check_outputs(folder, plot)
    if scheduler is not None and native is None:  # whose machines may be others
        native = False
    try:
        chosen = [replace(v, system=natively(v.system, native)) for v in variants]
        done = [
            run_study(v, folder / v.variant, workers, scheduler, not is_quiet()) for v in chosen
        ]
    except KeyboardInterrupt:
        kept = sum(Store(folder / v.variant).kept() for v in variants)
        of = f"{kept} of {sum(v.runs for v in variants)} runs are kept in {folder}"
        return fail(f"interrupted; {of}, the same command goes on", INTERRUPTED)
    if plot:
        with waiting("drawing"):
            for picture in draw_sweep(done, folder, suffix, title):
                say(f"drew {picture}")
    limits = reached(done)
    show(as_json, _as_json(name, folder, done, limits), _as_text(done, limits))
    failed = all(d.failed == d.study.runs for d in done)
    return NEGATIVE if failed or not all(limit.kept for limit in limits) else 0


def _chosen(
    study: str | None, plot: bool, given: Mapping[str, Any]
) -> tuple[str, Path, tuple[Study, ...]]:
    """The name of a study, the folder of its runs, and its variants; of a file or of --vary."""
    metrics, seed, out = chosen_metrics(given["metric_files"]), given["seed"], given["out"]
    if given["varying"]:
        if study is not None:
            raise InputError(f"{study}: must not come with {VARY}, which is a study without a file")
        if seed is not None:
            raise InputError(f"--seed {seed}: {VARY} has nothing that is random; must be left out")
        made = varied(_system(given), given["varying"], given["of"], metrics, plot=plot)
        return VARY, out or Path("sweep"), (made,)
    if study is None:
        raise InputError(f"no STUDY; must be a .toml file, the name of a built-in one, or {VARY}")
    for option, key in OF_VARY.items():
        value = given[key]
        if not (value is None or value is False or value == ()):
            raise InputError(f"{option}: must come with {VARY}; a study says it itself")
    path, built_in = _file(study)
    fmus = load_system().components[0].fmu.parent if built_in else None
    reader = Made(load_system, with_preset, with_controller, fmus, given["controller"])
    variants = read_studies(path, reader, metrics, seed)
    if plot and variants[0].pictures == Pictures():
        raise InputError(f"--plot: {path.name} has no [figures]; must say what to draw")
    return path.name, out or Path(path.stem if seed is None else f"{path.stem}-{seed}"), variants


def _system(given: Mapping[str, Any]) -> System:
    """The system with what is the same in all runs that --vary asks for."""
    fixed = set_values(given["settings"])
    for name in (text.partition("=")[0] for text in given["varying"]):
        if name in fixed:
            raise InputError(f"--set {name}: {VARY} varies it, too; must be in one of them")
    return chosen_system(given)


def _file(study: str) -> tuple[Path, bool]:
    """The file of a study, given by its path or by its name, where it is a built-in one.

    Its runs may be in a folder of that name.
    """
    path = Path(study)
    if path.suffix == ".toml" and path.is_file():
        check_nature(path, "study")
        return path, False
    from ...grasp.presets import STUDIES

    if not (STUDIES / f"{study}.toml").is_file():
        check_nature(path, "study")
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
    lines += [_varied(done[0].study, p) for p in done[0].study.parameters]
    heads = "".join(f"{h:>11s}" for h in ("runs", *STATISTICS))
    lines.append(f"{'':28s}{'':{wide}s}{'':5s}{heads}")
    summaries = [(d.study.variant, d.table.summary()) for d in done]
    for name in dict.fromkeys(name for _, summary in summaries for name in summary):
        factor, unit = done[0].study.shown(name)
        for variant, summary in summaries:
            row = summary.get(name, {"runs": 0})
            numbers = "".join(f"{_number(row.get(h), factor):>11s}" for h in STATISTICS)
            of = variant if wide else ""
            lines.append(f"{name:28s}{of:{wide}s}{unit:5s}{row['runs']:>11}{numbers}")
    for d in done:
        for found in d.sensitivities:
            lines += _sensitivity_lines(found)
    return "\n".join([*lines, *(_limit_line(done[0].study, limit) for limit in limits)])


def _varied(study: Study, parameter: Parameter) -> str:
    """Like "object position: 0 to 50 mm, 11 values"."""
    of = parameter.distribution
    factor, unit = study.shown(parameter.name)
    if any(isinstance(x, bool | str) for x in of.extremes):
        return f"{parameter.name}: {choices(of.extremes)}"
    low, high = (factor * float(end(of.extremes)) for end in (min, max))
    count = f", {of.levels} values" if of.levels else ""
    return f"{parameter.name}: {low:g} to {high:g} {unit}".rstrip() + count


def _number(value: float | None, factor: float) -> str:
    return "-" if value is None else f"{factor * value:.4g}"


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
    """Like "kept    adaptive: time_difference: greatest 0.02806 s, at most 0.03 s"."""
    limit = found.limit
    of = f"{found.variant}: " if found.variant else ""
    beside = f" from {limit.reference}" if limit.reference else ""
    factor, unit = study.shown(found.column)
    value = "none" if found.value is None else f"{_number(found.value, factor)} {unit}".rstrip()
    most = f"{factor * limit.most:g} {unit}".rstrip()
    missing = f"; {found.missing} runs have none" if found.missing else ""
    return (
        f"{'kept' if found.kept else 'MISSED':8s}{of}{found.column}{beside}: {limit.statistic} "
        f"{value}, at most {most}{missing}"
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
