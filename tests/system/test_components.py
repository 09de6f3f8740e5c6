"""A component: units that a system file names, its solver, its native twin with the same bits."""

import json
import logging
import shutil
from dataclasses import replace

import numpy as np
import pytest
from comparison.made import PLANT, write_fmu
from grasp_cosim import InputError, System, grasp_system, simulate
from grasp_cosim.base.si_units import Unit
from grasp_cosim.comparison.qualify import prepare_swap
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.grasp.system import with_controller
from grasp_cosim.interface.read import read_interface
from grasp_cosim.interface.renaming import in_units
from grasp_cosim.ssp.to_archive import write_ssp
from grasp_cosim.system.parts import Solver
from grasp_cosim.system.settings import settings
from grasp_cosim.system.validity import connection_transform, remarks
from support.marks import needs_compiler
from support.native_fmus import build_model, needs_gcc
from support.native_systems import write_oscillator

SPRING = {
    "position": 'causality="input" | Real start="0" unit="m"',
    "force": 'causality="output" | Real unit="N"',
}
BARE = {name: text.replace(' unit="m"', "") for name, text in PLANT.items()}
"""The plant without units of length."""


def load(folder, plant, more="", link='"plant.gap -> spring.position"'):
    """A plant and a spring that pushes it; `more` stands under [components.plant]."""
    write_fmu(folder / "plant.fmu", plant)
    write_fmu(folder / "spring.fmu", SPRING, {"force": ["position"]})
    path = folder / "loop.toml"
    path.write_text(
        f'connections = [{link}, "spring.force -> plant.force"]\n'
        "[experiment]\nstep = 1e-3\nstop = 0.01\n"
        f'[components.plant]\nfmu = "plant.fmu"\nvalues = {{ width = 0.07 }}\n{more}\n'
        '[components.spring]\nfmu = "spring.fmu"\n',
        "utf-8",
    )
    return System.load(path)


def gap_to_position(system):
    return connection_transform(system, system.connections[0])


@pytest.mark.parametrize(
    ("unit", "factor"), [("mm", 1e-3), ("m", 1.0), ("km", 1e3), ("um", 1e-6), ("metre", 1.0)]
)
def test_a_connection_converts_by_the_named_unit(tmp_path, unit, factor):
    system = load(tmp_path, BARE, f'units = {{ gap = "{unit}" }}')
    assert gap_to_position(system) == pytest.approx((factor, 0.0), rel=1e-15)
    assert system.component("plant", "").interface.by_name["gap"].unit == unit
    assert settings(system)["components"]["plant"]["units"] == {"gap": unit}


@pytest.mark.parametrize("plant", [PLANT, BARE])
def test_a_minus_before_a_unit_turns_the_sign(tmp_path, plant):
    system = load(tmp_path, plant, 'units = { gap = "-mm", width = "-m" }')
    assert gap_to_position(system) == pytest.approx((-1e-3, 0.0), rel=1e-15)
    interface = system.component("plant", "").interface
    assert in_units(interface, {"gap": "-m"}).units["-m"].factor == -1.0
    with pytest.raises(InputError, match="units: 'gap' = '--kg': no unit that"):
        in_units(interface, {"gap": "--kg"})


def test_without_a_name_values_are_passed_as_they_are(tmp_path):
    assert gap_to_position(load(tmp_path, BARE)) == (1.0, 0.0)


def test_a_definition_of_the_fmu_goes_before_the_known_unit(tmp_path):
    interface = read_interface(write_fmu(tmp_path / "plant.fmu", BARE))
    own = replace(interface, units={"mm": Unit("mm", (0, 1, *[0] * 6), 0.5)})
    for declares, factor in ((own, 0.5), (interface, 1e-3)):
        found = in_units(declares, {"gap": "mm"})
        unit = found.unit(found.by_name["gap"])
        assert unit.factor == factor


def test_a_declared_unit_is_replaced(tmp_path):
    system = load(tmp_path, dict(PLANT), 'units = { gap = "mm" }')
    assert gap_to_position(system) == (1e-3, 0.0)


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ('{ gab = "mm" }', ": units: 'gab' = 'mm': plant.fmu has no variable 'gab'; did"),
        (
            '{ gap = "mmm" }',
            ": units: 'gap' = 'mmm': no unit that plant.fmu defines, or that is kno",
        ),
        (
            '{ gap = "" }',
            ": units: 'gap' = '': no unit that plant.fmu defines, or that is known; mu",
        ),
        (
            '{ touching = "1" }',
            ": units: 'touching' = '1': is of type Boolean; must be a Real, as o",
        ),
        (
            '{ gap = "-mM" }',
            ": units: 'gap' = '-mM': no unit that plant.fmu defines, or that is known; did",
        ),
        ("{ gap = 1 }", ".units.gap = 1: must be the name of a unit, like 'mm'"),
        ('"mm"', ".units: 'mm'; must be a table"),
    ],
)
def test_a_name_that_is_wrong_is_one_line(tmp_path, units, message):
    with pytest.raises(InputError) as caught:
        load(tmp_path, BARE, f"units = {units}")
    assert str(caught.value).startswith(f"loop.toml: components.plant{message}")
    assert "\n" not in str(caught.value)


