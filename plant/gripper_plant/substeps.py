"""How many sub-steps of its own a plant takes within a communication step."""

from math import ceil

RATIO = 0.1
"""Longest sub-step as a fraction of the fastest time constant."""


def count(rate: float, h: float) -> int:
    """Number of equal sub-steps that resolve a rate in 1/s within h seconds."""
    return max(1, ceil(h * rate / RATIO - 1e-9))
