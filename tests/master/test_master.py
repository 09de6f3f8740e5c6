"""The master without any FMU: order of exchange, time, rates, failures, steps that are rejected."""

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from grasp_cosim import InputError, SimulationError
from grasp_cosim.recording.recorded_run import Rejection
from grasp_cosim.system.parts import Connection, Port
from support.mocks import Mock, Run, make_system


@pytest.fixture
def mock(tmp_path):
    return lambda *args, **kwargs: Mock(tmp_path, *args, **kwargs)


@pytest.fixture
def clock(mock):
    return mock("clock", lambda u, t: t)


def through(u, t):
    return u


def in_a_row(*mocks):
    """Each one's y goes to the next one's u."""
    return [Connection(Port(a.name, "y"), Port(b.name, "u")) for a, b in pairwise(mocks)]


def chain(scheme, *mocks, **more):
    return Run(make_system(mocks, in_a_row(*mocks), scheme=scheme, **more), mocks)


def test_sequential_passes_values_on_within_the_step(mock, clock):
    signals = chain("sequential", clock, mock("a", through), mock("b", through)).to_the_end()
    assert signals["clock.y"] == signals["a.y"] == signals["b.y"]


def test_sequential_against_the_order_delays_by_a_step(mock, clock):
    a = mock("a", through)
    system = make_system([a, clock], [Connection(Port("clock", "y"), Port("a", "u"))])
    signals = Run(system, [a, clock]).to_the_end()
    assert signals["a.y"][1:] == signals["clock.y"][:-1]


def test_jacobi_delays_every_connection_by_a_step(mock, clock):
    signals = chain("jacobi", clock, mock("a", through), mock("b", through)).to_the_end()
    assert signals["a.y"][1:] == signals["clock.y"][:-1]
    assert signals["b.y"][2:] == signals["clock.y"][:-2]


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_rows_carry_the_time_their_values_belong_to(clock, scheme):
    run = chain(scheme, clock)
    assert run.to_the_end()["clock.y"] == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert run.memory.columns()[0].tolist() == [k * 100_000_000 / 1e9 for k in range(5)]


def test_time_is_never_accumulated(clock):
    chain("sequential", clock, step_ns=100_000, steps=3000).to_the_end()
    times = [float(call.split()[1]) for call in clock.calls if call.startswith("step")]
    assert times == [k * 100_000 / 1e9 for k in range(3000)]


def test_an_unconnected_input_is_never_sent(mock):
    a = mock("a", through)
    a.u = 5.0
    assert Run(make_system([a], []), [a]).to_the_end()["a.y"] == [5.0] * 5
    assert "send" not in a.calls


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
@pytest.mark.parametrize("phase", ["send", "step", "receive"])
@pytest.mark.parametrize("status", [3, 4])
def test_a_bad_status_ends_the_run(mock, clock, scheme, phase, status):
    a = mock("a", through)
    run = chain(scheme, clock, a)
    run.master.initialise()
    run.master.advance(2)
    a.statuses[phase] = status
    with pytest.raises(SimulationError, match=f"a: status {status} at 0.2"):
        run.master.advance(2)
    assert run.master.steps_done == 2
    assert len(run.signals()["a.y"]) == 3


def _with_statuses(mock, scheme, statuses):
    """A run whose components return these statuses in the third step."""
    mocks = [mock(name, through) for name in "abc"]
    run = Run(make_system(mocks, [], scheme=scheme), mocks)
    run.master.initialise()
    run.master.advance(2)
    for one, status in zip(mocks, statuses, strict=True):
        one.statuses["step"] = status
    return run, mocks


def test_all_components_that_fail_in_a_step_of_jacobi_are_named(mock):
    run, mocks = _with_statuses(mock, "jacobi", (3, 0, 4))
    message = r"^a: status 3 at 0\.2; c: status 4 at 0\.2$"
    with pytest.raises(SimulationError, match=message):
        run.master.advance(2)
    assert [sum(call.startswith("step") for call in one.calls) for one in mocks] == [3, 3, 3]
    assert run.master.steps_done == 2


