"""Recorded signals as text inside a page: exact, compact, unpacked in page/data.js.

The bit patterns of the doubles are taken as whole numbers. Of a smooth signal their second
differences are small, so that most of their high bytes are equal; these are put together and
deflated. The published grasp takes 2 characters per value, where base64 of doubles takes 10.7.
"""

import base64
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

MAX_VALUES = 20_000_000
"""So many values at most go into a page, 25 MB if they are smooth, 200 if they are pure noise; of
longer runs the extremes are kept."""

MANY_SIGNALS, MAX_VALUES_OF_MANY_SIGNALS = 500, 2_000_000
"""Of more signals than the first number a page has at most so many values as the second one, which
a browser still opens."""

COMPRESSION_LEVEL = 4
"""Of zlib: 10 s for the most values that go into a page; 9 takes minutes to save a tenth."""


@dataclass(frozen=True, eq=False)
class Excerpt:
    """The rows of a run in its page: time in s and signals, thinned if rows_per_pair is not None.

    Then every two rows stand for rows_per_pair recorded ones: the lowest and the highest value of
    each signal among these, in the order in which they came. The last row is the last one recorded.
    """

    time: npt.NDArray[np.float64]
    signals: Mapping[str, npt.NDArray[Any]]
    rows_per_pair: int | None


def excerpt_of(
    time: npt.NDArray[np.float64],
    signals: Mapping[str, npt.NDArray[Any]],
    max_values: int = MAX_VALUES,
) -> Excerpt:
    """Return the run as it is if it has at most `max_values` values, else thinned to these."""
    columns = 1 + len(signals)
    if columns > MANY_SIGNALS:
        max_values = min(max_values, MAX_VALUES_OF_MANY_SIGNALS)
    if len(time) * columns <= max_values:
        return Excerpt(time, signals, None)
    pairs = max((max_values // columns - 1) // 2, 1)
    rows_per_pair = -(-len(time) // pairs)
    starts = np.arange(0, len(time), rows_per_pair)
    middles = np.minimum(starts + rows_per_pair // 2, len(time) - 1)
    times = np.append(np.column_stack((time[starts], time[middles])), time[-1])
    # The last block may have a single row, whose time is then there twice.
    rows = np.flatnonzero(np.diff(times, append=np.inf) > 0.0)
    extremes = {name: _extremes(values, rows_per_pair)[rows] for name, values in signals.items()}
    return Excerpt(times[rows], extremes, rows_per_pair)


def _extremes(values: npt.NDArray[Any], block_rows: int) -> npt.NDArray[Any]:
    """The lowest and highest value of each block as they come, and the last value."""
    blocks = np.pad(values, (0, -len(values) % block_rows), mode="edge")
    return np.append(lowest_and_highest(blocks.reshape(-1, block_rows)), values[-1])


def lowest_and_highest(blocks: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Return the lowest and the highest value of each block, in the order in which they came.

    Blocks are along the first axis, their rows along the second; further ones are columns.
    """
    places = np.stack((blocks.argmin(axis=1), blocks.argmax(axis=1)), axis=1)
    return np.take_along_axis(blocks, np.sort(places, axis=1), axis=1)


def packed(values: npt.NDArray[Any]) -> str:
    """Values as base64 of deflated text; numbers and booleans become doubles, which are exact."""
    bits = np.ascontiguousarray(values, "<f8").view(np.int64)
    zero = np.int64(0)
    second_differences = np.diff(np.diff(bits, prepend=zero), prepend=zero)  # modulo 2^64
    planes = second_differences.astype("<i8").view(np.uint8).reshape(-1, 8).T
    return base64.b64encode(zlib.compress(planes.tobytes(), COMPRESSION_LEVEL)).decode("ascii")
