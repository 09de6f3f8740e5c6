"""FMUs for model exchange are integrated to their exact solutions, event by event."""

import re
import sys
from ctypes import c_double
from pathlib import Path

import fmpy
import numpy as np
import numpy.typing as npt
import pytest
from grasp_cosim import SimulationError, System, simulate
from grasp_cosim.cli import main
from grasp_cosim.system.parts import Component, Connection, Event, Port, Solver
from support.marks import ENGINES
from support.native_fmus import build_model, needs_cvode, needs_gcc, state_space

Floats = npt.NDArray[np.float64]


def bouncing_ball(time, e=0.7, v_min=0.1, h=1.0, g=9.81):
    """Height and speed, flight by flight."""
    begin, up = -float(np.sqrt(2.0 * h / g)), float(np.sqrt(2.0 * h * g))
    height, speed = np.zeros_like(time), np.zeros_like(time)
    while up >= v_min and begin < time[-1]:
        end = begin + 2.0 * up / g
        flying = (time >= begin) & (time < end)
        since = time[flying] - begin
        height[flying], speed[flying] = up * since - 0.5 * g * since**2, up - g * since
        begin, up = end, up * e
    return height, speed


def held_input(k, step, inputs, start):
    """The states of x' = -k x + u at the communication points, where u is held over each step."""
    states = [start]
    for u in inputs[:-1]:
        states.append(u / k + (states[-1] - u / k) * np.exp(-k * step))
    return np.array(states)


pytestmark = [needs_gcc, needs_cvode]
EXCHANGE = ("ModelExchange",)
WITHIN = 1e-6
"""Relative, of the exact solution, with the tolerance that a solver has where none is given."""
GIVEN = {"dahlquist": {"u": 0.0}, "odd": {"u": False}}

versions = pytest.mark.parametrize("version", ["2.0", pytest.param("3.0", marks=pytest.mark.slow)])


def part(name, folder, version="2.0", **more):
    fmu = build_model(name, folder, version, EXCHANGE)
    return Component(name, fmu, {**GIVEN.get(name, {}), **more})


def run(component, step, stop, **more):
    times = round(step * 1e9), round(stop * 1e9)
    return simulate(System("alone", (component,), (), *times, "sequential"), **more)  # type: ignore[arg-type]


@pytest.mark.parametrize("step", [0.01, 0.1, 3.0])
def test_a_ball_bounces_as_it_should(tmp_path, step):
    """By 16 state events, to rest; however many of them are in a communication step."""
    result = run(part("bouncing_ball", tmp_path), step, 3.0)
    height, speed = bouncing_ball(result.time)
    assert result["bouncing_ball.h"] == pytest.approx(height, rel=WITHIN, abs=WITHIN)
    assert result["bouncing_ball.v"] == pytest.approx(speed, rel=WITHIN, abs=WITHIN)
    assert result.log == (
        "bouncing_ball: bouncing_ball.fmu runs by model exchange, integrated by CVode with a "
        "relative tolerance of 1e-10",
    )


@versions
def test_an_exponential_to_its_tail(tmp_path, version):
    result = run(part("dahlquist", tmp_path, version), 0.1, 10.0)
    assert result["dahlquist.x"] == pytest.approx(np.exp(-result.time), rel=WITHIN, abs=0.0)


@pytest.mark.parametrize(("width", "step"), [(1.0, 0.2), (0.1, 0.01), (0.3, 0.1)])
@versions
def test_a_stair_has_its_steps_at_the_very_points(tmp_path, version, width, step):
    """0.1 and 0.3 s are added up in the FMU, which is not exact; the points are."""
    result = run(part("stair", tmp_path, version, width=width, last=100), step, 30.0 * width)
    count = 1 + np.floor(result.time / width + 1e-9)
    assert result["stair.counter"].tolist() == count.tolist()


@pytest.mark.parametrize("engine", ENGINES)
@versions
def test_inputs_jump_at_communication_points(tmp_path, version, engine):
    """The first one's state is the second one's input, and held over its steps."""
    fmu = build_model("dahlquist", tmp_path, version, EXCHANGE)
    parts = (Component("a", fmu, {"u": 0.0}), Component("b", fmu, {"k": 3.0}))
    connection = (Connection(Port("a", "x"), Port("b", "u")),)
    system = System("pair", parts, connection, 100_000_000, 1_000_000_000, "jacobi")
    result = simulate(system, engine=engine)  # type: ignore[arg-type]
    a, b = result["a.x"], result["b.x"]
    assert a == pytest.approx(np.exp(-result.time), rel=WITHIN)
    assert b == pytest.approx(held_input(3.0, 0.1, a, 1.0), rel=WITHIN)


