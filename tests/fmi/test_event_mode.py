"""FMUs of FMI 3.0 that handle their events with the master: against exact solutions."""

import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError, System, simulate
from grasp_cosim.cli import main
from grasp_cosim.system.parts import Component, Connection, Event, Port
from support.marks import engines, slow
from support.native_fmus import (
    CAPABLE,
    EVENT_MODE,
    TYPES,
    build,
    build_model,
    needs_cvode,
    needs_gcc,
    starts,
)

pytestmark = needs_gcc

TICK, COUNTDOWN, BOUND, TAKEN = range(15, 19)
"""References of models/sampled.c that its description does not have by itself."""

INPUTS = {"offset": 0.0, "trigger": 0.0}
isolations = pytest.mark.parametrize("isolation", ["none", slow("process")])


def clock(variability="constant", reference=TICK, name="tick", **more):
    """The declaration of an input clock."""
    said = " ".join(f'{key}="{value}"' for key, value in more.items())
    return (
        f'<Clock name="{name}" valueReference="{reference}" causality="input" '
        f'intervalVariability="{variability}" {said}/>'
    )


def sampled(folder, more="", values=None, isolation="none", **others):
    """The component 'part' of models/sampled.c."""
    fmu = build_model(
        "sampled", folder, "3.0", ["CoSimulation"], capabilities=EVENT_MODE, more=more, **others
    )
    return Component("part", fmu, {**INPUTS, **(values or {})}, isolation=isolation)


def run(*components, step=0.1, stop=1.0, engine="auto", connections=(), **more):
    nanoseconds = round(step * 1e9), round(stop * 1e9)
    system = System("events", components, connections, *nanoseconds, "sequential", **more)
    return simulate(system, engine=engine)


def integral(ticks, time, gain=1.0):
    """x of x' = -gain x(last tick) from 1 on, held at 1 before the first tick."""
    x, held, last, points = 1.0, 0.0, 0.0, []
    for point in sorted({*ticks, *time}):
        x, last = x + held * (point - last), point
        held = -gain * x if point in ticks else held
        points += [x] if point in time else []
    return np.array(points)


def flights(time, h=1.0, g=9.81, e=0.7):
    """The height of a ball that bounces, flight by flight."""
    begin, up, height = -np.sqrt(2.0 * h / g), np.sqrt(2.0 * h * g), np.zeros_like(time)
    while up >= 0.1 and begin < time[-1]:
        end = begin + 2.0 * up / g
        flying = (time >= begin) & (time < end)
        height[flying] = up * (time[flying] - begin) - 0.5 * g * (time[flying] - begin) ** 2
        begin, up = end, up * e
    return height


@engines
@isolations
@pytest.mark.parametrize("step", [0.01, 0.5])
@pytest.mark.parametrize("capabilities", [EVENT_MODE, {**EVENT_MODE, "hasEventMode": "false"}])
def test_a_ball_bounces_with_and_without_event_mode(
    tmp_path, capabilities, step, isolation, engine
):
    """With it each bounce is an event that ends a step, several in one; they are no rejections."""
    fmu = build_model("bouncing_ball", tmp_path, "3.0", ["CoSimulation"], capabilities=capabilities)
    result = run(Component("b", fmu, {}, isolation=isolation), step=step, stop=3.0, engine=engine)
    assert result["b.h"] == pytest.approx(flights(result.time), abs=1e-6)
    assert not result.rejections


@engines
@isolations
def test_the_end_that_is_asked_for_in_an_event(tmp_path, engine, isolation):
    fmu = build_model("stair", tmp_path, "3.0", ["CoSimulation"], capabilities=EVENT_MODE)
    values = {"width": 0.25, "last": 4}
    result = run(Component("s", fmu, values, isolation=isolation), stop=3.0, engine=engine)
    assert (result.complete, result.ended_at) == (False, 0.8)
    assert result.log[-1].startswith("s asked for the end of the simulation at t = 0.75 s")
    assert result["s.counter"].tolist() == [1, 1, 1, 2, 2, 3, 3, 3, 4]


def test_the_time_that_it_names_for_its_next_event_ends_a_step(tmp_path):
    """It would step over it."""
    result = run(sampled(tmp_path, values={"named": 0.25, "gain": 2.0}), step=0.4, stop=2.0)
    ticks = [0.25 * k for k in range(1, 9)]
    assert result["part.x"] == pytest.approx(integral(ticks, result.time, 2.0), rel=1e-12)
    assert result["part.last"].tolist() == [-1.0, 0.25, 0.75, 1.0, 1.5, 2.0]


