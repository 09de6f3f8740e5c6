"""Sobol indices against SciPy's, and against a function whose indices are known."""

import numpy as np
import pytest
from grasp_cosim import System
from grasp_cosim.sweep.design import Design
from grasp_cosim.sweep.distributions import Uniform
from grasp_cosim.sweep.sensitivity import Floats, indices, sensitivity
from grasp_cosim.sweep.study import Parameter, Study
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
        found.parameters, (0.3139, 0.4424, 0.0), (0.5576, 0.4424, 0.2437), strict=True
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
    assert [i.first for i in found.parameters] == indices(rows)[0].tolist()


@pytest.mark.parametrize("scale", [1e-300, 1e300])
def test_they_do_not_depend_on_the_unit(values: Floats, scale: float) -> None:
    few, scaled = (sensitivity("y", NAMES, v[:320], 1) for v in (values, scale * values))
    assert few is not None
    assert scaled is not None
    for one, other in zip(few.parameters, scaled.parameters, strict=True):
        assert other.first == pytest.approx(one.first, rel=1e-9, abs=1e-12)
        assert other.total_interval == pytest.approx(one.total_interval, rel=1e-9, abs=1e-12)


def test_noise_is_no_part_of_any_parameter_s_effect(grasp: System) -> None:
    """A value of the noise belongs to its seeds, as in a sensor; x alone acts besides it."""
    x, inert = (
        Parameter(name, (f"plant.finger_mass[{j}]",), Uniform(0.4, 0.6))
        for j, name in enumerate(("x", "inert"), start=1)
    )
    seeds = ("sensor_1.noise.seed", "sensor_2.noise.seed")
    study = Study("made", grasp, (x, inert), Design("saltelli", 256, 1), seeds)

    def value(k: int) -> float:
        point = study.point(k)
        noise = [np.random.default_rng(int(point[seed])).uniform(-0.1, 0.1) for seed in seeds]
        return float(point["x"]) + float(sum(noise))

    found = sensitivity("y", ["x", "inert"], np.array([value(k) for k in range(study.runs)]), 1)
    assert found is not None
    share = 1.0 / 3.0  # of x: a variance of 0.2^2/12, and the two of noise have it each
    assert [i.first for i in found.parameters] == pytest.approx([share, 0.0], abs=0.08)
    assert [i.total for i in found.parameters] == pytest.approx([share, 0.0], abs=0.08)


def test_rounding_is_no_variance() -> None:
    noise = np.random.default_rng(1).integers(0, 3, 40) * np.finfo(float).eps
    assert sensitivity("y", NAMES, 3.0 + noise, 1) is None


@pytest.mark.parametrize("value", [3.0, np.nan])
def test_what_does_not_vary_has_none(value: float) -> None:
    assert sensitivity("y", NAMES, np.full(40, value), 1) is None
