"""A session that is reset is as a new one; a run that ends where its user says."""

import re
from dataclasses import replace

import pytest
from fmi.test_instances import KINDS, alone
from grasp_cosim import InputError, Realtime, SimulationError, System, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.hand.system import hand_system
from grasp_cosim.system.parts import Component
from grasp_cosim.tandem.system import SYSTEM as TANDEM
from master.test_states import EVENTS, FAULTS, FMI_3, LIMITS, MORE, MS, native_grasp, told
from support.marks import engines, needs_pythonfmu, slow
from support.native_fmus import EVENT_MODE, build_model, needs_cvode, needs_gcc, state_space

pytestmark = needs_gcc

SHORT = {"step": 0.1, "stop": 1.0}


def run(session, steps=10**6, **given):
    for name, value in given.items():
        session.set(name.replace("__", "."), value)
    session.step(steps)
    return told(session.result())


def check(system, away=20, values=(), **options):
    """It is reset twice without values, then to these, and back by a state."""
    with simulate.session(system, **options) as session:
        first = run(session)
    with simulate.session(system.with_values(dict(values)), **options) as session:
        second = run(session)
    with simulate.session(system, **options) as session:
        session.step(away)
        for _ in range(2):
            session.reset()
            assert session.time == 0.0
            assert run(session) == first
        session.reset(dict(values))
        assert run(session) == second
        session.reset()
        assert run(session) == second


VALUES = {"plant.object_width": 0.05, "sensor_1.reflectance": 0.6}


@engines
def test_a_grasp_begins_anew(natives, engine):
    """With all that acts on it."""
    system = replace(native_grasp(natives), faults=FAULTS, events=EVENTS, limits=LIMITS)
    check(system, 250, VALUES, engine=engine, every=3)


@needs_pythonfmu
def test_fmus_in_python_begin_anew(grasp):
    check(replace(grasp, step_ns=MS, stop_ns=60 * MS), 40, VALUES)


@engines
@pytest.mark.parametrize(("version", "isolation"), KINDS)
def test_fmus_that_do_not_give_their_state_begin_anew(tmp_path, version, isolation, engine):
    check(alone(tmp_path, version, isolation, early_at=0.55), 5, {"part.gain": 3.0}, engine=engine)


@needs_cvode
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_model_exchange_begins_anew(tmp_path, version):
    fmu = build_model("bouncing_ball", tmp_path, version, ["ModelExchange"])
    system = System("s", (Component("b", fmu, {}),), (), 100 * MS, 2000 * MS, "jacobi")
    check(system, 12, {"b.h": 0.7})


@pytest.mark.parametrize("capabilities", [EVENT_MODE, FMI_3])
def test_clocks_and_events_begin_anew(tmp_path, capabilities):
    fmu = build_model("sampled", tmp_path, "3.0", ["CoSimulation"], "", capabilities, MORE)
    values = {"offset": 0.0, "trigger": 0.0, "named": 0.15, "delay": 0.03, "bound": 0.0}
    part = Component("part", fmu, values)
    check(System("s", (part,), (), 30 * MS, 900 * MS, "jacobi"), 14, {"part.period": 0.05})


def test_after_a_failure_it_begins_anew(tmp_path):
    with simulate.session(alone(tmp_path, "2.0", "none", error_at=0.45)) as session:
        with pytest.raises(SimulationError):
            session.step(10)
        session.reset({"part.error_at": 1e9})
        assert session.step(10)
        assert session.complete
        with pytest.raises(InputError, match="gain must be >= 0"):
            session.reset({"part.gain": -1.0})
        with pytest.raises(InputError, match="broken off"):
            session.step()
        session.reset({"part.gain": 2.0})
        assert session.step(10)
        assert session["part.x"] == pytest.approx(4.0, rel=1e-12)


def test_a_state_of_before_has_the_values_of_before(natives):
    with simulate.session(native_grasp(natives)) as session:
        session.step(30)
        state = session.save()
        first = run(session, 50)
        session.reset(VALUES)
        session.step(70)
        session.restore(state)
        assert run(session, 50) == first
        told_of = session.result().settings["components"]["plant"]["values"]
        assert told_of["object_width"] == 0.07
        session.reset()
        assert session["plant.gap[1]"] == pytest.approx(0.045)


SLOW, FAST = ({"controller.wrist.bandwidth": hertz} for hertz in (1.0, 5.0))


def test_what_metrics_note_of_start_values_is_as_of_a_new_session(natives):
    """And comes back with a state of before; whoever is told the log misses no line of it."""
    lines = []
    slow = System.load(TANDEM, natives).with_values(SLOW)
    with simulate.session(slow, note=lines.append) as session:
        (noted,) = session.result().log
        assert noted.startswith("controller.wrist.bandwidth = 1 Hz")
        state = session.save()
        session.reset(FAST)
        assert session.result().log == ()
        session.restore(state)
        assert session.result().log == (noted,)
        session.reset(FAST)
        session.set("plant.moving_mass", 0.4)
    assert lines == [noted, "t = 0 s: plant.moving_mass = 0.4"]


