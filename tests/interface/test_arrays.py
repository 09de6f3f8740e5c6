"""Arrays: names and values of elements, row by row from 1, and variables in their place."""

import json
import math

import numpy as np
import pytest
from grasp_cosim import InputError
from grasp_cosim.interface.expansion import expanded, flattened, from_text, parse_values
from grasp_cosim.interface.read import read_interface
from grasp_cosim.interface.renaming import in_units, renamed
from grasp_cosim.interface.variables import MAX_ELEMENTS, element_names, size_of
from hypothesis import given
from hypothesis import strategies as st
from support.native_fmus import state_space

SHAPES = st.lists(st.integers(1, 4), min_size=1, max_size=4)
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
    ("value", "message"),
    [
        ([[1, 2], [3, 4], [5, 6]], r"is \[3, 2\]"),
        ([1, 2, 3], r"is \[3\]"),
        ([[1, 2, 3], [4, 5]], "rows of different lengths"),
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
    assert size_of([2**64 - 1] * 1000) == size_of([2**40]) == MAX_ELEMENTS + 1
    assert element_names("u", (2, 0)) == ()
    assert flattened(1.0, (2, 0)) == flattened([], (0,)) == []


def of(*dimensions):
    """A further array of fixed size."""
    sizes = "".join(f'<Dimension start="{n}"/>' for n in dimensions)
    return FIXED.format("F", "input", 'start="0"', sizes)


def declared(folder, more="", types=False):
    return read_interface(state_space(folder, types=types, more=more, binary=False))


SCALAR = '<Float64 name="F[2]" valueReference="301" causality="input" start="7"/>'
SMALL = {"m": 2, "n": 1, "r": 1}
EXPANDED = {
    "as declared": ({}, {}, {}, {}),
    "with other inputs than starts": ({}, {"m": 2, "n": 5}, {}, {}),
    "all types of numbers": ({"types": True}, {"k": 1}, {}, {}),
    "many dimensions": ({"more": of(*[1] * 20, 2)}, {}, {}, {}),
    "a variable by the name of an element": ({"more": of(3) + SCALAR}, {}, {}, {}),
    "renamed whole": ({}, SMALL, {"force": "u"}, {}),
    "renamed twice alike": ({}, SMALL, {"force[1]": "u[1]", "force": "u"}, {}),
    "renamed by elements": ({}, SMALL, {"left": "u[2]", "u[2]": "u[1]"}, {}),
    "units": ({}, {"r": 2}, {}, {"u": "mm", "y[2]": "N"}),
}
SHOWN = {"types": ("u_", "y_"), "more": ("F",)}
"""The variables that are told of, by how they begin, where it is not about all."""


@pytest.mark.parametrize("name", EXPANDED)
def test_elements_in_the_place_of_arrays(name, tmp_path, snapshot):
    """The first and the last of each array."""
    made, lengths, rename, units = EXPANDED[name]
    found = in_units(renamed(expanded(declared(tmp_path, **made), lengths), rename), units)
    about = next((SHOWN[key] for key in made), ("",))
    arrays = [f"{n}: {a.shape}: {' '.join(a.names)}" for n, a in found.arrays.items()]
    variables = [
        f"{v.name} #{v.reference} {v.shape or v.element} {v.type} {v.start} {v.unit}: "
        f"{' '.join(v.dependencies or ())}; {' '.join(v.initial_dependencies or ())}"
        for v in found.variables
        if v.element is None or v.element.place in (0, v.element.size - 1)
    ]
    assert [text for text in (*arrays, *variables) if text.startswith(about)] == snapshot


def test_a_name_of_an_array_that_is_taken_or_not_there(tmp_path):
    found = expanded(declared(tmp_path), {})
    with pytest.raises(InputError, match=r"'u\[1\]' is renamed to 'a\[1\]' already"):
        renamed(found, {"a": "u", "b": "u[1]"})
    with pytest.raises(InputError, match=r"no variable 'u\[4\]'"):
        renamed(found, {"a": "u[4]"})


@pytest.mark.parametrize("dimensions", [(2**40,), (2**20, 2**20), (2**63, 3), (1, 10**5 + 1)])
def test_too_many_elements_are_left_alone_by_name(tmp_path, dimensions):
    found = expanded(declared(tmp_path, of(*dimensions)), {})
    assert "F" not in found.arrays
    assert "u" in found.arrays
    assert not found.by_name["F"].supported
    with pytest.raises(InputError, match=f"array of Float64 with more than {MAX_ELEMENTS}"):
        parse_values(found, "here", "F", 1.0)


def test_values_of_an_array_are_checked_one_by_one(tmp_path):
    found = expanded(declared(tmp_path, types=True), {"k": 1})
    name = "u_Enumeration"
    assert parse_values(found, "here", name, [["fast"], [1]]) == {
        f"{name}[1,1]": 2,
        f"{name}[2,1]": 1,
    }
    assert parse_values(found, "here", name, "fast,slow", text=True) == {
        f"{name}[1,1]": 2,
        f"{name}[2,1]": 1,
    }
    with pytest.raises(InputError, match=r"^here: u_Int8\[2,1\] = 128: must be "):
        parse_values(found, "here", "u_Int8", [1, 128])
    with pytest.raises(InputError, match=r"^here: u_Int8 = .*: is \[3\]; must be \[2, 1\], or"):
        parse_values(found, "here", "u_Int8", [1, 2, 3])
    with pytest.raises(InputError, match=r"^here: u_Int8 = '\[1': "):
        parse_values(found, "here", "u_Int8", "[1", text=True)
    with pytest.raises(InputError, match=r"^here: m = \[1\]: is not an array; must be one value"):
        parse_values(found, "here", "m", [1])
    with pytest.raises(InputError, match=r"u_Int64\[1,1\] = '9007199254740993.0': must be"):
        parse_values(found, "here", "u_Int64", "9007199254740993.0", text=True)


def test_a_start_that_is_no_number_is_a_flaw(tmp_path):
    wrong = FIXED.format("F", "input", 'start="1 two 3"', '<Dimension start="3"/>')
    with pytest.raises(InputError, match="variable 'F': start = 'two': must be a number"):
        declared(tmp_path, wrong)
