"""The master without any FMU: order of exchange, time, initialisation, failures."""

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from grasp_cosim import InputError, SimulationError, System
from grasp_cosim.fmi.fmi2 import Call
from grasp_cosim.master.fixed_step import Master
from grasp_cosim.recording.result import Recorder
from grasp_cosim.system.interface import Interface, Value, Variable
from grasp_cosim.system.parts import Component, Port, Wire

Function = Callable[[float, float], float]


def interface(kind: str = "Real") -> Interface:
    """An input u and an output y of one kind."""
    pair = [("u", "input", "0"), ("y", "output", None)]
    return Interface(
        Path("mock.fmu"),
        "",
        "mock",
        tuple(
            Variable(name, kind, causality, k, None, start, -math.inf, math.inf)  # type: ignore[arg-type]
            for k, (name, causality, start) in enumerate(pair)
        ),
    )


class Mock:
    """y = output(u, time), where time only moves with a step."""

    def __init__(self, name: str, output: Function, kind: str = "Real") -> None:
        self.name = name
        self.interface = interface(kind)
        self.output = output
        self.u = 0.0
        self.time = 0.0
        self.calls: list[str] = []
        self.statuses = {"send": 0, "step": 0, "receive": 0}

    def enter_initialization(self, values: Mapping[str, Value], stop: float) -> None:
        self.calls.append("enter")
        self.u = float(values.get("u", self.u))

    def exit_initialization(self) -> None:
        self.calls.append("exit")

    def setters(self, variables: Sequence[Variable], reals: Any, integers: Any) -> list[Call]:
        def send() -> int:
            self.calls.append("send")
            self.u = float((reals if len(reals) else integers)[0])
            return self.statuses["send"]

        return [send] if variables else []

    def getters(self, variables: Sequence[Variable], reals: Any, integers: Any) -> list[Call]:
        def receive() -> int:
            self.calls.append("receive")
            (reals if len(reals) else integers)[0] = self.output(self.u, self.time)
            return self.statuses["receive"]

        return [receive]

    def stepper(self, time: ctypes.c_double, step: float) -> Call:
        def advance() -> int:
            self.calls.append(f"step {time.value!r}")
            self.time = time.value + step
            return self.statuses["step"]

        return advance

    def failure(self, status: int, time: float) -> SimulationError:
        return SimulationError(f"{self.name}: status {status} at {time!r}")


def chain(scheme: str, *mocks: Mock, step_ns: int = 100_000_000, steps: int = 4) -> Master:
    """The mocks in a row: each one's y goes to the next one's u; the last one's ends there."""
    wires = tuple(Wire(Port(a.name, "y"), Port(b.name, "u")) for a, b in pairwise(mocks))
    return master(scheme, mocks, wires, step_ns, steps)


def master(
    scheme: str, mocks: Sequence[Mock], wires: tuple[Wire, ...], step_ns: int, steps: int
) -> Master:
    system = object.__new__(System)  # the mocks have no files to check
    for name, value in {
        "name": "mock.toml",
        "components": tuple(Component(m.name, Path("mock.fmu"), {}) for m in mocks),
        "wires": wires,
        "step_ns": step_ns,
        "stop_ns": step_ns * steps,
        "scheme": scheme,
    }.items():
        object.__setattr__(system, name, value)
    return Master(system, mocks)


def recorded(run: Master) -> dict[str, list[float]]:
    recorder = Recorder(run.plan, run.total_steps)
    run.listeners.append(recorder)
    run.initialise()
    run.advance(run.total_steps)
    return {name: column.tolist() for name, column in recorder.signals().items()}


def clock(name: str = "clock") -> Mock:
    return Mock(name, lambda u, t: t)


def through(name: str) -> Mock:
    return Mock(name, lambda u, t: u)


def test_sequential_passes_values_on_within_the_step() -> None:
    signals = recorded(chain("sequential", clock(), through("a"), through("b")))
    assert signals["clock.y"] == signals["a.y"] == signals["b.y"]


def test_sequential_against_the_order_delays_by_a_step() -> None:
    a, b = through("a"), clock()
    run = master("sequential", [a, b], (Wire(Port("clock", "y"), Port("a", "u")),), 10**8, 4)
    signals = recorded(run)
    assert signals["a.y"][1:] == signals["clock.y"][:-1]


def test_jacobi_delays_every_wire_by_a_step() -> None:
    signals = recorded(chain("jacobi", clock(), through("a"), through("b")))
    assert signals["a.y"][1:] == signals["clock.y"][:-1]
    assert signals["b.y"][2:] == signals["clock.y"][:-2]


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_rows_carry_the_time_their_values_belong_to(scheme: str) -> None:
    signals = recorded(chain(scheme, clock()))
    assert signals["clock.y"] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])


