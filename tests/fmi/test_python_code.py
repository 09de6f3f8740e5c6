"""Python code in the loop: what it is called with, its state, and what it may not do."""

import pytest
from grasp_cosim import InputError, SimulationError, System, simulate
from support.marks import engines

EXPERIMENT = {"step": 0.1, "stop": 0.5}


class Count:
    """How often it was called, and the sum of its input."""

    outputs = {"calls": 0.0, "sum": 0.0}  # noqa: RUF012

    def __init__(self):
        self.calls, self.sum = 0, 0.0

    def step(self, t, inputs):
        self.calls += 1
        self.sum += inputs["u"]
        return {"calls": self.calls, "sum": self.sum}


def clock(t, inputs):
    return t


class Clock:
    parameters = {"gain": 1.0}  # noqa: RUF012

    def step(self, t, inputs):
        return self.gain * t


def counted(source=clock, count=Count, **more):
    return System(components={"source": source, "count": count},
                  connections=["source.y -> count.u"], experiment=EXPERIMENT, **more)  # fmt: skip


@engines
def test_it_is_called_once_at_each_point_with_the_values_there(engine):
    result = simulate(counted(), engine=engine)
    assert result["source.y"] == pytest.approx(result.time)
    assert result["count.calls"].tolist() == [1, 2, 3, 4, 5, 6]
    assert result["count.sum"] == pytest.approx([0.0, 0.1, 0.3, 0.6, 1.0, 1.5])


@engines
def test_its_parameters_are_recorded_as_they_are(engine):
    system = counted(Clock).with_record("source.*")
    with simulate.session(system, engine=engine) as session:
        session.step(2)
        session.set("source.gain", 3.0)
        session.step(2)
        result = session.result()
    assert result["source.gain"].tolist() == [1.0, 1.0, 1.0, 3.0, 3.0]
    assert result["source.y"] == pytest.approx([0.0, 0.1, 0.2, 0.9, 1.2])


def test_a_loop_of_code_is_solved_at_the_start_and_counts_as_one_call():
    """y = 1 - u / 2, which comes back as u = sum of y: 2 / 3 at the start."""
    links = ["count.sum -> half.u", "half.y -> count.u"]
    system = System(components={"half": lambda t, i: 1.0 - i["u"] / 2.0, "count": Count},
                    connections=links, experiment=EXPERIMENT)  # fmt: skip
    result = simulate(system)
    assert result["count.sum"][0] == pytest.approx(2.0 / 3.0)
    assert result["count.calls"][:2].tolist() == [1, 2]


@pytest.mark.parametrize("count", [Count, Count()], ids=["class", "object"])
def test_a_session_goes_back_to_its_state_and_to_its_start(count):
    with simulate.session(counted(Clock, count)) as session:
        session.step(2)
        state = session.save()
        for _ in range(2):
            session.step(2)
            assert (session["count.calls"], session["count.sum"]) == (5, pytest.approx(1.0))
            session.restore(state)
            assert session["count.calls"] == 3
        for _ in range(2):
            session.reset()
            assert (session["count.calls"], session["count.sum"]) == (1, 0.0)
            session.step(5)
            assert (session["count.calls"], session["count.sum"]) == (6, pytest.approx(1.5))
        session.reset({"source.gain": 2.0})
        session.step(5)
        assert session["count.sum"] == pytest.approx(3.0)
    assert simulate(counted(count=count))["count.calls"][-1] == 6


def failing(t, inputs):
    return 1.0 / (t - 0.3)


def lacking(t, inputs):
    return {"x": 1.0}


def empty(t, inputs):
    return None


def infinite(t, inputs):
    return float("inf")


@engines
@pytest.mark.parametrize(
    ("code", "at_start", "said"),
    [
        (failing, False, r"test_python_code.py, line \d+: ZeroDivisionError: .* at t = 0.3 s"),
        (lacking, True, "returned 'x', which is no output; valid: y at t = 0 s"),
        (empty, True, "returned no 'y'; must return a value of each output at t = 0 s"),
        (infinite, True, "returned y = inf; must be finite at t = 0 s"),
    ],
)
def test_a_failure_is_a_line_with_its_place(code, at_start, said, engine):
    with pytest.raises(InputError if at_start else SimulationError, match=f"^source: {said}"):
        simulate(counted(code), engine=engine)


@engines
def test_ctrl_c_in_it_is_no_failure_of_it(engine):
    def interrupted(t, inputs):
        if t > 0.25:
            raise KeyboardInterrupt
        return t

    with (
        pytest.raises(KeyboardInterrupt),
        simulate.session(counted(interrupted), engine=engine) as session,
    ):
        session.step(5)


def test_what_cannot_be_copied_is_said():
    odd = Count()
    odd.lock = open(__file__)  # noqa: PTH123, SIM115
    with odd.lock, pytest.raises(InputError, match=r"^count: cannot be made: .*TypeError: cannot"):
        simulate(counted(count=odd))


def test_what_must_be_an_fmu_says_so():
    with (
        simulate.session(counted()) as session,
        pytest.raises(InputError, match=r"^source: is Python code, .*; must be an FMU$"),
    ):
        session._instances[0].numbers()
