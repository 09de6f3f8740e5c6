"""The command run."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import click

from ...errors import InputError, SimulationError
from ...files import check_folder
from ...master.engine import ENGINES, Engine
from ...master.simulation import MOST, simulate
from ...realtime.options import Realtime
from ...recording.mdf import check_mdf
from ...recording.result import Result
from ...report.plot import new_figure
from ...report.timing import draw_timing
from ...system.description import System
from ..frame import INTERRUPTED, chosen_metrics, fail, json_option, metrics_option, pair
from ..options import SystemOptions, system_options, taken
from ..realtime import chosen_realtime, realtime_options, timing_lines
from ..step_study import StepStudyOptions, step_study_options


@dataclass(frozen=True, slots=True)
class Outputs:
    """What is written of a run: its folder, a picture, an MDF file."""

    out: Path | None
    plot: bool
    mdf: bool

    def check(self) -> None:
        """InputError where something could not be written, before the run and not after."""
        if self.mdf and not self.out:
            raise InputError("--mdf: must come with --out, the folder for signals.mf4")
        if self.mdf:
            check_mdf()
        if self.plot:
            new_figure(1.0, 1.0)
        if self.out or self.plot:
            check_folder(self.out or Path())

    def write(self, result: Result) -> None:
        """Write a result."""
        if self.out:
            result.to_csv(self.out / "signals.csv")
            result.to_json(self.out / "run.json")
        if self.out and self.mdf:
            result.to_mdf(self.out / "signals.mf4")
        if self.plot:
            self._draw(result, self.out or Path())

    def _draw(self, result: Result, folder: Path) -> None:
        """The grasp, or all signals where it is none, and the timing if it was paced."""
        picture = folder / f"{result.drawing.stem}.png"
        result.plot(picture)
        click.echo(f"drew {picture}", err=True)
        if result.timing:
            draw_timing(result.timing, float(result.time[-1]), folder / "timing.png")
            click.echo(f"drew {folder / 'timing.png'}", err=True)


@dataclass(frozen=True, slots=True)
class Running:
    """How a run is made: what is recorded, by which engine, which metrics."""

    every: int
    engine: Engine
    metric_files: tuple[Path, ...]


@click.command()
@click.argument("system", required=False, type=click.Path(path_type=Path))
@system_options
@click.option("--swap", "swaps", multiple=True, metavar="COMPONENT=FMU")
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
@metrics_option
@step_study_options
@realtime_options
@json_option
def run(swaps: tuple[str, ...], as_json: bool, **given: Any) -> int:
    """Run SYSTEM, a .toml or .ssp file; by default the built-in grasp.

    \b
    Example: grasp-cosim run --case 1 --set plant.initial_object_position=0.02 --out results --plot
    In real time: grasp-cosim run --realtime --step 1e-3 --priority 80 --cpu 1 --out results
    """
    outputs, question = taken(Outputs, given), taken(StepStudyOptions, given)
    paced = chosen_realtime(given)
    question.check(paced is not None)
    options = taken(SystemOptions, given)
    fmus = dict(pair("--swap", text, "COMPONENT=FMU") for text in swaps)
    system = options.load().revised(fmus, options.values, ("--swap", "--set"))
    running = taken(Running, given)
    if question.step_study:
        metrics = chosen_metrics(running.metric_files)
        return question.run(system, metrics, outputs.out, outputs.plot, as_json)
    outputs.check()
    return _run(system, running, outputs, paced, as_json)


def _run(
    system: System, running: Running, outputs: Outputs, paced: Realtime | None, as_json: bool
) -> int:
    """Simulate, write and print what came of it; the exit code."""
    metrics = chosen_metrics(running.metric_files)
    try:
        result = simulate(
            system,
            progress=True,
            every=running.every,
            engine=running.engine,
            realtime=paced,
            metrics=metrics,
        )
    except SimulationError as error:
        if error.result:
            outputs.write(error.result)
            if outputs.out:
                click.echo(f"kept what was recorded, in {outputs.out}", err=True)
        raise
    outputs.write(result)
    for line in result.log[len(system.notes) :]:
        click.echo(line, err=True)
    click.echo(json.dumps(_as_json(result)) if as_json else _summary(result))
    if not result.complete:
        message = f"interrupted at t = {result.time[-1]:.6g} s; kept what was recorded"
        return fail(message, INTERRUPTED)
    return 0


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
