"""Signals besides the outputs: recorded as an FMU has them at every step, never the end of a run.

By FMUs that only have locals: x' = k (u - x), so that x = u (1 - exp(-k t)).
"""

from dataclasses import replace

import fmpy
import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError, System, load_run, metric, simulate
from grasp_cosim.master import master
from grasp_cosim.recording.folder import RunFolder
from grasp_cosim.recording.mdf import read_mdf
from grasp_cosim.system.parts import Component, Condition, Connection, Event, Fault, Port
from support.marks import engines, skip_where_fmpy_runs_none
from support.native_fmus import build, inner, needs_cvode, needs_gcc, starts, state_space

pytestmark = needs_gcc

STEP, STEPS = 100_000_000, 5
LOCALS = ["x", "der(x)", "power[1]", "count", "high", "label", "empty"]
FIRST_STAMP = 2**53 + 1


def alone(fmu, *record, steps=STEPS, **more):
    component = Component("a", fmu, {"u": 1.0}, **more)
    made = System("alone", (component,), (), STEP, STEP * steps, "sequential")
    return made.with_record(*record)


def solution(result, k=2.0):
    return 1.0 - np.exp(-k * result.time)


VERSIONS = pytest.mark.parametrize("version", ["2.0", "3.0"])


@engines
@VERSIONS
def test_locals_are_recorded_where_there_is_no_output(tmp_path, version, engine):
    result = simulate(alone(inner(tmp_path, version)), engine=engine)
    assert list(result) == [f"a.{name}" for name in LOCALS]
    x = solution(result)
    assert result["a.x"] == pytest.approx(x, abs=1e-12)
    assert result["a.der(x)"] == pytest.approx(2.0 * (1.0 - x), abs=1e-12)
    assert result["a.power[1]"] == pytest.approx(x**2, abs=1e-12)
    assert result["a.count"].tolist() == [0, 1, 2, 3, 4, 5]
    assert result["a.high"].tolist() == (x > 0.5).tolist()
    assert result["a.label"].tolist() == ["high" if value > 0.5 else "low" for value in x]
    assert (result.units["a.x"], result["a.count"].dtype) == ("m", np.int64)
    assert result.log == (
        "a: inner.fmu has no output: recorded by default: 7 locals",
        "a.empty is nan at t = 0.3 s: recorded as it is",
    )


@pytest.mark.parametrize("isolation", ["none", pytest.param("process", marks=pytest.mark.slow)])
def test_of_an_fmu_with_outputs_any_signal_is_recorded_that_is_named(tmp_path, isolation):
    fmu = inner(tmp_path, outputs=True)
    by_default = simulate(alone(fmu, isolation=isolation))
    assert list(by_default) == ["a.y"]
    result = simulate(alone(fmu, "a.*", "!a.empty", "a.time", isolation=isolation))
    constants = {"k": 2.0, "u": 1.0, "tau": 0.5}
    assert {*result} == {f"a.{n}" for n in (*LOCALS[:-1], *constants, "y", "time")}
    for name, value in constants.items():
        assert result[f"a.{name}"].tolist() == [value] * (STEPS + 1)
    assert result["a.time"] == pytest.approx(result.time, abs=1e-15)  # as the FMU adds it up
    assert result["a.x"].tolist() == result["a.y"].tolist() == by_default["a.y"].tolist()


@needs_cvode
@VERSIONS
def test_locals_of_model_exchange_are_those_after_the_step(tmp_path, version):
    result = simulate(alone(inner(tmp_path, version, kinds=("ModelExchange",)), "a.x", "a.de*"))
    assert result["a.x"] == pytest.approx(solution(result), abs=1e-9)
    assert result["a.der(x)"] == pytest.approx(2.0 - 2.0 * result["a.x"], abs=1e-15)


