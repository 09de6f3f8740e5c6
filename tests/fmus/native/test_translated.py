"""The shipped blocks, also of N fingers, and those of docs/: the bits of Python."""

import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path
from random import Random

import pytest
from fmus.native.c_block import Both, loaded
from grasp_cosim.fmu_export.shipped import block_of as block_of_ours
from grasp_cosim.inspection.block_templates import TEMPLATE_FOLDER
from support.kinds import TRANSLATED
from support.marks import part, platforms, seeds, slow
from support.native_fmus import needs_gcc

pytestmark = needs_gcc

DOCS = Path(__file__).parents[3] / "docs"
BLOCKS = [*TEMPLATE_FOLDER.glob("*_*.py"), DOCS / "moving_object.py"]
OWN = {block.stem: block for block in sorted(BLOCKS)}
NAMES = [*TRANSLATED, *OWN]


@contextmanager
def block_of(name, folder):
    """A block by its name."""
    if name in OWN:
        with loaded(folder / f"{name}.py", OWN[name].read_text("utf-8")) as own:
            yield own
    else:
        yield block_of_ours(name)


@pytest.mark.parametrize("name", [*TRANSLATED, *map(slow, OWN)])
def test_c_gives_the_bits_of_python(name, tmp_path):
    with block_of(name, tmp_path) as block:
        both = Both(name, block, tmp_path / "c", options=["-O0"])
        assert sum(both.random_run(Random(seed), 10) for seed in range(15)) > 100


@pytest.mark.parametrize(
    "name",
    ["HandPlant4", *map(slow, ("HandController2", "HandControllerAdaptive5", "HandPlantMovable8"))],
)
def test_a_hand_of_n_fingers(name, tmp_path):
    both = Both(name, block_of_ours(name), tmp_path / "c", options=["-O0"])
    assert sum(both.random_run(Random(seed), 10) for seed in range(15)) > 50


@pytest.mark.slow
@pytest.mark.campaign
@pytest.mark.parametrize("name", NAMES)
def test_ten_million_values(name, tmp_path):
    with block_of(name, tmp_path) as block:
        both, random = Both(name, block, tmp_path / "c"), Random(f"{name} {seeds(1)[0]}")
        count = 0
        while count < part(10_000_000) / len(NAMES):
            count += both.random_run(random, 200)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("cc", "option"),
    [("clang", "-O2"), ("gcc", "-O3"), platforms("gcc", "-O0"), platforms("clang", "-O0")],
)
@pytest.mark.parametrize("name", NAMES)
def test_any_compiler_gives_the_bits_of_python(name, cc, option, tmp_path):
    with block_of(name, tmp_path) as block:
        both = Both(name, block, tmp_path / "c", cc, [option])
        assert sum(both.random_run(Random(seed), 30) for seed in range(20)) > 500


@pytest.mark.slow
def test_the_same_sources_give_the_same_bytes():
    code = (
        "from grasp_cosim.fmu_export.native.blocks import translated\n"
        "from grasp_cosim.fmu_export.shipped import blocks\n"
        "for name in ('GripperPlantMovable', 'ProximitySensor', 'GraspController'):\n"
        "    print(translated(name, blocks()[name]))\n"
    )
    texts = {
        subprocess.check_output(
            [sys.executable, "-c", code], env={**os.environ, "PYTHONHASHSEED": str(seed)}
        )
        for seed in (1, 2)
    }
    assert len(texts) == 1
    assert str(Path.cwd().parent) not in texts.pop().decode()
