"""The standard deviation that the estimate says it has, against Monte Carlo.

White noise of sigma_0 in samples h seconds apart is behind the low-pass sigma_0/sqrt(1 + 2·T_f/h),
which is `intensity_noise`. The bounds are those of a mean of squares of normal numbers.
"""

from dataclasses import replace
from math import exp, log, sqrt
from random import Random
from statistics import fmean, variance

import pytest
from grasp_controller import holding, reflectance_ratio
from grasp_controller.adaptive import Params
from scipy.stats import chi2
from support.approach import H, N, approach, relit, run
from support.marks import slow

TRIALS = 200

LOW, HIGH = (float(chi2.ppf(tail, TRIALS)) / TRIALS for tail in (1e-4, 1.0 - 1e-4))
"""Between them is a mean of so many squares, but for 1 in 5000."""

ALPHA = (0.6, 1.0)
TRUTH = log(0.6)

NEVER_HOLDS = holding.Params(squeeze=1e12)


def law(q, noise, prior):
    """One that knows of the noise of a sample in V, and whose low-pass lets through all."""
    T_f = 1e-6
    learnt = reflectance_ratio.Params(
        time_constant=T_f,
        weight_exponent=q,
        intensity_noise=noise / sqrt(1.0 + 2.0 * T_f / H),
        prior_deviation=prior,
        limit=10.0,
    )
    return Params(reflectance=learnt, hold=NEVER_HOLDS)


def noisy(samples, deviation, random):
    def in_noise(xi):
        return xi + random.gauss(0.0, deviation)

    return [relit(u, in_noise, in_noise) for u in samples]


def learnt(p, noise, alpha, gaps, count, random):
    """What an approach in noise of so many V teaches, from the first gap in m to the second."""
    start, end = gaps
    samples = approach(alpha, (start, start), end, count)
    return run(p, noisy(samples, noise, random))[-1][0].estimate


@pytest.mark.parametrize(
    ("q", "gaps"), [(5.0, (0.08, 5e-3)), (5.0, (0.08, 0.04)), (1.0, (0.08, 5e-3))]
)
def test_the_variance_is_that_of_many_approaches(q, gaps):
    """The prior is so wide that it draws nothing towards 0."""
    noise = 5e-5
    p, random = law(q, noise, 10.0), Random(1)
    found = [learnt(p, noise, ALPHA, gaps, 40, random) for _ in range(TRIALS)]
    said = fmean(each.deviation**2 for each in found)
    assert LOW < variance(each.beta for each in found) / said < HIGH
    assert fmean(each.beta for each in found) == pytest.approx(TRUTH, abs=0.5 * sqrt(said))


@pytest.mark.parametrize(("noise", "gaps"), [(5e-4, (0.08, 0.075)), (2e-3, (0.04, 0.03))])
def test_any_ratio_is_as_far_off_as_is_said(noise, gaps):
    """Ratios as the prior has them, and little to learn from: what is known is prior and light."""
    p, random = law(5.0, noise, 1.0), Random(2)
    errors, deviations = [], []
    for _ in range(TRIALS):
        beta = random.gauss(0.0, 1.0)
        alpha = (exp(0.5 * beta), exp(-0.5 * beta))
        estimate = learnt(p, noise, alpha, gaps, 5, random)
        errors.append((estimate.beta - beta) / estimate.deviation)
        deviations.append(estimate.deviation)
    assert LOW < fmean(error * error for error in errors) < HIGH
    assert 0.1 < fmean(deviations) < 0.8


@pytest.mark.parametrize("count", [100, slow(400)])
@pytest.mark.parametrize("end", [5e-3, 0.04])
def test_behind_the_low_pass_it_is_the_same(count, end):
    """With the numbers of the block: noise that is no longer white counts as if it were."""
    p = replace(Params(), hold=NEVER_HOLDS)
    noise = p.reflectance.intensity_noise * sqrt(1.0 + 2.0 * p.reflectance.time_constant / H)
    random, trials = Random(3), 60
    found = [learnt(p, noise, ALPHA, (0.08, end), count, random) for _ in range(trials)]
    squares = fmean(((each.beta - TRUTH) / each.deviation) ** 2 for each in found)
    assert float(chi2.ppf(1e-4, trials)) < trials * squares < float(chi2.ppf(1.0 - 1e-4, trials))


def test_weights_of_one_over_the_noise_are_the_best():
    """q = 2 + 2/n; the default costs 1.9 times the variance, and looks more at what is near."""
    best = 2.0 + 2.0 / N
    variances = {}
    for q in (best, 3.0, 4.5, 5.0):
        samples = approach((1.0, 1.0), end=0.0, count=400)
        variances[q] = run(law(q, 5e-5, 10.0), samples)[-1][0].estimate.deviation ** 2
    assert min(variances, key=lambda q: variances[q]) == best
    assert variances[5.0] / variances[best] == pytest.approx(1.86, abs=0.1)
