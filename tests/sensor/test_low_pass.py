"""The low-pass filter against scipy's, and against what a Butterworth filter is."""

from math import pi

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import low_pass
from scipy import signal
from support.marks import examples

QUICK = examples(100)

PUBLISHED = low_pass.coefficients(500.0, 10_000.0)

CUTOFFS = st.floats(1e-3, 0.49)
"""As a fraction of the sampling rate."""


def polynomials(c):
    """Numerator and denominator, multiplied out."""
    b, a, *sections = c
    above, below = np.array([b, b]), np.array([1.0, a])
    for b_0, a_1, a_2 in sections:
        above = np.convolve(above, [b_0, 2.0 * b_0, b_0])
        below = np.convolve(below, [1.0, a_1, a_2])
    return above.tolist(), below.tolist()


def run(c, samples, start):
    z = low_pass.settled(c, start)
    results = []
    for v in samples:
        y, z = low_pass.filtered(c, z, v)
        results.append(y)
    return results


def test_the_published_filter_is_scipys():
    b, a = signal.butter(5, 500, fs=10_000)
    above, below = polynomials(PUBLISHED)
    np.testing.assert_allclose(above, b, rtol=1e-12, atol=0.0)
    np.testing.assert_allclose(below, a, rtol=1e-12, atol=0.0)


@QUICK
@given(CUTOFFS)
def test_the_magnitude_is_butterworths(part):
    """1 / sqrt(1 + (tan(pi·f) / tan(pi·part))^10): 1 at rest, -3 dB at the cutoff, then down."""
    b, a, *sections = low_pass.coefficients(part, 1.0)
    for f in (0.0, 0.5 * part, part, 0.5 * (part + 0.5)):
        z = np.exp(-2j * pi * f)
        h = b * (1.0 + z) / (1.0 + a * z)
        for b_0, a_1, a_2 in sections:
            h *= b_0 * (1.0 + z) ** 2 / (1.0 + a_1 * z + a_2 * z * z)
        expected = (1.0 + (np.tan(pi * f) / np.tan(pi * part)) ** 10) ** -0.5
        assert abs(h) == pytest.approx(expected, rel=1e-6)


@QUICK
@given(CUTOFFS)
def test_it_is_stable(part):
    _, a, *sections = low_pass.coefficients(part, 1.0)
    assert abs(a) < 1.0
    for _, a_1, a_2 in sections:
        assert abs(a_2) < 1.0
        assert abs(a_1) < 1.0 + a_2


def test_the_samples_are_scipys():
    samples = np.random.default_rng(3).normal(size=1000)
    sections = signal.butter(5, 500, fs=10_000, output="sos")
    expected, _ = signal.sosfilt(sections, samples, zi=0.7 * signal.sosfilt_zi(sections))
    np.testing.assert_allclose(run(PUBLISHED, samples.tolist(), 0.7), expected, atol=1e-13)


@QUICK
@given(CUTOFFS, st.floats(-100.0, 100.0))
def test_it_starts_settled(part, v):
    values = run(low_pass.coefficients(part, 1.0), [v] * 50, v)
    assert values == pytest.approx([v] * 50, rel=1e-9)
