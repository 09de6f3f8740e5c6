"""The standard deviation that the estimate says it has, against Monte Carlo.

`intensity_noise` sigma is what is left of the noise in the mean over `travel` ell: evenly sampled
every d metres, white noise has sigma·sqrt(ell/d) in each sample. The low-pass is out of the way.

The noise weighs with xi^q once more than the light of its moment tells: V_j puts the last, largest
xi in its place. With q = 2 + 2/n it makes no difference, and V_j is exact; else it is a bound.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import exp, log, sqrt
from random import Random
from statistics import fmean, variance

import pytest
from grasp_controller import holding, reflectance_ratio
from grasp_controller.adaptive import Inputs, Params
from grasp_controller.reflectance_ratio import Estimate
from scipy.stats import chi2
from support.approach import L_0, N, Pair, approach, relit, run
from support.slow import slow

TRIALS = 200

LOW, HIGH = (float(chi2.ppf(tail, TRIALS)) / TRIALS for tail in (1e-4, 1.0 - 1e-4))
"""Between them is a mean of so many squares of standard normal numbers, but for 1 in 5000."""

EXACT = 2.0 + 2.0 / N
"""The weight exponent with which V_j is exact."""

ALPHA = (0.6, 1.0)
TRUTH = log(0.6)


def law(q: float, sigma: float, prior: float) -> Params:
    learnt = reflectance_ratio.Params(
        time_constant=1e-6,
        weight_exponent=q,
        intensity_noise=sigma,
        prior_deviation=prior,
        limit=10.0,
    )
    return Params(reflectance=learnt, hold=holding.Params(squeeze=1e12))


def noisy(samples: Sequence[Inputs], deviation: float, random: Random) -> list[Inputs]:
    def in_noise(xi: float) -> float:
        return xi + random.gauss(0.0, deviation)

    return [relit(u, in_noise, in_noise) for u in samples]


def learnt(p: Params, alpha: Pair, gaps: Pair, count: int, random: Random) -> Estimate:
    """What an approach in noise teaches, from the first gap in m to the second."""
    start, end = gaps
    spacing = (start - end) / count
    deviation = p.reflectance.intensity_noise * sqrt(p.reflectance.travel / spacing)
    samples = approach(alpha, (start, start), end, count)
    return run(p, noisy(samples, deviation, random))[-1][0].estimate


def trials(q: float, sigma: float, gaps: Pair, count: int) -> list[Estimate]:
    """With a prior so wide that it draws nothing towards 0."""
    p, random = law(q, sigma, 10.0), Random(1)
    return [learnt(p, ALPHA, gaps, count, random) for _ in range(TRIALS)]


def share_of_the_bound(q: float, gaps: Pair, count: int) -> float:
    """The variance of a weighted line, first order in the noise, as a share of V_j.

    It is the same for each face: alpha scales both alike.
    """
    start, end = gaps
    way = [start + (end - start) * k / count + L_0 for k in range(1, count + 1)]
    weights: list[float] = [l ** (-N * q) for l in way]
    mean = sum(w * l for w, l in zip(weights, way, strict=True)) / sum(weights)
    spread = [w * (l - mean) ** 2 for w, l in zip(weights, way, strict=True)]
    excess = q - EXACT
    noise: list[float] = [
        s * (l / way[-1]) ** (-N * excess) for s, l in zip(spread, way, strict=True)
    ]
    return sum(noise) / sum(spread)


@pytest.mark.parametrize("gaps", [(0.08, 5e-3), (0.08, 0.04)])
def test_the_variance_is_that_of_many_approaches(gaps: Pair) -> None:
    found = trials(EXACT, 5e-5, gaps, 40)
    said = fmean(each.deviation**2 for each in found)
    assert LOW < variance(each.beta for each in found) / said < HIGH
    assert fmean(each.beta for each in found) == pytest.approx(TRUTH, abs=0.5 * sqrt(said))


@pytest.mark.parametrize("q", [1.0, 5.0])
def test_with_another_weight_it_is_off_by_as_much_as_the_light_changed(q: float) -> None:
    """By default it is a bound, up to twice the deviation; with q too small it is too little."""
    gaps, count = (0.08, 5e-3), 40
    found = trials(q, 5e-5, gaps, count)
    said = fmean(each.deviation**2 for each in found)
    share = share_of_the_bound(q, gaps, count)
    assert LOW * share < variance(each.beta for each in found) / said < HIGH * share
    assert (share < 1.0) == (q > EXACT)


@pytest.mark.parametrize(("sigma", "gaps"), [(5e-4, (0.08, 0.075)), (2e-3, (0.04, 0.03))])
def test_any_ratio_is_as_far_off_as_is_said(sigma: float, gaps: Pair) -> None:
    """Ratios as the prior has them, and little to learn from: what is known is prior and light."""
    p, random = law(EXACT, sigma, 1.0), Random(2)
    errors, deviations = [], []
    for _ in range(TRIALS):
        beta = random.gauss(0.0, 1.0)
        estimate = learnt(p, (exp(0.5 * beta), exp(-0.5 * beta)), gaps, 5, random)
        errors.append((estimate.beta - beta) / estimate.deviation)
        deviations.append(estimate.deviation)
    assert LOW < fmean(error * error for error in errors) < HIGH
    assert 0.1 < fmean(deviations) < 0.7


@pytest.mark.parametrize("count", [100, slow(400)])
@pytest.mark.parametrize("end", [5e-3, 0.04])
def test_by_default_it_bounds_the_error(count: int, end: float) -> None:
    """With the weights, the low-pass and the noise of the bench; slow counts are fine samples."""
    p = replace(Params(), hold=holding.Params(squeeze=1e12))
    random = Random(3)
    found = [learnt(p, ALPHA, (0.08, end), count, random) for _ in range(40)]
    squares = [((each.beta - TRUTH) / each.deviation) ** 2 for each in found]
    assert fmean(squares) < 1.0
