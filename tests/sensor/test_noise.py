"""MRG32k3a against its published numbers and whole numbers of any size; the distribution."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from proximity_sensor import noise
from scipy import stats
from support.marks import examples

M_1, M_2 = 2**32 - 209, 2**32 - 22853
X = np.array([[0, 1, 0], [0, 0, 1], [-810728, 1403580, 0]], dtype=object)
Y = np.array([[0, 1, 0], [0, 0, 1], [-1370589, 0, 527612]], dtype=object)
"""What a draw does to the last three numbers of each recurrence."""


def power(a, exponent, m):
    result = np.eye(3, dtype=int).astype(object)
    while exponent:
        if exponent % 2:
            result = result @ a % m
        a, exponent = a @ a % m, exponent // 2
    return result


def draws(draw, s, count):
    numbers = []
    for _ in range(count):
        u, s = draw(s)
        numbers.append(u)
    return numbers, s


def normals(seed, count):
    return np.array(draws(noise.normal, noise.stream(float(seed)), count)[0])


def test_the_published_numbers():
    """Those of RngStreams with all its seeds 12345: the first five, the 1,000th; a state."""
    numbers, _ = draws(noise.uniform, noise.stream(0.0), 1000)
    assert numbers[:3] == [0.12701112204657714, 0.3185275653967945, 0.3091860155832701]
    assert numbers[3:5] == [0.8258468629271136, 0.2216299157820229]
    assert numbers[999] == 0.98607848680213228
    _, s = draws(noise.uniform, noise.stream(0.0), 35)
    assert s == (1040577685, 3747037609, 277208355, 1712706441, 627445683, 2408037141)


@pytest.mark.parametrize(
    ("number", "state"),
    [
        (0.0, (12345,) * 6),
        (1.0, (3692455944, 1366884236, 2968912127, 335948734, 4161675175, 475798818)),
        (399.0, (2260181002, 1948664812, 612976419, 1919355493, 2890171896, 2701138777)),
    ],
)
def test_the_published_streams(number, state):
    assert noise.stream(number) == state


@examples(50)
@given(st.integers(0, 2**32 - 1))
@example(2**32 - 1)
def test_a_stream_begins_as_many_jumps_on(number):
    s = noise.stream(float(number))
    for a, m, part in ((X, M_1, s[:3]), (Y, M_2, s[3:])):
        assert part == tuple(power(a, number * 2**127, m).sum(axis=1) * 12345 % m)


@examples(100)
@given(
    st.tuples(*[st.integers(0, M_1 - 1)] * 3), st.tuples(*[st.integers(0, M_2 - 1)] * 3)
)  # fmt: skip
@example((0, 0, 0), (0, 0, 0))
@example((M_1 - 1, 0, 0), (M_2 - 1, M_2 - 1, 0))
@example((0, M_1 - 1, M_1 - 1), (0, 0, M_2 - 1))
def test_no_state_is_rounded_and_no_number_is_zero(x, y):
    """The logarithm of the noise is taken of it."""
    s = tuple(map(float, (*x, *y)))
    for _ in range(10):
        x = x[1], x[2], (1403580 * x[1] - 810728 * x[0]) % M_1
        y = y[1], y[2], (527612 * y[2] - 1370589 * y[0]) % M_2
        u, s = noise.uniform(s)
        assert s == (*x, *y)
        assert u == pytest.approx(((x[2] - y[2]) % M_1 or M_1) / (M_1 + 1), rel=1e-15)
        assert 0.0 < u < 1.0


@pytest.mark.parametrize("seed", [0, 1, 4294967295])
def test_it_is_normal_and_white(seed):
    """Within four standard errors, which are those of independent normal numbers."""
    count = 10_000
    values = normals(seed, count)
    assert abs(values.mean()) < 4.0 * np.sqrt(1.0 / count)
    assert abs(values.var() - 1.0) < 4.0 * np.sqrt(2.0 / count)
    assert stats.kstest(values, "norm").pvalue > 1e-3
    for lag in range(1, 21):
        assert abs(np.mean(values[lag:] * values[:-lag])) < 4.5 / np.sqrt(count), lag