def test_in_sequence_none_steps_from_values_of_one_that_failed(mock):
    run, mocks = _with_statuses(mock, "sequential", (3, 0, 4))
    with pytest.raises(SimulationError, match=r"^a: status 3 at 0\.2$"):
        run.master.advance(2)
    assert [sum(call.startswith("step") for call in one.calls) for one in mocks] == [3, 2, 2]


def test_after_a_fatal_status_no_instance_of_the_same_fmu_is_called(mock):
    run, (a, _, c) = _with_statuses(mock, "jacobi", (4, 3, 3))
    c.path = a.path
    with pytest.raises(SimulationError, match=r"^a: status 4 at 0\.2; b: status 3 at 0\.2$"):
        run.master.advance(2)
    assert sum(call.startswith("step") for call in c.calls) == 2


@pytest.mark.parametrize("phase", ["send", "step", "receive"])
def test_a_warning_does_not_end_the_run(mock, clock, phase):
    a = mock("a", through)
    a.statuses[phase] = 1
    assert chain("sequential", clock, a).to_the_end()["a.y"][-1] == pytest.approx(0.4)


def test_the_warnings_of_all_components_are_gathered_in_one_pass(mock, clock):
    """Of 5,000 components a pass for each takes minutes."""

    class Owners(list):
        passes = 0

        def __iter__(self):
            Owners.passes += 1
            return super().__iter__()

    a, b, c = (mock(name, through) for name in "abc")
    a.statuses["step"] = b.statuses["send"] = 1
    run = chain("sequential", clock, a, b, c)
    run.to_the_end()
    run.master.plan = replace(run.master.plan, owners=Owners(run.master.plan.owners))
    assert run.master.warnings() == ["a: 4 warnings since 0.0", "b: 4 warnings since 0.0"]
    assert Owners.passes == 1


def test_a_value_that_is_not_finite_is_found_and_is_the_last_one_kept(mock):
    run = chain("sequential", mock("lens", lambda u, t: math.nan if t > 0.15 else t))
    with pytest.raises(SimulationError, match=r"lens\.y = nan at step 2: must be finite"):
        run.to_the_end()
    assert len(run.signals()["lens.y"]) == 3


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_a_slow_component_steps_at_the_end_of_its_own_step(mock, clock, scheme):
    slow = mock("slow", lambda u, t: t)
    signals = chain(scheme, clock, slow, steps=8, own={"slow": 200_000_000}).to_the_end()
    steps = [call for call in slow.calls if call.startswith("step")]
    assert steps == [f"step {t!r} 0.2" for t in (0.0, 0.2, 0.4, 0.6)]
    assert signals["slow.y"] == pytest.approx([0, 0, 0.2, 0.2, 0.4, 0.4, 0.6, 0.6, 0.8])


def test_a_slow_component_sees_the_present_in_sequence_and_its_start_in_jacobi(mock, clock):
    slow = mock("slow", through)
    own = {"steps": 8, "own": {"slow": 200_000_000}}
    sequential = chain("sequential", clock, slow, **own).to_the_end()["slow.y"]
    assert sequential == pytest.approx([0, 0, 0.2, 0.2, 0.4, 0.4, 0.6, 0.6, 0.8])
    clock.time = slow.time = slow.u = 0.0
    jacobi = chain("jacobi", clock, slow, **own).to_the_end()["slow.y"]
    assert jacobi == pytest.approx([0, 0, 0, 0, 0.2, 0.2, 0.4, 0.4, 0.6])


def test_a_rate_that_does_not_divide_names_both_numbers(mock, clock):
    with pytest.raises(
        InputError, match=r"clock: step = 0\.25 s is not a whole multiple of the base step 0\.1 s; "
    ):
        chain("sequential", clock, steps=8, own={"clock": 250_000_000})
    with pytest.raises(InputError, match=r"clock: step = 0\.3 s does not divide stop = 0\.8 s"):
        chain("sequential", clock, steps=8, own={"clock": 300_000_000})


@pytest.fixture
def run(tmp_path):
    """A run of three steps of one component that rejects some."""

    def make(rejects, vary=True):
        mock = Mock(tmp_path, "a", lambda u, t: t, direct=False, vary=vary, rejects=rejects)
        return Run(make_system([mock], [], steps=3), [mock])

    return make


def steps(run):
    """Begin and length of each step that was tried."""
    calls = run.master.instances[0].calls
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
