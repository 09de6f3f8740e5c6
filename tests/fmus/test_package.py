"""What an FMU brings along follows from its imports, and runs beside others of its names."""

import os
import subprocess
import sys
from itertools import chain
from pathlib import Path
from zipfile import ZipFile

import pytest
from grasp_cosim.fmu_export.build import build_block
from grasp_cosim.fmu_export.package import IMPORT, with_imports
from grasp_cosim.fmu_export.shipped import SHIPPED
from support.fmi2 import Fmu, Instance, drive
from support.kinds import all_kinds

SPRING = Path(__file__).parents[2] / "orchestrator/grasp_cosim/inspection/templates/spring_plant.py"

LOAD = """
import sys, importlib
sys.path.insert(0, sys.argv[1])
importlib.import_module(open(sys.argv[1] + "/slavemodule.txt").read())
for module in list(sys.modules.values()):
    if (getattr(module, "__file__", None) or "").startswith(sys.argv[1]):
        print(module.__file__)
"""


def check_packed(fmu, folder):
    """A bare Python that imports the script imports every module in the FMU, and finds them all."""
    with ZipFile(fmu) as archive:
        archive.extractall(folder)
    resources = folder / "resources"
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", LOAD, str(resources)],
        capture_output=True, check=True, text=True,
    )  # fmt: skip
    assert sorted(done.stdout.split("\n")[:-1]) == sorted(map(str, resources.rglob("*.py")))


@pytest.mark.parametrize("name", SHIPPED)
def test_the_modules_of_an_fmu_are_those_that_its_script_imports(fmus, tmp_path, name):
    """Each under a name that ends in the hash of the content, which is the GUID."""
    check_packed(fmus / f"{name}.fmu", tmp_path)
    content = (tmp_path / "resources/slavemodule.txt").read_text().removeprefix(f"{name}_")
    assert f'guid="{content}"' in (tmp_path / "modelDescription.xml").read_text()
    packed = [file.name.partition(".")[0] for file in (tmp_path / "resources").glob("[!_]*")]
    assert {module.rpartition("_")[2] for module in packed} == {content, "slavemodule"}


def test_the_modules_of_a_block_of_ones_own_are_those_that_it_imports(tmp_path):
    check_packed(build_block(SPRING, tmp_path).path, tmp_path / "unpacked")


FILES = {
    "__init__.py": "",
    "a.py": "import math\nfrom . import b, NAME\nfrom .inner import deep\nfrom typing import Any",
    "b.py": "def f():\n    from .late import x\n    import numpy\n    from scipy import linalg\n",
    "late.py": "",
    "unused.py": "",
    "inner/__init__.py": "from .. import up",
    "inner/deep.py": "from second_package_of_the_test.leaf import f\n",
    "inner/unused.py": "",
    "up.py": '"""Of text,\nfrom unused, too."""\n',
    "data.txt": "",
}


def test_imports_are_followed_in_whatever_form_they_come(tmp_path, monkeypatch):
    second = {"__init__.py": "", "leaf.py": "", "unused.py": ""}
    for package, files in (("package", FILES), ("second_package", second)):
        for name, text in files.items():
            file = tmp_path / f"{package}_of_the_test" / name
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    packed = with_imports({"Script.py": b"from package_of_the_test import a\n"})
    unused = {"unused.py", "inner/unused.py", "data.txt"}
    assert packed.keys() == {
        "Script.py",
        *(f"package_of_the_test/{name}" for name in FILES.keys() - unused),
        "second_package_of_the_test/__init__.py",
        "second_package_of_the_test/leaf.py",
    }
    assert packed["package_of_the_test/b.py"] == FILES["b.py"].encode()


def test_a_package_that_is_not_installed_is_no_surprise_of_the_host(tmp_path):
    with pytest.raises(ImportError, match="no_such_package: no such package; must be installed"):
        with_imports({"Script.py": b"from no_such_package import block\n"})


