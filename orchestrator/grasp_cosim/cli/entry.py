"""From a command line to an exit code."""

import ctypes
import faulthandler
import os
import signal
import sys
from typing import NoReturn

import click

from ..base import interruption
from ..base.errors import InputError, SimulationError
from ..base.files import FULL
from ..base.system_calls import when_c_exits
from .frame import FAILED, INTERRUPTED, TERMINATED, WRONG, fail
from .group import cli
from .streams import OutputError, harmless_streams, keep_output_for_us, leave

NAME = "grasp-cosim"
COMPLETE = "_GRASP_COSIM_COMPLETE"
"""The environment variable in which click's completion script for a shell says what it wants."""


def entry() -> NoReturn:
    """The command grasp-cosim, see __main__.py."""
    if COMPLETE in os.environ:  # the shell asks what may come next
        cli.main(prog_name=NAME, complete_var=COMPLETE)
    keep_output_for_us()
    interruption.command()
    try:
        when_c_exits(_EXITED)
        if "--debug" in sys.argv:
            faulthandler.enable()
        code = main(sys.argv[1:])
    except KeyboardInterrupt:
        code = fail("interrupted", INTERRUPTED)
    came = interruption.over()
    if came == signal.SIGTERM:
        code = TERMINATED
    elif came and code in (WRONG, FAILED):  # what an FMU made of it
        code = INTERRUPTED
    try:
        sys.stdout.close()
    except OSError as error:
        code = code or fail(str(OutputError(error)), FAILED)
    leave(code)


def main(arguments: list[str]) -> int:
    """Run a command line and return its exit code.

    An error is one line on standard error, without a traceback unless --debug is given.
    """
    with harmless_streams():
        return _main(arguments, "--debug" in arguments)


def _main(arguments: list[str], debug: bool) -> int:
    try:
        return int(cli.main(arguments, NAME, standalone_mode=False, obj=arguments) or 0)
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
    except (SimulationError, OutputError) as error:
        return fail(str(error), FAILED, debug)
    except (KeyboardInterrupt, click.Abort):
        return fail("interrupted", INTERRUPTED)
    except (Exception, SystemExit) as error:  # which a Python FMU may raise
        if interruption.came():  # and a module that was being imported made this error of it
            return fail("interrupted", INTERRUPTED)
        return fail(f"{type(error).__name__}: {error} (--debug shows where)", FAILED, debug)


def _exited(_: object) -> None:
    """A run that an FMU ends by exit() would look like one that is done; we end by leave()."""
    if os.getpid() == _OWNER:  # and not a fork
        said = "the binary of an FMU called exit(); with isolation = 'process' that ends it alone"
        os._exit(fail(said, FAILED))


_OWNER = os.getpid()
_EXITED = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(_exited)
