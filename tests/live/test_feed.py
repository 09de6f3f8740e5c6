"""The rows that a live page keeps: extremes of everything, in bounded memory, for late clients."""

import numpy as np
import pytest
from grasp_cosim.exchange.listener import Experiment, Signal
from grasp_cosim.live import feed as live_feed
from grasp_cosim.live.feed import MAX_BYTES, MAX_PAIRS, MAX_SIGNALS, Feed, Pairs
from hypothesis import given
from hypothesis import strategies as st

SETTINGS = {"system": "made", "step": 1e-3, "stop": 1e6}


def rows_of(first, count, signals=1, seed=0):
    """Rows of a random walk over time in steps of 1 ms."""
    values = np.random.default_rng(seed + first).normal(size=(count, signals))
    return np.column_stack((1e-3 * np.arange(first, first + count), values))


def same_extremes(rows, kept):
    low, high = rows[:, 1:].min(axis=0), rows[:, 1:].max(axis=0)
    return (kept[:, 1:].min(axis=0) == low).all() and (kept[:, 1:].max(axis=0) == high).all()


@given(
    st.lists(st.integers(1, 400), min_size=1, max_size=30),
    st.integers(2, 7),
    st.integers(1, 3),
)
def test_however_the_rows_come_their_extremes_are_kept_in_order_of_time(counts, size, signals):
    pairs, all_rows, first = Pairs(signals, size), [], 0
    for count in counts:
        all_rows.append(rows_of(first, count, signals))
        pairs.add(all_rows[-1])
        first += count
    pairs.add(np.empty((0, 1 + signals)), last=True)
    rows, kept = np.concatenate(all_rows), pairs.all()
    assert same_extremes(rows, kept)
    assert (np.diff(kept[:, 0]) >= 0.0).all()
    assert kept[0, 0] == 0.0
    assert kept[-1, 0] <= rows[-1, 0] < kept[-1, 0] + 1e-3 * size
    assert pairs.count == -(-len(rows) // size)


def test_two_rows_are_a_pair_as_they_are():
    pairs, rows = Pairs(2, 2), rows_of(0, 10, 2)
    pairs.add(rows)
    assert pairs.all().tolist() == rows.tolist()


def test_a_long_run_takes_no_more_memory_than_a_short_one(monkeypatch):
    """An hour at 200 pairs a second, with fewer places to be quick; the latest stay fine."""
    monkeypatch.setattr(live_feed, "MAX_PAIRS", 64)
    pairs, size = Pairs(1, 2), []
    highest, lowest = -np.inf, np.inf
    for chunk in range(2000):
        rows = rows_of(100 * chunk, 100)
        highest, lowest = max(highest, rows[:, 1].max()), min(lowest, rows[:, 1].min())
        pairs.add(rows)
        size.append(len(pairs.all()))
    assert max(size) <= 2 * (2 + 1) * 64
    kept = pairs.all()
    assert (kept[:, 1].max(), kept[:, 1].min()) == (highest, lowest)
    assert kept[-128:].tolist() == rows_of(100 * 1999, 100)[-128:].tolist() or len(kept) > 128
    assert kept[-100:].tolist() == rows.tolist()
    assert (np.diff(kept[:, 0]) >= 0.0).all()


@pytest.mark.parametrize("signals", [1, 40, MAX_SIGNALS])
def test_the_memory_is_bounded_however_many_signals_there_are(signals):
    pairs = Pairs(signals, 2)
    arrays = [pairs._latest, pairs._whole]
    assert sum(array.nbytes for array in arrays) <= MAX_BYTES
    assert len(pairs._whole) <= MAX_PAIRS


def test_who_is_behind_gets_what_is_there_and_knows_what_is_missing(monkeypatch):
    monkeypatch.setattr(live_feed, "MAX_PAIRS", 16)
    pairs = Pairs(1, 2)
    pairs.add(rows_of(0, 40))
    piece = pairs.since(5, 100)
    assert (piece.first, len(piece.rows), pairs.count) == (5, 15, 20)
    assert piece.rows.reshape(-1, 2).tolist() == rows_of(0, 40)[10:].tolist()
    assert pairs.since(5, 4).rows.tolist() == piece.rows[:4].tolist()
    assert len(pairs.since(20, 4).rows) == 0
    pairs.add(rows_of(40, 400))
    assert pairs.since(5, 100).first > 5


def made(signals, factor=1.0, every=1):
    feed = Feed(factor, every)
    feed.begin(Experiment.of(SETTINGS), signals)
    return feed


def test_a_feed_copies_what_it_gets_and_leaves_texts_out():
    feed = made(
        [Signal("a.x", "m", "Real"), Signal("a.t", None, "String"), Signal("a.b", None, "Boolean")]
    )
    rows = np.array([[1.0, 0.0, 1.0], [2.0, 1.0, 0.0]])
    feed.block(np.arange(2), rows)
    rows[:] = 9.0
    assert not feed.begun.is_set()
    feed.digest()
    assert feed.begun.is_set()
    time, columns = feed.columns()
    assert (feed.left_out, [*columns]) == (1, ["a.x", "a.b"])
    assert (time[-1], columns["a.x"][-1], columns["a.b"][-1]) == (1e-3, 2.0, 0.0)
    feed.end(True)
    assert feed.ended
    assert feed.pairs.count == 1


def test_rows_that_nobody_pairs_are_paired_by_who_brings_too_many(monkeypatch):
    monkeypatch.setattr(live_feed, "MAX_WAITING_BYTES", 800)
    feed = made([Signal("a.x", "m", "Real")])
    for chunk in range(50):
        feed.block(np.arange(60 * chunk, 60 * chunk + 60), np.zeros((60, 1)))
        assert feed._waiting_bytes <= 800
    assert feed.begun.is_set()


def test_many_signals_have_fewer_pairs_and_very_many_are_left_out():
    few = made([Signal("a.x", None, "Real")], 10.0)
    many = made([Signal(f"a.x{i}", None, "Real") for i in range(MAX_SIGNALS + 5)], 10.0)
    assert (few.pairs._block_rows, many.left_out, len(many.signals)) == (50, 5, MAX_SIGNALS)
    assert many.pairs._block_rows > few.pairs._block_rows
    assert made([Signal("a.x", None, "Real")], 1.0, 300).pairs._block_rows == 2