def test_an_import_is_none_in_the_middle_of_a_text():
    text = 'from a import b\nfrom c.d import (\n  e\n)\n"""\nfrom the start, import is\n"""\n'
    assert IMPORT.findall(text) == ["a", "c"]


# All Python FMUs of a process share one sys.modules: each runs its own code all the same

TESTS = Path(__file__).parents[1]
ROOT = TESTS.parent
PARAMETERS = {
    "GraspControllerAdaptive": {"contact_force.stiffness": 60.0, "hold.squeeze": 1.0},
    "GripperPlant": {"finger_mass[1]": 0.8, "object_width": 0.1, "initial_object_position": 0.0},
    "ProximitySensor": {"gain": 0.01, "diffusion_exponent": 2.0},
}


@all_kinds
@pytest.mark.parametrize("name", PARAMETERS)
def test_interleaved_instances_are_as_each_one_alone(load, name):
    """Bit for bit, with other parameters."""
    alone, of_each = [], ({}, PARAMETERS[name], {})
    for values in of_each:
        with Instance(load(name)).initialise(**values) as instance:
            alone.append(drive(instance, 0, 250))
    assert alone[0] != alone[1]
    instances = [Instance(load(name)).initialise(**values) for values in of_each]
    rounds = [[drive(i, k, k + 1) for i in instances] for k in range(250)]
    assert [[*chain(*run)] for run in zip(*rounds, strict=True)] == alone
    for instance in instances:
        instance.call("FreeInstance")


@all_kinds
def test_two_builds_of_one_fmu_run_their_own_code(load, tmp_path, altered):
    """Alive at the same time and step by step in turn; whichever came first."""
    change = "p.gain * p.alpha", "2.0 * p.gain * p.alpha"
    other = altered("ProximitySensor", "proximity_sensor/optics.py", *change)
    ours, theirs = load("ProximitySensor"), Fmu(other, tmp_path / "theirs")
    assert ours.guid != theirs.guid
    for order in ((ours, theirs, ours), (theirs, ours, theirs)):
        instances = [Instance(fmu).initialise(gap=0.02) for fmu in order]
        for k in range(50):
            values = [drive(instance, k, k + 1)[0] for instance in instances]
            one = values[order.index(ours)]
            assert values == [one if f is ours else 2.0 * one for f in order]
        for instance in instances:
            instance.call("FreeInstance")


# Other hosts, and other people's FMUs: each in a process of its own

HOST = """
import sys
from pathlib import Path
{before}
from support.fmi2 import Fmu, Instance, drive
folder, *fmus = map(Path, sys.argv[1:])
for path in fmus:
    with Instance(Fmu(path, folder / path.stem)).initialise() as instance:
        print(path.stem, *map(float.hex, drive(instance, 0, 100)))
"""
NOTHING = 'assert not {m for m in sys.modules if m.startswith(("grasp", "gripper", "prox"))}'
REPLACED = """
import gripper_plant.rigid, proximity_sensor.channel, grasp_controller.adaptive
import grasp_cosim.fmu_export.slave
from types import ModuleType
OURS = "gripper_plant", "proximity_sensor", "grasp_controller", "grasp_cosim", "block_variables"
for name in [*sys.modules]:
    if name.partition(".")[0] in OURS:
        sys.modules[name] = ModuleType(name, "nothing in it")
"""


def run(script, *arguments):
    """What a host prints; it must end with exit code 0."""
    roots = [ROOT / folder for folder in ("plant", "sensor", "controller", "fmus", "orchestrator")]
    done = subprocess.run(
        [sys.executable, "-c", script, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, [TESTS, *roots]))},
        capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.mark.slow
def test_a_host_does_not_change_what_an_fmu_computes(fmus, tmp_path):
    """Whose modules of the same names are empty."""
    alone, beside = (
        run(HOST.format(before=before), tmp_path / str(k), *sorted(fmus.glob("*.fmu")))
        for k, before in enumerate((NOTHING, REPLACED))
    )
    assert len({*alone.split()}) > 250
    assert alone == beside
