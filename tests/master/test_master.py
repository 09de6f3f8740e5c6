"""The master without any FMU: order of exchange, time, rates, failures."""

import math
from collections.abc import Callable
from itertools import pairwise

import pytest
from grasp_cosim import InputError, SimulationError
from grasp_cosim.system.parts import Connection, Port
from support.mocks import Mock, Run, make_system

Make = Callable[..., Mock]


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


def chain(scheme, *mocks, step_ns=100_000_000, steps=4):
    return Run(make_system(mocks, in_a_row(*mocks), steps, step_ns, scheme=scheme), mocks)


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


@pytest.mark.parametrize("kind", ["Integer", "Boolean"])
def test_integers_and_booleans_are_exchanged_and_recorded(mock, kind):
    source = mock("a", lambda u, t: float(t > 0.15), kind)
    signals = chain("sequential", source, mock("b", through, kind)).to_the_end()
    assert signals["a.y"] == signals["b.y"] == [0, 0, 1, 1, 1]
    assert isinstance(signals["a.y"][0], bool) is (kind == "Boolean")


def test_strings_are_passed_on(mock):
    source = mock("a", lambda u, t: f"at {t:g}", "String")
    target = mock("b", through, "String")
    chain("sequential", source, target).to_the_end()
    assert target.u == "at 0.4"


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


@pytest.mark.parametrize("phase", ["send", "step", "receive"])
def test_a_warning_does_not_end_the_run(mock, clock, phase):
    a = mock("a", through)
    a.statuses[phase] = 1
    assert chain("sequential", clock, a).to_the_end()["a.y"][-1] == pytest.approx(0.4)


def test_a_value_that_is_not_finite_is_found_and_is_the_last_one_kept(mock):
    run = chain("sequential", mock("lens", lambda u, t: math.nan if t > 0.15 else t))
    with pytest.raises(SimulationError, match=r"lens\.y = nan at step 2: must be finite"):
        run.to_the_end()
    assert len(run.signals()["lens.y"]) == 3


def rates(mocks, scheme, own, steps=8):
    system = make_system(mocks, in_a_row(*mocks), steps, scheme=scheme, own=own)
    return Run(system, mocks)


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_a_slow_component_steps_at_the_end_of_its_own_step(mock, clock, scheme):
    slow = mock("slow", lambda u, t: t)
    signals = rates([clock, slow], scheme, {"slow": 200_000_000}).to_the_end()
    steps = [call for call in slow.calls if call.startswith("step")]
    assert steps == [f"step {t!r} 0.2" for t in (0.0, 0.2, 0.4, 0.6)]
    assert signals["slow.y"] == pytest.approx([0, 0, 0.2, 0.2, 0.4, 0.4, 0.6, 0.6, 0.8])


def test_a_slow_component_sees_the_present_in_sequence_and_its_start_in_jacobi(mock, clock):
    slow = mock("slow", through)
    own = {"slow": 200_000_000}
    sequential = rates([clock, slow], "sequential", own).to_the_end()["slow.y"]
    assert sequential == pytest.approx([0, 0, 0.2, 0.2, 0.4, 0.4, 0.6, 0.6, 0.8])
    clock.time = slow.time = slow.u = 0.0
    jacobi = rates([clock, slow], "jacobi", own).to_the_end()["slow.y"]
    assert jacobi == pytest.approx([0, 0, 0, 0, 0.2, 0.2, 0.4, 0.4, 0.6])


def test_a_rate_that_does_not_divide_names_both_numbers(mock, clock):
    with pytest.raises(
        InputError, match=r"clock: step = 0\.25 s is not a whole multiple of the base step 0\.1 s; "
    ):
        rates([clock], "sequential", {"clock": 250_000_000})
    with pytest.raises(InputError, match=r"clock: step = 0\.3 s does not divide stop = 0\.8 s"):
        rates([clock], "sequential", {"clock": 300_000_000})


def test_a_connection_scales(mock, clock):
    a = mock("a", through)
    connection = Connection(Port("clock", "y"), Port("a", "u"), 1000.0, -5.0)
    signals = Run(make_system([clock, a], [connection]), [clock, a]).to_the_end()
    assert signals["a.y"] == [1000.0 * y - 5.0 for y in signals["clock.y"]]
