"""What is learnt of the reflectances: its deviation against Monte Carlo, errors of n and l_0.

White noise of sigma_0 in samples h seconds apart is behind the low-pass sigma_0/sqrt(1 + 2·T_f/h),
which is `intensity_noise`. For a sensor with n_j, y is (K·alpha_j)^(-1/n)·(l + l_0)^(n_j/n): no
line, but the same curve for both faces where n_1 = n_2.
"""

from dataclasses import replace
from math import exp, log, sqrt, tanh
from random import Random
from statistics import fmean, variance

import pytest
from grasp_controller import holding, reflectance_ratio
from grasp_controller.adaptive import Inputs, Params
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import chi2
from support.approach import L_0, H, N, approach, intensity, pairs, relit, run
from support.marks import examples, slow

TRIALS = 200

LOW, HIGH = (float(chi2.ppf(tail, TRIALS)) / TRIALS for tail in (1e-4, 1.0 - 1e-4))
"""Between them is a mean of so many squares, but for 1 in 5000."""

ALPHA = (0.6, 1.0)
TRUTH = log(0.6)

NEVER_HOLDS = holding.Params(squeeze=1e12)


NO_DEVIATION = {
    "exponent_deviation": 0.0,
    "offset_deviation": 0.0,
    "offset_distance_deviation": 0.0,
    "gain_deviation": 0.0,
}
"""A calibration without an error."""

NOISE_ALONE = {**NO_DEVIATION, "caution": 0.0}
"""All of the fitted ratio acts."""


def law(q, noise, prior):
    """One that knows of the noise of a sample in V, and whose low-pass lets through all."""
    T_f = 1e-6
    learnt = reflectance_ratio.Params(
        time_constant=T_f,
        weight_exponent=q,
        intensity_noise=noise / sqrt(1.0 + 2.0 * T_f / H),
        prior_deviation=prior,
        limit=10.0,
        **NOISE_ALONE,
    )
    return Params(reflectance=learnt, hold=NEVER_HOLDS)


def noisy(samples, deviation, random):
    def in_noise(xi):
        return xi + random.gauss(0.0, deviation)

    return [relit(u, in_noise, in_noise) for u in samples]


def learnt_in_noise(p, noise, alpha, gaps, count, random):
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
    found = [learnt_in_noise(p, noise, ALPHA, gaps, 40, random) for _ in range(TRIALS)]
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
        estimate = learnt_in_noise(p, noise, alpha, gaps, 5, random)
        errors.append((estimate.beta - beta) / estimate.deviation)
        deviations.append(estimate.deviation)
    assert LOW < fmean(error * error for error in errors) < HIGH
    assert 0.1 < fmean(deviations) < 0.8


@pytest.mark.parametrize("count", [100, slow(400)])
@pytest.mark.parametrize("end", [5e-3, 0.04])
def test_behind_the_low_pass_it_is_the_same(count, end):
    """With the numbers of the block: noise that is no longer white counts as if it were."""
    p = Params(reflectance=reflectance_ratio.Params(**NOISE_ALONE), hold=NEVER_HOLDS)
    noise = p.reflectance.intensity_noise * sqrt(1.0 + 2.0 * p.reflectance.time_constant / H)
    random, trials = Random(3), 60
    found = [learnt_in_noise(p, noise, ALPHA, (0.08, end), count, random) for _ in range(trials)]
    squares = fmean(((each.beta - TRUTH) / each.deviation) ** 2 for each in found)
    assert float(chi2.ppf(1e-4, trials)) < trials * squares < float(chi2.ppf(1.0 - 1e-4, trials))


