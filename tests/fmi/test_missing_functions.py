"""Binaries that lack functions: those that are never called are not missed."""

from zipfile import ZipFile

import pytest
from grasp_cosim import InputError, System, simulate
from grasp_cosim.fmi.load import load
from grasp_cosim.system.parts import Component
from support.fmi2 import read_members
from support.native_fmus import needs_cvode, needs_gcc, talker

pytestmark = needs_gcc
versions = pytest.mark.parametrize("version", ["2.0", "3.0"])


def without(folder, version, *functions, **more):
    """The talker whose binary calls some functions otherwise: names without fmi2 or fmi3."""
    fmu = talker(folder, version=version, **more)
    members = read_members(fmu)
    with ZipFile(fmu, "w") as archive:
        for name, data in members.items():
            for function in functions if name.startswith("binaries/") else ():
                symbol = f"fmi{version[0]}{function}\0".encode()
                assert symbol in data
                data = data.replace(symbol, b"x" + symbol[1:])
            archive.writestr(name, data)
    return fmu


@versions
@pytest.mark.parametrize("isolation", ["none", "process"])
def test_what_is_needed_is_said_by_name_before_anything_runs(tmp_path, version, isolation):
    fmu = without(tmp_path, version, "DoStep", "Terminate")
    message = (
        rf"^a: .*talker.fmu does not load: its binary lacks fmi{version[0]}DoStep, "
        rf"fmi{version[0]}Terminate; must have what is called$"
    )
    with pytest.raises(InputError, match=message):
        load(Component("a", fmu, {}, isolation=isolation))


@versions
def test_a_getter_that_is_needed_is_said_by_name(tmp_path, version):
    whole = "GetInteger" if version == "2.0" else "GetInt32"
    without(tmp_path, version, whole)
    path = tmp_path / "t.toml"
    path.write_text(
        '[experiment]\nstep = 0.5\nstop = 1.0\n[components.a]\nfmu = "talker.fmu"\n', "utf-8"
    )
    message = rf"^a: .*talker.fmu: its binary lacks fmi{version[0]}{whole}; must have"
    with pytest.raises(InputError, match=message):
        simulate(System.load(path))


@versions
def test_what_is_never_called_is_not_missed(tmp_path, version):
    """No Strings are set; without SetDebugLogging there is less in the log."""
    fmu = without(tmp_path, version, "GetString", "SetString", "SetDebugLogging")
    load(Component("a", fmu, {})).close()


@needs_cvode
@versions
def test_model_exchange_needs_its_own(tmp_path, version):
    fmu = without(tmp_path, version, "SetTime", kinds=("ModelExchange",))
    with pytest.raises(InputError, match=f"its binary lacks fmi{version[0]}SetTime; must have"):
        load(Component("a", fmu, {}))
