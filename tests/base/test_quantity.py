"""A number with its unit: the forms in which callers say it, and what is none."""

import numpy as np
import pytest
from grasp_cosim import InputError, Quantity
from grasp_cosim.base.quantity import as_quantity


@pytest.mark.parametrize(
    "said", [Quantity("50 mm"), Quantity(50, "mm"), (50, "mm"), "50 mm", " +5e1  mm ", "50. mm"]
)
def test_one_quantity_in_several_forms(said):
    found = as_quantity(said)
    assert (found, str(found)) == (Quantity(50.0, "mm"), "50 mm")


@pytest.mark.parametrize("said", [50, "50", "50mm", "fast mode", "1,2 mm", (50, 1), ("50", "mm")])
def test_what_is_no_quantity(said):
    assert as_quantity(said) is None


def test_a_number_of_numpy_is_one():
    assert Quantity(np.float32(0.5), "N").value == 0.5


@pytest.mark.parametrize("said", [("50",), (50,), ("x", "mm"), (None, "mm"), (50, 3)])
def test_a_quantity_that_is_none_is_refused(said):
    with pytest.raises(InputError, match="must be a number with its unit, like '50 mm'"):
        Quantity(*said)
