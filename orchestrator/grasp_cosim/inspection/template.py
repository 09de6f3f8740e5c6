"""Blocks in Python to start from, each with its test: what `init --template` writes."""

import sys
from keyword import iskeyword
from pathlib import Path
from typing import NamedTuple

from ..base.errors import InputError

TEMPLATES = Path(__file__).with_name("templates")


class Template(NamedTuple):
    """The module that is copied, and the components of the grasp whose place its FMU takes."""

    module: str
    components: tuple[str, ...]


KINDS = {
    "plant": Template("spring_plant", ("plant",)),
    "sensor": Template("range_sensor", ("sensor_1", "sensor_2")),
    "controller": Template("pi_controller", ("controller",)),
}
"""The templates by what they are for."""


def test_of(file: Path) -> Path:
    """The file of the test of a block in a file."""
    return file.with_name(f"test_{file.name}")


def texts(file: Path, kind: str) -> dict[Path, str]:
    """The texts of the block of a kind, to be written to a file, and of its test, by file.

    InputError where the test could not import a module of that name.
    """
    if iskeyword(file.stem) or file.stem in sys.stdlib_module_names:
        raise InputError(
            f"{file}: is a name of Python's own; must be another, like my_{file.stem}.py"
        )
    module = KINDS[kind].module
    block, *parts = (
        (TEMPLATES / name).read_text("utf-8")
        for name in (f"{module}.py", f"test_{module}.py.in", "test_in_the_grasp.py.in")
    )
    return {file: block, test_of(file): "".join(parts).replace("$module", file.stem)}
