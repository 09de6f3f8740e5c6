"""Numbers in the texts of others, and whole ones that a float64 cannot hold."""

import re

import pytest
from grasp_cosim.base.checks import EXACT, exact, integer, real
from grasp_cosim.base.errors import InputError, SimulationError
from hypothesis import example, given
from hypothesis import strategies as st


@given(st.floats(allow_nan=False), st.integers())
def test_numbers_are_read_as_they_are_written(number, whole):
    assert (real(f" {number!r}\t"), integer(f" {whole}\n")) == (number, whole)


@pytest.mark.parametrize("text", ["1_0", "1e1_0", "١٢", "", "0,5", "1.5mm"])
def test_what_python_alone_takes_for_a_number_is_none(text):
    for read in (real, integer):
        with pytest.raises(ValueError, match=r"number|float|int"):
            read(text)


@given(st.integers(-(2 * EXACT), 2 * EXACT))
@example(EXACT - 1)
@example(-EXACT)
def test_whole_numbers_that_a_float_tells_from_all_others_are_exact(value):
    neighbours = {value - 1, value, value + 1}
    if len({float(x) for x in neighbours}) == len(neighbours):
        exact("here", value)
    else:
        with pytest.raises(InputError, match=f"^here = {value}: must be smaller than"):
            exact("here", value)


def test_the_text_and_the_failure_are_those_given():
    said = "here = 1e20 at step 3: must be smaller than 2**53 in magnitude, to be exact"
    with pytest.raises(SimulationError, match=re.escape(said)):
        exact("here", 10**20, "1e20 at step 3", SimulationError)
    exact("here", 1e300)