@VERSIONS
def test_the_values_are_those_that_fmpy_records(tmp_path, version):
    skip_where_fmpy_runs_none(version)
    fmu = inner(tmp_path, version)
    names = ["x", "der(x)", "power[1]", "count", "high"]
    theirs = fmpy.simulate_fmu(
        str(fmu), stop_time=0.5, step_size=0.1, output_interval=0.1, output=names,
        fmi_type="CoSimulation", start_values={"u": 1.0},
    )  # fmt: skip
    ours = simulate(alone(fmu, *(f"a.{name}" for name in names)))
    for name in names:
        assert ours[f"a.{name}"].tolist() == theirs[name].tolist()


@engines
def test_elements_of_arrays_are_recorded_whole_or_one_by_one(tmp_path, engine):
    fmu = state_space(tmp_path)
    values = {"u[1]": 1.0, "u[2]": 2.0, "u[3]": 3.0}
    system = System("ss", (Component("a", fmu, values),), (), STEP, 3 * STEP, "sequential")
    whole = simulate(system.with_record("a.x", "a.y", "a.u"), engine=engine)
    assert list(whole) == [f"a.{n}[{i}]" for n in "uyx" for i in (1, 2, 3)]
    one = simulate(system.with_record("a.x[2]", "a.A[1,1]"), engine=engine)
    assert list(one) == ["a.A[1,1]", "a.x[2]"]
    assert one["a.x[2]"].tolist() == whole["a.x[2]"].tolist()
    assert one["a.A[1,1]"].tolist() == [1.0] * 4


@engines
def test_a_parameter_and_an_input_that_events_set_have_their_values_of_now(tmp_path, engine):
    """What is set before the step from 0.2 s on is in the row of its end."""
    set_ = Event({Port("a", "k"): 4.0, Port("a", "u"): 3.0}, at_ns=2 * STEP)
    system = replace(alone(inner(tmp_path), "a.k", "a.u", "a.tau"), events=(set_,))
    result = simulate(system, engine=engine)
    assert result["a.k"].tolist() == [2.0, 2.0, 2.0, 4.0, 4.0, 4.0]
    assert result["a.u"].tolist() == [1.0, 1.0, 1.0, 3.0, 3.0, 3.0]
    assert result["a.tau"].tolist() == [0.5, 0.5, 0.5, 0.25, 0.25, 0.25]


def loop(tmp_path, *record, **more):
    """The output of a to the input of b; a connected input is what its FMU was given last."""
    parts = (
        Component("a", inner(tmp_path, outputs=True, name="a"), {"u": 1.0}),
        Component("b", inner(tmp_path, name="b"), {}),
    )
    connection = Connection(Port("a", "y"), Port("b", "u"), 3.0)
    more = {"scheme": "sequential", **more}
    made = System("loop", parts, (connection,), STEP, STEPS * STEP, **more)
    return made.with_record(*record)


@engines
def test_a_connected_input_is_what_was_passed(tmp_path, engine):
    one = simulate(loop(tmp_path, "b.u", "a.y"), engine=engine)
    assert one["b.u"].tolist() == (3.0 * one["a.y"]).tolist()
    other = simulate(loop(tmp_path, "b.u", "a.y", scheme="jacobi"), engine=engine)
    assert other["b.u"].tolist() == [0.0, *(3.0 * other["a.y"][:-1]).tolist()]


@engines
def test_by_default_a_faulted_input_is_recorded_behind_its_fault(tmp_path, engine):
    faults = (Fault(Port("b", "u"), "bias", {"value": 7.0}, start_ns=2 * STEP),)
    clean = simulate(loop(tmp_path), engine=engine)
    result = simulate(loop(tmp_path, faults=faults), engine=engine)
    assert [name for name in result if name not in clean] == ["b.u"]
    expected = 3.0 * result["a.y"] + np.array([0.0, 0.0, 0.0, 7.0, 7.0, 7.0])
    assert result["b.u"].tolist() == expected.tolist()
    assert "b.u" not in simulate(loop(tmp_path, "!b.u", faults=faults), engine=engine)


