"""Shared by the commands: exit codes, options, errors as one line."""

from __future__ import annotations

import json
import logging
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ..base.errors import InputError
from ..base.files import check_folder
from ..base.progress import Progress, write
from ..base.text import on_one_line

if TYPE_CHECKING:
    from ..metrics.metric import Metric

NEGATIVE, WRONG, FAILED, INTERRUPTED, TERMINATED = 1, 2, 3, 130, 143
"""Exit codes other than 0: result negative, input wrong, failure on the way, Ctrl-C, SIGTERM."""

PATH = click.Path(path_type=Path)
"""The type of an option or argument that is a path."""


json_option = click.option(
    "--json", "as_json", is_flag=True, help="Print the results as one JSON object."
)

metrics_option = click.option(
    "--metrics",
    "metric_files",
    multiple=True,
    type=PATH,
    help="Add the metrics that a Python file defines.",
)


def chosen_metrics(files: Sequence[Path]) -> tuple[Metric, ...]:
    """The metrics of the files that metrics_option names; InputError where one fails."""
    from ..metrics.metric import load_metrics

    return tuple(m for path in files for m in load_metrics(path))


def pair(option: str, text: str, form: str) -> tuple[str, str]:
    """Both sides of 'LEFT=RIGHT'; InputError, naming the form, where text is not like that."""
    key, equals, value = text.partition("=")
    if not (key and equals and value):
        raise InputError(f"{option} {text!r}: must be {form}")
    return key, value


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


def say(line: str, always: bool = False) -> None:
    """Print one line on standard error, whatever is in it; with --quiet nothing, unless always."""
    if always or not is_quiet():
        write(on_one_line(line))


def waiting(activity: str) -> Progress:
    """A context manager for what takes a while: shows how long it has taken, not with --quiet."""
    return Progress(activity, unit="", shown=not is_quiet())


QUIET = "grasp_cosim.quiet"
"""The entry for --quiet in what click keeps of a command line."""


def is_quiet() -> bool:
    """True with --quiet."""
    context = click.get_current_context(silent=True)
    return bool(context and context.meta.get(QUIET))


def _set_quiet(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    if value:
        ctx.meta[QUIET] = True


def _set_verbose(ctx: click.Context, _: click.Parameter, value: bool) -> None:
    if value:
        ctx.with_resource(logging_at(logging.INFO))


class _LogPrinter(logging.Handler):
    """Says what is logged, with --quiet only what may make the figures wrong."""

    def emit(self, record: logging.LogRecord) -> None:
        say(record.getMessage(), always=record.levelno >= logging.ERROR)


@contextmanager
def logging_at(level: int) -> Iterator[None]:
    """Have what our modules log at this level or above said meanwhile."""
    logger = logging.getLogger("grasp_cosim")
    level_before, handlers_before = logger.level, [*logger.handlers]
    if not any(isinstance(handler, _LogPrinter) for handler in logger.handlers):
        logger.addHandler(_LogPrinter())
    logger.setLevel(min(level, logger.level or level))  # --verbose may be the earlier one
    try:
        yield
    finally:
        logger.setLevel(level_before)
        logger.handlers = handlers_before


_flag = partial(click.Option, is_flag=True, expose_value=False)

EVERYWHERE = (
    _flag(["--debug"], help="Show the traceback of an error."),
    _flag(
        ["-q", "--quiet"],
        callback=_set_quiet,
        help="Print neither progress nor notes, only errors.",
    ),
    _flag(
        ["-v", "--verbose"],
        callback=_set_verbose,
        help="Print the FMUs, the engine, the time of each phase and the warnings of the FMUs.",
    ),
)
"""Options that stand before a command as well as on it."""


def fail(message: str, code: int, debug: bool = False) -> int:
    """Print the message as one line on standard error; return the exit code."""
    if debug:
        traceback.print_exc()
    click.echo(on_one_line(f"grasp-cosim: {message}"), err=True)
    return code
