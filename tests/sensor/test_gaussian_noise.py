"""Noise: the distribution, and that nothing hangs together."""

import numpy as np
import pytest
from proximity_sensor import gaussian_noise, mrg32k3a
from scipy import stats

COUNT = 20_000


def noise(seed, count=COUNT):
    s = mrg32k3a.stream(float(seed))
    values = []
    for _ in range(count):
        value, s = gaussian_noise.normal(s)
        values.append(value)
    return np.array(values)


@pytest.fixture(scope="module", params=[0, 1, 4294967295])
def values(request):
    return noise(request.param)


def test_box_and_muller():
    """The first two published numbers of the generator, worked out with numpy."""
    u_1, u_2 = 0.12701112204657714, 0.3185275653967945
    value, s = gaussian_noise.normal(mrg32k3a.stream(0.0))
    assert value == pytest.approx(np.sqrt(-2.0 * np.log(u_1)) * np.cos(2.0 * np.pi * u_2))
    assert mrg32k3a.uniform(s)[0] == 0.3091860155832701


def test_moments(values):
    """Within four standard errors, which are those of 20,000 independent normal numbers."""
    assert abs(values.mean()) < 4.0 * np.sqrt(1.0 / COUNT)
    assert abs(values.var() - 1.0) < 4.0 * np.sqrt(2.0 / COUNT)
    assert abs(stats.skew(values)) < 4.0 * np.sqrt(6.0 / COUNT)
    assert abs(stats.kurtosis(values)) < 4.0 * np.sqrt(24.0 / COUNT)


def test_distribution(values):
    assert stats.kstest(values, "norm").pvalue > 1e-3


def test_a_sample_knows_nothing_of_those_before(values):
    for lag in range(1, 21):
        correlation = np.mean(values[lag:] * values[:-lag])
        assert abs(correlation) < 4.5 / np.sqrt(COUNT), lag


def test_seeds_know_nothing_of_each_other():
    rows = np.array([noise(seed, 4000) for seed in (0, 1, 2, 3, 4, 5, 6, 7, 1000, 65536)])
    correlations = np.corrcoef(rows) - np.eye(len(rows))
    assert np.abs(correlations).max() < 4.5 / np.sqrt(4000)


def test_over_the_seeds_each_sample_is_normal():
    """What a Monte Carlo study over seeds relies on."""
    columns = np.array([noise(seed, 3) for seed in range(400)]).T
    for column in columns:
        assert stats.kstest(column, "norm").pvalue > 1e-3
    assert np.abs(np.corrcoef(columns) - np.eye(3)).max() < 4.5 / np.sqrt(400)
