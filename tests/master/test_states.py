"""A session that is saved and restored: the run goes on as if what came between had not been."""

import gc
from dataclasses import replace

import pytest
from fmi.test_instances import KINDS, alone
from grasp_cosim import InputError, Realtime, SimulationError, System, simulate
from grasp_cosim.exchange.listener import Listener
from grasp_cosim.fmi.events import MAX_DENSE_EVENTS
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.system.parts import Component, Condition, Connection, Event, Fault, Limit, Port
from support.marks import engines, needs_pythonfmu, slow
from support.native_fmus import (
    CAPABLE,
    EVENT_MODE,
    build,
    build_model,
    needs_cvode,
    needs_gcc,
    starts,
    state_space,
    talker,
)
from support.native_systems import driven

pytestmark = needs_gcc

MS = 1_000_000
FMI_2 = {**CAPABLE, "canGetAndSetFMUstate": "true"}
FMI_3 = {**EVENT_MODE, "canGetAndSetFMUState": "true"}


def able(system, version):
    """The same, of FMUs of tests/support/models that say that they give their states."""
    folder, capabilities = system.components[0].fmu.parent, FMI_2 if version == "2.0" else FMI_3
    build(folder, version=version, capabilities=capabilities)
    return replace(system, components=tuple(replace(c) for c in system.components))


def way(system, at, away=0, changes=(), then=(), **options):
    """The result of a session in which `then` is set after `at` steps, the last one a single one.

    Where it goes another way for `away` steps before, and then for none, `changes` are set there.
    """
    with simulate.session(system, **options) as session:
        session.step(at - 1)
        session.step()
        state = session.save()
        for steps in (away, 0) if away else ():
            for name, value in dict(changes).items():
                session.set(name, value)
            if steps:
                session.step(steps)
                session.step(3)
            session.restore(state)
            assert session.time == state.time
        for name, value in dict(then).items():
            session.set(name, value)
        while session.step(7):
            pass
        return session.result()


def told(result, names=None):
    """All that a result says of its signals, or of those names, but for the wall time."""
    numbers = {
        n: x for n, x in result.metrics.items() if n not in ("wall_time", "real_time_factor")
    }
    signals = {name: result[name].tobytes() for name in names or result}
    ends = result.complete, result.ended_at, result.log, result.limits, result.rejections
    return result.time.tobytes(), signals, ends, repr(numbers)


def check(system, at, away, changes=(), then=(), **options):
    plain = way(system, at, then=then, **options)
    assert told(way(system, at, away, changes, then, **options)) == told(plain)
    if not then:
        run = simulate(system, **options)
        assert told(run) == told(plain, names=run)  # which has no inputs that nothing sets


def native_grasp(natives):
    return replace(System.load(SYSTEM, natives), step_ns=MS, stop_ns=400 * MS)


GAPS = [Port(f"sensor_{j}", "gap") for j in (1, 2)]
FAULTS = (
    Fault(GAPS[0], "stuck", {}, 55 * MS, 90 * MS),
    Fault(GAPS[0], "noise", {"standard_deviation": 1e-3}, seed=3),
    Fault(GAPS[1], "dropout", {"probability": 0.6}, 10 * MS),
    Fault(GAPS[1], "delay", {"time": 0.02}, 40 * MS),
    Fault(GAPS[1], "bias", {"value": 1e-3}, when=Condition(GAPS[1], "<", 0.06)),
)
EVENTS = (
    Event({Port("sensor_1", "reflectance"): 0.7}, at_ns=65 * MS),
    Event({Port("plant", "finger_mass[1]"): 0.8}, when=Condition(GAPS[0], "<", 0.034)),
)
LIMITS = (Limit(Condition(GAPS[0], "<", 0.03), "warn"),)


@engines
@pytest.mark.parametrize("every", [1, 3])
@pytest.mark.parametrize(("at", "away"), [(50, 45), (33, 200), (33, 367)])
def test_all_that_acts_on_a_run_goes_back(natives, engine, every, at, away):
    """Faults that remember, what happens once, limits, energies; after the last step, too."""
    system = replace(native_grasp(natives), faults=FAULTS, events=EVENTS, limits=LIMITS)
    assert len(simulate(system).log) > 6
    changes = {"sensor_2.reflectance": 0.2, "plant.finger_mass[2]": 0.2}
    check(system, at, away, changes, engine=engine, every=every)


@engines
def test_drives_and_driven_parameters_go_back(tmp_path, engine):
    table = "time,a.u_Real,a.gain\n" + "".join(f"{t / 20},{t % 3},{t // 4}\n" for t in range(20))
    system = System.load(driven(tmp_path, table, more='[input]\nfile = "drive.csv"\n', step=0.01))
    check(able(system, "2.0"), 35, 50, engine=engine)


