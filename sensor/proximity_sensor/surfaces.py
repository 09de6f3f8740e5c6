"""Surfaces by name: the coloured paper of the paper's experiments, Sec. IV.B."""

from collections.abc import Mapping
from types import MappingProxyType

REFLECTANCE: Mapping[str, float] = MappingProxyType(
    {"white": 1.0, "blue": 0.93, "red": 0.92, "brown": 0.86, "black": 0.57}
)
"""alpha relative to white."""
