"""Public names, the names nearest to one that is not known, and those of packages."""

import re
import shlex
import subprocess
import sys
from importlib.metadata import metadata
from pathlib import Path

import grasp_cosim
import pytest
from grasp_cosim.base.checks import install_command, packages
from grasp_cosim.base.errors import FEW, MANY, nearest

PLANT = [
    *("force[1]", "force[2]", "gap[1]", "gap[2]", "finger_mass[1]", "finger_mass[2]"),
    *("initial_position[1]", "initial_position[2]", "object_width", "initial_object_position"),
    *("friction.coulomb[1]", "friction.coulomb[2]"),
]
PORTS = [f"plant.{name}" for name in PLANT] + ["sensor_1.reflectance", "sensor_2.reflectance"]


@pytest.mark.parametrize(
    ("name", "names", "found"),
    [
        ("initial_objct_position", PLANT, "initial_object_position"),
        ("OBJECT_WIDTH", PLANT, "object_width"),
        ("mass", PLANT, "finger_mass[1], finger_mass[2]"),
        ("gap[3]", PLANT, "gap[1], gap[2]"),
        ("frction.coulomb[1]", PLANT, "friction.coulomb[1]"),
        ("friction.kulomb[2]", PLANT, "friction.coulomb[2]"),
        ("plnt.object_width", PORTS, "plant.object_width"),
        ("object_width", PORTS, "plant.object_width"),
        ("plant.reflectance", PORTS, "sensor_1.reflectance, sensor_2.reflectance"),
        ("sensor_2.reflektance", PORTS, "sensor_2.reflectance"),
    ],
)
def test_the_nearest_names_are_asked_about(name, names, found):
    assert nearest(name, names, "`inspect`") == f"did you mean {found}?"


@pytest.mark.parametrize("name", ["zzz", "plant.zzz", "1"])
def test_where_none_is_near_a_few_are_named_and_where_all_are(name):
    said = nearest(name, PORTS, "`inspect`")
    few = ", ".join(PORTS[:FEW])
    assert said == f"valid: {few}, ... ({len(PORTS) - FEW} more); `inspect` shows all"


@pytest.mark.parametrize("see", ["", "`inspect`"])
def test_a_short_list_is_named_whole(see):
    names = [f"component_{letter}" for letter in "abcdefgh"]
    assert len(names) == MANY
    assert nearest("zzz", names, see) == f"valid: {', '.join(names)}"
    assert nearest("zzz", [], see) == "valid: none"


def test_every_extra_is_named_by_its_packages():
    extras = metadata("grasp-cosim").get_all("Provides-Extra") or []
    named = {extra: packages(extra) for extra in extras}
    assert {"plot", "parquet", "native"} <= named.keys()
    assert named["plot"] == [named["plot"][0]]
    assert named["plot"][0].startswith("matplotlib>=")
    assert [re.split("[>=]", what)[0] for what in named["parquet"]] == ["pyarrow"]
    assert all(named[extra] for extra in extras if extra != "fast")
    assert packages("no such extra") == []


def test_the_command_is_for_the_python_that_runs(monkeypatch):
    monkeypatch.setattr(sys, "executable", "/my folder/python")
    command = install_command("scipy>=1.15", "pandas")
    assert command == "'/my folder/python' -m pip install 'scipy>=1.15' pandas"
    assert shlex.split(command)[0] == sys.executable


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
