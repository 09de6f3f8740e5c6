"""The magnitudes from which on a value is looked at: the loop compares them, row by row."""

from typing import Any

import numpy as np

from .listener import Floats

NEVER = np.iinfo(np.int64).max
"""No value has these bits, not even nan."""

INFINITY = int(np.float64(np.inf).view(np.int64))
"""Bits of inf; those of nan are above. The bits of magnitudes have the order of these."""


class Bounds:
    """Bounds of the first values of each row, as bits, and whether a value has come to its own.

    So rows need not be gone through again: nothing is to be found in them before that.
    """

    def __init__(self, width: int) -> None:
        """Without a bound for any of so many values."""
        self.magnitudes = np.full(width, NEVER, np.int64)
        self.exceeded = np.ones(1, np.int64)
        """Not 0 once a value has come to its bound, and before any is put."""
        self.compared = False
        """True if a loop compares them; otherwise any value may have come to its bound."""

    @property
    def may_be_exceeded(self) -> bool:
        """False if no value since put() has come to its bound."""
        return not self.compared or bool(self.exceeded[0])

    def put(self, columns: Any, magnitudes: Floats, infinite: Any) -> None:
        """Put other bounds of the values in some columns of a row; none of them is exceeded.

        Args:
            columns: The columns.
            magnitudes: The bounds. Where one is 0 that is any other value than 0, and where it is
                inf or nan, it is inf and nan.
            infinite: True where inf itself is no reason to look, only nan.
        """
        bits = np.where(magnitudes == 0.0, 5e-324, magnitudes).view(np.int64)
        self.magnitudes[columns] = np.minimum(bits, INFINITY + np.asarray(infinite, np.int64))
        self.exceeded[0] = 0
