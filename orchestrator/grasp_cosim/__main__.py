"""The command grasp-cosim, also as `python -m grasp_cosim`.

Python starts the latter in the current folder. That is then the first one where Python looks for
modules, and where it looked for the first few already: `python -P -m grasp_cosim` does not. Nothing
else is imported from there.
"""

import os
import signal
import sys
from typing import NoReturn


def entry() -> NoReturn:
    """The command grasp-cosim; before it begins, Ctrl-C ends the process as SIGTERM does."""
    if sys.argv[1:] == ["--version"]:  # which scripts ask for, without all that a command needs
        from contextlib import suppress
        from importlib.metadata import version

        with suppress(OSError):  # which the text below explains
            os.write(1, f"grasp-cosim, version {version('grasp-cosim')}\n".encode())
            sys.exit()
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not ignored, as after `&`
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    from .cli import entry as run

    run()


if __name__ == "__main__":
    if not sys.flags.safe_path and sys.path[0] == os.getcwd():  # noqa: PTH109 - importing pathlib looks there
        del sys.path[0]
    entry()
