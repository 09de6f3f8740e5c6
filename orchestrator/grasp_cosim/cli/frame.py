"""What the commands share: the group, exit codes, errors as one line."""

import traceback
from collections.abc import Callable, Sequence
from functools import reduce
from pathlib import Path
from typing import Any

import click

from ..errors import InputError
from ..grasp.presets import with_preset
from ..grasp.system import grasp_system
from ..metrics.metric import Metric, load_metrics
from ..system.description import System

NEGATIVE, WRONG, FAILED, INTERRUPTED = 1, 2, 3, 130
"""Exit codes beside 0: result negative, input wrong, failure on the way, Ctrl-C."""

Command = Callable[..., Any]


def _together(*options: Command) -> Command:
    """Several options as one decorator."""

    def decorate(command: Command) -> Command:
        return reduce(lambda made, option: option(made), reversed(options), command)

    return decorate


json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")


@click.group(context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="grasp-cosim")
@click.option("--debug", is_flag=True, help="Show the traceback of an error.")
def cli(debug: bool) -> None:
    """FMI co-simulation of a delicate grasp.

    \b
    grasp-cosim run [SYSTEM]         a closed loop; by default the published grasp, from FMUs
    grasp-cosim report RUN           a page and figures of a run that was recorded
    grasp-cosim evaluate             the published table and figures, side by side with ours
    grasp-cosim identify             friction from contact times or from a recorded log
    grasp-cosim qualify FMU --as C   whether an FMU may take the place of component C
    grasp-cosim sweep STUDY          many runs, in parallel; begun again, it goes on
    grasp-cosim ssp SYSTEM -o FILE   a system as an SSP archive
    grasp-cosim proxy FMU -o FILE    an FMU with the same variables that talks to a peer
    grasp-cosim serve FMU            an FMU as a test bench, for a proxy
    grasp-cosim relay --to HOST:PORT a bad network on the way there, reproducible
    grasp-cosim build                the FMUs
    grasp-cosim inspect FMU          an FMU's interface
    grasp-cosim doctor FMU           whether this machine will load an FMU
    grasp-cosim COMMAND --help       options and an example
    """


preset_options = _together(
    click.option("--preset", "presets", multiple=True, help="Values that the system file names."),
    click.option("--case", type=click.IntRange(0, 2), help="Short for --preset case_0, ..._2."),
    click.option("--bench", is_flag=True, help="Short for --preset bench."),
)
"""The options that with_chosen_presets() takes."""

metrics_option = click.option(
    "--metrics",
    "metric_files",
    multiple=True,
    type=click.Path(path_type=Path),
    help="A Python file with metrics of your own.",
)


def with_chosen_presets(
    system: System, presets: Sequence[str], case: int | None, bench: bool
) -> System:
    """The system with what the preset_options ask for, the case last."""
    names = [*presets, *(["bench"] if bench else []), *([] if case is None else [f"case_{case}"])]
    return reduce(with_preset, names, system)


def chosen_metrics(files: Sequence[Path]) -> tuple[Metric, ...]:
    """The metrics of the files that metrics_option names; InputError where one fails."""
    return tuple(m for path in files for m in load_metrics(path))


def load_system(path: Path | None, step: float | None, stop: float | None) -> System:
    """The system of a file, by default the built-in grasp; what its reader notes is printed."""
    if path is None:
        return grasp_system()
    system = System.load(path, step=step, stop=stop)
    for note in system.notes:
        click.echo(note, err=True)
    return system


def pair(option: str, text: str, form: str) -> tuple[str, str]:
    """Both sides of 'LEFT=RIGHT'; InputError, naming the form, where text is not like that."""
    left, equals, right = text.partition("=")
    if not (left and equals and right):
        raise InputError(f"{option} {text!r}: must be {form}")
    return left, right


def fail(message: str, code: int, debug: bool = False) -> int:
    """Print the message as one line on standard error; return the exit code."""
    if debug:
        traceback.print_exc()
    click.echo(f"grasp-cosim: {message}", err=True)
    return code
