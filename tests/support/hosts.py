"""Fixtures of the tests with hosts in C: the native FMUs, unpacked, and the hosts."""

import shutil

import pytest
from grasp_fmus.native.targets import here

from .c_host import Part, unpacked
from .marks import slow
from .platforms import host_of

Parts = dict[str, Part]
"""By the names of the FMUs."""


@pytest.fixture(scope="session")
def parts_of(folder_of, tmp_path_factory):
    """The native FMUs for a version of FMI, unpacked once per test process."""
    known = {}

    def parts(fmi):
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
def parts(request, parts_of):
    """The native FMUs, of each version of FMI in turn."""
    return parts_of(request.param)


@pytest.fixture(scope="session")
def host_for(tmp_path_factory):
    """The host for a platform, compiled once per test process."""
    known = {}

    def host(target):
        if target not in known:
            known[target] = host_of(target, tmp_path_factory.mktemp("host"))
        return known[target]

    return host


@pytest.fixture
def host(host_for):
    """The host for this machine."""
    if not shutil.which("gcc"):
        pytest.skip("NO gcc")
    return host_for(here())


@pytest.fixture(scope="session")
def parts_on(parts_of, tmp_path_factory):
    """The same FMUs for a platform and a version of FMI, compiled once per test process."""
    known = {}

    def parts(platform, fmi):
        if (platform.name, fmi) not in known:
            folder = tmp_path_factory.mktemp("compiled")
            known[platform.name, fmi] = {
                name: Part(part.fmu, platform.compiled(part.fmu, folder))
                for name, part in parts_of(fmi).items()
            }
        return known[platform.name, fmi]

    return parts
