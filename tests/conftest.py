"""What several tests share: the FMUs, built once per test process, and the built-in system."""

from pathlib import Path

import pytest
from grasp_cosim import System
from grasp_cosim.grasp import SYSTEM
from grasp_fmus.build import build


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the freshly built FMUs."""
    folder = tmp_path_factory.mktemp("fmus")
    build(folder)
    return folder


@pytest.fixture(scope="session")
def grasp(fmus: Path) -> System:
    """The built-in grasp."""
    return System.load(SYSTEM, fmus)
