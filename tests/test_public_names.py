"""The names at the top of grasp_cosim: each can be had, and none is hidden by a room."""

import subprocess
import sys
from pathlib import Path

import grasp_cosim
import pytest

ROOMS = {path.stem for path in Path(grasp_cosim.__file__).parent.iterdir()}


def test_no_room_has_the_name_of_a_public_name():
    """`from grasp_cosim import sweep` would be a module, once somebody had imported that."""
    assert {"master", "sweeps", "comparison"} <= ROOMS
    assert not ROOMS & {*grasp_cosim.__all__}


@pytest.mark.parametrize("name", grasp_cosim.__all__)
def test_a_public_name_is_one_that_its_home_has(name):
    value = getattr(grasp_cosim, name)
    home = grasp_cosim._HOMES.get(name, "base.errors")
    assert getattr(sys.modules[f"grasp_cosim.{home}"], name) is value


def test_importing_the_package_imports_no_numbers():
    program = "import sys, grasp_cosim; print('numpy' in sys.modules, 'fmpy' in sys.modules)"
    assert subprocess.check_output([sys.executable, "-c", program], text=True) == "False False\n"
