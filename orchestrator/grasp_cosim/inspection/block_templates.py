"""Blocks in Python to start from, each with its test: what `init --template` writes."""

import sys
from keyword import iskeyword
from pathlib import Path
from typing import NamedTuple

from ..base.errors import InputError

TEMPLATE_FOLDER = Path(__file__).with_name("templates")


class BlockTemplate(NamedTuple):
    """The module that is copied, and the components of the grasp whose place its FMU takes."""

    module: str
    components: tuple[str, ...]


BLOCK_TEMPLATES = {
    "plant": BlockTemplate("spring_plant", ("plant",)),
    "sensor": BlockTemplate("range_sensor", ("sensor_1", "sensor_2")),
    "controller": BlockTemplate("pi_controller", ("controller",)),
}
"""The templates by what they are for."""


def test_file_of(file: Path) -> Path:
    """The file of the test of a block in a file."""
    return file.with_name(f"test_{file.name}")


def block_files(file: Path, kind: str) -> dict[Path, str]:
    """The texts of a block of a kind and of its test, by the files to which they are written.

    Raises:
        InputError: The test could not import a module of that name.
    """
    if iskeyword(file.stem) or file.stem in sys.stdlib_module_names:
        raise InputError(
            f"{file}: is a name of Python's own; must be another, like my_{file.stem}.py"
        )
    module = BLOCK_TEMPLATES[kind].module
    block, test, test_in_the_grasp = (
        (TEMPLATE_FOLDER / name).read_text("utf-8")
        for name in (f"{module}.py", f"test_{module}.py.in", "test_in_the_grasp.py.in")
    )
    test_text = f"{test}{test_in_the_grasp}".replace("$module", file.stem)
    return {file: block, test_file_of(file): test_text}
