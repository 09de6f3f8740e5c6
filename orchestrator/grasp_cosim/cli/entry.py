"""From a command line to an exit code.

What is printed is harmless to a terminal, and an output that fails is an error of one line.
"""

import atexit
import ctypes
import faulthandler
import os
import signal
import sys
from codecs import lookup
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from typing import Any, NoReturn

import click

from ..base import interruption
from ..base.errors import InputError, SimulationError
from ..base.files import FULL
from ..base.system_calls import end_fork, flush_c, when_c_exits
from ..base.text import printable
from .frame import FAILED, INTERRUPTED, TERMINATED, WRONG, fail
from .group import cli

COMPLETE = "_GRASP_COSIM_COMPLETE"
"""The environment variable by which a shell asks click what may come next."""


def entry() -> NoReturn:
    """The command grasp-cosim, see __main__.py."""
    if COMPLETE in os.environ:
        cli.main(prog_name="grasp-cosim", complete_var=COMPLETE)
    keep_output_for_us()
    try:
        interruption.command()
        when_c_exits(_EXITED)
        if "--debug" in sys.argv:
            faulthandler.enable()
        code = main(sys.argv[1:])
    except KeyboardInterrupt:
        code = fail("interrupted", INTERRUPTED)
    came = interruption.over()
    if came == signal.SIGTERM:
        code = TERMINATED
    elif came and (code in (WRONG, FAILED) or interruption.lost()):
        code = INTERRUPTED  # an FMU made an error of it, or Python lost it
    try:
        sys.stdout.close()
    except OSError as error:
        code = code or fail(str(OutputError(error)), FAILED)
    leave(code)


def main(arguments: list[str]) -> int:
    """Run a command line and return its exit code.

    An error is one line on standard error, without a traceback unless --debug is given.
    """
    debug = "--debug" in arguments
    with harmless_streams():
        try:
            return _exit_code_of_command(arguments)
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


def _exit_code_of_command(arguments: list[str]) -> int:
    """The exit code of a command; what it raises is raised. A fork of an FMU ends here."""
    owner = os.getpid()
    try:
        return int(cli.main(arguments, "grasp-cosim", standalone_mode=False, obj=arguments) or 0)
    finally:
        end_fork(owner)


def _end_at_exit(_: object) -> None:
    """A run that an FMU ends by exit() would look like one that is done; we end by leave()."""
    if os.getpid() == _OWNER:  # and not a fork
        remedy = "with isolation = 'process' that ends only the process of the FMU"
        message = f"the binary of an FMU called exit(); {remedy}"
        os._exit(fail(message, FAILED))


_OWNER = os.getpid()
_EXITED = ctypes.CFUNCTYPE(None, ctypes.c_void_p)(_end_at_exit)


# ------------------------------------------------------------------ standard output and error


class OutputError(Exception):
    """Standard output cannot be written. The message is one line."""

    def __init__(self, error: OSError) -> None:
        super().__init__(f"standard output: {error.strerror}")


class _Harmless:
    """A stream that writes text as printable() makes it."""

    def __init__(self, stream: Any, failed: Callable[[OSError], object]) -> None:
        self._stream = stream
        self._failed = failed

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> int:
        """Write the text. A carriage return at its beginning stays: so a progress bar begins."""
        start = text[: text.startswith("\r")]
        try:
            self._stream.write(start + printable(text[len(start) :]))
        except OSError as error:
            self._failed(error)
        return len(text)

    def flush(self) -> None:
        """Write what waits."""
        try:
            self._stream.flush()
        except OSError as error:
            self._failed(error)


@contextmanager
def harmless_streams() -> Iterator[None]:
    """Whatever is printed goes through printable(); OutputError where it cannot be written."""
    stderr: Any = sys.stderr

    def failed(error: OSError) -> NoReturn:  # of an OSError click would make its own exit code
        raise OutputError(error) from error

    def nobody_to_tell(_: OSError) -> None:
        os.dup2(os.open(os.devnull, os.O_WRONLY), stderr.fileno())

    out: Any = _Harmless(sys.stdout, failed)
    err: Any = _Harmless(stderr, nobody_to_tell)
    with redirect_stdout(out), redirect_stderr(err):
        yield


def keep_output_for_us() -> None:
    """Prints of the binary of an FMU go to standard error: --json prints only the result.

    In the place of a standard file that is closed comes one that cannot be written. Else the next
    file that is opened would get its number, and what an FMU prints.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDONLY)
    standard_output = os.dup(1)
    os.dup2(2, 1)
    sys.stdout = _text_stream(standard_output, sys.stdout)
    sys.stderr = _text_stream(os.dup(2), sys.stderr)


def leave(code: int) -> NoReturn:
    """End the process as sys.exit() does, and what FMUs have printed is not lost.

    But without the end of libraries, which may crash where an import was interrupted.
    """
    atexit._run_exitfuncs()
    with suppress(OSError):
        sys.stderr.flush()
    flush_c()
    os._exit(code)


def _text_stream(descriptor: int, like: Any) -> Any:
    """A text stream with the encoding of another, None where that was closed; not in ASCII."""
    is_ascii = like is None or lookup(like.encoding).name == "ascii"
    encoding, errors = ("utf-8", "backslashreplace") if is_ascii else (like.encoding, like.errors)
    buffering = LINE_BUFFERED if like and like.line_buffering else DEFAULT_BUFFERING
    return os.fdopen(descriptor, "w", buffering, encoding, errors)


LINE_BUFFERED, DEFAULT_BUFFERING = 1, -1
"""As open() has them."""