def test_what_metrics_refuse_of_start_values_leaves_the_session_as_it_is():
    with simulate.session(hand_system(native=True)) as session:
        session.step(3)
        with pytest.raises(InputError, match=r"hand\.toml: controller\.weight = 0\.9, 1, 1"):
            session.reset({"controller.weight[1]": 0.9})
        assert session.time == pytest.approx(3 * session.system.step_ns * 1e-9)
        assert session.step()


class Line:
    """1 + gain u, at once."""

    inputs = {"u": 1.0}  # noqa: RUF012
    outputs = ("y",)
    parameters = {"gain": 0.0}  # noqa: RUF012

    def step(self, t, inputs):
        return {"y": 1.0 + self.gain * inputs["u"]}


def test_a_state_of_before_has_what_was_said_of_its_initialisation():
    ring = ["a.y -> b.u", "b.y -> a.u"]
    made = System(components=dict.fromkeys("ab", Line), connections=ring, experiment=SHORT)
    with simulate.session(made) as session:
        state, first = session.save(), session.result().log
        session.reset({"a.gain": -0.5, "b.gain": 0.5})
        (solved,) = session.result().log
        assert solved.startswith("algebraic loop at t = 0 through a.u: solved in")
        assert first != (solved,)
        session.restore(state)
        assert session.result().log == first


def test_what_is_no_start_value_of_these_fmus_is_refused(tmp_path, natives):
    system = native_grasp(natives)
    with simulate.session(system) as session:
        for values in ({"experiment.stop": 2.0}, {"experiment.step": 1e-4}):
            with pytest.raises(InputError, match="must be start values that change no size of"):
                session.reset(values)
        with pytest.raises(InputError, match=r"with_values plant\.object_with"):
            session.reset({"plant.object_with": 0.05})
        assert session.step()
    fmu = state_space(tmp_path)
    sizes = System("s", (Component("ss", fmu, {}),), (), 100 * MS, 1000 * MS, "jacobi")
    refused = pytest.raises(InputError, match=r"reset: ss\.m: must be start values that change no")
    with simulate.session(sizes) as session, refused:
        session.reset({"ss.m": 2})
    refused = pytest.raises(InputError, match="a run in real time cannot go back")
    with simulate.session(system, realtime=Realtime()) as session, refused:
        session.reset()


# ------------------------------------------------------------------ until


@engines
@pytest.mark.parametrize("realtime", [False, slow(Realtime(factor=1e6))])
def test_a_run_ends_where_its_user_says(natives, engine, realtime):
    """At the first communication point, as all of its rows tell."""
    system = native_grasp(natives)
    options = {"engine": engine, "realtime": realtime}

    def close(session):
        return session["plant.gap[1]"] < 0.04

    result, whole = simulate(system, until=close, **options), simulate(system)
    rows = int((whole["plant.gap[1]"] < 0.04).argmax()) + 1
    assert result["plant.gap[1]"].tolist() == whole["plant.gap[1]"][:rows].tolist()
    assert (result.complete, result.ended_at) == (False, whole.time[rows - 1])
    assert result.came_to_its_end
    assert f"t = {result.ended_at:g} s: until close was true: the run ended" in result.log
    assert not realtime or result.timing.steps == rows - 1
    assert simulate(system, until=lambda _: True, **options).ended_at == 0.0
    never = simulate(system, until=lambda _: False, **options)
    assert (never.complete, never.ended_at) == (True, None)


@pytest.mark.parametrize("until", [True, "plant.gap[1] < 0.01"])
def test_until_is_a_function(natives, until):
    with pytest.raises(InputError, match=f"^until = {re.escape(repr(until))}: must be a function"):
        simulate(System.load(SYSTEM, natives), until=until)


def test_what_ended_by_until_is_not_said_to_be_ended_by_an_fmu(natives):
    shown = repr(simulate(System.load(SYSTEM, natives), until=lambda _: True))
    assert "ended there" in shown
    assert "FMU" not in shown


def test_until_may_fail(natives):
    with pytest.raises(InputError, match="no such signal"):
        simulate(System.load(SYSTEM, natives), until=lambda session: session["plant.gab[1]"] > 0.0)


@pytest.mark.parametrize("act", ["step", "reset"])
def test_what_is_asked_until_when_does_not_move_the_session(natives, act):
    system = System.load(SYSTEM, natives)
    with pytest.raises(InputError, match="until: has stepped or reset the session; must only"):
        simulate(system, until=lambda s: s.time > 0.01 and bool(getattr(s, act)()))
