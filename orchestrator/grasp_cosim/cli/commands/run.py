"""The command run."""

from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path
from typing import Any

import click

from ...errors import InputError, SimulationError
from ...master.engine import ENGINES, Engine
from ...master.simulation import MOST, simulate
from ...numerals import counted, fixed
from ...recording.folder import RunFolder
from ...recording.mdf import check_mdf
from ...recording.result import Result
from ...report.timing import draw_result
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
    metrics_option,
    say,
    show,
    title_option,
    waiting,
)
from ..native import native_option, natively
from ..options import (
    chosen_stimuli,
    chosen_system,
    input_options,
    isolations,
    names_options,
    replacements,
    set_values,
    swap_option,
    swapped_fmus,
    system_options,
)
from ..realtime import chosen_realtime, realtime_options, timing_lines
from ..step_study import check_step_study, step_study_options, study_step


@click.command()
@click.argument("system", required=False, type=PATH)
@system_options
@swap_option
@names_options
@input_options
@click.option("--out", type=PATH, help="Folder for signals.csv and run.json.")
@click.option(
    "--plot",
    is_flag=True,
    help="Draw grasp.png, and timing.png with --realtime, in --out or the current folder.",
)
@format_option
@title_option
@click.option("--mdf", is_flag=True, help="Write signals.mf4 (ASAM MDF 4) too; needs --out.")
@click.option(
    "--every", type=click.IntRange(1, MOST), default=1, help="Record each N-th step only."
)
@click.option(
    "--isolation",
    "isolation",
    multiple=True,
    metavar="[COMPONENT=]none|process",
    help="Where all FMUs run, or one: in a process of its own, or none. Default: as SYSTEM says.",
)
@native_option("as SYSTEM names them; with --step-study, native where there is a C compiler.")
@click.option(
    "--engine",
    type=click.Choice(ENGINES),
    default="auto",
    show_default=True,
    help="The loop over the steps in Python, or in C; auto: in C where that pays.",
)
@metrics_option
@step_study_options
@realtime_options
@json_option
def run(
    swaps: tuple[str, ...],
    mdf: bool,
    every: int,
    engine: Engine,
    metric_files: tuple[Path, ...],
    title: str,
    as_json: bool,
    **given: Any,
) -> int:
    """Run SYSTEM, a .toml or .ssp file; by default the built-in grasp.

    \b
    Example: grasp-cosim run --case 1 --set plant.initial_object_position=0.02 --out results --plot
    In real time: grasp-cosim run --realtime --step 1e-3 --priority 80 --cpu 1 --out results
    """
    paced, out = chosen_realtime(given), given["out"]
    check_step_study(given, paced is not None)
    system = _chosen(given, swaps)
    metrics = chosen_metrics(metric_files)
    if given["step_study"]:
        return study_step(system, metrics, given, as_json)
    if mdf and not out:
        raise InputError("--mdf: must come with --out, the folder for signals.mf4")
    if mdf:
        check_mdf()
    check_outputs(out, given["plot"])
    with (
        natively(system, given["native"], as_named=True) as chosen,
        _folder(out, chosen, paced is not None, title) as folder,
    ):
        try:
            result = simulate(
                chosen,
                progress=not is_quiet(),
                every=every,
                listeners=[folder] if folder else (),
                engine=engine,
                realtime=paced or False,
                metrics=metrics,
                note=say,
            )
        except SimulationError as error:
            if error.result:
                _write(error.result.titled(title), folder, given, mdf)
                if out:
                    say(f"kept what was recorded, in {out}")
            raise
        _write(result.titled(title), folder, given, mdf)
    show(as_json, _as_json(result), _summary(result))
    if not result.complete:
        message = f"interrupted at t = {result.time[-1]:.6g} s; kept what was recorded"
        return fail(message, INTERRUPTED)
    return 0 if result.signals else NEGATIVE  # as the log says


def _folder(
    out: Path | None, system: System, paced: bool, title: str
) -> RunFolder | nullcontext[None]:
    """The folder of the run, if it is to have one."""
    command = ("grasp-cosim", *click.get_current_context().find_root().obj)
    return RunFolder(out, system, command, paced, title) if out else nullcontext()


def _chosen(given: dict[str, Any], swaps: tuple[str, ...]) -> System:
    """The system with the FMUs and values of the command line; what is left out is said."""
    fmus = swapped_fmus(swaps)
    stimuli = chosen_stimuli(given)
    system = chosen_system(given, fmus, stimuli)
    new = replacements(given, fmus)
    swapped = system.revised(new, set_values(given["settings"]), ("--swap", "--set"))
    for note in swapped.notes[len(system.notes) :]:
        say(note)
    if stimuli:
        swapped = swapped.with_input(replace(stimuli, partial=False))  # all FMUs are there now
    return isolations(swapped, given["isolation"])


def _write(result: Result, folder: RunFolder | None, given: Mapping[str, Any], mdf: bool) -> None:
    out, suffix = given["out"], given["suffix"]
    if folder:
        folder.finish(result)
    if not result.signals:
        return
    if out and mdf:
        result.to_mdf(out / "signals.mf4")
    if given["plot"] and result.numbers:
        with waiting("drawing"):
            for picture in draw_result(result, out or Path(), suffix):
                say(f"drew {picture}")


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
        f"{counted(m['steps'], 'step')} of {1e3 * m['step']:g} ms, {m['scheme']}, "
        f"{fixed(m['real_time_factor'], 2)} times as fast as real time"
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
    return "    none" if value is None else fixed(factor * value, 3, width=8)
