"""The command that simulates once."""

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..base.errors import InputError, RunInterruptedError, SimulationError
from ..exchange.listener import Listener
from ..master.simulation import simulate
from ..recording.folder import FORMS, Form, RunFolder
from ..recording.mdf import check_mdf
from ..recording.result import Result
from ..report import terminal
from ..system.description import System
from ..system.structure import SCHEMES
from .frame import (
    INTERRUPTED,
    NEGATIVE,
    PATH,
    check_outputs,
    chosen_metrics,
    fail,
    is_quiet,
    json_option,
    metrics_option,
    say,
    show,
    waiting,
)
from .options import (
    SystemOptions,
    chosen_system,
    native_option,
    natively,
    record_option,
    swap_options,
    system_options,
    values_option,
)

if TYPE_CHECKING:
    from ..live.live_page import LivePage


@click.command()
@click.argument("system", required=False, type=PATH)
@system_options
@click.option(
    "--scheme",
    type=click.Choice(SCHEMES),
    help="Step the components one after the other (sequential) or all at once (jacobi). "
    "Default: the scheme of SYSTEM, or sequential.",
)
@swap_options
@click.option(
    "--input",
    type=PATH,
    help="Drive inputs and tunable parameters by a table with the column time and columns such as "
    "plant.force.",
)
@record_option
@values_option
@metrics_option
@native_option
@click.option("--realtime", is_flag=True, help="Pace the run by the clock, and print its timing.")
@click.option(
    "--show",
    "shows_page",
    is_flag=True,
    help="With --realtime: serve a page on this computer that shows the run and changes its "
    "parameters while it goes on. The command prints the address.",
)
@click.option(
    "--every", type=click.IntRange(1), default=1, metavar="N", help="Record only every N-th step."
)
@click.option("-o", "--out", type=PATH, help="Folder for the signals and run.json.")
@click.option(
    "--format",
    "form",
    type=click.Choice(FORMS),
    default="csv",
    help="Format of the signals in --out. Use arrow for long runs.",
)
@click.option(
    "--plot",
    is_flag=True,
    help="Draw grasp.png in --out or in the current folder. With --realtime, draw timing.png, too.",
)
@click.option("--mdf", is_flag=True, help="Write signals.mf4 (ASAM MDF 4) to --out, too.")
@json_option
def run(
    metric_files: tuple[Path, ...],
    native: bool | None,
    realtime: bool,
    shows_page: bool,
    every: int,
    out: Path | None,
    form: Form,
    plot: bool,
    mdf: bool,
    as_json: bool,
    **system_options: Any,
) -> int:
    """Run a system once.

    SYSTEM is a .toml or .ssp file, or the run.json of a run, which is repeated. The default is the
    built-in grasp. The command prints the metrics. The exit code is 1 if the verdict of the system
    fails or no signal is recorded.

    \b
    Example: grasp-cosim run --case 1 --out results --plot
    Change a value: grasp-cosim run --set plant.initial_object_position=0.02
    Record other signals: grasp-cosim run --record 'plant.*,controller.force[1]'
    Run in real time: grasp-cosim run --realtime --step 1e-3 --out results
    Change parameters on the way: grasp-cosim run --realtime --show --stop 60 --out results
    Repeat that run: grasp-cosim run results/run.json --out repeated
    """
    if shows_page and not realtime:
        raise InputError("--show: needs --realtime, the run that the page follows")
    if mdf and not out:
        raise InputError("--mdf: needs --out, the folder for signals.mf4")
    if form != "csv" and not out:
        raise InputError(f"--format {form}: needs --out, the folder for signals.{form}")
    options = SystemOptions(**system_options)
    for override in options.overrides:
        if override.place.startswith("realtime.") and not realtime:
            text = f"{override.label}={override.value}"
            raise InputError(f"{text}: does nothing without --realtime")
    system, metrics = chosen_system(options), chosen_metrics(metric_files)
    if mdf:
        check_mdf()
    check_outputs(out, plot)
    chosen = natively(system, native)
    page = _page_of(chosen, every) if shows_page else None
    if page:
        chosen = page.system
    command = ("grasp-cosim", *click.get_current_context().find_root().obj)
    with RunFolder(out, chosen, command, realtime, form=form) if out else nullcontext() as folder:

        def finish(result: Result, error: SimulationError | None) -> None:
            _write(result, folder, out, plot, mdf)
            if error is None:
                show(as_json, terminal.run_json(result), terminal.run_text(result))
            elif out:
                say(f"kept what was recorded, in {out}")

        listeners: list[Listener] = [folder] if folder else []
        if page:
            listeners.append(page.feed)

        def note(line: str) -> None:
            say(line)
            if page:
                page.note(line)

        try:
            with page or nullcontext():
                if page:
                    say(f"live: {page.address}", always=True)
                result = simulate(
                    chosen,
                    progress=not is_quiet(),
                    every=every,
                    listeners=listeners,
                    realtime=realtime,
                    metrics=metrics,
                    note=note,
                    finish=finish,
                    requests=page.requests if page else None,
                )
        except RunInterruptedError as interrupted:
            result = interrupted.result
    if not result.came_to_its_end:
        message = f"interrupted at t = {result.end_time:.6g} s; kept what was recorded"
        return fail(message, INTERRUPTED)
    for criterion in result.verdict:
        if not criterion.passed:
            say(f"verdict: {criterion}")
    is_recorded = result.signals and len(result.time)
    return 0 if is_recorded and result.passed else NEGATIVE  # a line above gives the reason


def _page_of(system: System, every: int) -> "LivePage":
    """The page that is to follow the run of a system."""
    from ..live.live_page import LivePage  # only here: most runs have none

    return LivePage(system, every)


def _write(
    result: Result, folder: RunFolder | None, out: Path | None, plot: bool, mdf: bool
) -> None:
    """Finish the folder of a run, and write or draw what else there is to be of it."""
    if folder:
        folder.finish(result)
    parts = result.windows if result.is_triggered else (result,)
    if out and mdf and result.signals:
        for part in parts:
            part.to_mdf(out / part.subfolder / "signals.mf4")
    if plot and result.numbers:
        from ..report.timing_chart import draw_pictures  # only here: most runs draw nothing

        with waiting("drawing"):
            for part in dict.fromkeys((*parts, result)):
                for picture in draw_pictures(part, (out or Path()) / part.subfolder, "png"):
                    say(f"drew {picture}")
