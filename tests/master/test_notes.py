"""Lines of the log are handed on: known early, before the first step, else at the end."""

import pytest
from grasp_cosim import SimulationError, simulate
from grasp_cosim.fmi.instance import ERROR
from grasp_cosim.system.parts import Connection, Event, Port
from support.mocks import Mock, make_system

LOOP = "algebraic loop at t = 0 through a.u: solved in "


def ring(folder, monkeypatch, **more):
    """y = 1 - 5 u, u = y; and its second mock."""
    mocks = [
        Mock(folder, "a", lambda u, t: 1.0 - 5.0 * u),
        Mock(folder, "b", lambda u, t: u),
    ]
    by_name = {m.name: m for m in mocks}
    monkeypatch.setattr(
        "grasp_cosim.master.simulation.load", lambda component: by_name[component.name]
    )
    ends = [(Port("a", "y"), Port("b", "u")), (Port("b", "y"), Port("a", "u"))]
    return make_system(mocks, [Connection(*e) for e in ends], 10, **more), mocks[1]  # type: ignore[arg-type]


def test_a_loop_is_told_before_the_first_step(tmp_path, monkeypatch):
    system, b = ring(tmp_path, monkeypatch)
    told = []

    def note(line):
        told.append((line, any(c.startswith("step") for c in b.calls)))

    result = simulate(system, note=note)
    ((line, stepped),) = told
    assert line.startswith(LOOP)
    assert not stepped
    assert result.log == (line,)


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


def test_what_the_reader_of_the_file_noted_is_not_told_again(tmp_path, monkeypatch):
    system, _ = ring(tmp_path, monkeypatch, notes=("read in a way",))
    told = []
    result = simulate(system, note=told.append)
    assert result.log == ("read in a way", *told)
