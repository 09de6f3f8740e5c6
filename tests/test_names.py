"""Public names, names nearest to one that is not known, those of packages; numbers in texts."""

import pydoc
import re
import shlex
import subprocess
import sys
import tomllib
from importlib.metadata import metadata, version
from pathlib import Path

import grasp_cosim
import pytest
from grasp_cosim.base.checks import EXACT, exact, install_command, integer, packages, real
from grasp_cosim.base.errors import (
    MAX_LISTED_IN_FULL,
    MAX_LISTED_OF_MANY,
    InputError,
    SimulationError,
    nearest,
)
from hypothesis import example, given
from hypothesis import strategies as st

PYPROJECT = Path(__file__).parents[1] / "pyproject.toml"

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
    few = ", ".join(PORTS[:MAX_LISTED_OF_MANY])
    assert (
        said == f"valid: {few}, ... ({len(PORTS) - MAX_LISTED_OF_MANY} more); `inspect` shows all"
    )


@pytest.mark.parametrize("see", ["", "`inspect`"])
def test_a_short_list_is_named_whole(see):
    names = [f"component_{letter}" for letter in "abcdefgh"]
    assert len(names) == MAX_LISTED_IN_FULL
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


def test_all_has_every_extra_but_those_of_the_house():
    extras = tomllib.loads(PYPROJECT.read_text("utf-8"))["project"]
    extras = extras["optional-dependencies"]
    (everything,) = extras.pop("all")
    assert everything == f"grasp-cosim[{','.join(sorted(extras.keys() - {'dev'}))}]"
    assert {"jupyter", "pandas", "plot", "xarray"} <= extras.keys()  # which the notebook asks for


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
    home = grasp_cosim._MODULES.get(name, "base.errors")
    assert getattr(sys.modules[f"grasp_cosim.{home}"], name) is value


def test_dir_and_help_have_the_public_names_alone():
    assert [n for n in dir(grasp_cosim) if not n.startswith("_")] == grasp_cosim.__all__
    page = pydoc.render_doc(grasp_cosim, renderer=pydoc.plaintext)
    assert "class System(" in page
    assert "Run a system once for each row of a table" in page
    names: dict[str, object] = {}
    exec("from grasp_cosim import *", names)
    assert {*names} == {*grasp_cosim.__all__, "__builtins__"}


def test_the_version_is_that_of_the_distribution():
    assert grasp_cosim.__version__ == version("grasp-cosim")
    with pytest.raises(AttributeError, match="no attribute 'versoin'"):
        grasp_cosim.versoin  # noqa: B018


def test_importing_the_package_imports_no_numbers():
    names = "numpy", "fmpy", "importlib.metadata"
    program = f"import sys, grasp_cosim; print([n for n in {names} if n in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", program], text=True) == "[]\n"


@given(st.floats(allow_nan=False), st.integers())
def test_numbers_are_read_as_they_are_written(number, whole):
    assert (real(f" {number!r}\t"), integer(f" {whole}\n")) == (number, whole)


@pytest.mark.parametrize("text", ["1_0", "1e1_0", "١٢", "", "0,5", "1.5mm"])
def test_what_python_alone_takes_for_a_number_is_none(text):
    for read in (real, integer):
        with pytest.raises(ValueError, match=r"number|float|int"):
            read(text)


@given(st.integers(-(2 * EXACT), 2 * EXACT))
@example(EXACT - 1)
@example(-EXACT)
def test_whole_numbers_that_a_float_tells_from_all_others_are_exact(value):
    neighbours = {value - 1, value, value + 1}
    if len({float(x) for x in neighbours}) == len(neighbours):
        exact("here", value)
    else:
        with pytest.raises(InputError, match=f"^here = {value}: must be smaller than"):
            exact("here", value)


def test_the_text_and_the_failure_are_those_given():
    said = "here = 1e20 at step 3: must be smaller than 2**53 in magnitude, to be exact"
    with pytest.raises(SimulationError, match=re.escape(said)):
        exact("here", 10**20, "1e20 at step 3", SimulationError)
    exact("here", 1e300)
