"""Events, faults and stimuli in runs, against the equation of the sensor, NumPy and FMPy."""

from dataclasses import replace

import numpy as np
import pytest
from fmpy import simulate_fmu
from grasp_cosim import InputError, SimulationError, System, simulate
from grasp_cosim.system.parts import Event, Fault, Port
from grasp_cosim.system.stimuli import read_stimuli
from hypothesis import given
from hypothesis import strategies as st
from support.marks import engines, examples, skip_where_fmpy_runs_none
from support.native_fmus import build, needs_gcc
from support.native_systems import REALS, driven

STEP = 1e-3
GAP = Port("sensor_1", "gap")
REFLECTANCE = Port("sensor_1", "reflectance")


def intensity(gap, reflectance=1.0):
    """Eq. (9) in V, for a gap in m."""
    return np.asarray(0.0024 * reflectance / (np.maximum(gap, 0.0) + 0.005) ** 1.1506)


def run(system, stop=0.3, **changes):
    return simulate(replace(system, **changes), step=STEP, stop=stop)


def on_gap(kind, start=0, end=None, **given):
    """A fault of the connection to sensor 1, with a window in steps."""
    unit = round(STEP * 1e9)
    return Fault(GAP, kind, given, start * unit, None if end is None else end * unit)


def test_a_change_of_reflectance_moves_the_target(grasp):
    """Finger 1's side gets darker: it looks further away, so the target moves its way."""
    event = Event({REFLECTANCE: 0.6}, at_ns=100_000_000)
    plain, changed = run(grasp), run(grasp, events=(event,))
    k = 100  # the row of the event: what it sets acts on the step from there
    for name in plain:
        assert plain[name][: k + 1].tobytes() == changed[name][: k + 1].tobytes()
    alpha = np.where(np.arange(301) <= k, 1.0, 0.6)
    expected = intensity(changed["plant.gap[1]"], alpha)
    assert changed["sensor_1.intensity"] == pytest.approx(expected, rel=1e-12)
    difference = changed["controller.target_position"] - plain["controller.target_position"]
    assert not difference[: k + 1].any()
    assert (np.diff(difference[k + 1 :]) < 0).all()
    assert "t = 0.1 s: sensor_1.reflectance = 0.6" in changed.log


TUNED = {
    "plant.finger_mass[1]": 0.8,
    "plant.friction.coulomb[2]": 0.05,
    "plant.actuator.force_limit[1]": 0.5,
    "controller.simultaneous_contact.enabled": False,
    "controller.impact_reduction.viscosity[2]": -0.4,
}
"""What acts by the steps alone."""


def test_an_event_at_the_start_is_a_start_value(grasp):
    at_once = Event({Port(*name.split(".", 1)): v for name, v in TUNED.items()}, at_ns=0)
    changed, began = run(grasp, events=(at_once,)), run(grasp.with_values(TUNED))
    for name in began:
        assert changed[name][1:].tobytes() == began[name][1:].tobytes(), name
    assert changed["plant.position[1]"][-1] != run(grasp)["plant.position[1]"][-1]
    assert "t = 0 s: controller.simultaneous_contact.enabled = false" in changed.log


def test_values_that_do_not_go_together_end_the_run_with_the_reason(grasp):
    low, high = (Port("sensor_1", f"adc.range[{i}]") for i in (1, 2))
    event = Event({low: 20.0, Port("sensor_1", "surface"): "black"}, at_ns=10_000_000)
    with pytest.raises(SimulationError, match=r"adc\.range = 20\.0, 10\.0 V: the second must be"):
        run(grasp, events=(event,))
    back = Event({high: 30.0}, at_ns=10_000_000)
    result = run(grasp, events=(event, back))
    assert result["sensor_1.intensity"][11] == pytest.approx(
        intensity(result["plant.gap[1]"], 0.57)[11]
    )


def test_a_fault_from_0_acts_at_t_0(grasp):
    result = run(grasp, stop=0.01, faults=(on_gap("bias", value=0.003),))
    expected = intensity(result["plant.gap[1]"] + 0.003)
    assert result["sensor_1.intensity"] == pytest.approx(expected, rel=1e-12)


def test_what_did_not_happen_is_in_the_log(grasp):
    event = Event({REFLECTANCE: 0.6}, at_ns=10_000_000)
    with simulate.session(replace(grasp, events=(event,)), step=STEP, stop=0.01) as session:
        session.step(9)
        assert session.result().log == ()
        session.step()
        line = "events[0] did not happen: no step began at or after t = 0.01 s"
        assert session.result().log == (line,)


INPUT = '[input]\nfile = "drive.csv"\n'
TEXT = """time,a.u_{0},a.u_Boolean,a.u_Enumeration
-1,0,0,1
0.2,0,1,2
0.37,0.9,1,2
0.5,1.0,1,1
0.5,3.0,0,1
0.8,3.5,0,2
"""
ROWS = [tuple(map(float, line.split(","))) for line in TEXT.splitlines()[1:]]


