"""What an error of the exponent n, and of the offset l_0, does to the estimate.

For a sensor with n_j, y is (K·alpha_j)^(-1/n)·(l + l_0)^(n_j/n): no line, but the same curve for
both faces where n_1 = n_2, and the slopes at equal gaps have the ratio that they should.
"""

from dataclasses import replace
from math import log, tanh

import pytest
from grasp_controller import holding, reflectance_ratio
from grasp_controller.adaptive import Inputs, Params
from hypothesis import given
from hypothesis import strategies as st
from support.approach import L_0, N, approach, intensity, pairs, run
from support.marks import examples

SURE = Params(
    reflectance=reflectance_ratio.Params(time_constant=1e-6, intensity_noise=1e-12, limit=10.0),
    hold=holding.Params(squeeze=1e12),
)
"""No noise is reckoned with, no lag, and nothing but the light."""

SHORT = 1e-4
"""m, of travel: the line is the tangent."""


def learnt(samples):
    return run(SURE, samples)[-1][0].estimate.beta


def sensed(samples, alpha, n):
    """The same approach, seen by sensors of other exponents."""
    seen = []
    for u in samples:
        (x_1, x_2), (n_1, n_2) = u.position, n
        xi_1 = intensity(x_1 - 0.035, alpha[0], n_1)
        seen.append(u._replace(intensity=(xi_1, intensity(-x_2 - 0.035, alpha[1], n_2))))
    return seen


@examples(15)
@given(pairs(0.1, 2.0), st.floats(0.9, 1.5), st.floats(1e-3, 0.04), st.integers(10, 60))
def test_at_equal_gaps_a_common_error_of_n_cancels(alpha, n, end, count):
    samples = approach(alpha, end=end, count=count, n=n)
    assert learnt(samples) == pytest.approx(log(alpha[0] / alpha[1]), abs=1e-6)


def short(alpha, gaps, n):
    """A tenth of a millimetre before the gaps in m."""
    samples = []
    for k in range(11):
        l_1, l_2 = (gap + SHORT * (1.0 - k / 10) for gap in gaps)
        seen = (intensity(l_1, alpha[0], n), intensity(l_2, alpha[1], n))
        samples.append(Inputs((0.035 + l_1, -0.035 - l_2), (-1e-3, 1e-3), seen))
    return samples


@pytest.mark.parametrize("n", [1.0, 1.3])
@pytest.mark.parametrize("gaps", [(0.02, 0.01), (0.005, 0.04), (0.03, 0.03)])
def test_layer_3_rests_at_equal_gaps_whatever_n(n, gaps):
    """beta is off by (n_true - n)·ln(d_2/d_1), which is nothing where layer 3 takes the fingers.

    With it the intensities count as those of equal faces, and of the block's n.
    """
    samples = short((0.5, 1.0), gaps, n)
    d_1, d_2 = (gap + L_0 for gap in gaps)
    assert learnt(samples) == pytest.approx(log(0.5) + (n - N) * log(d_2 / d_1), abs=3e-3)
    alike = (d_1 / d_2) ** N
    f_s = 3.0 * tanh((1.0 - alike) / (1.0 + alike))
    _, y = run(SURE, samples)[-1]
    assert y.simultaneous_contact_force == pytest.approx(f_s, abs=5e-3)


@pytest.mark.parametrize("n", [(1.14, 1.16), (1.3, 1.1)])
def test_an_error_of_one_sensor_does_not_cancel(n):
    """The slopes then have the ratio n_1/n_2 as well, and distances to two powers."""
    gap = 0.02
    samples = sensed(approach((0.5, 1.0), (gap + SHORT, gap + SHORT), gap, 10), (0.5, 1.0), n)
    n_1, n_2 = n
    calibrated = (n_1 - n_2) * log(0.1)  # of K, which is the same at 100 mm
    expected = log(0.5) + calibrated - (n_1 - n_2) * log(gap + L_0) - N * log(n_1 / n_2)
    assert learnt(samples) == pytest.approx(expected, abs=2e-3)


@examples(15)
@given(pairs(0.1, 2.0), st.floats(5e-4, 0.02), pairs(0.02, 0.08))
def test_neither_the_gain_nor_the_offset_is_used(alpha, l_0, gaps):
    """A common l_0 shifts the lines, and K scales both: the slopes have the ratio of alpha."""
    samples = [
        u._replace(
            intensity=(
                intensity(u.position[0] - 0.035 + l_0 - L_0, alpha[0]),
                intensity(-u.position[1] - 0.035 + l_0 - L_0, alpha[1]),
            )
        )
        for u in approach(alpha, gaps)
    ]
    assert learnt(samples) == pytest.approx(log(alpha[0] / alpha[1]), abs=1e-6)
    other = replace(SURE.reflectance, gain=1.0, offset_distance=0.5)
    assert run(replace(SURE, reflectance=other), samples)[-1][0].estimate.beta == learnt(samples)
