"""Keeps the process as it is around calls of FMUs, whose code may do in it what it likes."""

import os
from collections.abc import Iterator
from contextlib import contextmanager

from ..base.files import CURRENT_FOLDER
from ..base.interruption import interruptible
from ..system.parts import Component


def leaves_process_alone(component: Component) -> bool:
    """True for an FMU in its own process, or made of our own C.

    It neither catches Ctrl-C nor changes the current folder, so its calls need no guard.
    """
    fmu = component.loaded
    return component.isolation == "process" or (fmu.ours and not fmu.python)


@contextmanager
def guarded_process() -> Iterator[None]:
    """Ctrl-C is a KeyboardInterrupt, and the current folder stays, whatever the FMUs here do."""
    with interruptible(), same_folder():
        yield


@contextmanager
def same_folder() -> Iterator[None]:
    """Go back to the current folder from wherever an FMU went."""
    with CURRENT_FOLDER:
        folder = os.getcwd()  # noqa: PTH109 - twice in a step, so as fast as can be
    try:
        yield
    finally:
        with CURRENT_FOLDER:
            if os.getcwd() != folder:  # noqa: PTH109
                os.chdir(folder)
