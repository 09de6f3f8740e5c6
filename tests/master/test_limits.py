"""Limits of a system: conditions that must not hold, in both engines and schemes."""

from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import System, simulate
from grasp_cosim.base.errors import InputError, SimulationError
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.master.engine import has_compiler
from grasp_cosim.system.parts import RELATIONS, Condition, Limit, Port
from support.native_fmus import needs_gcc

ENGINES = ["python", pytest.param("compiled", marks=needs_gcc)]


def limited(system, *limits):
    return replace(system, limits=limits)


def limit(text, relation, value, then="abort"):
    return Limit(Condition(Port(*text.split(".", 1)), relation, value), then)


@pytest.fixture
def short(grasp):
    return grasp.with_experiment(step=4e-3, stop=1.0)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
@pytest.mark.parametrize("relation", RELATIONS[:4])
def test_a_run_is_aborted_at_the_first_point_where_a_limit_is_exceeded(
    short, engine, scheme, relation
):
    """With the row of that point, whether the signal is recorded or not."""
    short = short.with_experiment(scheme=scheme)
    whole = simulate(short)["plant.position[1]"]
    value = float(whole[100])
    compare = {"<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal}
    holds = compare[relation](whole, value)
    first = int(np.argmax(holds))
    system = limited(short.with_record("sensor_1.*"), limit("plant.position[1]", relation, value))
    with pytest.raises(SimulationError) as error:
        simulate(system, engine=engine)
    result = error.value.result
    assert len(result.time) == first + 1
    time = f"{first * 4e-3:.9g} s"
    said = f"limits[0]: plant.position[1] {relation} {value!r}"
    assert f"{said} at t = {time}, it is {whole[first]:.6g} m: the run was aborted" in str(
        error.value
    )
    (trip,) = result.limits
    assert trip == (str(system.limits[0].when), "abort", result.time[-1], whole[first], 1)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_warning_is_said_once_and_its_steps_are_counted(short, engine):
    """Several limits that hold at the same points are all noticed; values stay as they are."""
    whole = simulate(short)
    x, u = whole["plant.position[1]"], whole["controller.force[1]"]
    limits = [
        limit("plant.position[1]", "<", float(x[80]), "warn"),
        limit("controller.force[1]", ">", float(u[80]), "warn"),
        limit("plant.contact[1]", "==", True, "warn"),
    ]
    result = simulate(limited(short, *limits), engine=engine)
    np.testing.assert_array_equal(result["plant.position[1]"], x)
    counts = {trip.limit.split()[0]: trip.steps for trip in result.limits}
    assert counts == {
        "plant.position[1]": (x < x[80]).sum(),
        "controller.force[1]": (u > u[80]).sum(),
    }
    assert sum("limits[0]: plant.position[1] <" in line for line in result.log) == 1


def test_a_limit_at_the_start(short):
    with pytest.raises(SimulationError, match=r"limits\[0\]: plant\.gap\[1\] > 0\.0 at t = 0 s"):
        simulate(limited(short, limit("plant.gap[1]", ">", 0.0)))


@pytest.mark.skipif(not has_compiler(), reason="NO C compiler")
def test_in_real_time(short):
    whole = simulate(short)["plant.position[1]"]
    system = limited(short.natively(), limit("plant.position[1]", "<", float(whole[20])))
    with pytest.raises(SimulationError, match="the run was aborted") as error:
        simulate(system, realtime=True, engine="compiled")
    assert len(error.value.result.time) == 22


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("then = 'abort'", r"limits[0]: no entry 'when'; must have one"),
        ("when = 'plant.gap[1] < 1'\nthen = 'stop'", "then = 'stop': must be one of abort, warn"),
        ("when = 'plant.gap[1] ~ 1'", "when = 'plant.gap[1] ~ 1': must be like"),
        ("when = 'plant.gap[9] < 1'", "plant has no number 'gap[9]'"),
        ("when = 'plant.contact[1] < 2'", "plant.contact[1] is Boolean; must be compared with"),
        ("when = 'plant.gap[1] < 1'\nset = 1", "unknown entry 'set'"),
    ],
)
def test_limits_of_a_system_file_that_are_none(tmp_path, fmus, table, said):
    with pytest.raises(InputError) as error:
        read(tmp_path, fmus, table)
    assert said in str(error.value)


def test_limits_of_a_system_file(tmp_path, fmus):
    system = read(tmp_path, fmus, "when = 'plant.contact_force[1] > 8'")
    assert system.limits == (limit("plant.contact_force[1]", ">", 8.0),)


def read(folder, fmus, table):
    """The grasp with a limit."""
    path = folder / "system.toml"
    path.write_text(f"{SYSTEM.read_text()}\n[[limits]]\n{table}\n")
    return System.load(path, fmus)
