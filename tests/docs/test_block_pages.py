"""The pages on blocks, fmus/README.md and that on native FMUs: their commands and examples."""

import re
import shlex
import shutil
import textwrap
from pathlib import Path
from typing import get_type_hints

import pytest
from block_variables import Input, Output, Parameter
from grasp_cosim import cli
from grasp_cosim.fmu_export.native.advice import ADVICE
from grasp_cosim.inspection.block_templates import TEMPLATE_FOLDER
from support.marks import needs_compiler

ROOT = Path(__file__).parents[2]
BLOCKS = (ROOT / "fmus/README.md").read_text("utf-8")
NATIVE = (ROOT / "orchestrator/grasp_cosim/fmu_export/native/README.md").read_text("utf-8")


def commands(page):
    return re.findall(r"^grasp-cosim (.*)$", page, re.MULTILINE)


@pytest.fixture
def own(checkout):
    """The checkout, with a block of its user's."""
    shutil.copy(TEMPLATE_FOLDER / "spring_plant.py", checkout / "my_plant.py")
    return checkout


@pytest.mark.slow
def test_the_commands_on_blocks(own):
    assert len(commands(BLOCKS)) == 3
    for command in commands(BLOCKS):
        assert cli.main(shlex.split(command)) == 0, command
    assert (own / "fmus/build/MyPlant.fmu").is_file()


@pytest.mark.slow
@needs_compiler
def test_the_commands_on_native_fmus(own):
    """But for other platforms, which test_targets.py builds for."""
    here = [command for command in commands(NATIVE) if "--target" not in command]
    assert len(here) == 4
    for command in here:
        assert cli.main(shlex.split(command)) == 0, command
    assert (own / "fmus/native/GripperPlant.fmu").is_file()
    assert (own / "fmus/native/MyPlant.fmu").is_file()
    files = {path.name for path in (own / "controller_c").iterdir()}
    assert {"GraspController.h", "GraspController.c", "main.c", "GraspController.a2l"} <= files


def test_the_declarations():
    (block,) = re.findall(r"```python\n(.*?)```", BLOCKS, re.DOTALL)
    head = "from typing import Annotated\nfrom block_variables import Input, Output, Parameter\n"
    names = {}
    exec(f"{head}class Fields:\n{textwrap.indent(block, '    ')}", names)
    hints = get_type_hints(names["Fields"], include_extras=True)
    found = {name: type(hint.__metadata__[0]) for name, hint in hints.items()}
    assert found == {"distance": Parameter, "gap": Input, "intensity": Output}


def test_the_example_of_a_refusal():
    (shown,) = re.findall(r"^ {4}my_plant\.py: line 61: (.*\n {4}.*)$", NATIVE, re.MULTILINE)
    assert " ".join(shown.split()) == ADVICE["While"]