def column(result, name):
    return [float(x) for x in result[name]]


@needs_gcc
@engines
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_values_are_those_of_fmpy(engine, version, tmp_path):
    skip_where_fmpy_runs_none(version)
    real = REALS[version]
    result = simulate(
        System.load(driven(tmp_path, TEXT.format(real), version, INPUT)), engine=engine
    )
    names = [f"u_{real}", "u_Boolean", "u_Enumeration"]
    kinds = [np.double, np.bool_, np.int32]
    rows = np.array(ROWS, dtype=[("time", np.double), *zip(names, kinds, strict=True)])
    outputs = [name.replace("u_", "y_") for name in names]
    build(tmp_path, version=version, complete=True)  # FMPy wants all functions
    theirs = simulate_fmu(
        str(tmp_path / "native.fmu"), stop_time=1.0, output_interval=0.1, step_size=0.1,
        input=rows, output=[*outputs, "x"], fmi_type="CoSimulation",
    )  # fmt: skip
    assert np.allclose(theirs["time"], result.time, rtol=0.0, atol=1e-12)
    for name in [*outputs, "x"]:
        assert np.allclose(theirs[name], column(result, f"a.{name}"), rtol=0.0, atol=1e-12), name
    assert len(set(column(result, f"a.y_{real}"))) > 6


@needs_gcc
@engines
def test_held_holds_reals_too(engine, tmp_path):
    text = "time,a.u_Real\n0.25,1\n0.5,2\n0.5,3\n2,9\n"
    path = driven(tmp_path, text, more=INPUT + 'interpolation = "held"\n')
    result = simulate(System.load(path), engine=engine)
    assert column(result, "a.y_Real")[1:] == [1.0] * 5 + [3.0] * 5
    result = simulate(System.load(path, input=read_stimuli(tmp_path / "drive.csv")), engine=engine)
    assert column(result, "a.y_Real")[-1] == pytest.approx(3.0 + 6.0 * 0.4 / 1.5)


@needs_gcc
@engines
@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_an_own_step_takes_the_value_at_its_beginning(engine, scheme, tmp_path):
    path = driven(tmp_path, "time,a.u_Real\n0,0\n1,1\n", more=INPUT, own="step = 0.5")
    result = simulate(System.load(path), engine=engine, scheme=scheme)
    assert column(result, "a.y_Real") == [0.0] * 10 + [0.5]
    assert column(result, "a.x") == [0.0] * 10 + [0.25]


@needs_gcc
@given(
    times=st.lists(st.integers(-3, 13), min_size=1, max_size=6).map(sorted),
    values=st.lists(st.floats(-1e6, 1e6), min_size=6, max_size=6),
)
@examples(25)
def test_both_engines_give_the_same_bits(times, values, tmp_path_factory):
    folder = tmp_path_factory.mktemp("drawn")
    rows = "".join(f"{0.1 * t!r},{v!r}\n" for t, v in zip(times, values, strict=False))
    system = System.load(driven(folder, f"time,a.u_Real\n{rows}", more=INPUT))
    runs = [column(simulate(system, engine=e), "a.y_Real") for e in ("python", "auto")]
    assert runs[0] == runs[1]
    known = [t * 0.1 for t in times]
    last = {round(t, 1): v for t, v in zip(known, values, strict=False)}
    for k, y in enumerate(runs[0][1:]):
        if round(0.1 * k, 1) in last:
            assert y == last[round(0.1 * k, 1)]


@needs_gcc
def test_a_session_goes_along_and_does_not_set_what_is_driven(tmp_path):
    system = System.load(driven(tmp_path, "time,a.u_Real\n0,0\n1,1\n", more=INPUT))
    with simulate.session(system) as session:
        session.step(6)
        assert session["a.u_Real"] == pytest.approx(0.5)
        with pytest.raises(InputError, match=r"a.u_Real: is driven by a column: must have"):
            session.set("a.u_Real", 1.0)


@needs_gcc
def test_a_swap_to_another_unit_keeps_what_is_meant(tmp_path):
    build(tmp_path, "milli", "2.0", {"u_Real": "mm"})
    path = driven(tmp_path, "time,a.u_Real\n0,2\n", more=INPUT)
    build(tmp_path, "native", "2.0", {"u_Real": "m"})
    with pytest.raises(InputError, match=r"or an input file, is meant in m; must be in that"):
        System.load(path).swap("a", tmp_path / "milli.fmu")
    (tmp_path / "drive.csv").write_text("time,a.u_Real [cm]\n0,2\n", "utf-8")
    for system, value in (
        (System.load(path), 0.02),
        (System.load(path).swap("a", tmp_path / "milli.fmu"), 20.0),
    ):
        assert column(simulate(system), "a.y_Real") == [value] * 11
