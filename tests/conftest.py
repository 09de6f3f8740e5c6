"""What several tests share: the FMUs, built once per test process, and the built-in system."""

from collections.abc import Callable
from pathlib import Path

import pytest
from grasp_cosim import System
from grasp_cosim.grasp import SYSTEM
from grasp_fmus import build as builder

Altered = Callable[[str, str, str, str], Path]


@pytest.fixture(scope="session")
def fmus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the freshly built FMUs."""
    folder = tmp_path_factory.mktemp("fmus")
    builder.build(folder)
    return folder


@pytest.fixture(scope="session")
def grasp(fmus: Path) -> System:
    """The built-in grasp."""
    return System.load(SYSTEM, fmus)


@pytest.fixture
def altered(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Altered:
    """Builds the FMU of a script with one place in one source file changed."""
    original = builder._sources

    def build(script: str, source: str, before: str, after: str) -> Path:
        def changed(path: Path) -> dict[str, bytes]:
            sources = original(path)
            assert sources[source].count(before.encode()) == 1
            return {**sources, source: sources[source].replace(before.encode(), after.encode())}

        monkeypatch.setattr(builder, "_sources", changed)
        return builder.build_fmu(builder.SCRIPTS / f"{script}.py", tmp_path / "altered")

    return build
