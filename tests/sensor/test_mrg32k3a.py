"""MRG32k3a against its published numbers, and against itself in whole numbers of any size."""

import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from proximity_sensor import mrg32k3a
from proximity_sensor.mrg32k3a import JUMP_1, JUMP_2
from support.marks import examples

M_1, M_2 = 2**32 - 209, 2**32 - 22853
QUICK = examples(100)

Whole = tuple[int, int, int]
Square = tuple[Whole, Whole, Whole]

X = ((0, 1, 0), (0, 0, 1), (-810728, 1403580, 0))
Y = ((0, 1, 0), (0, 0, 1), (-1370589, 0, 527612))
"""What a draw does to the last three numbers of each recurrence."""


def product(a, b, m):
    rows = [[sum(a[i][k] * b[k][j] for k in range(3)) % m for j in range(3)] for i in range(3)]
    (p, q, r), (s, t, u), (v, w, x) = rows
    return (p, q, r), (s, t, u), (v, w, x)


def power(a, exponent, m):
    result = ((1, 0, 0), (0, 1, 0), (0, 0, 1))
    while exponent:
        if exponent % 2:
            result = product(result, a, m)
        a, exponent = product(a, a, m), exponent // 2
    return result


def whole(a):
    (p, q, r), (s, t, u), (v, w, x) = a
    return (int(p), int(q), int(r)), (int(s), int(t), int(u)), (int(v), int(w), int(x))


def draws(s, count):
    numbers = []
    for _ in range(count):
        u, s = mrg32k3a.uniform(s)
        numbers.append(u)
    return numbers, s


def test_the_published_numbers():
    """Those of RngStreams with all its seeds 12345: the first five, the 1,000th, the 100,000th."""
    numbers, _ = draws(mrg32k3a.stream(0.0), 100_000)
    assert numbers[:5] == [
        0.12701112204657714,
        0.3185275653967945,
        0.3091860155832701,
        0.8258468629271136,
        0.2216299157820229,
    ]
    assert (numbers[999], numbers[99_999]) == (0.98607848680213228, 0.69628910995743587)


def test_the_published_state_after_35_draws():
    _, s = draws(mrg32k3a.stream(0.0), 35)
    assert s == (1040577685, 3747037609, 277208355, 1712706441, 627445683, 2408037141)


@pytest.mark.parametrize(
    ("number", "state"),
    [
        (0.0, (12345,) * 6),
        (1.0, (3692455944, 1366884236, 2968912127, 335948734, 4161675175, 475798818)),
        (2.0, (1015873554, 1310354410, 2249465273, 994084013, 2912484720, 3876682925)),
        (7.0, (3281794178, 2616230133, 1457051261, 2762791137, 2480527362, 2282316169)),
        (399.0, (2260181002, 1948664812, 612976419, 1919355493, 2890171896, 2701138777)),
    ],
)
def test_the_published_streams(number, state):
    assert mrg32k3a.stream(number) == state


def test_a_jump_is_2_to_the_127_draws():
    assert whole(JUMP_1) == power(X, 2**127, M_1)
    assert whole(JUMP_2) == power(Y, 2**127, M_2)


@QUICK
@given(st.integers(0, 2**32 - 1))
@example(2**32 - 1)
def test_a_stream_begins_as_many_jumps_on(number):
    s = mrg32k3a.stream(float(number))
    for a, m, part in ((X, M_1, s[:3]), (Y, M_2, s[3:])):
        jumps = power(a, number * 2**127, m)
        assert part == tuple(sum(row) * 12345 % m for row in jumps)


@QUICK
@given(
    st.tuples(*[st.integers(0, M_1 - 1)] * 3).filter(any),
    st.tuples(*[st.integers(0, M_2 - 1)] * 3).filter(any),
)
@example((0, 0, 1), (0, 0, 1))
@example((M_1 - 1, 0, 0), (M_2 - 1, M_2 - 1, 0))
@example((0, M_1 - 1, M_1 - 1), (0, 0, M_2 - 1))
def test_no_state_is_rounded(x, y):
    s = (float(x[0]), float(x[1]), float(x[2]), float(y[0]), float(y[1]), float(y[2]))
    for _ in range(10):
        x = x[1], x[2], (1403580 * x[1] - 810728 * x[0]) % M_1
        y = y[1], y[2], (527612 * y[2] - 1370589 * y[0]) % M_2
        u, s = mrg32k3a.uniform(s)
        assert s == (*x, *y)
        assert u == ((x[2] - y[2]) % M_1 or M_1) * mrg32k3a.UNIT
        assert 0.0 < u < 1.0


def test_equal_numbers_do_not_make_a_zero():
    """The logarithm of the noise is taken of it."""
    u, s = mrg32k3a.uniform((0.0, 0.0, 0.0, 0.0, 0.0, 0.0))
    assert s[2] == s[5]
    assert u == M_1 * mrg32k3a.UNIT < 1.0


def test_the_unit_is_that_of_the_modulus():
    assert pytest.approx(1.0 / (M_1 + 1), rel=1e-15) == mrg32k3a.UNIT


def test_streams_are_uniform_at_each_place():
    """Seed after seed, at the same place: as good as one after the other in one stream."""
    rows = [draws(mrg32k3a.stream(float(k)), 30)[0] for k in range(400)]
    for place in (0, 1, 29):
        column = [row[place] for row in rows]
        counts = [sum(i / 10 <= u < (i + 1) / 10 for u in column) for i in range(10)]
        chi_square = sum((n - 40.0) ** 2 / 40.0 for n in counts)
        assert chi_square < 27.9  # exceeded by chance once in a thousand
        assert len(set(column)) == 400
