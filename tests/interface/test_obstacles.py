"""The likely reason why an FMU does not load, by what is said of it."""

from tempfile import gettempdir

import pytest
from grasp_cosim.interface.obstacles import of_loading
from grasp_cosim.interface.read import describe
from support.native_fmus import build_model, needs_gcc


@needs_gcc
@pytest.mark.parametrize(
    ("said", "licence"),
    [
        ("No license for feature X", True),
        ("libflexlm.so: cannot open shared object file", True),
        ("x.so: undefined symbol: licence_check", False),
        ("undefined symbol: licence_check (no licence)", True),
        ("cannot allocate memory", False),
    ],
)
def test_a_licence_is_wanted_where_that_is_said(said, licence, tmp_path):
    obstacle = of_loading(describe(build_model("stair", tmp_path)), said)
    assert (obstacle is not None and "licence" in obstacle.what) == licence


@needs_gcc
def test_a_folder_without_execution_is_named(tmp_path):
    """The words are those of glibc, where TMPDIR is mounted with noexec."""
    said = "binaries/linux64/stair.so: failed to map segment from shared object"
    obstacle = of_loading(describe(build_model("stair", tmp_path)), said)
    assert obstacle is not None
    assert gettempdir() in obstacle.what
    assert "TMPDIR" in obstacle.remedy
