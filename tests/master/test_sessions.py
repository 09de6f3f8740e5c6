"""Sessions: what can be done with one, when that is over, and what is told when."""

import math
import os
from dataclasses import replace

import numpy as np
import pytest
from fmi.test_instances import KINDS, alone
from grasp_cosim import InputError, SimulationError, simulate
from grasp_cosim.fmi.instance import ERROR
from grasp_cosim.master import master
from grasp_cosim.system.parts import Connection, Event, Port
from support.marks import engines
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


def test_a_value_that_does_not_fit_breaks_nothing(tmp_path):
    with simulate.session(alone(tmp_path, "3.0", "none")) as session:
        with pytest.raises(InputError, match="must be a finite number"):
            session.set("part.gain", float("nan"))
        assert session.step(10)
        assert session.complete


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


def test_an_engine_that_does_not_exist_is_refused(grasp):
    with pytest.raises(InputError, match="engine = 'complied': must be one of auto, python, comp"):
        simulate(grasp, stop=1e-3, engine="complied")


@engines
def test_a_value_that_is_not_finite_is_found_in_its_step(tmp_path, monkeypatch, engine):
    """Also where it has gone again at the end of the call."""
    monkeypatch.setattr(master, "LONG", math.inf)
    mock = Mock(tmp_path, "a", lambda u, t: math.inf if 0.45 < t < 0.65 else t)
    monkeypatch.setattr("grasp_cosim.master.simulation.load", lambda component: mock)
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
        assert len(session.result().log) == 2


LOOP = "algebraic loop at t = 0 through a.u: solved in "


def ring(folder, monkeypatch, **more):
    """y = 1 - 5 u, u = y; and its second mock."""
    mocks = [Mock(folder, "a", lambda u, t: 1.0 - 5.0 * u), Mock(folder, "b", lambda u, t: u)]
    by_name = {m.name: m for m in mocks}
    monkeypatch.setattr(
        "grasp_cosim.master.simulation.load", lambda component: by_name[component.name]
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
