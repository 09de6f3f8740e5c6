"""Steps that a component rejects are taken in parts, counted, or end the run."""

from collections.abc import Callable

import pytest
from grasp_cosim import SimulationError
from grasp_cosim.recording.result import Rejection
from support.mocks import Mock, Run, make_system

Make = Callable[..., Run]


@pytest.fixture
def run(tmp_path):
    """A run of three steps of one component that rejects some."""

    def make(rejects, vary=True):
        mock = Mock(tmp_path, "a", lambda u, t: t, direct=False, vary=vary, rejects=rejects)
        return Run(make_system([mock], [], steps=3), [mock])

    return make


def steps(run):
    """Begin and length of each step that was tried."""
    calls = run.master.instances[0].calls  # type: ignore[attr-defined]
    pairs = (call.split()[1:] for call in calls if call.startswith("step"))
    return [(float(begin), float(length)) for begin, length in pairs]


def test_a_step_that_gets_somewhere_is_gone_on_with(run):
    """It stops at 0.13 once, as at an event of its own."""
    made = run(lambda begin, end: 0.13 if begin < 0.13 < end else end)
    assert made.to_the_end()["a.y"] == pytest.approx([0.0, 0.1, 0.2, 0.3], abs=1e-15)
    assert steps(made)[2] == pytest.approx((0.13, 0.07))
    assert made.master.rejections == {"a": Rejection(1, 0.1)}


@pytest.mark.parametrize("beyond", [0.0, 1e-9, 0.15])
def test_a_step_that_reached_its_end_or_more_is_done(run, beyond, monkeypatch):
    """The next step begins at the end of it all the same."""
    made = run(lambda begin, end: end if begin else end - 0.01)
    (mock,) = made.master.instances
    monkeypatch.setattr(mock, "last_successful_time", lambda: 0.1 + beyond)
    made.to_the_end()
    assert [begin for begin, _ in steps(made)] == pytest.approx([0.0, 0.1, 0.2])
    assert made.master.rejections == {"a": Rejection(1, 0.0)}


def test_a_step_that_gets_nowhere_is_halved(run):
    """It takes no step longer than 0.03 s."""
    made = run(lambda begin, end: begin if end - begin > 0.03 else end)
    assert made.to_the_end()["a.y"] == pytest.approx([0.0, 0.1, 0.2, 0.3], abs=1e-15)
    assert made.master.rejections == {"a": Rejection(3, 0.0)}
    taken = [(begin, length) for begin, length in steps(made) if length <= 0.03]
    assert len(taken) == 12
    assert all(length == pytest.approx(0.025) for _, length in taken)


def test_a_step_that_never_gets_anywhere_ends_the_run(run):
    made = run(lambda begin, end: begin if begin >= 0.1 else end)
    with pytest.raises(SimulationError, match=r"a: status 2 at 0\.1"):
        made.to_the_end()
    assert made.signals()["a.y"] == [0.0, 0.1]
    assert len(steps(made)) == 12  # 0.1 s halved ten times, after one good step


def test_ever_smaller_progress_ends_the_run(run):
    made = run(lambda begin, end: begin + 1e-9)
    with pytest.raises(SimulationError, match="a: status 2"):
        made.to_the_end()


def test_a_component_of_a_fixed_step_ends_the_run(run):
    made = run(lambda begin, end: begin, vary=False)
    with pytest.raises(SimulationError, match=r"a: status 2 at 0\.0"):
        made.to_the_end()
