"""The command inspect."""

import shutil
import sys
from pathlib import Path

import click

from ...inspection.inspection import as_text, inspect_fmu
from ..frame import PATH, json_option, show


@click.command()
@click.argument("fmu", type=PATH)
@json_option
def inspect(fmu: Path, as_json: bool) -> int:
    """Show the interface of any FMU.

    It prints the variables, with units, ranges and dependencies, and the capabilities.

    \b
    Example: grasp-cosim inspect fmus/build/GripperPlant.fmu
    """
    report = inspect_fmu(fmu)
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    show(as_json, report, as_text(report, width))
    return 0