def test_values_are_converted_for_an_fmu_in_other_units(tmp_path):
    plant = {n: text.replace('unit="m"', 'unit="mm"') for n, text in PLANT.items()}
    plant["width"] = plant["width"].replace('start="0.05"', 'start="50"').replace(' max="1"', "")
    in_mm = write_fmu(tmp_path / "other.fmu", plant)
    system = load(tmp_path, dict(PLANT))
    swapped = system.swap("plant", in_mm)
    assert swapped.start("plant.width") == pytest.approx(70.0, rel=1e-15)
    assert gap_to_position(swapped) == (1e-3, 0.0)
    again = swapped.swap("plant", tmp_path / "plant.fmu")
    assert again.start("plant.width") == pytest.approx(0.07, rel=1e-15)
    revised = system.with_settings({"components.plant.fmu": in_mm, "plant.width": 60.0})
    assert revised.start("plant.width") == 60.0


HEAD = '[experiment]\nstep = 0.1\nstop = 1.0\n[components.x]\nfmu = "dahlquist.fmu"\n'


def solved(folder, solver, *kinds):
    build_model("dahlquist", folder, "2.0", kinds or ("CoSimulation", "ModelExchange"))
    path = folder / "system.toml"
    path.write_text(f"{HEAD}values = {{ u = 0.0 }}\n{solver}\n", "utf-8")
    return System.load(path)


@needs_gcc
def test_what_a_system_file_says(tmp_path):
    text = "solver = { relative_tolerance = 1e-6, absolute_tolerance = 1e-9, maximum_step = 0.01 }"
    system = solved(tmp_path, text)
    assert system.components[0].integrated == Solver(1e-6, 1e-9, 0.01)
    assert remarks(system) == (
        "x: dahlquist.fmu runs by model exchange, integrated by CVode with a relative tolerance "
        "of 1e-06",
    )
    assert solved(tmp_path, "solver = {}").components[0].integrated == Solver()
    assert solved(tmp_path, "").components[0].integrated is None
    assert solved(tmp_path, "", "ModelExchange").components[0].integrated == Solver()


@needs_gcc
@pytest.mark.parametrize(
    ("solver", "message"),
    [
        ("1e-6", "components.x.solver: 1e-06; must be a table"),
        (
            "{ tolerance = 1e-6 }",
            "unknown entry 'tolerance'; did you mean absolute_tolerance, ",
        ),
        ("{ relative_tolerance = 0 }", "relative_tolerance = 0: must be a number from 1e-13 to 0"),
        ("{ relative_tolerance = '1' }", "relative_tolerance = '1': must be a number from"),
        ("{ absolute_tolerance = 0.0 }", "absolute_tolerance = 0.0: must be a number greater than"),
        ("{ maximum_step = -1.0 }", "maximum_step = -1.0: must be a number greater than 0"),
    ],
)
def test_a_mistake_is_one_line(tmp_path, solver, message):
    with pytest.raises(InputError, match=message) as caught:
        solved(tmp_path, f"solver = {solver}")
    assert "\n" not in str(caught.value)


@needs_gcc
def test_a_solver_for_co_simulation_alone(tmp_path):
    """It gets the tolerance, and is not integrated here."""
    (component,) = solved(tmp_path, "solver = {}", "CoSimulation").components
    assert component.integrated is None
    message = (
        "x: solver: maximum_step: dahlquist.fmu is for co-simulation only, with its own solver"
    )
    with pytest.raises(InputError, match=message):
        solved(tmp_path, "solver = { maximum_step = 0.1 }", "CoSimulation")


@needs_gcc
def test_another_fmu_takes_the_solver_that_it_can(tmp_path):
    system = solved(tmp_path, "solver = { relative_tolerance = 1e-6 }")
    for kind, solver in (("CoSimulation", None), ("ModelExchange", Solver(1e-6))):
        other = build_model("dahlquist", tmp_path, kinds=[kind], file="other")
        assert system.swap("x", other).components[0].solver == solver