@engines
@VERSIONS
def test_by_default_inputs_are_recorded_that_events_and_stimuli_set(tmp_path, version, engine):
    fmu = inner(tmp_path, version, outputs=True)
    set_ = Event({Port("a", "u"): 3.0, Port("a", "k"): 4.0}, at_ns=2 * STEP)
    result = simulate(replace(alone(fmu), events=(set_,)), engine=engine)
    assert list(result) == ["a.u", "a.y"]
    assert result["a.u"].tolist() == [1.0, 1.0, 1.0, 3.0, 3.0, 3.0]
    (tmp_path / "drive.csv").write_text("time,a.u\n0,0\n0.5,5\n", "utf-8")
    driven = simulate(alone(fmu).with_input(tmp_path / "drive.csv"), engine=engine)
    assert driven["a.u"] == pytest.approx([0.0, 0.0, 1.0, 2.0, 3.0, 4.0], abs=1e-12)


@engines
@pytest.mark.parametrize("record", [(), ("a.y",)])
def test_a_session_reads_and_records_what_it_sets(tmp_path, record, engine):
    """In one line of the log, whatever it sets how often; without a record by asking the FMU."""
    system = alone(inner(tmp_path, outputs=True), *record)
    inputs, read = [1.0], []
    with simulate.session(system, engine=engine) as session:
        read.append(session["a.u"])
        for k in range(STEPS):
            session.set("a.u", 0.5 * k)
            read.append(session["a.u"])
            session.step()
            inputs.append(0.5 * k)
        assert session["a.k"] == 2.0
        with pytest.raises(InputError, match=r"^'a\.w': no such signal; valid: .*a\.u"):
            session["a.w"]
        result = session.result()
    assert read == inputs
    assert [result[name].tolist() for name in result if name == "a.u"] == [inputs] * (not record)
    assert result.log == ("t = 0 s: a.u = 0.0; set 5 times, the last at t = 0.4 s: a.u = 2.0",)
    assert "a.u" not in simulate(system, engine=engine)


@engines
@pytest.mark.parametrize("record", [(), ("b.x",)])
def test_conditions_go_by_any_number(tmp_path, record, engine):
    """Recorded or not; x of a is above 0.5 from 0.4 s on, b.tau was 0.5 all the time."""
    stuck = Fault(Port("b", "u"), "stuck", {"value": 7.0}, when=Condition(Port("a", "x"), ">", 0.5))
    set_ = Event({Port("b", "k"): 4.0}, when=Condition(Port("b", "tau"), "<", 0.6))
    system = loop(tmp_path, *record, faults=(stuck,), events=(set_,))
    result = simulate(system, engine=engine)
    assert result.log[-2:] == (
        "t = 0 s: b.k = 4.0 (b.tau < 0.6)",
        "t = 0.4 s: b.u: stuck begins",
    )
    assert ("b.tau" in result, "a.x" in result) == (False, False)


def test_a_metric_gets_the_outputs_always_and_else_what_is_recorded(tmp_path):
    @metric("last", unit="1")
    def last(run):
        return run["a.y"][-1]

    @metric("work", unit="J")
    def work(run):
        return run["a.power[1]"].sum()

    fmu = inner(tmp_path, outputs=True)
    narrow = simulate(alone(fmu, "a.power[1]"), metrics=[last, work])
    assert list(narrow) == ["a.power[1]"]
    assert narrow.metrics["last"] == simulate(alone(fmu))["a.y"][-1]
    assert narrow.metrics["work"] == narrow["a.power[1]"].sum()
    missing = simulate(alone(fmu), metrics=[work])
    (line,) = missing.measured.missing
    assert (
        "a lacks power[1]; a signal that is no output must be recorded, --record a.power[1]" in line
    )


@pytest.mark.parametrize("form", ["csv", "arrow"])
def test_a_folder_has_what_is_recorded_and_metrics_of_the_rest(tmp_path, form):
    @metric("last", unit="1")
    def last(run):
        return run["a.y"][-1]

    recorded = ("a.stamp", "a.label", "a.high", "a.em*")
    system = alone(inner(tmp_path, outputs=True, stamp="local"), *recorded)
    out = tmp_path / "out"
    with RunFolder(out, system, form=form) as folder:
        result = simulate(system, listeners=[folder], metrics=[last])
        folder.finish(result)
    again = load_run(out)
    assert list(again) == list(result)
    for name, column in result.items():
        assert again[name].dtype == column.dtype
        assert list(map(repr, again[name].tolist())) == list(map(repr, column.tolist()))
    assert again.metrics["last"] == result.metrics["last"]
    assert again.settings["record"] == list(recorded)
    assert again.log == result.log


