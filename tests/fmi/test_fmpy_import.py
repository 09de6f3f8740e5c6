"""Of FMPy only what is used is loaded, and yet all of it is there for whoever asks."""

import subprocess
import sys

import pytest

UNUSED = "fmpy.model_description", "fmpy.simulation", "fmpy.util", "attrs"


def printed(program):
    """What a program prints in its own Python."""
    return subprocess.check_output([sys.executable, "-c", program], text=True)


def test_what_is_not_used_is_not_loaded():
    program = f"import sys, grasp_cosim.fmi.load; print([m for m in {UNUSED} if m in sys.modules])"
    assert printed(program) == "[]\n"


def test_all_names_are_there_as_without_us():
    names = "from fmpy import *; print(sorted(n for n in dir() if n[0] != '_'))"
    ours, own = (eval(printed(text)) for text in (f"import grasp_cosim.fmi; {names}", names))
    assert {*ours} - {"grasp_cosim"} == {*own}


@pytest.mark.parametrize(
    "program",
    [
        "import fmpy; print(fmpy.read_model_description.__module__)",
        "from fmpy import read_model_description as r; print(r.__module__)",
        "import fmpy; print(fmpy.model_description.__name__)",
        "import fmpy.model_description as m; print(m.__name__)",
        "import fmpy.simulation; print(fmpy.simulation.ModelDescription.__module__)",
    ],
)
def test_the_rest_comes_when_it_is_asked_for(program):
    assert printed(f"import grasp_cosim.fmi; {program}") == "fmpy.model_description\n"


def test_a_name_that_fmpy_has_not_is_an_error():
    program = "import grasp_cosim.fmi, fmpy; print(hasattr(fmpy, 'simulate'))"
    assert printed(program) == "False\n"


def test_fmpy_that_was_there_before_stays_as_it_is():
    program = "import fmpy; was = {*vars(fmpy)}; import grasp_cosim.fmi; print({*vars(fmpy)} - was)"
    assert printed(program) == "set()\n"
