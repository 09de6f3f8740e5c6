"""The row of t = 0 has what the first step uses: outputs as they are out of initialisation mode."""

import subprocess
import sys
from itertools import count

import fmpy
import pytest
from grasp_cosim import System, simulate
from grasp_cosim.system.parts import Component, Connection, Port, Solver
from support.marks import engines, needs_pythonfmu, skip_where_fmpy_runs_none, slow
from support.mocks import Mock, Run, make_system
from support.native_fmus import build_model, needs_cvode, needs_gcc

STEP = 100_000_000
"""ns."""

LATE = """
from pythonfmu import Fmi2Causality, Fmi2Slave, Real


class Late(Fmi2Slave):
    def __init__(self, **more):
        super().__init__(**more)
        self.y = 0.0
        self.register_variable(Real("y", causality=Fmi2Causality.output))

    def exit_initialization_mode(self):
        self.y = 1.0

    def do_step(self, time, step):
        return True
"""


def late(mock, gain=1.0, **more):
    """A mock with y = 298 + gain u from the end of its initialisation on, 0 before."""

    def output(u, t):
        return 298.0 + gain * u if "exit" in made.calls else 0.0

    made = mock("a", output, **more)
    return made


@pytest.fixture
def mock(tmp_path):
    return lambda *args, **kwargs: Mock(tmp_path, *args, **kwargs)


def started(mocks, pairs, **more):
    """The run after its initialisation; each pair 'ab' is a connection from a's y to b's u."""
    connections = [Connection(Port(a, "y"), Port(b, "u")) for a, b in map(tuple, pairs)]
    run = Run(make_system(mocks, connections, **more), mocks)
    run.master.initialise()
    return run


def values(run, *ports):
    """What the first step uses, by the names of ports."""
    slots = {str(port): slot for port, slot in run.master.slots.items()}
    return [run.master.values[slots[port]] for port in ports]


def through(u, t):
    return u


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_what_changed_is_passed_on_along_the_data_flow(mock, scheme):
    """c is the first in the system and the last in the data flow."""
    mocks = [mock("c", through), mock("b", through), late(mock, direct=False)]
    run = started(mocks, ["ab", "bc"], scheme=scheme)
    assert values(run, "a.y", "b.u", "b.y", "c.u", "c.y") == [298.0] * 5
    assert [m.u for m in mocks[:2]] == [298.0, 298.0]
    assert run.master.log == []


def test_an_output_that_is_as_before_is_read_once_and_not_passed_on(mock):
    mocks = [mock("a", lambda u, t: 1.0, direct=False), mock("b", through)]
    started(mocks, ["ab"])
    assert [m.calls[m.calls.index("exit") + 1 :] for m in mocks] == [["receive"], ["receive"]]


def test_a_loop_is_gone_through_once(mock):
    """What comes back, twice as much each time, is left to the steps to come."""
    a, b = late(mock), mock("b", lambda u, t: 2.0 * u)
    run = started([a, b], ["ab", "ba"])
    first, arriving, back, returned = values(run, "a.y", "b.u", "b.y", "a.u")
    assert (first, arriving, back, returned) == (298.0, 298.0, 596.0, 596.0)


def test_a_loop_that_there_is_not_at_the_start_and_that_does_not_settle_is_said(mock):
    a, b = late(mock, gain=2.0, initially=False), mock("b", through)
    run = started([a, b], ["ab", "ba"])
    assert run.master.log == ["b.u, a.u: what arrives goes on changing after the initialisation"]
    first, arriving, back, returned = values(run, "a.y", "b.u", "b.y", "a.u")
    assert (first, back) == (arriving, returned)


def test_the_time_of_day_is_not_refused(mock):
    """Read out of initialisation mode once, and passed on."""
    ticks = count(100)
    day = mock("a", lambda u, t: float(next(ticks)) if "exit" in day.calls else 0.0, direct=False)
    run = started([day, mock("b", through)], ["ab"])
    assert values(run, "a.y", "b.u", "b.y") == [100.0] * 3


def chain(folder, version, scheme, isolation="none"):
    """A source of 298 K that is passed through a second FMU to a third."""
    fmu = build_model("late", folder, version)
    values = [{"base": 298.0, "u": 0.0}, {"base": 1.0}, {"gain": 2.0}]
    components = [
        Component(name, fmu, more, isolation=isolation)
        for name, more in zip("abc", values, strict=True)
    ]
    connections = (
        Connection(Port("a", "y"), Port("b", "u")),
        Connection(Port("b", "y"), Port("c", "u"), -1.0),
    )
    return System("late", (*components,), connections, STEP, 3 * STEP, scheme)


@needs_gcc
@engines
@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
@pytest.mark.parametrize(("version", "isolation"), [("2.0", "none"), slow("3.0", "process")])
def test_fmus_that_have_their_outputs_late(tmp_path, version, isolation, scheme, engine):
    with simulate.session(chain(tmp_path, version, scheme, isolation), engine=engine) as session:
        assert session["c.u"] == -299.0
        session.step(3)
        result = session.result()
    for name, value in {"a.y": 298.0, "b.y": 299.0, "c.y": -598.0}.items():
        assert result[name].tolist() == [value] * 4, name


@needs_gcc
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_the_first_row_is_that_of_fmpy(tmp_path, version):
    skip_where_fmpy_runs_none(version)
    fmu = build_model("late", tmp_path, version)
    theirs = fmpy.simulate_fmu(
        str(fmu), stop_time=0.3, output_interval=0.1, start_values={"base": 7.0},
        output=["y"], fmi_type="CoSimulation",
    )  # fmt: skip
    component = Component("late", fmu, {"base": 7.0, "u": 0.0})
    ours = simulate(System("late", (component,), (), STEP, 3 * STEP, "sequential"))
    assert ours["late.y"].tolist() == theirs["y"].tolist() == [7.0] * 4


@needs_gcc
@needs_cvode
def test_inputs_of_model_exchange_arrive_at_the_start(tmp_path):
    fmu = build_model("late", tmp_path, kinds=["ModelExchange"])
    source = build_model("late", tmp_path, kinds=["CoSimulation"], file="source")
    components = (
        Component("model", fmu, {}, solver=Solver()),
        Component("source", source, {"base": 5.0, "u": 0.0}),
    )
    connections = (Connection(Port("source", "y"), Port("model", "u")),)
    result = simulate(System("late", components, connections, STEP, STEP, "jacobi"))
    assert result["model.y"].tolist() == [5.0, 5.0]


@needs_pythonfmu
@pytest.mark.slow
def test_a_slave_of_pythonfmu_that_has_its_outputs_late(tmp_path):
    (tmp_path / "late.py").write_text(LATE, "utf-8")
    command = [sys.executable, "-m", "pythonfmu", "build", "-f", "late.py"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    component = Component("late", tmp_path / "Late.fmu", {})
    result = simulate(System("late", (component,), (), STEP, 2 * STEP, "sequential"))
    assert result["late.y"].tolist() == [1.0, 1.0, 1.0]
