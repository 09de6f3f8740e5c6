"""From the master to the listeners: every row once, in order; what runs away ends the run."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError, simulate
from grasp_cosim.base.si_units import Unit
from grasp_cosim.exchange.divergence import DECADES, MAX_SCALES, Divergence, largest
from grasp_cosim.exchange.listener import Signal
from grasp_cosim.interface.interface import Interface
from grasp_cosim.interface.variables import Variable
from grasp_cosim.master.master import ENOUGH
from grasp_cosim.recording.csv import CsvListener
from grasp_cosim.recording.memory import MemoryListener
from grasp_cosim.system.parts import Port
from hypothesis import given
from hypothesis import strategies as st
from recording.rows import full_disk


@pytest.mark.parametrize("every", [1, 300])
def test_a_file_written_on_the_way_is_the_one_written_afterwards(grasp, tmp_path, every):
    result = simulate(grasp, stop=0.1, every=every, listeners=[CsvListener(tmp_path / "on.csv")])
    result.to_csv(tmp_path / "after.csv")
    assert result.time.tolist() == [k / 1e4 for k in (*range(0, 1000, every), 1000)]
    assert (tmp_path / "on.csv").read_bytes() == (tmp_path / "after.csv").read_bytes()


def test_a_run_that_is_broken_off_keeps_what_was_recorded(grasp, tmp_path):
    """Every 30th point and the last; a look on the way has its own point, which is not kept."""
    path = tmp_path / "s.csv"
    with simulate.session(grasp, stop=0.1, every=30, listeners=[CsvListener(path)]) as session:
        session.step(35)
        assert session.result().time.tolist() == [0.0, 0.003, 0.0035]
        session.step(30)
    times = [line.partition(",")[0] for line in path.read_text().splitlines()]
    assert times == ['"time"', "0.0", "0.003", "0.006", "0.0065"]


def test_where_a_listener_fails_the_others_keep_their_rows(grasp, tmp_path):
    full, memory = CsvListener(tmp_path / "s.csv"), MemoryListener()
    with simulate.session(grasp, stop=0.1, listeners=[memory, full]) as session:
        session.step(ENOUGH + 20)
        with full_disk(360_000), pytest.raises(SimulationError, match=r"s\.csv: can") as caught:
            session.step(1000 - ENOUGH)
    result = caught.value.result
    assert not result.complete
    rows = len((tmp_path / "s.csv").read_text().splitlines()) - 1
    assert 10 < rows < len(memory.columns()[0]) == len(result.time)
    assert (np.diff(memory.columns()[0]) > 0.0).all()


def test_where_a_listener_does_not_begin_no_file_is_left(grasp, tmp_path):
    (tmp_path / "file").touch()
    places = [tmp_path / "s.csv", tmp_path / "file" / "s.csv"]
    with pytest.raises(InputError, match=r"file/s\.csv: cannot be written: "):
        simulate(grasp, stop=0.1, listeners=[CsvListener(path) for path in places])
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_where_the_run_does_not_begin_no_file_is_left(grasp, tmp_path):
    wide = grasp.with_values({"plant.object_width": 0.5})
    with pytest.raises(
        InputError, match=r"^plant: GripperPlant.fmu refused .*object_width = 0\.5 m"
    ):
        simulate(wide, stop=0.1, listeners=[CsvListener(tmp_path / "s.csv")])
    assert list(tmp_path.iterdir()) == []


def test_where_a_listener_does_not_end_the_others_do(grasp, tmp_path):
    paths = [tmp_path / name for name in ("1.csv", "2.csv", "3.csv")]
    session = simulate.session(grasp, stop=0.1, listeners=[*map(CsvListener, paths)])
    session.step(10)
    paths[1].mkdir()
    with pytest.raises(SimulationError, match=r"2\.csv: cannot be written: Is a directory"):
        session.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["1.csv", "2.csv", "3.csv"]
    assert [len(path.read_text().splitlines()) for path in (paths[0], paths[2])] == [12, 12]


UNITS = {
    "N": Unit("N", (1, 1, -2, 0, 0, 0, 0, 0)),
    "uN": Unit("uN", (1, 1, -2, 0, 0, 0, 0, 0), 1e-6),
}
ROWS = 4000
K = np.arange(ROWS)


def watch(*columns, block=1000, unit=None, nominal=None, kind="Real"):
    """What runs away of signals a.y0, ... 1 ms apart; rows are counted over all blocks."""
    names = [f"y{i}" for i in range(len(columns))]
    variables = tuple(
        Variable(n, "Real", "output", 1, unit, None, None, None, magnitude=nominal) for n in names
    )
    interface = Interface(Any, "", "", variables, units=UNITS)
    system = SimpleNamespace(
        component=lambda name, place: SimpleNamespace(interface=interface),
        scheme="jacobi",
        step_ns=1_000_000,
        time_ns=lambda step: 1_000_000 * step,
    )
    outputs = {Port("a", n): Signal(f"a.{n}", unit, kind) for n in names}
    divergence, rows = Divergence(system, outputs), np.column_stack(columns)
    for first in range(0, len(rows), block):
        piece = slice(first, first + block)
        found = divergence(np.arange(len(rows))[piece], rows[piece], largest(rows[piece]))
        if found is not None:
            return first + found[0], found[1]
    return None


def ten(low, high):
    """Powers of ten of a number from low to high."""
    return st.floats(low, high).map(lambda x: float(10.0**x))


def response(damping, frequency, time):
    """Step and impulse response of a system of second order, from the roots; 0 before time 0."""
    t = np.maximum(time, 0.0)
    s = frequency * np.sqrt(np.array(damping**2 - 1.0, complex))
    one, two = -damping * frequency + s, -damping * frequency - s
    if abs(one - two) < 1e-6 * frequency:
        two = one * (1.0 + 1e-6)
    impulse = ((np.exp(one * t) - np.exp(two * t)) / (one - two)).real * frequency
    step = (1.0 + (two * np.exp(one * t) - one * np.exp(two * t)) / (one - two)).real
    return np.where(time >= 0.0, step, 0.0), np.where(time >= 0.0, impulse, 0.0)


@given(ten(-4.0, 1.0), ten(-4.0, 0.6), ten(-3.0, 12.0), st.integers(0, ROWS), st.floats(-1e3, 1e3))
def test_a_stable_system_of_second_order_may_overshoot(damping, frequency, size, start, rest):
    for curve in response(damping, frequency, K - float(start)):
        assert watch(rest + size * curve) is None


@given(
    st.lists(
        st.tuples(st.floats(0.0, 6.0), ten(-3.0, 6.0), st.integers(0, ROWS), st.booleans()),
        min_size=1,
        max_size=3,
    )
)
def test_ramps_powers_and_their_sums_do_not_trip(parts):
    """A power of 0 is a jump."""
    total = np.zeros(ROWS)
    for power, size, start, down in parts:
        after = np.maximum(K - start, 0) / ROWS
        total += (-size if down else size) * np.where(start <= K, after**power, 0.0)
    assert watch(total) is None


@given(ten(-2.3, 0.7), ten(-4.0, 0.497), st.floats(0.0, 6.3), ten(-9.0, 3.0), st.integers(1, 2000))
def test_what_grows_exponentially_trips_whatever_its_rate_and_frequency(
    rate, turn, phase, size, block
):
    """`rate` in decades a step: from one in 200 steps to five in one, with any oscillation."""
    decades = np.log10(size) + rate * K
    there = decades < 60.0
    curve = 10.0 ** decades[there] * np.cos(turn * K[there] + phase)
    if np.abs(curve).max() < 10.0 * MAX_SCALES * max(1.0, size):
        return  # it has not grown enough
    found = watch(curve, block=block)
    assert np.abs(curve[: found[0] + 1]).max() >= 10.0**DECADES


@pytest.mark.parametrize("rate", [1.0 / 500.0, 1.0 / 40.0, 0.1, 0.7])
def test_what_grows_evenly_trips_at_six_decades(rate):
    curve = 10.0 ** (rate * K[K * rate < 20.0])
    assert 6.0 <= np.log10(curve[watch(curve)[0]]) < 7.5


def stairs(spans):
    """A curve that stays at each decade for so many rows, and at last where it is."""
    reached = np.cumsum([0, *spans])
    return 10.0 ** (np.searchsorted(reached, K, side="right") - 1.0)


@pytest.mark.parametrize(
    ("spans", "trips"),
    [
        ([30] * 6, True),
        ([1] * 6, True),
        ([30] * 5, False),
        ([75, 30, 30, 30, 30, 75], True),  # one takes 2.5 times as long as another
        ([76, 30, 30, 30, 30, 76], False),
        ([40, 40, 40, 50, 50, 50], True),  # the second half takes 1.25 times as long
        ([40, 40, 40, 50, 50, 51], False),
        ([50, 50, 50, 40, 40, 40], True),
        ([200, 30, 30, 30, 30, 30, 30], True),  # only the last six count
        ([0, 30, 30, 30, 30, 30], False),
        ([0] * 6, False),
    ],
)
def test_six_decades_that_take_about_equally_long_are_growth(spans, trips):
    found = watch(stairs(spans))
    assert (None if found is None else found[0]) == (sum(spans) if trips else None)


GROWN = 10.0 ** (K / 500.0)
"""Up to 1e8."""


@pytest.mark.parametrize(
    ("curve", "options", "trips"),
    [
        (GROWN, {}, True),
        (GROWN, {"nominal": 1e4}, False),
        (1e4 * GROWN, {"nominal": 1.0}, True),  # from 1e4: to be 1e10, and it is 1e12
        (1e-3 * GROWN, {}, False),
        (1e-3 * GROWN, {"nominal": 1e-3}, True),
        (GROWN**5, {"kind": "Integer"}, False),
        (np.full(ROWS, 6e23), {}, False),
        (np.where(K < 100, 0.0, 6e23), {}, False),
        (np.where(K < 100, 1.0, 1e14), {}, False),
    ],
)
def test_the_scale_is_the_nominal_or_the_first_value_and_a_jump_does_not_trip(
    curve, options, trips
):
    assert (watch(curve, **options) is not None) == trips


@pytest.mark.parametrize(
    ("curve", "trips"),
    [
        (np.full(ROWS, 1.7976931348623157e308), False),
        (np.where(K % 2, 1.7e308, -1.7e308), False),
        (1e300 * GROWN, True),  # from its start value on: to be 1e306, and it is 1e308
        (1e307 * np.minimum(GROWN, 17.0), False),
        (np.where(K < 100, 0.0, 1.7e308), False),
    ],
)
def test_values_near_the_largest_double_are_watched_without_a_warning(curve, trips):
    assert (watch(curve) is not None) == trips


@given(st.integers(1, 300), st.integers(1, 300))
def test_blocks_of_any_length_come_to_the_same(one, two):
    columns = [10.0 ** (K[:900] / d) for d in (60.0, 70.0, 61.0)]
    assert watch(*columns, block=one) == watch(*columns, block=two)


def test_the_first_to_run_away_is_named():
    late, early = 10.0 ** (K / 500.0), 10.0 ** (K / 300.0)
    found = watch(late, early, unit="N")
    assert found[1].startswith("a.y1 ran away: 1e+06 N at t = 1.8 s, ")
    found = watch(late, unit="N")
    assert found[1] == (
        "a.y0 ran away: 1e+06 N at t = 3 s, ten times as much every 0.5 s; look at the signs and "
        "gains, or try a shorter step"
    )