def test_events_of_the_system_tune_parameters_and_set_inputs(tmp_path):
    """At 0.5 s x' = -x becomes x' = -4 x + 2."""
    component = part("dahlquist", tmp_path)
    event = Event({Port("dahlquist", "k"): 4.0, Port("dahlquist", "u"): 2.0}, 500_000_000)
    times = 100_000_000, 1_000_000_000
    result = simulate(System("s", (component,), (), *times, "sequential", (event,)))
    x, before = result["dahlquist.x"], result.time <= 0.5
    assert x[before] == pytest.approx(np.exp(-result.time[before]), rel=WITHIN)
    later = 0.5 + (np.exp(-0.5) - 0.5) * np.exp(-4.0 * (result.time[~before] - 0.5))
    assert x[~before] == pytest.approx(later, rel=WITHIN)


@versions
def test_values_of_all_types_arrive_in_event_mode(tmp_path, version):
    """The FMU takes others than continuous ones there alone; they arrive one step later."""
    fmu = build_model("feedthrough", tmp_path, version, EXCHANGE)
    from_one = Component("a", fmu, {})
    starts = {}
    for v in from_one.interface.of("input"):
        if v.supported:
            samples = {"Boolean": True, "String": "text", "Real": 0.5}
            starts[v.name] = samples.get(v.kind, 2)
    ends = [v.name[2:] for v in from_one.interface.of("output") if v.supported]
    connections = tuple(Connection(Port("a", f"y_{n}"), Port("b", f"u_{n}")) for n in ends)
    parts = (Component("a", fmu, starts), Component("b", fmu, {}))
    event = Event({Port("a", f"u_{n}"): "other" for n in ends if n == "String"}, 100_000_000)
    system = System("pair", parts, connections, *(10**8, 3 * 10**8), "sequential", (event,))
    result = simulate(system)
    for name in ends:
        assert result[f"b.y_{name}"][1] == starts[f"u_{name}"]
    assert result["b.y_String"].tolist() == ["text", "text", "other", "other"]


@pytest.mark.parametrize("sizes", [{}, {"m": 1, "n": 5, "r": 2}])
def test_arrays_are_states_inputs_and_outputs(tmp_path, sizes):
    """Sized by structural parameters; as its own co-simulation, which is exact, has it."""
    found = []
    for kind in ("CoSimulation", "ModelExchange"):
        fmu = state_space(tmp_path, kind, kind=kind)
        n, m, r = (sizes.get(name, 3) for name in ("n", "m", "r"))
        given = {**sizes, "x0[2]": 2.0}
        given |= {f"A[{i},{j}]": -1.0 / (i + j) for i in range(1, n + 1) for j in range(1, n + 1)}
        parts = (
            Component("a", fmu, {**given, **{f"u[{i}]": 0.1 * i for i in range(1, m + 1)}}),
            Component("b", fmu, {**given, **{f"u[{i}]": 0.5 for i in range(2, m + 1)}}),
        )
        connection = (Connection(Port("a", f"y[{r}]"), Port("b", "u[1]")),)
        event = (Event({Port("a", "A[1,1]"): -2.0, Port("a", "u[1]"): 3.0}, 500_000_000),)
        times = 100_000_000, 1_000_000_000
        system = System("s", parts, connection, *times, "sequential", event)
        found.append(simulate(system).signals)
    assert len(found[0]) == 2 * r + 1  # the outputs, and a.u[1], which an event sets
    for name, exact in found[0].items():
        assert found[1][name] == pytest.approx(exact, rel=WITHIN)


ODDITIES = {"STEPS": 2, "ITERATES": 4}
"""See tests/support/models/odd.c."""


@pytest.mark.parametrize(("kind", "gain", "events"), [("STEPS", 1.0, 2), ("ITERATES", 3.0, 4)])
@versions
def test_events_after_a_step_and_iterations_of_one(tmp_path, version, kind, gain, events):
    result = run(part("odd", tmp_path, version, kind=ODDITIES[kind]), 0.1, 1.0)
    assert result["odd.x"][-1] == pytest.approx(1.0 + gain, rel=1e-9)
    assert result["odd.events"][-1] == events


STUCK = {
    1: r"chatters, or does not come to rest \(1000 events in a row, each within 1% of the step "
    r"after the one before\) at t = .*; must have a hysteresis, name later times for its ev",
    3: "does not settle an event in 1000 iterations at t = 0.5 s",
    6: "returned error at t = 0.5 s",
    7: r"cannot be integrated by CVode \(At t = 0.5 repeated recoverable right-hand side",
    8: r"cannot be integrated by CVode \(At t = 0.5 and h = .*\) at t = 0.5 s",
    10: r"names nan as the time of its next event at t = 0.5 s",
    9: r"chatters, .* one before, the next at t = 0.25 s\) at t = 0.5 s; must have",
}


@pytest.mark.parametrize("kind", STUCK)
def test_what_does_not_go_on_ends_in_one_line(tmp_path, kind):
    with pytest.raises(SimulationError, match=f"^odd: odd.fmu {STUCK[kind]}") as caught:
        run(part("odd", tmp_path, kind=kind), 0.1, 1.0)
    assert "\n" not in str(caught.value)
    assert caught.value.result is not None


