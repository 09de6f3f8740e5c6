"""What is private in FMPy, and used here, is there: a new version of it is tried by these tests."""

import ctypes
import inspect
import re
import tomllib
from importlib import metadata
from pathlib import Path

import fmpy
import pytest
from fmpy.fmi1 import _FMU, FMICallException
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave
from grasp_cosim.fmi import fmpy_private
from grasp_cosim.fmi.messages import Messages
from support.native_fmus import build, needs_cvode, needs_gcc

ROOT = Path(__file__).resolve().parents[2]
THEIRS = {
    fmpy_private.FMU2CoSimulation: FMU2Slave,
    fmpy_private.FMU2ModelExchange: FMU2Model,
    fmpy_private.FMU3CoSimulation: FMU3Slave,
    fmpy_private.FMU3ModelExchange: FMU3Model,
}


def changed(name, how):
    """The sentence with which a test fails."""
    return (
        f"FMPy {fmpy.__version__} has changed {name}, which is private: {how}. "
        "Mend orchestrator/grasp_cosim/fmi/fmpy_private.py, or let pyproject.toml refuse it."
    )


@pytest.fixture
def slave(tmp_path):
    """FMPy's instance of a native FMU, whose library lacks functions, before it is instantiated."""
    fmu = build(tmp_path, version="2.0")
    folder = tmp_path / "extracted"
    fmpy.extract(fmu, folder)
    slave = fmpy_private.FMU2CoSimulation(
        guid="{native}", modelIdentifier="native", unzipDirectory=str(folder)
    )
    slave.messages = Messages("part", False, lambda: 0.0)
    return slave


def test_only_a_version_that_was_tried_is_installed():
    dependencies = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    (fmpy_there,) = [text for text in dependencies if text.startswith("fmpy")]
    lowest, highest = re.fullmatch(r"fmpy>=([\d.]+),<([\d.]+)", fmpy_there).groups()
    version, low, high = (
        tuple(map(int, text.split("."))) for text in (metadata.version("fmpy"), lowest, highest)
    )
    assert low <= version < high


@pytest.mark.parametrize("ours", THEIRS)
def test_classes_derive_from_those_of_fmpy_and_begin_as_they_do(ours):
    theirs = THEIRS[ours]
    assert issubclass(theirs, _FMU), changed("_FMU", f"{theirs.__name__} is none")
    assert ours.__name__[:4] == theirs.__name__[:4]


def test_the_version_of_fmi_is_told_by_the_name_of_the_class():
    source = inspect.getsource(_FMU._loadFunctions)
    for part in ("self.__class__.__name__", 'startswith("FMU2")', "inspect.getmembers(self)"):
        assert part in source, changed("_FMU._loadFunctions", f"it has no {part} any more")
    assert "inspect.signature(py_fun)" in source, changed(
        "_FMU._loadFunctions", "it reads the signatures of methods in another way"
    )


def test_calls_go_through_one_method():
    parameters = [*inspect.signature(_FMU._call).parameters]
    assert parameters == ["self", "fname", "args"], changed("_FMU._call", f"it takes {parameters}")
    for theirs in THEIRS.values():
        for name, method in inspect.getmembers(theirs, inspect.isfunction):
            if name.startswith(("fmi2", "fmi3")):
                source = inspect.getsource(method)
                assert "self._call(" in source, changed(f"{theirs.__name__}.{name}", "no _call")


@needs_gcc
def test_functions_are_found_by_name_with_the_type_that_they_return(slave):
    step = slave._functions.get("fmi2DoStep")
    assert step is not None, changed("_FMU._functions", "it has no fmi2DoStep")
    assert step.restype is ctypes.c_int, changed("_FMU._functions", "a status is no c_int")


@needs_gcc
def test_a_refused_call_raises_with_its_status(slave):
    slave.instantiate()
    with pytest.raises(FMICallException) as raised:
        slave.getReal([99])
    assert raised.value.status == 3, changed("FMICallException", "its status is another one")
    slave.freeInstance()


@needs_gcc
def test_an_fmu_without_an_instance_is_told_by_a_text(slave):
    slave.guid = "another"
    with pytest.raises(Exception, match=fmpy_private.FAILED_TO_INSTANTIATE):
        slave.instantiate()


@needs_gcc
def test_the_file_of_a_library_is_known(slave):
    assert fmpy_private.library_file(slave).endswith(f"native{fmpy.sharedLibraryExtension}")


@pytest.mark.parametrize("theirs", THEIRS.values())
def test_signatures_declare_every_argument(theirs):
    for name, method in inspect.getmembers(theirs, inspect.isfunction):
        if name.startswith(("fmi2", "fmi3")):
            for parameter in [*inspect.signature(method).parameters.values()][1:]:
                assert parameter.annotation is not inspect.Parameter.empty, changed(
                    f"{name}()", f"the type of {parameter.name} is not declared"
                )


@needs_cvode
def test_the_libraries_of_cvode_are_there():
    from fmpy.sundials import libraries

    names = ("core", "cvode", "nvecserial", "sunmatrixdense", "sunlinsoldense")
    for name in names:
        library = getattr(libraries, f"sundials_{name}", None)
        assert library is not None, changed(f"sundials.libraries.sundials_{name}", "it is gone")