@engines
@pytest.mark.parametrize("step", [0.1, 0.25, slow(0.03)])
def test_a_clock_ticks_at_its_times_whatever_the_step(tmp_path, engine, step):
    """At the start, then each 0.1 s; a tick at the end of a step is in its row."""
    component = sampled(tmp_path, clock(intervalDecimal="0.1"), {"gain": 4.0})
    result = run(component, step=step, stop=1.5, engine=engine)
    ticks = [k / 10 for k in range(16)]
    assert result["part.x"] == pytest.approx(integral(ticks, result.time, 4.0), rel=1e-11)
    assert result["part.ticks"].tolist() == [int(t * 10 + 1e-6) + 1 for t in result.time]
    assert result["part.last"] == pytest.approx(np.floor(result.time * 10 + 1e-6) / 10, rel=1e-15)


VARIABILITIES = {
    "fraction": (clock(intervalCounter=1, resolution=3, shiftCounter=1), {}, [1 / 3, 2 / 3, 1.0]),
    "fixed": (clock("fixed", intervalDecimal="0.4", shiftDecimal="0.15"), {}, [0.15, 0.55, 0.95]),
    "calculated": (clock("calculated"), {"period": 0.3, "first": 0.2}, [0.2, 0.5, 0.8]),
    "changing": (clock("changing"), {"period": 0.2, "factor": 2.0}, [0.2, 0.6]),
    "counted": (
        clock("changing", supportsFraction="true"), {"period": 1 / 3}, [1 / 3, 2 / 3, 1.0],
    ),
}  # fmt: skip


@pytest.mark.parametrize("variability", VARIABILITIES)
def test_clocks_of_all_kinds_of_intervals(tmp_path, variability):
    more, values, ticks = VARIABILITIES[variability]
    result = run(sampled(tmp_path, more, values))
    assert result["part.x"] == pytest.approx(integral(ticks, result.time), rel=1e-12)
    assert result["part.ticks"][-1] == len(ticks)


@needs_cvode
def test_clocks_tick_in_model_exchange_too(tmp_path):
    fmu = build_model(
        "sampled", tmp_path, "3.0", ["ModelExchange"], more=clock(intervalDecimal="0.15")
    )
    result = run(Component("part", fmu, {**INPUTS, "gain": 3.0}))
    ticks = [0.15 * k for k in range(7)]
    assert result["part.x"] == pytest.approx(integral(ticks, result.time, 3.0), rel=1e-9)
    assert result["part.ticks"].tolist() == [1, 1, 2, 3, 3, 4, 5, 5, 6, 7, 7]


def test_an_interval_that_is_tuned_counts_from_the_last_tick(tmp_path):
    tuned = Event({Port("part", "period"): 0.25}, 500_000_000)
    result = run(sampled(tmp_path, clock("tunable"), {"period": 0.4}), events=(tuned,), stop=1.2)
    ticks = [0.0, 0.4, 0.65, 0.9, 1.15]
    assert result["part.x"] == pytest.approx(integral(ticks, result.time), rel=1e-12)


@engines
@isolations
def test_a_countdown_begins_with_a_discrete_input(tmp_path, engine, isolation):
    """The input comes over a connection, as the step at 0.3 s begins, and is set by an event."""
    source = build_model("late", tmp_path, "3.0", ["CoSimulation"])
    more = clock("countdown", COUNTDOWN, "countdown")
    part = sampled(tmp_path, more, {"delay": 0.25}, isolation)
    del part.values["trigger"]
    components = Component("source", source, {"u": 0.0}), part
    result = run(
        *components,
        connections=(Connection(Port("source", "y"), Port("part", "trigger")),),
        events=(Event({Port("source", "u"): 1.0}, 200_000_000),),
        engine=engine,
    )
    assert result["part.last"].tolist() == [-1.0] * 5 + [pytest.approx(0.45)] * 6
    assert result["part.events"].tolist() == [1, 1, 1, 2, 2, 3, 3, 3, 3, 3, 3]


def test_an_input_of_a_clock_arrives_with_its_ticks(tmp_path):
    more = (
        clock(intervalDecimal="0.2", shiftDecimal="0.1")
        + f'<Float64 name="bound" valueReference="{BOUND}" causality="input" '
        f'variability="discrete" start="0" clocks="{TICK}"/>'
        f'<Float64 name="taken" valueReference="{TAKEN}" causality="local"/>'
    )
    part = sampled(tmp_path, more, {"bound": 1.0})
    events = (Event({Port("part", "bound"): 2.0}, 400_000_000),)
    nanoseconds = 100_000_000, 1_000_000_000
    system = System("bound", (part,), (), *nanoseconds, "sequential", events=events)
    taken = []
    with simulate.session(system) as session:
        (instance,) = session.master.instances
        variable = instance.interface.by_name["taken"]
        while session.step():
            taken += instance.get([variable])
    assert taken == [1.0] * 4 + [2.0] * 6
    assert session.result()["part.events"].tolist() == [1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6]