def test_warnings_of_its_evaluations_are_in_the_log(tmp_path):
    result = run(part("odd", tmp_path, kind=11), 0.1, 1.0)
    assert result["odd.x"][-1] == pytest.approx(1.0, rel=1e-9)
    (line,) = (line for line in result.log if "warning" in line)
    first, followed = line.split("; ")
    assert re.fullmatch(
        r"odd: warning at t = 0\.[56]\d* s: an evaluation returned a warning", first
    )
    assert int(followed.removesuffix(" more followed")) > 5


def test_a_session_and_its_settings(tmp_path):
    component = part("dahlquist", tmp_path)
    system = System("s", (component,), (), 100_000_000, 1_000_000_000, "sequential")
    with simulate.session(system) as session:
        session.step(5)
        session.set("dahlquist.u", 1.0)
        session.set("dahlquist.u", 0.0)  # as it was: nothing happens
        while session.step(2):
            pass
        assert session["dahlquist.x"] == pytest.approx(np.exp(-1.0), rel=WITHIN)
        settings = session.result().settings["components"]["dahlquist"]
    assert settings["solver"]["relative_tolerance"] == 1e-10


def test_a_solver_table_is_kept_to(tmp_path):
    """An FMU of both kinds runs co-simulation without one."""
    fmu = build_model("dahlquist", tmp_path)
    errors = []
    for solver in (None, Solver(1e-3), Solver(1e-6), Solver(1e-3, maximum_step=1e-4)):
        result = run(Component("x", fmu, {"u": 0.0}, solver=solver), 0.5, 1.0)
        assert ("solver" in result.settings["components"]["x"]) == (solver is not None)
        errors.append(abs(result["x.x"][-1] - np.exp(-1.0)))
    assert errors[1] > 10.0 * errors[2]
    assert errors[1] > 3.0 * errors[3]
    assert errors[0] < 1e-9


@pytest.mark.skipif(not Path("/proc/self/maps").exists(), reason="there is no /proc")
def test_the_libraries_are_unloaded(tmp_path):
    run(part("bouncing_ball", tmp_path), 0.1, 0.2)
    assert "bouncing_ball.so" not in Path("/proc/self/maps").read_text("utf-8")


def cvode(*arguments):
    from grasp_cosim.fmi.cvode import Cvode  # here, as it may not be there

    return Cvode(*arguments)


class Decay:
    """x' = -x, and an indicator x - 0.5; the latest time and the number of evaluations."""

    def __init__(self):
        self.latest, self.count = 0.0, 0
        self.solver = cvode(1, 1, self.slopes, self.crossings, Solver())
        self.solver.x[0] = 1.0

    def slopes(self, time, states, slopes):
        self.latest, self.count = max(self.latest, time), self.count + 1
        c_double.from_address(slopes).value = -c_double.from_address(states).value
        return 0

    def crossings(self, time, states, values):
        c_double.from_address(values).value = c_double.from_address(states).value - 0.5
        return 0


def test_it_stops_at_a_root_and_at_its_stop():
    decay = Decay()
    decay.solver.restart(0.0)
    time, found = 0.0, False
    while not found:
        time, found = decay.solver.step(1.0)
    assert time == pytest.approx(np.log(2.0), rel=1e-7)
    assert decay.solver.x[0] == pytest.approx(0.5, rel=1e-7)
    while time < 1.0:
        time, _ = decay.solver.step(1.0)
    assert (time, decay.latest) == (1.0, 1.0)
    decay.solver.close()


def test_new_nominal_values_are_kept_to():
    """Against a huge one the state is nothing, and takes few evaluations."""
    counts = []
    for nominal in (1.0, 1e12):
        decay, time = Decay(), 0.0
        decay.solver.restart(0.0, np.array([nominal]))
        while time < 1.0:
            time, _ = decay.solver.step(1.0)
        counts.append(decay.count)
        decay.solver.close()
    assert counts[1] < counts[0] / 2


SOLVING = ("grasp_cosim.fmi.cvode", "grasp_cosim.fmi.model_exchange")


def test_without_cvode_it_is_refused_by_name(tmp_path, monkeypatch, capsys):
    """FMPy has it for x86-64 Linux and Windows, and for Apple's ARM."""
    monkeypatch.setattr(fmpy, "platform_tuple", "riscv64-linux")
    for module in [m for m in sys.modules if m.startswith("fmpy.sundials") or m in SOLVING]:
        monkeypatch.delitem(sys.modules, module)
        package, _, name = module.rpartition(".")
        if package in sys.modules:
            monkeypatch.delattr(sys.modules[package], name, raising=False)
    build_model("dahlquist", tmp_path, "2.0", ["ModelExchange"])
    path = tmp_path / "system.toml"
    part = '[components.part]\nfmu = "dahlquist.fmu"\nvalues = { u = 0.0 }\n'
    path.write_text(f"[experiment]\nstep = 0.1\nstop = 1.0\n{part}", "utf-8")
    assert main(["run", str(path)]) == 2
    said = capsys.readouterr()
    *_, line = said.err.splitlines()
    begin = "grasp-cosim: part: dahlquist.fmu is for model exchange, and FMPy has no CVode for "
    assert line.startswith(f"{begin}this machine: ")
    assert line.endswith("; must be a co-simulation FMU")
    assert said.out == ""
