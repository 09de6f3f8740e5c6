"""How many sub-steps of its own a plant takes within a communication step."""

from math import ceil

RATIO = 0.1
"""Longest sub-step as a fraction of the fastest time constant."""

MOST = 20_000
"""In a communication step, so that none takes long; a plant may have fewer, MOST_SUBSTEPS."""


def needed(rate: float, h: float) -> float:
    """How many sub-steps resolve a rate in 1/s within h seconds, before they are made whole."""
    return h * rate / RATIO


def count(rate: float, h: float) -> int:
    """Number of equal sub-steps that resolve a rate in 1/s within h seconds."""
    return max(1, ceil(needed(rate, h) - 1e-9))