def test_an_event_that_inner_steps_have_not_come_to_is_left_to_the_fmu(tmp_path):
    """It names the same time again, then returns for it."""
    lagging = ("-DGRID=0.1",)
    result = run(sampled(tmp_path, values={"named": 0.25}, options=lagging), stop=0.5)
    assert result["part.last"].tolist() == [-1.0, -1.0, -1.0, 0.3, 0.3, 0.5]


def test_clocks_tick_at_the_points_of_a_step_that_cannot_vary(tmp_path):
    fixed = {**EVENT_MODE, "canHandleVariableCommunicationStepSize": "false"}
    more = clock(intervalDecimal="0.2")
    fmu = build_model("sampled", tmp_path, "3.0", ["CoSimulation"], capabilities=fixed, more=more)
    result = run(Component("part", fmu, INPUTS))
    assert result["part.ticks"].tolist() == [1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6]
    message = r"part: sampled.fmu: clock 'tick' ticks within steps of 0.15 s, which cannot vary; "
    with pytest.raises(InputError, match=message):
        run(Component("part", fmu, INPUTS), step=0.15, stop=0.3)


def test_discrete_inputs_of_several_types_arrive_in_one_event(tmp_path):
    """The frame of the FMU refuses them in step mode; a continuous one is set in that."""
    fmu = build(tmp_path, capabilities=EVENT_MODE)
    first, second = (Component(name, fmu, starts("3.0")) for name in ("first", "second"))
    types = [name for name in TYPES["3.0"] if name not in ("String", "Enumeration")]
    for name in types:
        del second.values[f"u_{name}"]
    connections = [Connection(Port("first", f"y_{t}"), Port("second", f"u_{t}")) for t in types]
    set_all = Event(
        {Port("first", f"u_{t}"): True if t == "Boolean" else 1 for t in types}, 2 * 10**8
    )
    result = run(first, second, connections=(*connections,), events=(set_all,), stop=0.5)
    for name in types:
        assert result[f"second.y_{name}"].tolist() == [0, 0, 0, 1, 1, 1], name


def test_an_event_that_cannot_be_handled_ends_the_run(tmp_path):
    """An FMU without event mode is not to have one."""
    fmu = build_model("dahlquist", tmp_path, "3.0", ["CoSimulation"], options=("-DNEEDY=true",))
    with pytest.raises(SimulationError) as caught:
        run(Component("part", fmu, {"u": 0.0}))
    assert str(caught.value) == (
        "part: dahlquist.fmu returned for an event at t = 0 s; must handle its events itself, or "
        "have event mode and a step that may vary (inputs: u = 0)"
    )
    assert caught.value.result is not None
    assert not caught.value.result.complete


def test_events_that_do_not_end_are_said(tmp_path):
    fmu = build_model("bouncing_ball", tmp_path, "3.0", ["CoSimulation"], capabilities=EVENT_MODE)
    ball = Component("ball", fmu, {"e": 0.99, "v_min": 1e-4})
    with pytest.raises(SimulationError, match=r"ball: bouncing_ball.fmu chatters, or does not com"):
        run(ball, step=100.0, stop=100.0)
    part = sampled(tmp_path, clock(intervalDecimal="1e-14", shiftDecimal="0.1"))
    message = r"part: sampled.fmu does not settle an event in 1000 iterations at t = 0.1 s"
    with pytest.raises(SimulationError, match=message):
        run(part, step=0.2)


REFUSED = {
    "triggered": (clock("triggered"), EVENT_MODE, "which another FMU has to tick"),
    "unknown": (clock("sometimes"), EVENT_MODE, "with intervalVariability = 'sometimes'; must be"),
    "open": (clock("fixed"), EVENT_MODE, "'tick', fixed, without an interval; must declare"),
    "mode": (clock(intervalDecimal="0.1"), CAPABLE, "which ticks in event mode; must declare has"),
    "zero": (clock(intervalDecimal="0"), EVENT_MODE, "interval = 0 s: must be above 0"),
    "silent": (clock("calculated"), EVENT_MODE, "does not say the interval of its clock 'tick'"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_clocks_that_are_refused_by_name(tmp_path, case, capsys):
    more, capabilities, message = REFUSED[case]
    build_model("sampled", tmp_path, "3.0", ["CoSimulation"], capabilities=capabilities, more=more)
    (tmp_path / "a.toml").write_text(
        '[experiment]\nstep = 0.1\nstop = 0.2\n[components.part]\nfmu = "sampled.fmu"\n'
        "values = { offset = 0.0, trigger = 0.0, period = 0.0 }\n"
    )
    assert main(["run", str(tmp_path / "a.toml")]) == 2
    line = capsys.readouterr().err.splitlines()[-1]
    assert "'tick'" in line
    assert message in line