SURE = Params(
    reflectance=reflectance_ratio.Params(
        time_constant=1e-6, intensity_noise=1e-12, limit=10.0, **NOISE_ALONE
    ),
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
    other = replace(SURE.reflectance, gain=(1.0, 1.0), offset_distance=(0.5, 0.5))
    assert run(replace(SURE, reflectance=other), samples)[-1][0].estimate.beta == learnt(samples)


def test_the_gaps_are_those_of_the_light():
    """Behind the low-pass as well, by the slopes; and by a white face before there are any."""
    samples = approach((0.5, 1.0), (0.06, 0.08), 0.01)
    for p, off in ((SURE, 1e-5), (replace(Params(), hold=NEVER_HOLDS), 5e-4)):
        (_, first), *_, (_, last) = run(p, samples)
        assert last.estimated_gap == pytest.approx((0.01, 0.01), abs=off)
        right = (0.06 + L_0) * 0.5 ** (-1.0 / N) - L_0
        assert first.estimated_gap == pytest.approx((right, 0.08), rel=1e-12)


def test_a_retreat_teaches_as_much_as_an_approach():
    samples = approach(ALPHA)
    there, back = (run(Params(), way)[-1][0].estimate for way in (samples, samples[::-1]))
    assert back == pytest.approx(there, rel=0.2)


def sensors_of(n, l_0, gain):
    """SURE, its sensors calibrated."""
    known = replace(SURE.reflectance, diffusion_exponent=n, offset_distance=l_0, gain=gain)
    return replace(SURE, reflectance=known)


def seen_by(samples, alpha, n, l_0, gain, offset=(0.0, 0.0)):
    """The same approach by Eq. (9) of each sensor."""
    seen = []
    for u in samples:
        x_1, x_2 = u.position
        gaps = (x_1 - 0.035, -x_2 - 0.035)
        xi_1, xi_2 = (alpha[j] * gain[j] / (gaps[j] + l_0[j]) ** n[j] + offset[j] for j in range(2))
        seen.append(u._replace(intensity=(xi_1, xi_2)))
    return seen


UNLIKE = {"n": (1.1, 1.2), "l_0": (5.5e-3, 4.5e-3), "gain": (3e-3, 2e-3)}


@pytest.mark.parametrize("alpha", [(1.0, 1.0), (0.5, 1.0), (1.2, 0.3)])
def test_sensors_that_differ_are_compared_by_the_gaps(alpha):
    """At gaps l the force is that of sensors with the mean n and l_0, (l + l_0)^-n."""
    p = sensors_of(**UNLIKE)
    for start, ends in (((0.06, 0.08), (0.02, 0.02)), ((0.06, 0.08), (0.01, 0.025))):
        way = [
            Inputs((0.035 + l_1, -0.035 - l_2), (0.0, 0.0), (0.1, 0.1))
            for k in range(101)
            for l_1, l_2 in [tuple(a + (b - a) * k / 100 for a, b in zip(start, ends, strict=True))]
        ]
        x, y = run(p, seen_by(way, alpha, **UNLIKE))[-1]
        assert x.estimate.beta == pytest.approx(log(alpha[0] / alpha[1]), abs=1e-6)
        assert y.estimated_gap == pytest.approx(ends, abs=1e-6)
        d_1, d_2 = (gap + 5e-3 for gap in ends)
        alike = (d_1 / d_2) ** 1.15
        expected = 3.0 * tanh((1.0 - alike) / (1.0 + alike))
        assert y.simultaneous_contact_force == pytest.approx(expected, abs=1e-6)


def test_before_anything_is_learnt_faces_count_as_white():
    u = seen_by(approach((1.0, 1.0), (0.03, 0.03)), (1.0, 1.0), **UNLIKE)[0]
    y = run(sensors_of(**UNLIKE), [u, u])[-1][1]
    assert y.estimated_gap == pytest.approx((0.03, 0.03), abs=1e-9)
    assert y.simultaneous_contact_force == pytest.approx(0.0, abs=1e-9)


def line_of(samples, **known):
    """What a calibration with deviations tells of the right finger."""
    learnt = replace(SURE.reflectance, **known)
    return run(replace(SURE, reflectance=learnt), samples)[-1][0].line_1


@pytest.mark.parametrize("alpha", [0.3, 1.0])
@pytest.mark.parametrize("end", [0.0, 0.01, 0.04])
def test_the_variance_by_calibration_is_that_of_small_errors(alpha, end):
    """By the slopes that sensors with small errors teach, and by their light at the last gap."""
    small, way, faces = 1e-5, approach((1.0, 1.0), end=end), (alpha, 1.0)
    one = {"n": (N, N), "l_0": (L_0, L_0), "gain": (0.0024, 0.0024)}
    beta = learnt(true := seen_by(way, faces, **one))
    by_c = (learnt(seen_by(way, faces, **one, offset=(small, 0.0))) - beta) / small
    told = line_of(true, offset_deviation=1.0)
    assert told.variance == pytest.approx(by_c**2, rel=2e-2)
    assert told.brightness_variance == pytest.approx(by_c**2, rel=2e-2)
    other = seen_by(way, faces, **{**one, "n": (N + small, N)})
    by_n = (learnt(other) - beta) / small
    told = line_of(true, exponent_deviation=1.0)
    assert told.brightness_variance == pytest.approx(by_n**2, rel=2e-2)
    seen = log(other[-1].intensity[0] / true[-1].intensity[0]) / small
    assert told.variance == pytest.approx((by_n - seen) ** 2, rel=2e-2)
    moved = seen_by(way, faces, **{**one, "l_0": (L_0 + small, L_0)})
    assert learnt(moved) == pytest.approx(beta, abs=1e-8)
    seen = log(moved[-1].intensity[0] / true[-1].intensity[0]) / small
    told = line_of(true, offset_distance_deviation=1.0)
    assert told.variance == pytest.approx(seen**2, rel=2e-2)
    assert line_of(true, gain_deviation=0.1).brightness_variance == pytest.approx(0.01, rel=1e-3)


@pytest.mark.parametrize("gamma", [0.5, 1.0])
@pytest.mark.parametrize("off", [0.9, 1.2, 1.7, 2.5])
def test_a_ratio_acts_from_gamma_deviations_on(gamma, off):
    """By 2·(f - gamma·sigma), up to f; here f is `off`·gamma deviations."""
    samples = approach((0.9, 1.0))
    one = run(replace(SURE, reflectance=replace(SURE.reflectance, offset_deviation=1.0)), samples)
    sigma = sqrt(one[-1][0].line_1.variance + one[-1][0].line_2.variance)
    f = abs(run(SURE, samples)[-1][0].estimate.beta)
    known = {"offset_deviation": f / (off * gamma * sigma), "caution": gamma}
    x = run(replace(SURE, reflectance=replace(SURE.reflectance, **known)), samples)[-1][0]
    acts = min(max(2.0 * (f - f / off), 0.0), f)
    assert x.estimate.beta == pytest.approx(-acts, rel=1e-2, abs=1e-12)


@given(st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(1e-3, 1.0), st.floats(0.1, 3.0))
def test_what_acts_is_no_worse_than_nothing_within_gamma_deviations(true, error, sigma, gamma):
    f = true + error * gamma * sigma
    p = replace(SURE.reflectance, caution=gamma)
    acts = reflectance_ratio.evidence(p, f * f / (sigma * sigma)) * f
    assert abs(acts - true) <= abs(true) * (1.0 + 1e-9) + 1e-12
