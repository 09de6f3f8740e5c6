"""The command build."""

import json
import sys
from pathlib import Path

import click

from ...errors import InputError
from ...files import check_folder
from ...grasp.system import BOUND_FOLDER, FMU_FOLDER
from ..frame import json_option


@click.command()
@click.argument("block", required=False, type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), help=f"Default: {FMU_FOLDER}")
@click.option(
    "--bind-python",
    is_flag=False,
    flag_value=sys.executable,
    metavar="[PYTHON]",
    help=f"For hosts that are not Python: bind to libpython. Default of --out: {BOUND_FOLDER}",
)
@json_option
def build(block: Path | None, out: Path | None, bind_python: str | None, as_json: bool) -> int:
    """Build the FMUs: the plants, GripperPlant*, then ProximitySensor and GraspController.

    With BLOCK, a Python file: the FMU of that block alone, spring_plant.py becomes SpringPlant.fmu.
    docs/your_plant.md shows one.

    Says what is not as it was built last. --bind-python adds the libpython of PYTHON, by default
    of this one, to what the FMUs load.

    \b
    Example: grasp-cosim build --out my_fmus
    Your own: grasp-cosim build docs/spring_plant.py
    """
    from grasp_fmus.block_build import build_block
    from grasp_fmus.build import build as build_fmus

    if bind_python == "":
        raise InputError("--bind-python '': must be a Python program, or left out")
    folder = out or (BOUND_FOLDER if bind_python else FMU_FOLDER)
    check_folder(folder)
    try:
        built = (
            [build_block(block, folder, bind_python)] if block else build_fmus(folder, bind_python)
        )
    except ValueError as error:
        raise InputError(f"build: {error}") from error
    if as_json:
        report = {str(b.path): {"status": b.status, "changes": list(b.changes)} for b in built}
        click.echo(json.dumps({"fmus": list(report), "built": report}))
    else:
        for b in built:
            click.echo("\n    ".join((f"{b.path}: {b.status}", *b.changes)))
    return 0
