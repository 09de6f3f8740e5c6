"""Surfaces by name: the coloured paper of the paper's experiments, Sec. IV.B."""

from collections.abc import Mapping
from enum import IntEnum
from types import MappingProxyType


class Surface(IntEnum):
    """A surface by its name; CUSTOM is one whose reflectance is given as a number."""

    CUSTOM = 0
    WHITE = 1
    BLUE = 2
    RED = 3
    BROWN = 4
    BLACK = 5


REFLECTANCE: Mapping[Surface, float] = MappingProxyType(
    {
        Surface.WHITE: 1.0,
        Surface.BLUE: 0.93,
        Surface.RED: 0.92,
        Surface.BROWN: 0.86,
        Surface.BLACK: 0.57,
    }
)
"""alpha relative to white."""
