"""Groups of a user's own: registered by a script, or an entry point of an installed package."""

import subprocess
import sys

import pytest
from grasp_cosim import InputError
from grasp_cosim.base import registry
from grasp_cosim.metrics.groups import Group, group_of, metrics_of, register_group
from grasp_cosim.metrics.metric import metric
from support.native_fmus import needs_gcc
from support.native_systems import write_oscillator

PACKAGE = '''
from grasp_cosim import metric
from grasp_cosim.metrics.groups import Group
from grasp_cosim.recording.result import View


@metric("reach", unit="m", group="swings")
def reach(run):
    """Where it ends."""
    return float(run["a.x"][-1])


def check(system):
    return [f"{system.name} is checked"]


def draw(run, path):
    return f"a picture of {run.settings['system']}"


def view():
    return View("swings", lambda run: "a.x" in run, draw)


SWINGS = Group((reach,), check, view)
'''

RUN = """
from grasp_cosim import System, simulate, sweep

system = System.load("oscillator.toml")
result = simulate(system)
assert list(result.measured.values) == ["reach"], result.measured
assert any("is checked" in line for line in result.log), result.log
assert result.plot() == "a picture of oscillator.toml"
table = sweep(system, [{"a.gain": 1.0}, {"a.gain": 2.0}], workers=2)
assert table.metrics == ("reach",)
"""


@pytest.fixture
def folder(tmp_path):
    """The oscillator with the group "swings", and the package that has it."""
    write_oscillator(tmp_path)
    path = tmp_path / "oscillator.toml"
    path.write_text('metrics = ["swings"]\n' + path.read_text("utf-8"), "utf-8")
    (tmp_path / "swinging.py").write_text(PACKAGE)
    return tmp_path


def ran(folder, program):
    """What went wrong in a program that runs beside the package."""
    (folder / "program.py").write_text(program)
    command = [sys.executable, str(folder / "program.py")]
    environment = {"PYTHONPATH": str(folder), "PATH": "", "HOME": str(folder)}
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=300, env=environment
    )
    return done.stderr


@needs_gcc
@pytest.mark.slow
def test_a_script_registers_its_group_for_itself_and_the_processes_of_its_sweeps(folder):
    registers = "import swinging\nfrom grasp_cosim.metrics.groups import register_group\n"
    assert ran(folder, f"{registers}register_group('swings', swinging.SWINGS)\n{RUN}") == ""


@needs_gcc
@pytest.mark.slow
def test_that_of_an_installed_package_is_an_entry_point(folder):
    info = folder / "swinging-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: swinging\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[grasp_cosim.groups]\nswings = swinging:SWINGS\n")
    assert ran(folder, RUN) == ""


@needs_gcc
@pytest.mark.slow
def test_nobody_registered_it(folder):
    assert ran(folder, RUN).splitlines()[-1] == (
        "grasp_cosim.base.errors.InputError: oscillator.toml: metrics: no group 'swings'; "
        "valid: grasp, hand, tandem"
    )


@pytest.fixture
def entry_points(monkeypatch):
    """Groups of installed packages, by name: the entry points of a test."""
    from importlib.metadata import EntryPoint

    def bring(name, value):
        point = EntryPoint(name, value, "grasp_cosim.groups")
        monkeypatch.setattr(registry, "_entry_points", lambda kind: {name: point})

    return bring


def test_an_entry_point_that_cannot_be_imported_is_said_in_a_line(entry_points):
    entry_points("swings", "no_such_package:GROUP")
    with pytest.raises(InputError) as caught:
        group_of("swings")
    assert str(caught.value) == (
        "groups: 'swings': no_such_package:GROUP cannot be imported: "
        "ModuleNotFoundError: No module named 'no_such_package'"
    )


def test_what_is_no_group_is_refused(entry_points):
    entry_points("swings", "math:pi")
    said = r"groups: 'swings': is of type float; must be a grasp_cosim.metrics.groups.Group"
    with pytest.raises(InputError, match=said):
        metrics_of(["swings"])
    with pytest.raises(InputError, match=said):
        register_group("swings", 3.0)


def test_a_group_takes_the_place_of_an_older_one_but_not_of_ours(monkeypatch):
    monkeypatch.setattr(registry, "_OBJECTS", {})
    first, second = (Group((metric(name)(len),)) for name in ("first", "second"))
    register_group("swings", first)
    register_group("swings", second)
    assert metrics_of(["swings"]) == second.metrics
    with pytest.raises(InputError, match="groups: 'grasp': comes with grasp-cosim; must have"):
        register_group("grasp", first)


@pytest.mark.parametrize(("kind", "name"), registry._LOADERS)
def test_all_that_the_facade_registers_is_there(kind, name):
    thing = registry.registered(kind, name)
    assert isinstance(thing, Group) if kind == "groups" else callable(thing)
