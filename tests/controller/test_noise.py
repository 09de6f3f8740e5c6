"""Noise of the intensities has no mean in f_p, Eq. (5), as it would have in a quotient."""

from itertools import accumulate, pairwise
from math import log, sqrt

import numpy as np
import pytest
from grasp_controller import impact_reduction as layer_2
from hypothesis import given
from hypothesis import strategies as st

XI = 0.02
"""V; the order of what a dark face sends back."""

N = 50_000
"""Samples of a series of noise."""

SIGMAS = 5.0
"""So many standard errors a mean may be off: by chance once in two million draws."""

INTENSITIES = st.floats(1e-6, 1e3)
"""V; from the floor on."""


def f_p(xi, before, h):
    """Of finger 1, in N; finger 2 has the same with the opposite sign."""
    right, left = layer_2.virtual_forces(layer_2.Params(), (xi, xi), (before, before), h)
    assert left == -right
    return right


@given(INTENSITIES, INTENSITIES)
def test_two_samples_that_change_places_cancel(xi, before):
    assert f_p(xi, before, 1e-3) == pytest.approx(-f_p(before, xi, 1e-3), rel=1e-12, abs=1e-10)


@given(st.lists(INTENSITIES, min_size=2))
def test_the_mean_is_that_of_the_way_from_first_to_last(xi):
    """Whatever noise is in between: D_p·(ln xi_N - ln xi_0)/(N·h)."""
    mean = np.mean([f_p(b, a, 1e-3) for a, b in pairwise(xi)])
    expected = 0.6 * (log(xi[-1]) - log(xi[0])) / (1e-3 * (len(xi) - 1))
    assert mean == pytest.approx(expected, rel=1e-9, abs=1e-8)


def noisy(s, r_1, seed):
    """Samples around XI: Gaussian, of relative standard deviation s, r_1 from one to the next."""
    first, *drawn = np.random.default_rng(seed).standard_normal(N + 1).tolist()
    own = sqrt(1.0 - r_1 * r_1)
    deviations = accumulate(drawn, lambda e, new: r_1 * e + own * new, initial=first)
    return [XI * (1.0 + s * e) for e in deviations]


@pytest.mark.parametrize(
    ("s", "r_1", "h", "seed"), [(0.066, 0.08, 1e-3, 1), (0.1, 0.5, 1e-3, 2), (0.1, 0.98, 1e-4, 3)]
)
def test_noise_biases_a_quotient_and_not_the_logarithms(s, r_1, h, seed):
    """The quotient has the mean -s^2·(1 - r_1)/h, and 3·s^2 of it more; the logarithms have none.

    With e and e' the relative noise of a sample and of the one before, the quotient is
    h·q = (e - e') + (e·e' - e^2) + ... The first part adds up to two samples' worth. The second
    has the mean -s^2·(1 - r_1), the variance s^4·(1 - r_1)·(3 - r_1), and where r_1 > 0 a negative
    correlation from term to term. What follows has the mean -3·s^4·(1 - r_1), -15·s^6·(1 - r_1).
    """
    xi = noisy(s, r_1, seed)
    bias = -s * s * (1.0 - r_1) / h
    of_the_ends = SIGMAS * sqrt(2.0) * s / (N * h)
    by_chance = SIGMAS * s * s * sqrt((1.0 - r_1) * (3.0 - r_1) / N) / h
    quotient = np.mean([(b - a) / (h * b) for a, b in pairwise(xi)])
    logarithms = np.mean([f_p(b, a, h) for a, b in pairwise(xi)]) / 0.6
    tolerance = of_the_ends + by_chance - 20.0 * s**4 * bias
    assert quotient == pytest.approx(bias * (1.0 + 3.0 * s * s), abs=tolerance)
    assert logarithms == pytest.approx(0.0, abs=of_the_ends)
    assert of_the_ends < -0.1 * bias  # no room for it


def test_on_the_move_noise_adds_its_square_to_the_logarithms():
    """The mean of ln xi is (sigma/xi)^2/2 lower, so its rate is 1 + (sigma/xi)^2 times xi'/xi.

    From a to b = 2·a that adds the integral, ((sigma/a)^2 - (sigma/b)^2)/2, whatever the step is.
    """
    a, b, sigma = XI, 2.0 * XI, 0.2 * XI
    noise = np.random.default_rng(4).standard_normal((2, N)) * sigma
    added = np.mean([f_p(b + v, a + u, 1.0) for u, v in noise.T.tolist()]) / 0.6 - log(2.0)
    expected = 0.5 * ((sigma / a) ** 2 - (sigma / b) ** 2)
    by_chance = SIGMAS * sqrt(((sigma / a) ** 2 + (sigma / b) ** 2) / N)
    assert by_chance < 0.5 * expected
    assert added == pytest.approx(expected, abs=by_chance + (sigma / a) ** 4)
