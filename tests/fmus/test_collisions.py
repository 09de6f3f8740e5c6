"""All Python FMUs of a process share one sys.modules: each runs its own code all the same."""

import ast
import os
import subprocess
import sys
from collections.abc import Iterator
from itertools import zip_longest
from math import sin
from pathlib import Path
from zipfile import ZipFile

import pytest
from conftest import Altered, Load
from grasp_fmus.package import package_folder
from support.fmi2 import OK, Fmu, Instance
from support.kinds import all_kinds
from support.packages import runnable

TESTS = Path(__file__).parents[1]
ROOT = TESTS.parent
H = 1e-3

BLOCKS = {
    "GraspController": ROOT / "controller" / "grasp_controller",
    "GraspControllerAdaptive": ROOT / "controller" / "grasp_controller",
    "GripperPlant": ROOT / "plant" / "gripper_plant",
    "GripperPlantCompliant": ROOT / "plant" / "gripper_plant",
    "GripperPlantMovable": ROOT / "plant" / "gripper_plant",
    "GripperPlantMuJoCo": ROOT / "plant" / "gripper_plant",
    "ProximitySensor": ROOT / "sensor" / "proximity_sensor",
}


def resources(fmu: Path) -> dict[str, str]:
    """The text files in resources/ by their names."""
    with ZipFile(fmu) as archive:
        return {
            name.removeprefix("resources/"): archive.read(name).decode()
            for name in archive.namelist()
            if name.startswith("resources/")
        }


# What is packed, and under which names


@pytest.mark.parametrize("name", BLOCKS)
def test_every_module_carries_the_hash_and_nothing_else_is_packed(fmus: Path, name: str) -> None:
    packed = resources(fmus / f"{name}.fmu")
    content = packed["slavemodule.txt"].removeprefix(f"{name}_")
    assert len(content) == 16
    assert packed.pop("slavemodule.txt") == f"{name}_{content}"
    block = f"from {BLOCKS[name].name} import "
    scripts = {f"{name}_{content}.py": packed[f"{name}_{content}.py"].replace(f"_{content}", "")}
    assert scripts[f"{name}_{content}.py"].startswith(block)
    for path, text in packed.items():
        package, _, file = path.partition("/")
        if file:
            folder = package_folder(package.removesuffix(f"_{content}"))
            scripts[path] = (folder / file).read_text()
        assert text.replace(f"_{content}", "") == scripts[path]


@pytest.mark.parametrize("name", BLOCKS)
def test_a_packed_module_imports_the_standard_library_and_packed_ones(
    fmus: Path, name: str
) -> None:
    packed = resources(fmus / f"{name}.fmu")
    content = packed.pop("slavemodule.txt").rpartition("_")[2]
    imported = {
        module.partition(".")[0]
        for file, text in packed.items()
        for module in imports(ast.parse(text, file))
    }
    ours = {module for module in imported if module not in sys.stdlib_module_names}
    at_need = {"mujoco"} if name == "GripperPlantMuJoCo" else set()
    assert ours == {file.partition("/")[0] for file in packed if "/" in file} | at_need
    assert ours >= {
        f"{BLOCKS[name].name}_{content}",
        f"grasp_fmus_{content}",
        f"block_variables_{content}",
    }


