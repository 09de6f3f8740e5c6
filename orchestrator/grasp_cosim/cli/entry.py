"""From a command line to an exit code."""

import sys
from typing import NoReturn

import click

from ..errors import InputError, SimulationError
from . import evaluate, fmus, qualify, report, run, ssp
from .frame import FAILED, INTERRUPTED, WRONG, cli, fail

COMMANDS = (
    run.run,
    report.report,
    evaluate.evaluate,
    qualify.qualify,
    ssp.ssp,
    fmus.build,
    fmus.inspect,
    fmus.doctor,
)
for command in COMMANDS:
    cli.add_command(command)


def entry() -> NoReturn:
    """The command grasp-cosim."""
    sys.exit(main(sys.argv[1:]))


def main(arguments: list[str]) -> int:
    """Run a command line and return its exit code.

    An error is one line on standard error, without a traceback unless --debug is given.
    """
    debug = "--debug" in arguments
    try:
        return int(cli.main(arguments, "grasp-cosim", standalone_mode=False) or 0)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.ctx.get_help(), err=True)
        return WRONG
    except click.ClickException as error:
        return fail(error.format_message(), WRONG)
    except InputError as error:
        return fail(str(error), WRONG, debug)
    except OSError as error:
        text = f"{error.filename}: {error.strerror}" if error.filename else str(error)
        return fail(text, WRONG, debug)
    except SimulationError as error:
        return fail(str(error), FAILED, debug)
    except (KeyboardInterrupt, click.Abort):
        return fail("interrupted", INTERRUPTED)
    except Exception as error:
        return fail(f"{type(error).__name__}: {error} (--debug shows where)", FAILED, debug)
