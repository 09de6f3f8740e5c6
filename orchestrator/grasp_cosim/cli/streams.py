"""What is printed: harmless to a terminal, and an output that fails is an error of one line."""

import atexit
import os
import sys
from codecs import lookup
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from typing import Any, NoReturn

from ..base.system_calls import flush_c
from ..base.text import printable

OUTPUT = "standard output"


class OutputError(Exception):
    """Standard output cannot be written. The message is one line."""

    def __init__(self, error: OSError) -> None:
        super().__init__(f"{OUTPUT}: {error.strerror}")


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
    """What the binary of an FMU prints goes to standard error: with --json, we alone may print.

    In the place of a standard file that is closed comes one that cannot be written. Else the next
    file that is opened would get its number, and what an FMU prints.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDONLY)
    ours = os.dup(1)
    os.dup2(2, 1)
    sys.stdout = _opened(ours, sys.stdout)
    sys.stderr = _opened(os.dup(2), sys.stderr)


def leave(code: int) -> NoReturn:
    """End the process as sys.exit() does, and what FMUs have printed is not lost.

    But without the end of libraries, which may crash where an import was interrupted.
    """
    atexit._run_exitfuncs()
    with suppress(OSError):
        sys.stderr.flush()
    flush_c()
    os._exit(code)


def _opened(descriptor: int, like: Any) -> Any:
    """A text stream with the encoding of another, which is None where that was closed.

    In place of ASCII it is UTF-8, as click has it, too.
    """
    plain = like is None or lookup(like.encoding).name == "ascii"
    encoding = "utf-8" if plain else like.encoding
    errors = "backslashreplace" if plain else like.errors
    line = like is not None and like.line_buffering
    return os.fdopen(descriptor, "w", 1 if line else -1, encoding=encoding, errors=errors)
