"""Histograms of times that take the same memory however long a run is.

The bins are those of an HDR histogram, 2**7 to an octave, so that a bin is at most 1/128 of its
values wide: they are the exponents of float64 numbers with the first 7 bits of their mantissas.
"""

import math
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from .timing import Spread

BITS = 7
"""An octave has 2**BITS bins."""

BINS = (63 << BITS) + 1
"""The number of bins: one for 0, then the octaves from 1 ns up to 2**63 ns."""

RESOLUTION = 2.0**-BITS
"""The width of a bin is this part of its octave."""

COARSE = 3
"""bars() puts 2**COARSE bins into a bar."""

Times = npt.NDArray[np.float64]
"""Times in ns: whole numbers from 0 on."""


def bins_of(times: Times) -> npt.NDArray[np.int64]:
    """The numbers of the bins of times in ns."""
    exponents = times.view(np.int64) >> (52 - BITS)
    bins: npt.NDArray[np.int64] = np.maximum(exponents - ((1023 << BITS) - 1), 0)
    return bins


def lower_edge(number: int) -> float:
    """Return the lower edge of bin `number` in ns; that of BINS is behind the last bin."""
    if number == 0:
        return 0.0
    octave, place = divmod(number - 1, 1 << BITS)
    return math.ldexp(1.0 + place * RESOLUTION, octave)


class Histograms:
    """Several histograms side by side, which take rows of times."""

    def __init__(self, count: int) -> None:
        """Make `count` empty histograms."""
        self._counts = np.zeros((count, BINS), np.int64)
        self._flat = self._counts.reshape(-1)
        self._offsets = BINS * np.arange(count)
        self._used = 1
        self._worst = np.full(count, -1.0)
        self._worst_at = np.zeros(count, np.int64)

    def add(
        self,
        times: Times,
        steps: npt.NDArray[np.int64],
        taken: npt.NDArray[np.bool_] | None = None,
    ) -> None:
        """Add times (len(steps), count) in ns; taken, of that shape, leaves some of them out."""
        if taken is not None:
            times = np.where(taken, times, -1.0)
        bins = bins_of(np.ascontiguousarray(times))
        self._used = max(self._used, int(bins.max()) + 1)
        bins += self._offsets
        np.add.at(self._flat, bins.reshape(-1) if taken is None else bins[taken], 1)
        highest = times.max(axis=0)
        for i in np.flatnonzero(highest > self._worst).tolist():
            self._worst[i] = highest[i]
            self._worst_at[i] = steps[times[:, i].argmax()]

    def medians(self) -> npt.NDArray[np.int64]:
        """The medians of all histograms in ns, as in spread(); 0 where one is empty."""
        behind = self._counts[:, : self._used].cumsum(axis=1)
        ranks = (behind[:, -1:] + 1) // 2
        return np.array([_longest(int(i)) for i in (behind >= ranks).argmax(axis=1)])

    def spread(self, i: int) -> Spread | None:
        """Return the statistics of histogram `i` in ns, None while it is empty.

        The worst is exact, and `worst_at` its step number. The others are the longest times of the
        bins that they fall into: too long by at most 1/128.
        """
        worst = int(self._worst[i])
        if worst < 0:
            return None
        behind = self._counts[i, : self._used].cumsum()
        ranks = (-(-int(behind[-1]) * per_mille // 1000) for per_mille in (500, 990, 999))
        times = (min(_longest(int(behind.searchsorted(rank))), worst) for rank in ranks)
        return Spread._make((*times, worst, int(self._worst_at[i])))

    def worst(self, i: int) -> int:
        """The longest time of histogram i in ns; 0 while it is empty."""
        return max(int(self._worst[i]), 0)

    def bars(self, i: int) -> tuple[list[float], list[int]]:
        """The edges in ns (one more than bars) and the counts of histogram i, to be drawn.

        Eight bins make one bar; empty bars side by side are one, those at the ends are left out.
        """
        counts = self._counts[i]
        bars = [int(counts[0]), *counts[1:].reshape(-1, 1 << COARSE).sum(axis=1).tolist()]
        limits = [0.0, *(lower_edge(i) for i in range(1, BINS + 1, 1 << COARSE))]
        edges: list[float] = []
        heights: list[int] = []
        for (begin, end), count in zip(pairwise(limits), bars, strict=True):
            if not count:
                continue
            if not edges or edges[-1] != begin:
                heights += [0] if edges else []
                edges.append(begin)
            heights.append(count)
            edges.append(end)
        return edges, heights


def _longest(number: int) -> int:
    return math.ceil(lower_edge(number + 1)) - 1