def imports(tree: ast.AST) -> Iterator[str]:
    """The modules that are imported by their absolute names."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield node.module or ""


# Instances side by side

PARAMETERS: dict[str, list[dict[str, float]]] = {
    "GraspController": [
        {},
        {"contact_force.stiffness": 60.0, "impact_reduction.viscosity[2]": -0.9},
        {"simultaneous_contact.gain": 0.0, "impact_reduction.mass": 2.0},
    ],
    "GraspControllerAdaptive": [
        {},
        {"contact_force.stiffness": 60.0, "reflectance.prior_deviation": 0.1},
        {"simultaneous_contact.gain": 0.0, "hold.squeeze": 1.0},
    ],
    "GripperPlant": [
        {},
        {"finger_mass[1]": 0.8, "object_width": 0.1, "initial_object_position": 0.0},
        {"finger_mass[2]": 0.2, "baumgarte_alpha": 350.0},
    ],
    "GripperPlantCompliant": [
        {},
        {"finger_mass[1]": 0.8, "kelvin_voigt.stiffness": 400.0, "initial_object_position": 0.0},
        {"finger_mass[2]": 0.2, "friction.static[1]": 0.5},
    ],
    "GripperPlantMovable": [
        {},
        {"object_mass": 0.2, "floor_friction": 0.6, "initial_object_position": 0.0},
        {"finger_mass[2]": 0.2, "friction.static[1]": 0.5},
    ],
    "GripperPlantMuJoCo": [
        {"object_fixed": False},
        {"object_mass": 0.2, "floor_friction": 0.6, "initial_object_position": 0.0},
        {"finger_mass[2]": 0.2, "friction.coulomb[1]": 0.5},
    ],
    "ProximitySensor": [{}, {"reflectance": 0.3}, {"gain": 0.01, "diffusion_exponent": 2.0}],
}


def driven(instance: Instance, steps: int) -> Iterator[list[float]]:
    """All outputs, step by step, under inputs that change; the plant gets into contact."""
    fmu = instance.fmu
    flags = [fmu.references[n] for n in fmu.names("output") if n in fmu.booleans]
    for k in range(steps):
        inputs = {
            n: (-5.0 if n == "force[1]" else 3.0) + sin(k)
            if n.startswith("force")
            else 0.05 + 0.04 * sin(0.3 * k + i)
            for i, n in enumerate(fmu.names("input"))
        }
        assert instance.set(inputs) == OK
        assert instance.step(k * H, H) == OK
        status, contacts = instance.get_boolean(flags)
        assert status == OK
        yield [*instance.outputs(), *contacts]


@all_kinds
@pytest.mark.parametrize("name", BLOCKS)
def test_interleaved_instances_are_as_each_one_alone(load: Load, name: str) -> None:
    """Bit for bit, with other parameters and other numbers of steps."""
    steps = (300, 200, 250)
    alone = []
    for values, n in zip(PARAMETERS[name], steps, strict=True):
        with Instance(load(name)).initialise(**values) as instance:
            alone.append(list(driven(instance, n)))
    assert len({str(trajectory[:200]) for trajectory in alone}) == 3
    instances = [Instance(load(name)).initialise(**values) for values in PARAMETERS[name]]
    runs = [driven(instance, n) for instance, n in zip(instances, steps, strict=True)]
    rounds = list(zip_longest(*runs))
    for instance in instances:
        instance.call("FreeInstance")
    together = [[row for row in run if row is not None] for run in zip(*rounds, strict=True)]
    assert together == alone


@all_kinds
def test_two_builds_of_one_fmu_run_their_own_code(
    load: Load, tmp_path: Path, altered: Altered
) -> None:
    """Alive at the same time and step by step in turn; whichever came first."""
    other = altered(
        "ProximitySensor",
        "proximity_sensor/optics.py",
        "p.gain * p.alpha",
        "2.0 * p.gain * p.alpha",
    )
    ours, theirs = load("ProximitySensor"), Fmu(other, tmp_path / "theirs")
    assert ours.guid != theirs.guid
    for order in ((ours, theirs, ours), (theirs, ours, theirs)):
        instances = [Instance(fmu).initialise(gap=0.02) for fmu in order]
        for values in zip(*(driven(instance, 50) for instance in instances), strict=True):
            one = values[order.index(ours)][0]
            assert [v[0] for v in values] == [one if f is ours else 2.0 * one for f in order]
        for instance in instances:
            instance.call("FreeInstance")


def test_two_builds_run_their_own_inner_modules(
    fmus: Path, tmp_path: Path, altered: Altered
) -> None:
    """Modules that a packed module imports, and those of the adapter, are of the same build."""
    other = altered("GripperPlant", "grasp_fmus/contract.py", "{i + 1}", "{i + 7}")
    ours = Fmu(fmus / "GripperPlant.fmu", tmp_path / "ours")
    theirs = Fmu(other, tmp_path / "theirs")
    with Instance(ours, "ours") as one, Instance(theirs, "theirs") as two:
        for instance in (one, two, one):
            mass = next(n for n in instance.fmu.references if n.startswith("finger_mass"))
            assert instance.set({mass: -1.0}) != OK
        assert [m.text.partition(" = -1.0")[0] for m in (*one.log, *two.log)] == [
            "ours, t = 0 s: finger_mass[1]",
            "ours, t = 0 s: finger_mass[1]",
            "theirs, t = 0 s: finger_mass[7]",
        ]


# Other hosts, and other people's FMUs: each in a process of its own

HOST = """
import sys
from pathlib import Path
{before}
from support.fmi2 import Fmu, Instance
from math import sin
folder, *fmus = map(Path, sys.argv[1:])
for path in fmus:
    fmu = Fmu(path, folder / path.stem)
    with Instance(fmu).initialise() as instance:
        for k in range(100):
            values = {{name: -0.1 * i + 0.03 * sin(k) for i, name in enumerate(fmu.names("input"))}}
            assert instance.set(values) == 0
            assert instance.step(k * 1e-3, 1e-3) == 0
            print(path.stem, *map(float.hex, instance.outputs()))