@needs_pythonfmu
def test_fmus_in_python_go_back(grasp):
    check(replace(grasp, step_ns=MS, stop_ns=100 * MS), 40, 30)


@engines
@pytest.mark.parametrize(("version", "isolation"), KINDS)
def test_any_kind_of_fmu_goes_back(tmp_path, version, isolation, engine):
    """Also one that takes steps in parts, or asks for the end."""
    part = alone(tmp_path, version, isolation, early_at=0.55, terminate_at=0.85)
    check(able(part, version), 3, 6, engine=engine)


@pytest.mark.slow
def test_inputs_on_their_way_to_another_process_go_back(natives):
    """It takes steps of four: what it is to get then waits."""
    system = native_grasp(natives)
    own = {"controller": {"isolation": "process", "step_ns": 4 * MS}}
    changed = (replace(c, **own.get(c.name, {})) for c in system.components)
    system = replace(system, components=tuple(changed), scheme="jacobi", stop_ns=60 * MS)
    check(system, 18, 9)


MORE = """
<Clock name="c" valueReference="15" causality="input" intervalVariability="tunable"
 intervalDecimal="0.07"/>
<Clock name="d" valueReference="16" causality="input" intervalVariability="countdown"/>
<Float64 name="bound" valueReference="17" causality="input" variability="discrete" start="0"
 clocks="15"/>
"""
"""Of models/sampled.c: clocks, and an input that arrives with the ticks of one."""


@engines
@pytest.mark.parametrize("isolation", ["none", slow("process")])
def test_clocks_and_what_waits_for_an_event_go_back(tmp_path, engine, isolation):
    fmu = build_model("sampled", tmp_path, "3.0", ["CoSimulation"], "", FMI_3, MORE)
    source = build(tmp_path, capabilities=FMI_3)
    values = {"offset": 0.0, "named": 0.15, "delay": 0.03, "bound": 0.0}
    part = Component("part", fmu, values, isolation=isolation)
    components = Component("source", source, starts("3.0")), part
    trigger = Connection(Port("source", "y_Float64"), Port("part", "trigger"))
    system = System("s", components, (trigger,), 30 * MS, 1200 * MS, "sequential")
    changes = {"source.u_Float64": 2.0, "part.period": 0.05, "part.bound": 4.0}
    then = {"source.u_Float64": 2.0}
    check(system, 13, 1, changes, then, engine=engine)
    check(system, 13, 9, changes, engine=engine)


def test_the_end_that_an_event_asks_for_goes_back(tmp_path):
    fmu = build_model("stair", tmp_path, "3.0", ["CoSimulation"], capabilities=FMI_3)
    part = Component("s", fmu, {"width": 0.25, "last": 4})
    check(System("s", (part,), (), 200 * MS, 3000 * MS, "jacobi"), 2, 9)


def test_an_event_that_is_met_again_and_again_is_no_chatter(tmp_path):
    fmu = build_model("stair", tmp_path, "3.0", ["CoSimulation"], capabilities=FMI_3)
    part = Component("s", fmu, {"width": 0.25, "last": 9})
    system = System("s", (part,), (), 200 * MS, 3000 * MS, "jacobi")
    with simulate.session(system, engine="python") as session:
        session.step()
        state = session.save()
        for _ in range(MAX_DENSE_EVENTS + 1):
            session.step()
            session.restore(state)


def test_elements_of_arrays_that_were_set_go_back(tmp_path):
    """An array is set whole: with an element those that were set before."""
    fmu = state_space(tmp_path, capabilities=FMI_3)
    system = System("s", (Component("ss", fmu, {}),), (), 100 * MS, 1000 * MS, "jacobi")
    check(system, 3, 2, {"ss.u[1]": 7.0}, {"ss.u[3]": 5.0})


def test_what_ran_away_on_the_other_way_is_not_told(tmp_path):
    part = replace(able(alone(tmp_path, "3.0", "none"), "3.0"), diverging="continue")
    changes = {"part.gain": 1e300, "part.u_Float64": 1e300, "part.u_UInt64": 2**63}
    then = {"part.u_Float64": 1e200}
    plain = way(part, 3, then=then)
    assert any("ran away" in line for line in plain.log)
    check(part, 3, 4, changes)
    check(part, 3, 4, changes, then)


def test_a_failure_names_the_inputs_that_are_there_again(tmp_path):
    system = able(alone(tmp_path, "2.0", "none", error_at=0.85), "2.0")
    for away in (0, 2):
        with pytest.raises(SimulationError, match="u_Integer = 0, "):
            way(system, 3, away, {"part.u_Integer": 5})


