"""The command build."""

from pathlib import Path

import click

from ...errors import InputError
from ...files import FMU_FOLDER, check_folder
from ..frame import PATH, bind_python_option, json_option, show

BOUND_FOLDER = Path("fmus/bound")
"""Where FMUs for hosts that are not Python are built, below the current folder."""


@click.command()
@click.argument("block", required=False, type=PATH)
@click.option("--out", type=PATH, help=f"Default: {FMU_FOLDER}")
@bind_python_option(f" Default of --out: {BOUND_FOLDER}")
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

    folder = out or (BOUND_FOLDER if bind_python else FMU_FOLDER)
    check_folder(folder)
    try:
        built = (
            [build_block(block, folder, bind_python)] if block else build_fmus(folder, bind_python)
        )
    except ValueError as error:
        raise InputError(f"build: {error}") from error
    report = {str(b.path): {"status": b.status, "changes": list(b.changes)} for b in built}
    lines = ("\n    ".join((f"{b.path}: {b.status}", *b.changes)) for b in built)
    show(as_json, {"fmus": list(report), "built": report}, "\n".join(lines))
    return 0
