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

LIMIT = 20_000_000
"""So many values at most go into a page, 25 MB if they are smooth, 200 if they are pure noise; of
longer runs the extremes are kept."""

MANY, LIMIT_OF_MANY = 500, 2_000_000
"""Of more signals than so many, so many values at most go into a page, which a browser opens."""

EFFORT = 4
"""Of zlib: 10 s for the most values that go into a page; 9 takes minutes to save a tenth."""


@dataclass(frozen=True, eq=False)
class Shown:
    """The rows of a run in its page: time in s and signals, thinned if rows_per_pair is not None.

    Then every two rows stand for rows_per_pair recorded ones: the lowest and the highest value of
    each signal among these, in the order in which they came. The last row is the last one recorded.
    """

    time: npt.NDArray[np.float64]
    signals: Mapping[str, npt.NDArray[Any]]
    rows_per_pair: int | None


def fit(
    time: npt.NDArray[np.float64], signals: Mapping[str, npt.NDArray[Any]], limit: int = LIMIT
) -> Shown:
    """Return the run as it is if it has at most `limit` values, else thinned to fit."""
    columns = 1 + len(signals)
    limit = min(limit, LIMIT_OF_MANY) if columns > MANY else limit
    if len(time) * columns <= limit:
        return Shown(time, signals, None)
    pairs = max((limit // columns - 1) // 2, 1)
    size = -(-len(time) // pairs)
    starts = np.arange(0, len(time), size)
    middles = np.minimum(starts + size // 2, len(time) - 1)
    kept = np.append(np.column_stack((time[starts], time[middles])), time[-1])
    rows = np.flatnonzero(np.diff(kept, append=np.inf) > 0.0)  # the last block may be of one row
    thinned = {name: _extremes(values, size)[rows] for name, values in signals.items()}
    return Shown(kept[rows], thinned, size)


def _extremes(values: npt.NDArray[Any], size: int) -> npt.NDArray[Any]:
    """The lowest and highest value of each block as they come, and the last value."""
    blocks = np.pad(values, (0, -len(values) % size), mode="edge").reshape(-1, size)
    pairs = np.sort(np.column_stack((blocks.argmin(axis=1), blocks.argmax(axis=1))), axis=1)
    return np.append(np.take_along_axis(blocks, pairs, axis=1), values[-1])


def packed(values: npt.NDArray[Any]) -> str:
    """Values as base64 of deflated text; numbers and booleans become doubles, which are exact."""
    bits = np.ascontiguousarray(values, "<f8").view(np.int64)
    zero = np.int64(0)
    second = np.diff(np.diff(bits, prepend=zero), prepend=zero)  # modulo 2^64
    planes = second.astype("<i8").view(np.uint8).reshape(-1, 8).T
    return base64.b64encode(zlib.compress(planes.tobytes(), EFFORT)).decode("ascii")