def test_what_is_set_after_a_restore_acts_as_if_there_had_been_no_other_way(natives):
    system = native_grasp(natives)

    def roll(session, mass):
        session.set("plant.finger_mass[1]", mass)
        session.step(30)
        return session["plant.position[1]"]

    with simulate.session(system) as session:
        session.step(50)
        state = session.save()
        found = []
        for mass in (0.5, 0.9, 0.5):
            found.append(roll(session, mass))
            session.restore(state)
        assert found[0] == found[2] != found[1]
        roll(session, 0.9)
        again = session.result()
    with simulate.session(system) as session:
        session.step(50)
        roll(session, 0.9)
        plain = session.result()
    assert again.log == plain.log
    assert again["plant.position[1]"].tobytes() == plain["plant.position[1]"].tobytes()


@pytest.mark.parametrize("every", [1, 3])
def test_states_that_were_left_behind_are_there_yet(natives, every):
    """A later one after an earlier one, whose rows the other way has taken the place of."""
    system = native_grasp(natives)
    with simulate.session(system, every=every) as session:
        session.step(20)
        early = session.save()
        session.step(40)
        late = session.save()
        session.step(100)
        result = session.result()
        session.restore(early)
        session.set("plant.finger_mass[1]", 0.9)
        session.step(70)
        session.restore(late)
        session.step(100)
        assert told(session.result()) == told(result)
        session.restore(early)
        assert len(session.result().time) == 20 // every + 1 + (every > 1)


def test_a_result_of_before_keeps_what_was_recorded(natives):
    with simulate.session(native_grasp(natives)) as session:
        state = session.save()
        session.set("plant.finger_mass[1]", 0.9)
        session.step(100)
        result = session.result()
        kept = result["plant.position[1]"].copy()
        session.restore(state)
        session.step(100)
        assert session.result()["plant.position[1]"][-1] != kept[-1]
    assert result["plant.position[1]"].tobytes() == kept.tobytes()


def test_after_a_failure_it_goes_on_from_a_state(natives):
    limit = Limit(Condition(GAPS[0], "<", 0.03), "abort")
    system = replace(native_grasp(natives), limits=(limit,))
    with simulate.session(system) as session:
        session.step(50)
        state = session.save()
        with pytest.raises(SimulationError, match="the run was aborted"):
            session.step(400)
        session.restore(state)
        session.set("sensor_1.reflectance", 0.1)
        assert session.step(10)
        assert session.result().log[-1].endswith("sensor_1.reflectance = 0.1")


@pytest.mark.parametrize("logged", [[], ["-DMUTE"]])
@pytest.mark.parametrize("at", [3, 6])
def test_a_warning_after_a_state_is_taken_back(tmp_path, logged, at):
    """And one before it is not."""
    fmu = talker(tmp_path, "-DWARNS_AFTER=0.045", *logged, capabilities=FMI_2)
    check(System("s", (Component("t", fmu, {}),), (), 10 * MS, 100 * MS, "jacobi"), at, 3)


def test_states_that_are_no_longer_referred_to_are_freed(natives):
    with simulate.session(native_grasp(natives)) as session:
        states = [session.save() for _ in range(5)]
        for _ in range(50):
            states[2] = session.save()
        gc.collect()
        kept = [len(instance._kept_states._kept) for instance in session._instances]
        assert kept == [6] * 4
        session.close()
        kept = [session._instances, states[2].time]
    assert kept == [[], 0.0]


class Deaf(Listener):
    """Gets rows, and does nothing."""


@needs_cvode
def test_what_cannot_go_back_is_refused(tmp_path, natives):
    """A refusal breaks nothing."""
    must = "; must be a co-simulation FMU with fmi2GetFMUstate or fmi3GetFMUState$"
    fmu = build_model("dahlquist", tmp_path, "2.0", ["ModelExchange"])
    exchanged = System(
        "s", (Component("part", fmu, {"u": 0.0}),), (), 100 * MS, 1000 * MS, "jacobi"
    )
    why = r"part: the state of \S+ cannot be saved, as it is integrated by CVode"
    unable = alone(tmp_path, "2.0", "process")
    without = r"^part: the state of native\.fmu cannot be saved \(canGet\S+\)"
    grasp = native_grasp(natives)
    realtime = "a run in real time cannot go back"
    for system, options, line in (
        (exchanged, {}, why + must),
        (unable, {}, without + must),
        (grasp, {"listeners": [Deaf()]}, "listeners cannot give rows back; must be"),
        (grasp, {"realtime": Realtime()}, realtime),
    ):
        with simulate.session(system, **options) as session:
            with pytest.raises(InputError, match=line):
                session.save()
            assert session.step()
    with simulate.session(grasp) as one, simulate.session(grasp) as other:
        state = one.save()
        with pytest.raises(InputError, match=r"State\(time=0\.0\): must be a state of this"):
            other.restore(state)
        one.close()
        with pytest.raises(InputError, match="the session is closed; must be a new one"):
            one.restore(state)
