"""How many sub-steps of its own a plant takes within a communication step."""

from math import ceil

LONGEST_STEP = 2.0
"""s, of every plant; a longer communication step is discarded."""

RATIO = 0.1
"""Longest sub-step as a fraction of the fastest time constant."""

MOST = 20_000
"""In a communication step, so that none is endless; one that needs more has no result."""


def count(rate: float, h: float) -> int:
    """Number of equal sub-steps that resolve a rate in 1/s within h seconds."""
    return max(1, ceil(h * rate / RATIO - 1e-9))
