"""From a command line to an exit code."""

import errno
import os
import sys
from typing import NoReturn

import click

from ..errors import InputError, SimulationError
from .crash import explain_crashes
from .frame import FAILED, INTERRUPTED, WRONG, fail
from .group import cli

FULL = (errno.ENOSPC, errno.EDQUOT, errno.EIO)
"""Errors of a disk, not of the input."""


def entry() -> NoReturn:
    """The command grasp-cosim."""
    _keep_output_for_us()
    explain_crashes("--debug" in sys.argv)
    code = main(sys.argv[1:])
    try:
        sys.stdout.close()
    except OSError as error:
        code = fail(f"standard output: {error.strerror}", FAILED)
    sys.exit(code)


def _keep_output_for_us() -> None:
    """What the binary of an FMU prints goes to standard error: with --json, we alone may print."""
    sys.stdout.flush()
    ours = os.dup(1)
    os.dup2(2, 1)
    sys.stdout = os.fdopen(ours, "w", encoding=sys.stdout.encoding, errors=sys.stdout.errors)


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
        return fail(text, FAILED if error.errno in FULL else WRONG, debug)
    except SimulationError as error:
        return fail(str(error), FAILED, debug)
    except (KeyboardInterrupt, click.Abort):
        return fail("interrupted", INTERRUPTED)
    except Exception as error:
        return fail(f"{type(error).__name__}: {error} (--debug shows where)", FAILED, debug)
