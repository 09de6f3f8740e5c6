"""The test models of tests/support/models are FMUs as FMPy has it, with the right values."""

from math import exp
from pathlib import Path

import fmpy
import pytest
from fmpy.validation import validate_fmu
from support.models import KINDS, MODELS, build_model
from support.native_fmus import needs_gcc

pytestmark = needs_gcc
VERSIONS = ("2.0", "3.0")


@pytest.mark.slow
@pytest.mark.parametrize("version", VERSIONS)
@pytest.mark.parametrize("name", MODELS)
def test_is_valid(name: str, version: str, tmp_path: Path) -> None:
    assert validate_fmu(str(build_model(name, tmp_path, version))) == []


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("version", VERSIONS)
def test_either_kind_alone_runs_in_fmpy(version: str, kind: str, tmp_path: Path) -> None:
    fmu = build_model("dahlquist", tmp_path, version, [kind])
    run = fmpy.simulate_fmu(str(fmu), stop_time=1.0, relative_tolerance=1e-9)
    assert run["x"][-1] == pytest.approx(exp(-1.0), rel=1e-7)
