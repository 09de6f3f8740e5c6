"""What the lines of N fingers tell of the brightness of their faces.

Each finger's line (reflectance_ratio.py) gives a_k = ln(K·alpha_k) with the variance V_k; the prior
of ln alpha_k is N(mu, sigma_b^2/2), its mean unknown, as is K:

    g_k = v/(v + V_k),    v = sigma_b^2/2,    mu = sum g_k·a_k/sum g_k
    b_k = t·g_k·(a_k - mu),    t = min(1, beta_max/(largest less smallest a_k with a slope))

With two fingers b_1 - b_2 is beta of reflectance_ratio.py, gain and limit included.
"""

from math import exp, inf, log, sqrt

from .reflectance_ratio import Line, Params

Each = tuple[float, ...]
"""A value per finger."""


def brightnesses(p: Params, lines: tuple[Line, ...]) -> Each:
    """b_k, the logarithm of each face's reflectance to the mean, as far as the lines are certain.

    All are zero before there is a slope.
    """
    gains = tuple(gain(p, line) for line in lines)
    told = tuple(p.diffusion_exponent * log(line.per_y) for line in lines)
    total, weighted, low, high = 0.0, 0.0, inf, -inf
    for g, a in zip(gains, told, strict=True):
        total = total + g
        weighted = weighted + g * a
        low = min(low, a) if g > 0.0 else low
        high = max(high, a) if g > 0.0 else high
    if total <= 0.0:
        return tuple(0.0 for _ in gains)
    mean = weighted / total
    t = p.limit / (high - low) if high - low > p.limit else 1.0
    return tuple(t * g * (a - mean) for g, a in zip(gains, told, strict=True))


def gain(p: Params, line: Line) -> float:
    """g_k: how far a line is believed, from 0 without a slope to 1."""
    v = _prior(p)
    return v / (v + line.variance) if v > 0.0 else 0.0


def deviation(p: Params, line: Line) -> float:
    """The standard deviation of b_k that is left, by noise alone."""
    return sqrt(_prior(p) * (1.0 - gain(p, line)))


def alike(b: Each, intensity: Each) -> Each:
    """The intensities in V as faces would give them that are all as dark as the darkest."""
    darkest = b[0]
    for one in b:
        darkest = min(darkest, one)
    return tuple(exp(darkest - one) * xi for one, xi in zip(b, intensity, strict=True))


def _prior(p: Params) -> float:
    return 0.5 * p.prior_deviation * p.prior_deviation
