"""Sobol indices against SciPy's, and against a function whose indices are known."""

import numpy as np
import pytest
from grasp_cosim.sweep.design import Design
from grasp_cosim.sweep.sensitivity import Floats, indices, sensitivity
from scipy.stats import sobol_indices

NAMES = ["a", "b", "c"]


def ishigami(x: Floats) -> Floats:
    """Ishigami and Homma 1990, of points in the unit cube."""
    a, b, c = (np.pi * (2.0 * x - 1.0)).T
    result: Floats = np.sin(a) + 7.0 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a)
    return result


@pytest.fixture(scope="module")
def values() -> Floats:
    return ishigami(Design("saltelli", 1024, 1).points([None] * 3))


def test_they_are_those_of_scipy(values: Floats) -> None:
    rows = values.reshape(-1, 5)
    first, total = indices(rows)
    function = {"f_A": rows[:, :1].T, "f_B": rows[:, 1:2].T, "f_AB": rows[:, 2:].T[:, None, :]}
    theirs = sobol_indices(func=function, n=1024)
    np.testing.assert_allclose(first, theirs.first_order.ravel(), rtol=1e-11, atol=1e-13)
    np.testing.assert_allclose(total, theirs.total_order.ravel(), rtol=1e-11, atol=1e-13)


def test_they_are_those_known(values: Floats) -> None:
    found = sensitivity("y", NAMES, values, 1)
    assert found is not None
    for index, first, total in zip(
        found.indices, (0.3139, 0.4424, 0.0), (0.5576, 0.4424, 0.2437), strict=True
    ):
        assert index.first == pytest.approx(first, abs=0.06)
        assert index.total == pytest.approx(total, abs=0.06)
        assert index.first_interval[0] < index.first < index.first_interval[1]
        assert index.total_interval[0] < index.total < index.total_interval[1]
    assert found == sensitivity("y", NAMES, values, 1)


def test_a_row_with_a_failed_run_is_left_out(values: Floats) -> None:
    holes = values.copy()
    holes[[7, 9, 503]] = np.nan
    found = sensitivity("y", NAMES, holes, 1)
    assert found is not None
    assert (found.rows, found.of) == (1024 - 2, 1024)
    rows = np.delete(values.reshape(-1, 5), [1, 100], axis=0)
    assert [i.first for i in found.indices] == indices(rows)[0].tolist()


@pytest.mark.parametrize("value", [3.0, np.nan])
def test_what_does_not_vary_has_none(value: float) -> None:
    assert sensitivity("y", NAMES, np.full(40, value), 1) is None
