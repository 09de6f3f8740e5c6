"""The timing of a paced run, made up from drawn samples."""

from collections import Counter

import numpy as np
import numpy.typing as npt
from grasp_cosim.realtime.timing import Histogram, Overrun, Spread, Timing

PERIOD = 1e-3
EDGES = np.geomspace(1e-8, 10.0, 181)
LISTED = 1000

BULK = {"plant": 24e-6, "sensor_1": 6e-6, "sensor_2": 6e-6, "controller": 14e-6}
"""Medians in s of the components."""

Times = npt.NDArray[np.float64]


def paced(steps=60_000, hiccups=12, seed=1, components=BULK, listed=LISTED):
    """Steps of which so many were made late by one part each."""
    rng = np.random.default_rng(seed)

    def drawn(median, spread=0.12):
        values = median * np.exp(spread * rng.standard_normal(steps))
        return values * np.where(rng.random(steps) < 0.004, rng.uniform(1.0, 8.0, steps), 1.0)

    inside = {name: drawn(median) for name, median in components.items()}
    inside |= {"exchange": drawn(2e-6)}
    around = {"start": drawn(3e-6, 0.6), "recording": drawn(8e-7, 0.5), "between": drawn(1e-6)}
    either = {**inside, **around}
    guilty = [name for name in either if name != "sensor_2"]
    spoilt = np.sort(rng.choice(steps, hiccups, replace=False))
    culprits = [guilty[k] for k in rng.integers(len(guilty), size=hiccups)]
    for step, culprit in zip(spoilt, culprits, strict=True):
        either[culprit][step] += PERIOD * rng.uniform(1.0, 6.0)
    late = np.sum(list(either.values()), axis=0) - PERIOD
    parts = {"step": np.sum(list(inside.values()), axis=0), "start": around["start"], **either}
    return Timing(
        factor=1.0,
        period=PERIOD,
        overrun="catch-up",
        granted=("SCHED_FIFO, priority 50",),
        refused=("memory not locked: RLIMIT_MEMLOCK is 65536 bytes; must be unlimited",),
        steps=steps,
        real_time_factor=1.0,
        overruns=hiccups,
        listed=tuple(
            Overrun(int(n), n * PERIOD, float(late[n]), culprit, float(either[culprit][n]))
            for n, culprit in zip(spoilt[:listed].tolist(), culprits, strict=False)
        ),
        culprits=dict(Counter(culprits).most_common()),
        parts={name: _spread(times) for name, times in parts.items()},
        histograms={name: _histogram(times) for name, times in parts.items()},
    )


def _spread(times):
    """Each quantile is a time that occurred."""
    median, p99, p999 = np.quantile(times, (0.5, 0.99, 0.999), method="inverted_cdf").tolist()
    worst = int(times.argmax())
    return Spread(median, p99, p999, float(times[worst]), worst * PERIOD)


def _histogram(times):
    """No empty bins at the ends."""
    counts = np.histogram(times, EDGES)[0]
    first, *_, last = np.flatnonzero(counts).tolist()
    edges = EDGES[first : last + 2]
    return Histogram(tuple(edges.tolist()), tuple(counts[first : last + 1].tolist()))