@engines
@pytest.mark.parametrize("causality", ["local", "output"])
def test_a_stamp_beyond_2_to_the_53_that_nothing_uses_is_recorded_as_far_as_it_can_be(
    tmp_path, causality, engine
):
    fmu = inner(tmp_path, stamp=causality)
    result = simulate(alone(fmu, "a.x", "a.stamp"), engine=engine)
    stamps = [float(FIRST_STAMP + 2 * n) for n in range(STEPS + 1)]
    assert result["a.stamp"].tolist() == stamps
    assert result.log == (
        f"a.stamp is {stamps[0]:.0f} at t = 0 s: recorded to the 53 bits that a float64 holds",
    )
    without = simulate(alone(fmu, "a.x", "!a.stamp"), engine=engine)
    assert (list(without), without.log) == (["a.x"], ())


@engines
def test_a_stamp_that_something_uses_ends_the_run(tmp_path, engine):
    fmu = inner(tmp_path, stamp="output")
    when = Condition(Port("a", "stamp"), ">", 3)
    system = replace(alone(fmu), events=(Event({Port("a", "k"): 1.0}, when=when),))
    with pytest.raises(InputError, match=r"a\.stamp = .* at step 0: must be smaller than 2\*\*53"):
        simulate(system, engine=engine)
    target = Component(
        "b", build(tmp_path), {n: v for n, v in starts("3.0").items() if n != "u_UInt64"}
    )
    parts = (*alone(fmu).components, target)
    link = Connection(Port("a", "stamp"), Port("b", "u_UInt64"))
    connected = System("two", parts, (link,), STEP, STEP * STEPS, "sequential")
    with pytest.raises(InputError, match=r"a\.stamp = .* at step 0: must be smaller than 2\*\*53"):
        simulate(connected, engine=engine)


@engines
@pytest.mark.parametrize("form", ["csv", "arrow"])
def test_a_whole_number_beyond_an_int64_is_recorded_too(tmp_path, form, engine):
    """The largest UInt64, which is 2^64 as a float64, is kept by every listener."""
    component = Component("a", build(tmp_path), {**starts("3.0"), "u_UInt64": 2**64 - 1})
    system = System("wide", (component,), (), STEP, STEP * 2, "sequential")
    system = system.with_record("a.y_UInt64", "a.steps")
    with RunFolder(tmp_path / "out", system, form=form) as folder:
        result = simulate(system, listeners=[folder], engine=engine)
        folder.finish(result)
    for one in (result, load_run(tmp_path / "out")):
        assert one["a.y_UInt64"].tolist() == [2.0**64] * 3
        assert one["a.steps"].tolist() == [0, 1, 2]
        assert one["a.steps"].dtype == np.int64
    result.to_mdf(tmp_path / "wide.mf4")
    assert read_mdf(tmp_path / "wide.mf4")[1]["a.y_UInt64"].tolist() == [2.0**64] * 3


def test_what_is_no_output_never_ends_a_run(tmp_path):
    """x doubles every 0.1 s or so, in an output and in a local."""
    growing = {"k": -60.0, "u": 1.0}
    fmu = inner(tmp_path, outputs=True)
    system = replace(alone(fmu, "a.x", steps=40), components=(Component("a", fmu, growing),))
    with pytest.raises(SimulationError, match=r"a\.y ran away"):
        simulate(system)
    result = simulate(system.with_record("a.x", "!a.y"))
    assert result.complete
    assert result["a.x"][-1] < -1e60


def test_rows_of_many_signals_take_little_memory(tmp_path, monkeypatch):
    """Fewer of them wait together; nothing else changes."""
    system = alone(inner(tmp_path), "a.*", "!a.label", steps=100)
    usual = simulate(system)
    monkeypatch.setattr(master, "MAX_BYTES", 4096)
    few = simulate(system)
    assert [few[n].tobytes() for n in few] == [usual[n].tobytes() for n in usual]
