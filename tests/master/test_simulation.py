"""Runs and sessions: what can be done with one, when it is over, what is told and left."""

import math
import os
import signal
import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from fmi.test_instances import KINDS, alone
from grasp_cosim import InputError, SimulationError, System, simulate
from grasp_cosim.fmi.instance import ERROR
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.master import master
from grasp_cosim.system.parts import Connection, Event, Port
from support.marks import engines, needs_pythonfmu
from support.mocks import Mock, make_system
from support.native_fmus import needs_gcc

pytestmark = needs_gcc


@engines
def test_a_closed_session_calls_no_fmu(tmp_path, engine):
    with simulate.session(alone(tmp_path, "3.0", "none"), engine=engine) as session:
        session.step(3)
    closed = "^alone: the session is closed; must be a new one$"
    with pytest.raises(InputError, match=closed):
        session.step()
    with pytest.raises(InputError, match=closed):
        session.set("part.gain", 2.0)
    assert session["part.x"] == pytest.approx(0.6)
    assert len(session.result().time) == 4


@engines
def test_after_a_failure_no_fmu_is_called(tmp_path, engine):
    system = alone(tmp_path, "3.0", "none", error_at=0.35)
    with simulate.session(system, engine=engine) as session:
        with pytest.raises(SimulationError):
            session.step(5)
        for call in (session.step, lambda: session.set("part.gain", 2.0)):
            with pytest.raises(InputError, match="the session is broken off by a failure or an"):
                call()
        assert len(session.result().time) == 4


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize(("version", "isolation"), KINDS)
def test_an_interrupted_session_does_not_go_on(tmp_path, version, isolation):
    """Its FMU is further than its rows."""
    part = alone(tmp_path, version, isolation, interrupt_at=0.001_000_5, interrupted=os.getpid())
    system = replace(part, step_ns=1000, stop_ns=100_000_000_000)
    with simulate.session(system, engine="python") as session:
        with pytest.raises(KeyboardInterrupt):
            session.step(100_000_000)
        with pytest.raises(InputError, match="the session is broken off by a failure or an"):
            session.step()
        result = session.result()
        assert not result.complete
        assert result["part.x"] == pytest.approx(2.0 * result.time, rel=1e-9)


def test_a_session_that_has_not_stepped_has_metrics(tmp_path):
    with simulate.session(alone(tmp_path, "3.0", "none")) as session:
        metrics = session.result().metrics
    assert (metrics["steps"], metrics["real_time_factor"]) == (0, 0.0)


@pytest.mark.parametrize("steps", [0, -1, 1.5, True, 2**63])
def test_steps_are_counted_in_whole_numbers(grasp, steps):
    with simulate.session(grasp, stop=0.01) as session:
        with pytest.raises(InputError, match=r"steps = .*: must be a whole number from 1 to"):
            session.step(steps)
        assert session.step(np.int64(3))
        assert session.time == 3e-4


def test_a_step_of_our_own_c_asks_the_system_for_nothing(natives, monkeypatch):
    """No signal handler is set, no folder looked up: FMUs that may do what they like need that."""

    def asked(*_):
        raise AssertionError("asked")

    with simulate.session(System.load(SYSTEM, natives)) as session:
        monkeypatch.setattr(signal, "signal", asked)
        monkeypatch.setattr(os, "getcwd", asked)
        assert session.step()
        session.restore(session.save())
        monkeypatch.undo()


def test_an_engine_that_does_not_exist_is_refused(grasp):
    with pytest.raises(InputError, match="engine = 'complied': must be one of auto, python, comp"):
        simulate(grasp, stop=1e-3, engine="complied")


@engines
def test_a_value_that_is_not_finite_is_found_in_its_step(tmp_path, monkeypatch, engine):
    """Also where it has gone again at the end of the call."""
    monkeypatch.setattr(master, "LONG", math.inf)
    mock = Mock(tmp_path, "a", lambda u, t: math.inf if 0.45 < t < 0.65 else t)
    monkeypatch.setattr("grasp_cosim.master.session.load", lambda component: mock)
    with simulate.session(make_system([mock], [], 10), engine=engine) as session:
        for _ in range(3):
            session.step()
        with pytest.raises(
            SimulationError, match=r"^a\.y = inf at step 5: must be finite"
        ) as error:
            session.step(5)
        assert len(error.value.result.time) == 6


def test_a_setting_is_checked_each_time(grasp):
    with simulate.session(grasp, stop=0.1) as session:
        session.set("sensor_1.reflectance", 0.5)
        session.set("sensor_1.reflectance", 0.25)
        with pytest.raises(InputError, match=r"^set: sensor_1\.reflectance: reflectance = 'dark'"):
            session.set("sensor_1.reflectance", "dark")
        for _ in range(2):
            with pytest.raises(
                InputError, match=r"^set: sensor_1\.sampling\.rate: is a fixed param"
            ):
                session.set("sensor_1.sampling.rate", 1e3)
        (line,) = session.result().log
        assert line == (
            "t = 0 s: sensor_1.reflectance = 0.5; set 2 times, the last at t = 0 s: "
            "sensor_1.reflectance = 0.25"
        )


LOOP = "algebraic loop at t = 0 through a.u: solved in "


def ring(folder, monkeypatch, **more):
    """y = 1 - 5 u, u = y; and its second mock."""
    mocks = [Mock(folder, "a", lambda u, t: 1.0 - 5.0 * u), Mock(folder, "b", lambda u, t: u)]
    by_name = {m.name: m for m in mocks}
    monkeypatch.setattr(
        "grasp_cosim.master.session.load", lambda component: by_name[component.name]
    )
    ends = [(Port("a", "y"), Port("b", "u")), (Port("b", "y"), Port("a", "u"))]
    return make_system(mocks, [Connection(*e) for e in ends], 10, **more), mocks[1]


