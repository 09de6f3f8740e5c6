"""The command inspect."""

import json
import shutil
import sys
from pathlib import Path

import click

from ...inspection.inspection import as_text, inspect_fmu
from ..frame import json_option


@click.command()
@click.argument("fmu", type=click.Path(path_type=Path))
@json_option
def inspect(fmu: Path, as_json: bool) -> int:
    """Show the interface of any FMU: variables, units, ranges, dependencies, capabilities.

    \b
    Example: grasp-cosim inspect fmus/build/GripperPlant.fmu
    """
    report = inspect_fmu(fmu)
    if as_json:
        click.echo(json.dumps(report))
    else:
        width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
        click.echo(as_text(report, width))
    return 0
