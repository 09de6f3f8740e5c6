"""The median of ten samples against its definition."""

from itertools import product
from statistics import median

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import sliding_median
from scipy.ndimage import median_filter
from support.marks import examples

QUICK = examples(300)

VOLTS = st.floats(-1e3, 1e3)


@QUICK
@given(st.tuples(VOLTS, VOLTS, VOLTS, VOLTS, VOLTS, VOLTS, VOLTS, VOLTS, VOLTS, VOLTS))
def test_it_is_the_mean_of_the_two_in_the_middle(window):
    assert sliding_median.median(window) == median(window)


def test_it_puts_everything_in_order():
    """A comparison network that sorts all zeros and ones sorts everything."""
    for a, b, c, d, e, f, g, h, i, j in product((0.0, 1.0), repeat=10):
        window = a, b, c, d, e, f, g, h, i, j
        assert sliding_median.median(window) == median(window)


def test_it_lies_between_the_two_medians_of_scipy():
    """scipy's, of ten samples, is the sixth in order; of the negative, less the fifth."""
    samples = np.random.default_rng(4).normal(size=300)
    upper = median_filter(samples, size=10, origin=4, mode="nearest")
    lower = -median_filter(-samples, size=10, origin=4, mode="nearest")
    for k in range(9, 300):
        a, b, c, d, e, f, g, h, i, j = samples[k - 9 : k + 1].tolist()
        value = sliding_median.median((a, b, c, d, e, f, g, h, i, j))
        assert value == 0.5 * (lower[k] + upper[k])


def test_a_ramp_comes_four_and_a_half_samples_late():
    assert sliding_median.median((0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0)) == 9.0 - 4.5


def test_four_outliers_leave_no_trace():
    window = (1.0, 1.0, 1e3, 1.0, -1e3, 1.0, 1e3, 1e3, 1.0, 1.0)
    assert sliding_median.median(window) == 1.0