def test_a_loop_is_told_before_the_first_step_and_what_is_known_is_not(tmp_path, monkeypatch):
    system, b = ring(tmp_path, monkeypatch, notes=("read in a way",))
    told = []

    def note(line):
        told.append((line, any(c.startswith("step") for c in b.calls)))

    result = simulate(system, note=note)
    ((line, stepped),) = told
    assert line.startswith(LOOP)
    assert not stepped
    assert result.log == ("read in a way", line)


def test_a_run_that_fails_has_told_it_and_what_came_later_once(tmp_path, monkeypatch):
    event = Event({Port("a", "p"): 2.0}, 100_000_000)
    system, b = ring(tmp_path, monkeypatch, events=(event,))
    told = []
    session = simulate.session(system, note=told.append)
    assert len(told) == 1
    session.step(2)
    b.statuses["step"] = ERROR
    with pytest.raises(SimulationError):
        session.step()
    session.close()
    session.close()
    assert told[0].startswith(LOOP)
    assert len(told) == len(set(told)) == 2
    assert "a.p" in told[1]


SHORT = 0.05


def test_every_output_is_recorded_with_its_unit(grasp):
    result = simulate(grasp, stop=SHORT)
    outputs = {
        f"{c.name}.{v.name}": v.unit for c in grasp.components for v in c.interface.of("output")
    } | {f"plant.exchange_energy[{j}]": "J" for j in (1, 2)}
    assert dict(result.units) == outputs
    assert set(result) == set(outputs)
    assert all(len(result[name]) == len(result.time) == 501 for name in outputs)
    assert result["plant.contact[1]"].dtype == bool


def test_nothing_jumps_at_the_start(grasp):
    """The virtual objects start where the fingers are measured, wherever the FMUs' inputs start."""
    moved = grasp.with_values(
        {"plant.initial_position[1]": 0.15, "plant.initial_position[2]": -0.1}
    )
    result = simulate(moved, stop=SHORT)
    assert result["controller.virtual_position[1]"][0] == 0.15
    assert result["controller.virtual_position[2]"][0] == -0.1
    assert result["controller.target_position"][0] == pytest.approx(0.025, abs=1e-15)
    for j in (1, 2):
        assert np.abs(np.diff(result[f"controller.force[{j}]"])).max() < 0.02


GAP = "l = 0.0 if u.gap < 0.0 else u.gap"


def test_an_fmu_that_fails_on_the_way_leaves_what_was_recorded(grasp, altered):
    trap = f"if u.gap < 0.044:\n        raise RuntimeError('the lamp is broken')\n    {GAP}"
    fmu = altered("ProximitySensor", "proximity_sensor/optics.py", GAP, trap)
    with pytest.raises(
        SimulationError, match=r"^sensor_1: .*fatal at t = .*lamp is broken"
    ) as caught:
        simulate(grasp.swap("sensor_1", fmu))
    result = caught.value.result
    assert not result.complete
    assert len(result.time) > 100
    assert result["plant.gap[1]"][-1] == pytest.approx(0.044, abs=1e-5)
    assert "\n" not in str(caught.value)
    assert "Traceback" in "".join(caught.value.__notes__)  # for --debug
    assert simulate(grasp, stop=1e-3).complete  # the process is well


@needs_pythonfmu
@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux which libraries are loaded")
def test_a_python_fmu_that_refuses_a_step_says_why_and_is_freed(grasp):
    """pythonfmu answers fmi2Fatal, after which FMI forbids to free it: ours outlives that."""
    before = Path("/proc/self/maps").read_text().count("GripperPlant.so")
    reason = r"^plant: \S+ returned fatal at t = 0 s: step of 20\.0 s: must be at most \S+ s "
    for _ in range(3):
        with pytest.raises(SimulationError, match=reason):
            simulate(grasp.with_experiment(step=20.0, stop=40.0))
    assert Path("/proc/self/maps").read_text().count("GripperPlant.so") == before


def test_nothing_stays_in_the_temporary_folder_or_on_the_path(grasp, tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    before = sys.path.copy()
    simulate(grasp, stop=1e-3)
    with pytest.raises(InputError):
        simulate(grasp.with_values({"plant.object_width": 0.5}), stop=1e-3)
    assert list(tmp_path.iterdir()) == []
    assert sys.path == before


@needs_pythonfmu
def test_a_temporary_folder_that_crashes_pythonfmu_is_refused(grasp, unpack_in):
    folder = unpack_in("a+b")
    with pytest.raises(InputError, match="set TMPDIR to a folder of plain ASCII letters"):
        simulate(grasp, stop=1e-3)
    assert list(folder.iterdir()) == []


def test_a_temporary_folder_with_a_space_is_fine(grasp, unpack_in):
    unpack_in("a b")
    assert simulate(grasp, stop=1e-3).complete


def test_a_session_says_how_far_it_is_and_which_names_it_has(grasp):
    with simulate.session(grasp, step=1e-3, stop=0.01) as session:
        session.step(3)
        assert repr(session) == "Session of grasp.toml at 0.003 of 0.01 s"
        names = session._ipython_key_completions_()
        assert {"plant.gap[1]", "sensor_1.gap"} <= {*names}
        assert [session[name] for name in names]
    assert repr(session).endswith(", closed")
