"""Names and values of the elements of arrays: row by row, counted from 1."""

import json
import math

import numpy as np
import pytest
from grasp_cosim.interface.arrays import (
    MOST_ELEMENTS,
    element_names,
    flattened,
    from_text,
    shape_text,
    size_of,
)
from hypothesis import given
from hypothesis import strategies as st

SHAPES = st.lists(st.integers(1, 4), min_size=1, max_size=4)


@given(SHAPES)
def test_names_and_values_go_row_by_row_as_numpy_does(shape):
    array = np.arange(math.prod(shape)).reshape(shape)
    flat = flattened(array.tolist(), shape)
    assert flat == flattened(array, shape) == array.ravel().tolist()
    for name, value in zip(element_names("u", shape), flat, strict=True):
        place = tuple(int(i) - 1 for i in name.removeprefix("u[").removesuffix("]").split(","))
        assert array[place] == value
    assert np.array(flat).reshape(shape).tolist() == array.tolist()


@given(SHAPES)
def test_names_are_different_and_as_many_as_elements(shape):
    names = element_names("a b", shape)
    assert len(set(names)) == len(names) == size_of(shape)


@given(SHAPES, st.floats(allow_nan=False))
def test_a_text_is_read_as_it_is_written(shape, value):
    nested = np.full(shape, value).tolist()
    if math.isfinite(value):
        assert flattened(from_text(json.dumps(nested)), shape) == [value] * size_of(shape)
    flat = ",".join(map(repr, np.ravel(nested).tolist()))
    read = flattened(from_text(flat), shape)
    assert [float(text) for text in read] == [value] * size_of(shape)


@pytest.mark.parametrize(
    ("value", "found"),
    [(1.5, [1.5] * 6), ([1, 2, 3, 4, 5, 6], [1, 2, 3, 4, 5, 6]), (((1, 2, 3), (4, 5, 6)), None)],
)
def test_one_value_a_flat_list_and_rows_are_taken(value, found):
    assert flattened(value, (2, 3)) == (found or [1, 2, 3, 4, 5, 6])


@pytest.mark.parametrize(
    ("value", "message"),
    [
        ([[1, 2], [3, 4], [5, 6]], r"is \[3, 2\]"),
        ([1, 2, 3], r"is \[3\]"),
        ([[1, 2, 3], [4, 5]], "rows of different lengths"),
        ([[1, 2, 3], 4], "rows of different lengths"),
        ([], r"is \[0\]"),
    ],
)
def test_another_shape_says_which(value, message):
    with pytest.raises(ValueError, match=message):
        flattened(value, (2, 3))


def test_sizes_are_counted_no_further_than_they_matter():
    assert size_of((2, 3)) == 6
    assert size_of(()) == 1
    assert size_of((2**40, 0)) == 0
    assert size_of([2**64 - 1] * 1000) == size_of([2**40]) == MOST_ELEMENTS + 1
    assert element_names("u", (2, 0)) == ()
    assert flattened(1.0, (2, 0)) == flattened([], (0,)) == []


def test_shapes_are_written_like_lists():
    assert [shape_text(s) for s in ((3,), (2, 3))] == ["[3]", "[2, 3]"]
