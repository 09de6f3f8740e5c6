"""Fixtures of the tests with hosts in C: the native FMUs, unpacked, and the hosts."""

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from grasp_fmus.native.targets import Target, here

from .c_host import Host, Part, unpacked
from .kinds import Kind
from .platforms import Platform, host_of
from .slow import slow

Parts = dict[str, Part]
"""By the names of the FMUs."""


@pytest.fixture(scope="session")
def parts_of(
    folder_of: Callable[[Kind], Path], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[int], Parts]:
    """The native FMUs for a version of FMI, unpacked once per test process."""
    known: dict[int, Parts] = {}

    def parts(fmi: int) -> Parts:
        if fmi not in known:
            folder = folder_of("native" if fmi == 2 else "native FMI 3")
            fmus = [
                unpacked(path, tmp_path_factory.mktemp(path.stem))
                for path in sorted(folder.glob("*.fmu"))
            ]
            known[fmi] = {fmu.name: Part(fmu, fmu.binary()) for fmu in fmus}
        return known[fmi]

    return parts


@pytest.fixture(params=[2, slow(3)], ids=["FMI 2", "FMI 3"])
def parts(request: pytest.FixtureRequest, parts_of: Callable[[int], Parts]) -> Parts:
    """The native FMUs, of each version of FMI in turn."""
    return parts_of(request.param)


@pytest.fixture(scope="session")
def host_for(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Target], Host]:
    """The host for a platform, compiled once per test process."""
    known: dict[Target, Host] = {}

    def host(target: Target) -> Host:
        if target not in known:
            known[target] = host_of(target, tmp_path_factory.mktemp("host"))
        return known[target]

    return host


@pytest.fixture
def host(host_for: Callable[[Target], Host]) -> Host:
    """The host for this machine."""
    if not shutil.which("gcc"):
        pytest.skip("NO gcc")
    return host_for(here())


@pytest.fixture(scope="session")
def parts_on(
    parts_of: Callable[[int], Parts], tmp_path_factory: pytest.TempPathFactory
) -> Callable[[Platform, int], Parts]:
    """The same FMUs for a platform and a version of FMI, compiled once per test process."""
    known: dict[tuple[str, int], Parts] = {}

    def parts(platform: Platform, fmi: int) -> Parts:
        if (platform.name, fmi) not in known:
            folder = tmp_path_factory.mktemp("compiled")
            known[platform.name, fmi] = {
                name: Part(part.fmu, platform.compiled(part.fmu, folder))
                for name, part in parts_of(fmi).items()
            }
        return known[platform.name, fmi]

    return parts
