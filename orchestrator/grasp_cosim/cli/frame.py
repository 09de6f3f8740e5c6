"""Shared by the commands: exit codes, options, errors as one line."""

from __future__ import annotations

import json
import sys
import traceback
from collections.abc import Callable, Collection, Sequence
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..errors import InputError
from ..files import PICTURES, check_folder
from ..plain import on_one_line

if TYPE_CHECKING:
    from ..metrics.metric import Metric
    from ..system.description import System
    from ..system.stimuli import Stimuli

NEGATIVE, WRONG, FAILED, INTERRUPTED, TERMINATED = 1, 2, 3, 130, 143
"""Exit codes beside 0: result negative, input wrong, failure on the way, Ctrl-C, SIGTERM."""

LONGEST = 2000
"""Characters of a message; of a longer one, without --debug, the middle is left out."""

Command = Callable[..., Any]

PATH = click.Path(path_type=Path)
"""The type of an option or argument that is a path."""


def together(*options: Command) -> Command:
    """Several options as one decorator."""
    return lambda command: reduce(lambda made, option: option(made), reversed(options), command)


json_option = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")

format_option = click.option(
    "--format",
    "suffix",
    type=click.Choice(PICTURES),
    default=PICTURES[0],
    show_default=True,
    help="Of the pictures.",
)

title_option = click.option(
    "--title", default="", help="Of pictures and pages. Default: system, case and controller."
)

metrics_option = click.option(
    "--metrics",
    "metric_files",
    multiple=True,
    type=PATH,
    help="A Python file with metrics of your own.",
)


def bind_python_option(more: str = "") -> Command:
    """The option of commands that build FMUs; `more` is added to its help."""

    def given(_: click.Context, __: click.Parameter, python: str | None) -> str | None:
        if python == "":
            raise InputError("--bind-python '': must be a Python program, or left out")
        return python

    return click.option(
        "--bind-python",
        is_flag=False,
        flag_value=sys.executable,
        metavar="[PYTHON]",
        callback=given,
        help=f"For hosts that are not Python: bind to libpython.{more}",
    )


def load_system(
    path: Path | None = None,
    step: float | None = None,
    stop: float | None = None,
    stimuli: Stimuli | None = None,
) -> System:
    """The system of a file, by default the built-in grasp; what its reader notes is printed.

    stimuli go before those that it names.
    """
    from ..system.description import System

    if path is None:
        from ..grasp.system import grasp_system

        return grasp_system().with_input(stimuli)
    system = System.load(path, step=step, stop=stop, input=stimuli)
    for note in system.notes:
        say(note)
    return system


def with_preset(system: System, name: str) -> System:
    """The system with a preset that its file names, or else with one of the built-in grasp."""
    if name in system.presets:
        return system.with_presets(name)
    from ..grasp.presets import with_preset as with_built_in

    return with_built_in(system, name)


def with_controller(system: System, law: str | None, swapped: Collection[str] = ()) -> System:
    """The system with one of the controllers that come with the package; None: as it is."""
    if law is None:
        return system
    from ..grasp.controllers import with_controller as with_shipped

    return with_shipped(system, law, swapped)


def chosen_metrics(files: Sequence[Path]) -> tuple[Metric, ...]:
    """The metrics of the files that metrics_option names; InputError where one fails."""
    from ..metrics.metric import load_metrics

    return tuple(m for path in files for m in load_metrics(path))


def pair(option: str, text: str, form: str) -> tuple[str, str]:
    """Both sides of 'LEFT=RIGHT'; InputError, naming the form, where text is not like that."""
    left, equals, right = text.partition("=")
    if not (left and equals and right):
        raise InputError(f"{option} {text!r}: must be {form}")
    return left, right


def check_outputs(out: Path | None, plot: bool) -> None:
    """InputError where files could not be written to `out` or, to `plot`, here, before any run."""
    if plot:
        from ..report.plot import new_figure

        new_figure(1.0, 1.0)
    if out or plot:
        check_folder(out or Path())


def show(as_json: bool, report: Any, text: str) -> None:
    """Print a report as one JSON object, or the text for people."""
    click.echo(json.dumps(report).replace("\x7f", "\\u007f") if as_json else text)


def say(line: str) -> None:
    """Print one line on standard error, whatever is in it."""
    click.echo(on_one_line(line), err=True)


def announce(line: str) -> None:
    """Print one line on standard error of what takes a while: where a progress bar is shown."""
    if shows_progress():
        say(line)


def shows_progress() -> bool:
    """True where progress is shown, on a terminal."""
    return sys.stderr.isatty()


def fail(message: str, code: int, debug: bool = False) -> int:
    """Print the message as one line on standard error; return the exit code."""
    if debug:
        traceback.print_exc()
    elif len(message) > LONGEST:
        message = f"{message[: LONGEST // 2]} [...] {message[-LONGEST // 2 :]}"
    say(f"grasp-cosim: {message}")
    return code
