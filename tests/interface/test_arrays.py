"""Arrays: names and values of elements, row by row from 1, and variables in their place."""

import json
import math

import numpy as np
import pytest
from grasp_cosim import InputError
from grasp_cosim.interface.expansion import expanded, flattened, from_text, values_of
from grasp_cosim.interface.interface import MOST_ELEMENTS, Element, element_names, size_of
from grasp_cosim.interface.read import read_interface
from hypothesis import given
from hypothesis import strategies as st
from support.native_fmus import ARRAY_TYPES as TYPES
from support.native_fmus import state_space

SHAPES = st.lists(st.integers(1, 4), min_size=1, max_size=4)
MATRIX = ("A[1,1]", "A[1,2]", "A[2,1]", "A[2,2]")
FIXED = '<Float64 name="{}" valueReference="300" causality="{}" {}>{}</Float64>'


@given(SHAPES)
def test_names_and_values_go_row_by_row_as_numpy_does(shape):
    array = np.arange(math.prod(shape)).reshape(shape)
    flat = flattened(array.tolist(), shape)
    assert flat == flattened(array, shape) == array.ravel().tolist()
    for name, value in zip(element_names("u", shape), flat, strict=True):
        place = tuple(int(i) - 1 for i in name.removeprefix("u[").removesuffix("]").split(","))
        assert array[place] == value
    assert np.array(flat).reshape(shape).tolist() == array.tolist()


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


def of(*dimensions):
    """A further array of fixed size."""
    sizes = "".join(f'<Dimension start="{n}"/>' for n in dimensions)
    return FIXED.format("F", "input", 'start="0"', sizes)


def declared(folder, more="", types=False):
    return read_interface(state_space(folder, types=types, more=more, binary=False))


def test_elements_have_the_reference_and_the_place_in_the_array(tmp_path):
    found = expanded(declared(tmp_path), {"n": 2})
    assert found.arrays["A"].shape == (2, 2)
    assert found.arrays["A"].names == MATRIX
    for place, name in enumerate(MATRIX):
        v = found.by_name[name]
        assert (v.reference, v.element, v.shape) == (5, Element("A", place, 4), ())
        assert v.supported
        assert v.settable
    assert "A" not in found.by_name


def test_starts_go_to_elements_and_one_goes_to_all(tmp_path):
    found = expanded(declared(tmp_path), {})
    assert [found.by_name[n].start for n in found.arrays["u"].names] == ["1", "2", "3"]
    assert [found.by_name[n].start for n in found.arrays["x0"].names] == ["0"] * 3
    resized = expanded(declared(tmp_path), {"m": 2, "n": 5})
    assert [resized.by_name[n].start for n in resized.arrays["u"].names] == [None, None]
    assert [resized.by_name[n].start for n in resized.arrays["x0"].names] == ["0"] * 5


def test_dependencies_on_an_array_are_on_its_elements(tmp_path):
    found = expanded(declared(tmp_path), {"m": 2, "n": 1, "r": 1})
    assert found.arrays["y"].names == ("y[1]",)
    expected = ("C[1,1]", "D[1,1]", "D[1,2]", "u[1]", "u[2]", "x")
    assert found.by_name["y[1]"].dependencies == expected
    assert found.by_name["y[1]"].initial_dependencies == (*expected[:3], "x0[1]", *expected[3:5])


def test_all_types_of_numbers_are_taken_apart(tmp_path):
    found = expanded(declared(tmp_path, types=True), {"k": 1})
    for fmi_type in TYPES:
        names = found.arrays[f"u_{fmi_type}"].names
        assert names == (f"u_{fmi_type}[1,1]", f"u_{fmi_type}[2,1]")
        assert {found.by_name[n].type for n in names} == {fmi_type}


