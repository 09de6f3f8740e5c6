"""The rows of a run for its page: taken while the run goes on, thinned, in bounded memory.

The thread that hands rows on only copies them. The server's thread makes pairs of them: of each
block of rows the lowest and the highest value of each signal, in the order in which they came, as
report/embed.py does it. The latest pairs are kept; of the whole run there are fewer, longer ones.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..exchange.listener import Experiment, Floats, Signal, Steps
from ..report.embed import lowest_and_highest
from ..system.times import in_seconds

PAIRS_PER_SECOND = 200
"""Of wall time; of many signals there are fewer."""

MAX_VALUES_PER_SECOND = 20_000
"""So many values of pairs there are at most in a second of wall time, for each client."""

MAX_PAIRS = 4096
"""The latest pairs that are kept, and those of the whole run; of many signals there are fewer."""

MAX_BYTES = 24_000_000
"""Of memory for all pairs."""

MAX_SIGNALS = 1000
"""Of more signals the first ones are shown."""

MAX_WAITING_BYTES = 8_000_000
"""Of rows that wait to be paired; then the thread that brings more does it."""


class Piece(NamedTuple):
    """Pairs of a run from the number `first` on: rows of the time in s and of the signals."""

    first: int
    rows: Floats


class Pairs:
    """The pairs of a run: the latest ones, and fewer of the whole run.

    A pair is two rows, of the time and of the signals. Of a block of rows they stand for its first
    and its middle moment.
    """

    def __init__(self, signals: int, block_rows: int) -> None:
        """Pairs of so many signals, each of so many rows, at least 2."""
        self.width = 1 + signals
        self.count = 0
        """The number of pairs that there have been."""
        self._block_rows = block_rows
        size = int(MAX_BYTES / (3 * 2 * 8 * self.width))
        self._most = max(16, min(MAX_PAIRS, size) // 2 * 2)
        self._rest = np.empty((0, self.width))
        self._latest = np.empty((2 * self._most, 2, self.width))
        self._latest_count = 0
        self._whole = np.empty((self._most, 2, self.width))
        self._whole_count, self._per_pair = 0, 1
        self._ungathered = np.empty((0, 2, self.width))

    def add(self, rows: Floats, last: bool = False) -> None:
        """Take rows of the time and the signals; the last ones are a pair however few they are."""
        rows = np.concatenate((self._rest, rows))
        size = self._block_rows
        full = len(rows) // size * size
        if full:
            self._add_pairs(_paired(rows[:full].reshape(-1, size, self.width)))
        self._rest = rows[full:].copy()
        if last and len(self._rest):
            self._add_pairs(_paired(self._rest[np.newaxis]))
            self._rest = self._rest[:0]

    def _add_pairs(self, pairs: Floats) -> None:
        self.count += len(pairs)
        self._gather(pairs)
        pairs = pairs[-self._most :]
        if self._latest_count + len(pairs) > len(self._latest):
            kept = self._latest[self._latest_count - self._most : self._latest_count].copy()
            self._latest[: self._most] = kept
            self._latest_count = self._most
        self._latest[self._latest_count : self._latest_count + len(pairs)] = pairs
        self._latest_count += len(pairs)

    def _gather(self, pairs: Floats) -> None:
        """Add pairs to those of the whole run, so many to one of these."""
        pairs = np.concatenate((self._ungathered, pairs))
        while len(pairs) >= self._per_pair:
            room = (self._most - self._whole_count) * self._per_pair
            taken = min(len(pairs) // self._per_pair * self._per_pair, room)
            gathered = _folded(pairs[:taken], self._per_pair)
            self._whole[self._whole_count : self._whole_count + len(gathered)] = gathered
            self._whole_count += len(gathered)
            pairs = pairs[taken:]
            if self._whole_count == self._most:
                self._whole[: self._most // 2] = _folded(self._whole, 2)
                self._whole_count //= 2
                self._per_pair *= 2
        self._ungathered = pairs.copy()

    def since(self, number: int, most: int) -> Piece:
        """At most so many pairs from a number on; fewer, and later ones, where some are gone."""
        first = max(number, self.count - self._latest_count)
        begin = self._latest_count - (self.count - first)
        return Piece(first, self._latest[begin : min(begin + most, self._latest_count)].copy())

    @property
    def last_row(self) -> Floats:
        """The last row where it is in no pair yet, as (0 or 1, 1 + signals)."""
        return self._rest[-1:]

    def all(self) -> Floats:
        """The rows of the whole run, the latest ones finer, as (rows, 1 + signals)."""
        latest = self._latest[: self._latest_count].reshape(-1, self.width)
        whole = self._whole[: self._whole_count].reshape(-1, self.width)
        if not len(latest):
            return latest.copy()
        older = whole[: int(np.searchsorted(whole[:, 0], latest[0, 0]))]
        return np.concatenate((older, latest))


def _paired(blocks: Floats) -> Floats:
    """The pair of each block: its lowest and highest values, at its first and middle moment."""
    pairs: Floats = lowest_and_highest(blocks)
    pairs[:, 0, 0], pairs[:, 1, 0] = blocks[:, 0, 0], blocks[:, blocks.shape[1] // 2, 0]
    return pairs


def _folded(pairs: Floats, count: int) -> Floats:
    """One pair for each so many pairs."""
    return pairs if count == 1 else _paired(pairs.reshape(-1, 2 * count, pairs.shape[2]))


class Feed:
    """A listener that takes the rows of a run for its page.

    `changed` is notified, with its lock held, where there is something new. Strings are left out.
    """

    is_of_all_rows = True

    def __init__(self, factor: float, every: int = 1) -> None:
        """Take every n-th row of a run that is so many times as fast as real time."""
        self._factor, self._every = factor, every
        self.changed = threading.Condition()
        self.begun = threading.Event()
        """Set once there is the first row, that of the start, or none will come."""
        self.has_rows = self.ended = False
        self._lock = threading.Lock()
        """Of what waits; who has it does nothing else."""
        self._waiting: list[tuple[Steps, Floats]] = []
        self._waiting_bytes = 0

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """Choose the signals: numbers and Booleans."""
        self.experiment = experiment
        places = [i for i, signal in enumerate(signals) if signal.kind != "String"][:MAX_SIGNALS]
        self.signals = tuple(signals[i] for i in places)
        self.left_out = len(signals) - len(places)
        """How many signals are not shown."""
        self._places = np.array(places, np.intp)
        pairs = min(PAIRS_PER_SECOND, MAX_VALUES_PER_SECOND / (2 * (1 + len(places))))
        rows = self._factor / (in_seconds(experiment.step_ns) * self._every)
        self.pairs = Pairs(len(places), max(2, round(rows / pairs)))

    def block(self, steps: Steps, rows: Floats) -> None:
        """Copy the rows; nothing else is done with them here, unless very many wait."""
        copied = steps.copy(), rows[:, self._places]
        with self._lock:
            self._waiting.append(copied)
            self._waiting_bytes += copied[1].nbytes
            too_many = self._waiting_bytes > MAX_WAITING_BYTES
        if too_many:
            self.digest()

    def end(self, complete: bool) -> None:
        """Pair the last rows, and say that there are no more."""
        self.digest(last=True)

    def digest(self, last: bool = False) -> None:
        """Pair the rows that wait, and notify those who wait for them."""
        with self.changed:
            with self._lock:
                waiting, self._waiting, self._waiting_bytes = self._waiting, [], 0
            rows = [self._with_times(steps, rows) for steps, rows in waiting]
            if rows or last:
                self.pairs.add(np.concatenate([np.empty((0, self.pairs.width)), *rows]), last)
            self.ended = self.ended or last
            if rows:
                self.time = float(rows[-1][-1, 0])
                self.has_rows = True
                self.begun.set()
            self.changed.notify_all()

    def _with_times(self, steps: Steps, rows: Floats) -> Floats:
        return np.column_stack((self.experiment.times(steps), rows))

    def columns(self) -> tuple[npt.NDArray[np.float64], dict[str, npt.NDArray[np.float64]]]:
        """The times in s and the columns of the rows that are kept, by name."""
        with self.changed:
            rows = np.concatenate((self.pairs.all(), self.pairs.last_row))
        return rows[:, 0], {s.name: rows[:, 1 + i] for i, s in enumerate(self.signals)}