"""

OURS = """
import gripper_plant.rigid, gripper_plant.contact
import proximity_sensor.optics
import grasp_controller.series, grasp_controller.adaptive
import grasp_fmus.slave, grasp_fmus.contract
sys.path.insert(0, str(Path(grasp_fmus.__file__).parent / "scripts"))
import GraspController, GraspControllerAdaptive, GripperPlant, GripperPlantCompliant
import GripperPlantMovable, GripperPlantMuJoCo, ProximitySensor
MODULES = {
    name: module for name, module in sys.modules.items()
    if name.partition(".")[0] in (
        "gripper_plant", "proximity_sensor", "grasp_controller", "grasp_fmus", "block_variables",
        "GraspController", "GraspControllerAdaptive", "GripperPlant", "GripperPlantCompliant",
        "GripperPlantMovable", "GripperPlantMuJoCo", "ProximitySensor",
    )
}
assert len(MODULES) > 15
"""

GARBLED = """
def garbage(*_, **__):
    raise AssertionError("the host's function was called")
for name, module in MODULES.items():
    for key, value in list(vars(module).items()):
        if isinstance(value, type):
            for method, function in list(vars(value).items()):
                if callable(function) and value.__module__ in MODULES:
                    setattr(value, method, garbage)
        if callable(value):
            setattr(module, key, garbage)
assert gripper_plant.rigid.step is gripper_plant.contact.advance is garbage
"""

REPLACED = """
from types import ModuleType
for name in MODULES:
    sys.modules[name] = ModuleType(name, "nothing in it")
"""

HOSTS = {
    "that imports the same packages": OURS,
    "that has garbled them": OURS + GARBLED,
    "that has other modules of the same names": OURS + REPLACED,
}


def run(script: str, *arguments: object) -> str:
    """What a host prints; it must end with exit code 0."""
    roots = [ROOT / folder for folder in ("plant", "sensor", "controller", "fmus")]
    done = subprocess.run(
        [sys.executable, "-c", script, *map(str, arguments)],
        env={**os.environ, "PYTHONPATH": os.pathsep.join(map(str, [TESTS, *roots]))},
        capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.fixture(scope="session")
def plain(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> str:
    """The results in a host that has imported nothing of ours."""
    nothing = 'assert not {m for m in sys.modules if m.startswith(("grasp", "gripper", "prox"))}'
    folder = tmp_path_factory.mktemp("plain")
    printed = run(HOST.format(before=nothing), folder, *runnable(fmus))
    assert len(set(printed.splitlines())) > 250
    return printed


@pytest.mark.slow
@pytest.mark.parametrize("host", HOSTS)
def test_a_host_does_not_change_what_an_fmu_computes(
    fmus: Path, plain: str, tmp_path: Path, host: str
) -> None:
    printed = run(HOST.format(before=HOSTS[host]), tmp_path, *runnable(fmus))
    assert printed == plain


FOREIGN = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Integrator(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = 1.0
        self.y = 0.0
        self.register_variable(Real("u", causality=Fmi2Causality.input))
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def do_step(self, current_time, step_size):
        self.y += step_size * self.u
        return True
"""

BUILD_FOREIGN = """
import sys
from pythonfmu import FmuBuilder
FmuBuilder.build_FMU(sys.argv[1], dest=sys.argv[2])
"""

NEIGHBOURS = """
import sys
from pathlib import Path
from support.fmi2 import Fmu, Instance
folder, *paths = map(Path, sys.argv[1:])
fmus = {path.stem: Fmu(path, folder / path.stem) for path in paths}
instances = {name: Instance(fmu, name).initialise() for name, fmu in fmus.items()}
foreign, plant = instances["Integrator"], instances["GripperPlant"]
for k in range(100):
    assert foreign.set({"u": 0.5 * k}) == 0
    assert plant.set({"force[1]": -0.5 * k}) == 0
    for instance in instances.values():
        assert instance.step(k * 0.0078125, 0.0078125) == 0
    print(*foreign.outputs(), *plant.outputs())
for instance in instances.values():
    assert instance.call("Terminate") == 0
    instance.call("FreeInstance")
"""


@pytest.fixture(scope="session")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """An FMU as pythonfmu's own builder makes it."""
    folder = tmp_path_factory.mktemp("foreign")
    script = folder / "Integrator.py"
    script.write_text(FOREIGN)
    run(BUILD_FOREIGN, script, folder)
    return folder / "Integrator.fmu"


@pytest.mark.parametrize("first", ["ours", "theirs"])
def test_a_stock_pythonfmu_fmu_lives_in_the_same_process(
    fmus: Path, load: Load, foreign: Path, tmp_path: Path, first: str
) -> None:
    paths = [fmus / "GripperPlant.fmu", foreign]
    printed = run(NEIGHBOURS, tmp_path, *(paths if first == "ours" else paths[::-1]))
    h = 0.0078125  # a power of two: the sum is exact
    with Instance(load("GripperPlant")).initialise() as plant:
        expected = []
        for k in range(100):
            assert plant.set({"force[1]": -0.5 * k}) == OK
            assert plant.step(k * h, h) == OK
            expected.append([0.25 * h * k * (k + 1), *plant.outputs()])
    assert [[float(v) for v in line.split()] for line in printed.splitlines()] == expected
