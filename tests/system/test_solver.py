"""The solver of a component: in a system file, in an archive, and with another FMU."""

from dataclasses import replace

import pytest
from grasp_cosim import InputError, System, simulate
from grasp_cosim.ssp.to_archive import write_ssp
from grasp_cosim.system.parts import Solver
from grasp_cosim.system.validity import remarks
from support.native_fmus import build_model, needs_gcc

pytestmark = needs_gcc
HEAD = '[experiment]\nstep = 0.1\nstop = 1.0\n[components.x]\nfmu = "dahlquist.fmu"\n'


def load(folder, solver, *kinds):
    build_model("dahlquist", folder, "2.0", kinds or ("CoSimulation", "ModelExchange"))
    path = folder / "system.toml"
    path.write_text(f"{HEAD}values = {{ u = 0.0 }}\n{solver}\n", "utf-8")
    return System.load(path)


def test_what_a_system_file_says(tmp_path):
    text = "solver = { relative_tolerance = 1e-6, absolute_tolerance = 1e-9, maximum_step = 0.01 }"
    system = load(tmp_path, text)
    assert system.components[0].integrated == Solver(1e-6, 1e-9, 0.01)
    assert remarks(system) == (
        "x: dahlquist.fmu runs by model exchange, integrated by CVode with a relative tolerance "
        "of 1e-06",
    )
    assert load(tmp_path, "solver = {}").components[0].integrated == Solver()
    assert load(tmp_path, "").components[0].integrated is None
    assert load(tmp_path, "", "ModelExchange").components[0].integrated == Solver()


@pytest.mark.parametrize(
    ("solver", "message"),
    [
        ("1e-6", r"\[components.x\]: solver: 1e-06; must be a table"),
        (
            "{ tolerance = 1e-6 }",
            "unknown entry 'tolerance'; did you mean absolute_tolerance, ",
        ),
        ("{ relative_tolerance = 0 }", "relative_tolerance = 0: must be a number from 1e-13 to 0"),
        ("{ relative_tolerance = '1' }", "relative_tolerance = '1': must be a number from"),
        ("{ absolute_tolerance = 0.0 }", "absolute_tolerance = 0.0: must be a number greater than"),
        ("{ maximum_step = -1.0 }", "maximum_step = -1.0 s: must be a number greater than 0"),
    ],
)
def test_a_mistake_is_one_line(tmp_path, solver, message):
    with pytest.raises(InputError, match=message) as caught:
        load(tmp_path, f"solver = {solver}")
    assert "\n" not in str(caught.value)


def test_a_solver_for_co_simulation_alone(tmp_path):
    message = "x: solver: dahlquist.fmu is for co-simulation alone; must be left out"
    with pytest.raises(InputError, match=message):
        load(tmp_path, "solver = {}", "CoSimulation")


def test_another_fmu_takes_the_solver_that_it_can(tmp_path):
    system = load(tmp_path, "solver = { relative_tolerance = 1e-6 }")
    for kind, solver in (("CoSimulation", None), ("ModelExchange", Solver(1e-6))):
        other = build_model("dahlquist", tmp_path, kinds=[kind], file="other")
        assert system.swap("x", other).components[0].solver == solver


@pytest.mark.parametrize("solver", ["solver = { relative_tolerance = 1e-6 }", ""])
@pytest.mark.parametrize("kinds", [("ModelExchange",), ("CoSimulation", "ModelExchange")])
def test_an_archive_keeps_it(tmp_path, solver, kinds):
    system, path = load(tmp_path, solver, *kinds), tmp_path / "system.ssp"
    write_ssp(system, path)
    again = System.load(path)
    assert again.components[0].solver == system.components[0].solver
    assert simulate(again)["x.x"].tolist() == simulate(system)["x.x"].tolist()
    assert replace(again.components[0], solver=None).integrated == (
        None if "CoSimulation" in kinds else Solver()
    )