@pytest.mark.parametrize("dimensions", [(2**40,), (2**20, 2**20), (2**63, 3), (1, 10**5 + 1)])
def test_too_many_elements_are_left_alone_by_name(tmp_path, dimensions):
    found = expanded(declared(tmp_path, of(*dimensions)), {})
    assert "F" not in found.arrays
    assert "u" in found.arrays
    assert not found.by_name["F"].supported
    with pytest.raises(InputError, match=f"array of Float64 with more than {MOST_ELEMENTS}"):
        values_of(found, "here", "F", 1.0)


def test_many_dimensions(tmp_path):
    found = expanded(declared(tmp_path, of(*[1] * 60, 2)), {})
    ones = ",".join(["1"] * 60)
    assert found.arrays["F"].names == (f"F[{ones},1]", f"F[{ones},2]")


def test_a_variable_by_the_name_of_an_element_keeps_it(tmp_path):
    scalar = '<Float64 name="F[2]" valueReference="301" causality="input" start="7"/>'
    found = expanded(declared(tmp_path, of(3) + scalar), {})
    assert "F" not in found.arrays
    assert found.by_name["F[2]"].reference == 301
    assert found.by_name["F"].shape == (3,)


def test_an_array_is_renamed_whole_and_by_elements(tmp_path):
    found = expanded(declared(tmp_path), {})
    whole = found.renamed({"force": "u"})
    assert whole.arrays["force"].names == ("force[1]", "force[2]", "force[3]")
    assert whole.by_name["force[2]"].element == Element("force", 1, 3)
    assert "force[2]" in (whole.by_name["y[1]"].dependencies or ())
    parts = found.renamed({"left": "u[2]", "u[2]": "u[1]"})
    assert parts.arrays["u"].names == ("u[2]", "left", "u[3]")
    assert [parts.by_name[n].element for n in parts.arrays["u"].names] == [
        Element("u", place, 3) for place in range(3)
    ]
    with pytest.raises(InputError, match=r"'u\[1\]' is renamed to 'a\[1\]' already"):
        found.renamed({"a": "u", "b": "u[1]"})
    with pytest.raises(InputError, match=r"no variable 'u\[4\]'"):
        found.renamed({"a": "u[4]"})


def test_units_are_named_whole_and_by_elements(tmp_path):
    found = expanded(declared(tmp_path), {}).in_units({"u": "mm", "y[2]": "N"})
    assert [found.by_name[n].unit for n in found.arrays["u"].names] == ["mm"] * 3
    assert [found.by_name[n].unit for n in found.arrays["y"].names] == [None, "N", None]


def test_values_of_an_array_are_checked_one_by_one(tmp_path):
    found = expanded(declared(tmp_path, types=True), {"k": 1})
    name = "u_Enumeration"
    assert values_of(found, "here", name, [["fast"], [1]]) == {f"{name}[1,1]": 2, f"{name}[2,1]": 1}
    assert values_of(found, "here", name, "fast,slow", text=True) == {
        f"{name}[1,1]": 2,
        f"{name}[2,1]": 1,
    }
    with pytest.raises(InputError, match=r"^here: u_Int8\[2,1\] = 128: must be "):
        values_of(found, "here", "u_Int8", [1, 128])
    with pytest.raises(InputError, match=r"^here: u_Int8 = .*: is \[3\]; must be \[2, 1\], or"):
        values_of(found, "here", "u_Int8", [1, 2, 3])
    with pytest.raises(InputError, match=r"^here: u_Int8 = '\[1': "):
        values_of(found, "here", "u_Int8", "[1", text=True)
    with pytest.raises(InputError, match=r"^here: m = \[1\]: is not an array; must be one value"):
        values_of(found, "here", "m", [1])
    with pytest.raises(InputError, match=r"u_Int64\[1,1\] = '9007199254740993.0': must be"):
        values_of(found, "here", "u_Int64", "9007199254740993.0", text=True)


def test_a_start_that_is_no_number_is_a_flaw(tmp_path):
    wrong = FIXED.format("F", "input", 'start="1 two 3"', '<Dimension start="3"/>')
    with pytest.raises(InputError, match="variable 'F': start = 'two': must be a number"):
        declared(tmp_path, wrong)
