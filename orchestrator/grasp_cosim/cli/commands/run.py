"""The command run."""

import json
from pathlib import Path
from typing import Any

import click

from ...errors import InputError, SimulationError
from ...files import check_folder
from ...master.engine import ENGINES, Engine
from ...master.simulation import MOST, simulate
from ...recording.mdf import check_mdf
from ...recording.result import Result
from ...report.plot import new_figure
from ...report.timing import draw_timing
from ...system.description import SCHEMES
from ..frame import (
    INTERRUPTED,
    chosen_metrics,
    fail,
    json_option,
    load_system,
    metrics_option,
    pair,
    preset_options,
    with_chosen_presets,
)
from ..realtime import chosen_realtime, realtime_options, timing_lines
from ..step_study import StepStudyRequest, run_step_study


@click.command()
@click.argument("system", required=False, type=click.Path(path_type=Path))
@preset_options
@click.option("--set", "settings", multiple=True, metavar="COMPONENT.VARIABLE=VALUE")
@click.option("--swap", "swaps", multiple=True, metavar="COMPONENT=FMU")
@click.option("--step", type=float, help="Communication step in s.")
@click.option("--stop", type=float, help="Stop time in s.")
@click.option("--scheme", type=click.Choice(SCHEMES))
@click.option("--out", type=click.Path(path_type=Path), help="Folder for signals.csv and run.json.")
@click.option(
    "--plot",
    is_flag=True,
    help="Draw grasp.png, and timing.png with --realtime, in --out or the current folder.",
)
@click.option("--mdf", is_flag=True, help="Write signals.mf4 (ASAM MDF 4) too; needs --out.")
@click.option(
    "--every", type=click.IntRange(1, MOST), default=1, help="Record each N-th step only."
)
@click.option("--engine", type=click.Choice(ENGINES), default="auto", show_default=True)
@click.option(
    "--step-study", is_flag=True, help="Repeat the run over steps: is --step small enough?"
)
@click.option("--of", "quantities", multiple=True, help="Metric or signal of a step study.")
@click.option("--tolerance", type=float, help="Of a step study, in the unit of --of; 1e-3 s.")
@metrics_option
@realtime_options
@json_option
def run(
    system: Path | None,
    presets: tuple[str, ...],
    case: int | None,
    bench: bool,
    settings: tuple[str, ...],
    swaps: tuple[str, ...],
    step: float | None,
    stop: float | None,
    scheme: str | None,
    out: Path | None,
    plot: bool,
    mdf: bool,
    every: int,
    engine: Engine,
    step_study: bool,
    quantities: tuple[str, ...],
    tolerance: float | None,
    metric_files: tuple[Path, ...],
    as_json: bool,
    realtime: bool,
    **pacing: Any,
) -> int:
    """Run SYSTEM, a .toml or .ssp file; by default the built-in grasp.

    \b
    Example: grasp-cosim run --case 1 --set plant.initial_object_position=0.02 --out results --plot
    In real time: grasp-cosim run --realtime --step 1e-3 --priority 80 --cpu 1 --out results
    """
    if tolerance is not None and not step_study:
        raise InputError(f"--tolerance {tolerance!r}: must come with --step-study")
    paced = chosen_realtime(realtime, pacing)
    if paced and step_study:
        raise InputError("--realtime: must not come with --step-study, which is not paced")
    if mdf and not out:
        raise InputError("--mdf: must come with --out, the folder for signals.mf4")
    if mdf:
        check_mdf()
    if quantities and not step_study:
        raise InputError(f"--of {quantities[0]}: must come with --step-study")
    metrics = chosen_metrics(metric_files)
    chosen = load_system(system, step, stop)
    fmus = dict(pair("--swap", text, "COMPONENT=FMU") for text in swaps)
    values = dict(pair("--set", text, "COMPONENT.VARIABLE=VALUE") for text in settings)
    chosen = with_chosen_presets(chosen, presets, case, bench)
    chosen = chosen.revised(fmus, values, ("--swap", "--set")).with_experiment(step, stop, scheme)
    if step_study:
        asked = StepStudyRequest(chosen, quantities, tolerance, metrics)
        return run_step_study(asked, out, plot, as_json)
    if plot:
        new_figure(1.0, 1.0)  # says at once if matplotlib is missing
    if out or plot:
        check_folder(out or Path())
    try:
        result = simulate(
            chosen, progress=True, every=every, engine=engine, realtime=paced, metrics=metrics
        )
    except SimulationError as error:
        if error.result:
            _write(error.result, out, plot, mdf)
            if out:
                click.echo(f"kept what was recorded, in {out}", err=True)
        raise
    _write(result, out, plot, mdf)
    for line in result.log[len(chosen.notes) :]:
        click.echo(line, err=True)
    click.echo(json.dumps(_as_json(result)) if as_json else _summary(result))
    if not result.complete:
        message = f"interrupted at t = {result.time[-1]:.6g} s; kept what was recorded"
        return fail(message, INTERRUPTED)
    return 0


def _write(result: Result, out: Path | None, plot: bool, mdf: bool) -> None:
    if out:
        result.to_csv(out / "signals.csv")
        result.to_json(out / "run.json")
    if out and mdf:
        result.to_mdf(out / "signals.mf4")
    if plot:
        _draw(result, out or Path())


def _draw(result: Result, folder: Path) -> None:
    """The grasp, or all signals where it is none, and the timing if it was paced."""
    picture = folder / f"{result.drawing.stem}.png"
    result.plot(picture)
    click.echo(f"drew {picture}", err=True)
    if result.timing:
        draw_timing(result.timing, float(result.time[-1]), folder / "timing.png")
        click.echo(f"drew {folder / 'timing.png'}", err=True)


def _as_json(result: Result) -> dict[str, Any]:
    timing = {"realtime": result.timing.as_dict()} if result.timing else {}
    missing = list(result.measured.missing)
    return {
        **result.metrics,
        "units": result.metric_units,
        **({"missing_metrics": missing} if missing else {}),
        **timing,
    }


def _summary(result: Result) -> str:
    m = result.metrics
    lines = [
        f"{m['steps']} steps of {1e3 * m['step']:g} ms, {m['scheme']}, "
        f"{m['real_time_factor']:.2f} times as fast as real time"
    ]
    lines += [
        f"{metric.title:22s}{_numbers(m[metric.name], metric.factor)} "
        f"{metric.display_unit}".rstrip()
        for metric in result.measured.metrics
    ]
    lines += result.measured.missing
    return "\n".join([*lines, *(timing_lines(result.timing) if result.timing else ())])


def _numbers(value: Any, factor: float) -> str:
    values = value if isinstance(value, list) else [value]
    return "  ".join(_number(v, factor) for v in values)


def _number(value: float | bool | None, factor: float) -> str:
    if isinstance(value, bool):
        return f"{'yes' if value else 'no':>8}"
    return "    none" if value is None else f"{factor * value:8.3f}"
