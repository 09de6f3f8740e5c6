"""The balance weights of a hand: against a programme of scipy, and which hands have none."""

import numpy as np
import pytest
from grasp_cosim import InputError
from grasp_cosim.hand.weights import LEAST, balance_weights, imbalance
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.optimize import minimize


@pytest.mark.parametrize(
    "angles", [(0, 120, 240), (0, 180), (0, 90, 180, 270), (10, 82, 154, 226, 298)]
)
def test_an_even_hand_has_even_weights(angles):
    assert balance_weights(angles) == (1.0,) * len(angles)


def test_three_fingers_have_the_only_weights_that_there_are():
    """By the sines of the opposite gaps, 135, 135 and 90 degrees."""
    sines = np.sin(np.radians([135.0, 135.0, 90.0]))
    assert balance_weights((0.0, 90.0, 225.0)) == pytest.approx(3.0 * sines / sines.sum())


@given(st.lists(st.floats(0.0, 359.0), min_size=3, max_size=8))
def test_they_are_the_nearest_to_1_that_balance(angles):
    ordered = np.sort(angles)
    assume(np.diff([*ordered, ordered[0] + 360.0]).max() < 170.0)
    found = balance_weights(angles)
    e = np.exp(1j * np.radians(angles))
    assert imbalance(np.radians(angles).tolist(), found) < 1e-10
    assert np.mean(found) == pytest.approx(1.0)
    assume(min(found) >= LEAST - 1e-9)
    conditions = [
        {"type": "eq", "fun": lambda n: np.array([n @ e.real, n @ e.imag, n.sum() - len(e)])}
    ]
    of_scipy = minimize(
        lambda n: np.sum((n - 1.0) ** 2),
        np.ones(len(e)),
        bounds=[(LEAST, None)] * len(e),
        constraints=conditions,
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assume(of_scipy.success)
    assert np.sum((np.array(found) - 1.0) ** 2) <= of_scipy.fun + 1e-6


@pytest.mark.parametrize(
    ("angles", "said"),
    [
        ((0, 90, 180), "there is no finger for 180 degrees after 180"),
        ((0, 40, 100), "there is no finger for 260 degrees after 100"),
        ((30, 30), "there is no finger for 360 degrees after 30"),
    ],
)
def test_directions_that_cannot_hold_are_refused(angles, said):
    with pytest.raises(InputError, match=said) as refused:
        balance_weights(angles)
    assert "\n" not in str(refused.value)


def test_where_all_cannot_have_a_quarter_the_least_has_what_it_can():
    weights = balance_weights((0.0, 170.0, 181.0))
    assert 0.0 < min(weights) < LEAST
    assert imbalance(np.radians((0.0, 170.0, 181.0)).tolist(), weights) < 1e-10
