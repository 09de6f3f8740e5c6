"""The command grasp-cosim, also as `python -m grasp_cosim`."""

from typing import NoReturn

from .early import leave_at_once


def entry() -> NoReturn:
    """The command grasp-cosim: Ctrl-C is one line while the command line is still imported."""
    leave_at_once()
    from .cli import entry as run

    run()


if __name__ == "__main__":
    entry()
