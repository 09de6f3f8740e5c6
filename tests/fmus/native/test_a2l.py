"""The A2L files of blocks: a2ltool has no remark on them, pya2l reads all that is declared."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from grasp_cosim.fmu_export.native.a2l import EPK_ADDRESS, IDENTIFIER
from grasp_cosim.fmu_export.native.c_only import c_only
from grasp_cosim.fmu_export.own_block import own_model
from grasp_cosim.fmu_export.package import shipped_model
from support.kinds import TRANSLATED
from support.marks import slow

ROOT = Path(__file__).parents[3]
BIN = Path(sys.executable).parent


def tool(name):
    """A tool of another package, whose command is next to Python."""
    found = shutil.which(name, path=str(BIN))
    if found is None:
        pytest.skip(f"NO {name}")
    return found


@pytest.fixture(params=[TRANSLATED[0], *map(slow, TRANSLATED[1:]), "SpringPlant"])
def model(request):
    if request.param != "SpringPlant":
        yield shipped_model(request.param)
        return
    template = ROOT / "orchestrator/grasp_cosim/inspection/templates/spring_plant.py"
    with own_model(template) as own:
        yield own


@pytest.fixture
def a2l(model, tmp_path):
    name = model.description.name
    path = tmp_path / f"{name}.a2l"
    path.write_bytes(c_only(model, a2l=True)[path.name])
    return path


def test_a2ltool_has_no_remark(a2l):
    command = [tool("a2ltool"), "--check", "--strict", "--show-xcp", a2l]
    done = subprocess.run(command, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert "No problems found" in done.stdout
    assert "XCP on UDP/IP\n    address: 127.0.0.1\n    port: 5555\n" in done.stdout


def test_pya2l_finds_what_is_declared(a2l, model):
    said = subprocess.run([tool("pya2l"), a2l, "to_json"], capture_output=True, check=True).stdout
    [module] = json.loads(said)["PROJECT"]["MODULE"]
    units = {c["Name"]["Value"]: c["Unit"].get("Value", "") for c in module["COMPU_METHOD"]}
    declared = {v.name: v for v in model.description.variables}
    parameters = {c["Name"]["Value"]: c for c in module["CHARACTERISTIC"]}
    measured = {m["Name"]["Value"]: m for m in module["MEASUREMENT"]}
    assert measured.pop("state.numbers")
    assert {*parameters} == {n for n, v in declared.items() if v.causality == "parameter"}
    assert {*measured} == {n for n, v in declared.items() if v.causality != "parameter"}
    for name, entry in (parameters | measured).items():
        variable = declared[name]
        assert units[entry["Conversion"]["Value"]] == variable.unit
        assert variable.description.isascii() <= (
            entry["LongIdentifier"].get("Value", "").replace("'", '"')
            == variable.description.replace("'", '"')
        )
        low, high = (entry[f"{end}Limit"].get("Value", 0.0) for end in ("Lower", "Upper"))
        if variable.limits:
            assert low == max(variable.limits[0], -1.7976931348623157e308)
            assert high == min(variable.limits[1], 1.7976931348623157e308)
        tunable = variable.variability == "tunable"
        assert ("READ_ONLY" in entry) == (variable.causality == "parameter" and not tunable)
    assert module["MOD_PAR"]["ADDR_EPK"][0]["Address"]["Value"] == str(EPK_ADDRESS)


def test_the_parameters_of_each_layer_are_a_group(tmp_path):
    text = c_only(shipped_model("GraspController"), a2l=True)["GraspController.a2l"].decode()
    groups = [line.split()[2] for line in text.splitlines() if "/begin GROUP" in line]
    layers = ["simultaneous_contact", "impact_reduction", "contact_force"]
    assert groups == [*layers, "inputs", "outputs", "states"]


@pytest.mark.parametrize(
    ("name", "fits"),
    [("a", True), ("a.b[1]", True), ("a[1][2].b", True), ("", False), ("1a", False),
     ("a b", False), ("a.", False), ("a[x]", False), ("ä", False)],
)  # fmt: skip
def test_names_that_an_a2l_file_may_have(name, fits):
    assert bool(IDENTIFIER.fullmatch(name)) is fits


def test_without_a2l_nothing_of_it_is_written():
    plain, more = (c_only(shipped_model("ProximitySensor"), a2l=a2l) for a2l in (False, True))
    assert plain.items() <= more.items()
    assert {*more} - {*plain} == {
        "ProximitySensor.a2l", "ProximitySensor_xcp.h", "xcp.h", "xcp_udp.h", "xcp_main.c",
    }  # fmt: skip
