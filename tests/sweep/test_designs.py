"""Designs: pure functions of their index, in the unit cube, spread as they should be."""

import numpy as np
import pytest
from grasp_cosim import InputError
from grasp_cosim.sweep.design import KINDS, Design, Kind
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

SAMPLED: list[Kind] = ["random", "latin-hypercube", "sobol", "saltelli"]

powers = st.sampled_from([1, 2, 8, 32])
seeds = st.integers(0, 2**40)


@given(st.sampled_from(SAMPLED), powers, seeds, st.integers(1, 5))
@examples(25)
def test_points_are_in_the_unit_cube_and_the_same_again(
    kind: Kind, runs: int, seed: int, width: int
) -> None:
    design, levels = Design(kind, runs, seed), [None] * width
    points = design.points(levels)
    assert points.shape == (design.total(levels), width)
    assert (points >= 0.0).all()
    assert (points < 1.0).all()
    np.testing.assert_array_equal(points, Design(kind, runs, seed).points(levels))


@given(st.integers(1, 40), st.integers(1, 40), seeds)
@examples(30)
def test_a_random_point_depends_on_seed_and_index_alone(a: int, b: int, seed: int) -> None:
    few, many = sorted((a, b))
    points = [Design("random", n, seed).points([None, None]) for n in (few, many)]
    np.testing.assert_array_equal(points[0], points[1][:few])


@pytest.mark.parametrize("kind", SAMPLED)
def test_other_seeds_make_other_points(kind: Kind) -> None:
    one, two = (Design(kind, 8, seed).points([None] * 3) for seed in (1, 2))
    assert not (one == two).any()


@pytest.mark.parametrize(
    ("kind", "off"), [("random", 0.05), ("latin-hypercube", 1e-3), ("sobol", 1e-3)]
)
def test_points_fill_the_cube(kind: Kind, off: float) -> None:
    points = Design(kind, 1024, 7).points([None] * 3)
    np.testing.assert_allclose(points.mean(axis=0), 0.5, atol=off)
    np.testing.assert_allclose(points.var(axis=0), 1.0 / 12.0, atol=off)
    correlation = np.corrcoef(points.T) - np.eye(3)
    assert abs(correlation).max() < 0.1


@pytest.mark.parametrize("kind", ["latin-hypercube", "sobol"])
def test_each_slice_of_each_parameter_has_one_point(kind: Kind) -> None:
    points = Design(kind, 64, 3).points([None] * 4)
    for column in (points * 64).astype(int).T:
        assert sorted(column) == list(range(64))


def test_a_grid_has_each_combination_once_the_last_fastest() -> None:
    points = Design("grid").points([2, 3])
    cells = (points * [2, 3]).astype(int).tolist()
    assert cells == [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]]


def test_a_saltelli_row_is_a_then_b_then_a_with_one_of_b() -> None:
    for a, b, *mixed in Design("saltelli", 4, 1).points([None] * 3).reshape(4, 5, 3):
        for i, row in enumerate(mixed):
            assert row[i] == b[i] != a[i]
            assert np.delete(row, i).tolist() == np.delete(a, i).tolist()


WRONG = [
    (("line",), "kind = 'line': must be one of grid, random"),
    (("grid", 4), "runs = 4: must be left out"),
    (("random",), "runs = None: must be a whole number 1 to"),
    (("random", True), "runs = True: must be a whole number"),
    (("random", 0), "runs = 0: must be"),
    (("sobol", 12), "runs = 12: must be a power of two"),
    (("saltelli", 3), "runs = 3: must be a power of two"),
    (("random", 4, -1), "seed = -1: must be a whole number from 0"),
]


@pytest.mark.parametrize(("arguments", "message"), WRONG)
def test_what_is_no_design(arguments: tuple[Kind], message: str) -> None:
    with pytest.raises(InputError, match=message):
        Design(*arguments)


def test_what_is_no_grid() -> None:
    with pytest.raises(InputError, match="parameter 2 has no list of values"):
        Design("grid").total([3, None])
    with pytest.raises(InputError, match="1010000 runs: must be at most"):
        Design("grid").points([10_000, 101])
    assert set(SAMPLED) == set(KINDS) - {"grid"}