@needs_gcc
@pytest.mark.parametrize("solver", ["solver = { relative_tolerance = 1e-6 }", ""])
@pytest.mark.parametrize("kinds", [("ModelExchange",), ("CoSimulation", "ModelExchange")])
def test_an_archive_keeps_it(tmp_path, solver, kinds):
    system, path = solved(tmp_path, solver, *kinds), tmp_path / "system.ssp"
    write_ssp(system, path)
    again = System.load(path)
    assert again.components[0].solver == system.components[0].solver
    assert simulate(again)["x.x"].tolist() == simulate(system)["x.x"].tolist()
    assert replace(again.components[0], solver=None).integrated == (
        None if "CoSimulation" in kinds else Solver()
    )


def natives(system):
    return {c.name for c in system.components if c.native}


@needs_compiler
def test_it_is_asked_for_anew_as_often_as_one_likes(grasp):
    everything = {"plant", "sensor_1", "sensor_2", "controller"}
    assert natives(grasp) == natives(grasp.natively(False)) == set()
    for native in (None, True):
        assert natives(grasp.natively(native)) == everything
        assert grasp.natively(native).natively(False) == grasp
    assert grasp.natively().natively() == grasp.natively()


@needs_compiler
def test_what_is_swapped_in_afterwards_runs_as_it_is(grasp):
    adaptive = with_controller(grasp.natively(), "adaptive")
    assert natives(adaptive) == {"plant", "sensor_1", "sensor_2"}
    assert natives(adaptive.natively()) == natives(grasp.natively())


@needs_compiler
@pytest.mark.parametrize("law", ["published", "adaptive"])
def test_the_built_in_grasp_runs_natively(law):
    native, python = (grasp_system(law, native) for native in (None, False))
    assert natives(native) == {c.name for c in python.components}
    assert natives(python) == set()
    ours, theirs = (simulate(s, step=1e-3, stop=0.2) for s in (native, python))
    assert all(np.array_equal(ours[name], theirs[name]) for name in theirs)


@pytest.fixture
def file(tmp_path, fmus):
    """The built-in grasp as a file, with a plant whose name is not that of its block."""
    shutil.copy(fmus / "GripperPlant.fmu", tmp_path / "my_plant.fmu")
    for name in ("ProximitySensor", "GraspController"):
        shutil.copy(fmus / f"{name}.fmu", tmp_path)
    path = tmp_path / "my.toml"
    path.write_text(SYSTEM.read_text("utf-8").replace("GripperPlant.fmu", "my_plant.fmu"), "utf-8")
    return path


@needs_compiler
def test_a_file_runs_natively_in_each_way_in_which_it_can_run(file):
    short = {"step": 1e-3, "stop": 0.2}
    result = simulate(file, **short)
    assert natives(result) == {"plant", "sensor_1", "sensor_2", "controller"}
    with simulate.session(file, **short) as session:
        session.step(200)
        assert natives(session.system) == natives(result)
        session.reset({"plant.object_width": 0.06})
    python = simulate(System.load(file).natively(False), **short)
    assert natives(python) == set()
    assert {n: c.tobytes() for n, c in python.items()} == {
        n: c.tobytes() for n, c in result.items()
    }
    result.save(file.parent / "run")
    fmus = json.loads((file.parent / "run" / "run.json").read_text())["fmus"]
    guids = {c.name: c.interface.guid for c in python.components}
    assert {name: fmu["native_twin_of"] for name, fmu in fmus.items()} == guids


@needs_compiler
def test_a_refusal_names_the_fmu_that_the_file_names(file):
    wide = System.load(file).with_values({"plant.object_width": 0.5})
    for system in (wide, wide.natively(False)):
        with pytest.raises(InputError, match=r"^plant: my_plant\.fmu refused its init.* = 0\.5 m"):
            simulate(system, stop=0.1)


@needs_compiler
def test_a_candidate_is_judged_itself(file):
    """Not a twin of it, which would run in its place."""
    swap = prepare_swap(System.load(file), "plant", file.parent / "my_plant.fmu", {}, {}, "none")
    result = simulate(swap.swapped, step=1e-3, stop=0.01)
    assert natives(result) == {"sensor_1", "sensor_2", "controller"}


@needs_compiler
def test_a_system_of_others_is_none_of_our_business(tmp_path, caplog):
    """Its FMUs need no Python."""
    system = System.load(write_oscillator(tmp_path))
    assert system.natively() == system == system.natively(True)
    assert caplog.text == ""


@needs_compiler
@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_they_run_in_python_unless_asked(grasp, caplog, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # where no native ones of the user's are
    assert natives(grasp.natively()) == set()
    ((_, level, said),) = caplog.record_tuples
    assert level == logging.WARNING
    assert said.startswith("FMUs run in Python, which takes longer: no C compiler: must be one of")
    with pytest.raises(InputError, match=r"^native FMUs cannot be built: no C compiler: must"):
        grasp.natively(True)