def test_time_is_never_accumulated() -> None:
    mock = clock()
    recorded(chain("sequential", mock, step_ns=100_000, steps=3000))
    times = [float(call.split()[1]) for call in mock.calls if call.startswith("step")]
    assert times == [k * 100_000 / 1e9 for k in range(3000)]


def test_values_propagate_at_t_0_against_the_order_of_execution() -> None:
    mocks = [through("c"), through("b"), Mock("a", lambda u, t: 7.0)]
    wires = (Wire(Port("a", "y"), Port("b", "u")), Wire(Port("b", "y"), Port("c", "u")))
    run = master("sequential", mocks, wires, 10**8, 1)
    signals = recorded(run)
    assert [signals[f"{name}.y"][0] for name in "abc"] == [7.0, 7.0, 7.0]


def test_initialisation_mode_comes_before_the_first_step() -> None:
    mock = through("a")
    recorded(chain("sequential", clock(), mock))
    assert mock.calls[0] == "enter"
    assert set(mock.calls[1 : mock.calls.index("exit")]) == {"send", "receive"}


def test_a_loop_that_settles_is_no_error() -> None:
    mocks = [Mock("a", lambda u, t: 0.0 * u + 3.0), through("b")]
    wires = (Wire(Port("a", "y"), Port("b", "u")), Wire(Port("b", "y"), Port("a", "u")))
    assert recorded(master("sequential", mocks, wires, 10**8, 1))["b.y"][0] == 3.0


def test_an_algebraic_loop_is_refused_by_name() -> None:
    mocks = [Mock("a", lambda u, t: u + 1.0), through("b")]
    wires = (Wire(Port("a", "y"), Port("b", "u")), Wire(Port("b", "y"), Port("a", "u")))
    with pytest.raises(InputError, match=r"an algebraic loop through a\.y, b\.y"):
        master("sequential", mocks, wires, 10**8, 1).initialise()


def test_initialisation_never_sends_what_no_output_has_put_out() -> None:
    """a runs before its source: what it is sent is the source's value, not a zero."""
    mock = Mock("a", lambda u, t: 1.0 / u)
    wires = (Wire(Port("b", "y"), Port("a", "u")),)
    run = master("sequential", [mock, Mock("b", lambda u, t: 5.0)], wires, 10**8, 1)
    mock.u = 1.0  # the start value
    run.initialise()
    assert mock.u == 5.0


def test_an_unwired_input_is_never_sent() -> None:
    mock = through("a")
    recorded(chain("sequential", mock))
    assert "send" not in mock.calls


@pytest.mark.parametrize("kind", ["Integer", "Boolean"])
def test_integers_and_booleans_are_exchanged_and_recorded(kind: str) -> None:
    source = Mock("a", lambda u, t: float(t > 0.15), kind)
    signals = recorded(chain("sequential", source, Mock("b", lambda u, t: u, kind)))
    assert signals["a.y"] == signals["b.y"] == [0, 0, 1, 1, 1]
    assert isinstance(signals["a.y"][0], bool) is (kind == "Boolean")


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
@pytest.mark.parametrize("phase", ["send", "step", "receive"])
@pytest.mark.parametrize("status", [2, 3, 4])
def test_a_bad_status_ends_the_run(scheme: str, phase: str, status: int) -> None:
    mock = through("a")
    run = chain(scheme, clock(), mock)
    run.initialise()
    run.advance(2)
    mock.statuses[phase] = status
    with pytest.raises(SimulationError, match=f"a: status {status} at 0.2"):
        run.advance(2)
    assert run.steps_done == 2


@pytest.mark.parametrize("phase", ["send", "step", "receive"])
def test_a_warning_does_not_end_the_run(phase: str) -> None:
    mock = through("a")
    mock.statuses[phase] = 1
    assert recorded(chain("sequential", clock(), mock))["a.y"][-1] == pytest.approx(0.4)


def test_a_failure_in_initialisation_is_a_wrong_input() -> None:
    mock = through("a")
    mock.statuses["receive"] = 3
    with pytest.raises(InputError, match="a: status 3"):
        chain("sequential", clock(), mock).initialise()


def test_a_value_that_is_not_finite_is_found_and_is_the_last_one_kept() -> None:
    lens = Mock("lens", lambda u, time: math.nan if time > 0.15 else time)
    run = chain("sequential", lens)
    recorder = Recorder(run.plan, run.total_steps)
    run.listeners.append(recorder)
    run.initialise()
    run.advance(1)
    recorder.check_finite(0)
    run.advance(3)
    with pytest.raises(SimulationError, match=r"lens\.y = nan at step 2: must be finite"):
        recorder.check_finite(1)
    assert len(recorder.signals()["lens.y"]) == 3
