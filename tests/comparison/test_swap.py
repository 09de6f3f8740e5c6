"""What a candidate declares otherwise, with model descriptions made by hand."""

import re
import zipfile
from contextlib import nullcontext
from dataclasses import replace
from pathlib import Path

import pytest
from comparison.made import DEPENDENCIES, PLANT, changed, without, write_fmu, write_system
from grasp_cosim.base.errors import InputError
from grasp_cosim.comparison.interface_difference import capability_differences
from grasp_cosim.comparison.qualify import component_of, prepare_swap
from grasp_cosim.interface.interface import Interface
from grasp_cosim.system.parts import Condition, Connection, Event, Fault, Port

GAP = Port("plant", "gap")
POSITION = Port("spring", "position")
FORCE_CONNECTION = Connection(Port("spring", "force"), Port("plant", "force"))
SPRING = {
    "position": 'causality="input" | Real start="0" unit="m"',
    "force": 'causality="output" | Real unit="N"',
}


@pytest.fixture
def system(tmp_path):
    """A plant and a spring."""
    return write_system(tmp_path)


def swap(system, candidate, rename=None, values=None, component="plant"):
    return prepare_swap(system, component, candidate, rename or {}, values or {}, "none")


def lines(swap):
    return [f"{d.severity} {d.kind} {d.variable}: {d.text}" for d in swap.differences]


def with_width(maximum):
    """The plant with its width in mm."""
    text = PLANT["width"].replace('"m"', '"mm"').replace("0.05", "50")
    return {**PLANT, "width": text.replace('"1"', f'"{maximum}"')}


OUTPUT, INPUT = 'causality="output"', 'causality="input"'
CANDIDATES = {
    "no gap": without("gap"),
    "no force": without("force"),
    "no width": without("width"),
    "no spare": without("spare"),
    "no mass": without("mass"),
    "no local variable": without("inner"),
    "another output": {**PLANT, "more": f"{OUTPUT} | Real"},
    "another input": {**PLANT, "more": f'{INPUT} | Real start="1"'},
    "gap is an Integer": changed("gap", 'Real unit="m" nominal="0.1"', "Integer"),
    "spare is an Integer": {**PLANT, "spare": f'{OUTPUT} variability="discrete" | Integer'},
    "touching is a Real": changed("touching", ' variability="discrete" | Boolean', " | Real"),
    "gap is local": changed("gap", "output", "local"),
    "force is a parameter": changed("force", INPUT, 'causality="parameter" variability="fixed"'),
    "mass is an input": changed("mass", 'causality="parameter" variability="tunable"', INPUT),
    "gap is discrete": changed("gap", OUTPUT, f'{OUTPUT} variability="discrete"'),
    "mass is fixed": changed("mass", "tunable", "fixed"),
    "gap in N": changed("gap", '"m"', '"N"'),
    "spare in N": changed("spare", '"m"', '"N"'),
    "gap in mm": changed("gap", '"m"', '"mm"'),
    "gap in metre": changed("gap", '"m"', '"metre"'),
    "gap without a unit": changed("gap", ' unit="m"', ""),
    "mass in 1": changed("mass", 'start="0.5"', 'start="0.5" unit="1"'),
    "width too small": changed("width", 'max="1"', 'max="0.06"'),
    "width smaller": changed("width", 'max="1"', 'max="0.08"'),
    "width wider": changed("width", 'max="1"', 'max="2"'),
    "width in mm": with_width(1000),
    "width in mm, too small": with_width(60),
    "gap has a least value": changed("gap", "nominal", 'min="0" nominal'),
    "mass starts otherwise": changed("mass", "0.5", "0.6"),
    "width starts otherwise": changed("width", "0.05", "0.06"),
    "force starts otherwise": changed("force", 'start="0"', 'start="1"'),
    "name starts otherwise": changed("name", '"a"', '"b"'),
    "several at once": {
        **{n: t for n, t in PLANT.items() if n not in ("gap", "width", "mass")},
        "spare": f'{OUTPUT} variability="discrete" | Integer',
    },
}


ABLE = 'canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true"'
CAPABILITIES = {
    "gap depends on force": {"dependencies": {**DEPENDENCIES, "gap": ["force"]}},
    "spare depends on force": {"dependencies": {**DEPENDENCIES, "spare": ["force"]}},
    "gap may depend on force": {"dependencies": {"touching": (), "spare": ()}},
    "one step size, the same": {"capabilities": ABLE.split()[1]},
    "one step size, another": {"capabilities": ABLE.split()[1], "step": "0.002"},
    "no state": {"capabilities": ABLE.split()[0]},
    "needs a tool": {"capabilities": f'{ABLE} needsExecutionTool="true"'},
    "model exchange": {"kind": "ModelExchange", "capabilities": ""},
}


def test_differences_of_variables(system, tmp_path, snapshot):
    """The worst first; a difference that blocks leaves no system to run."""
    told = {}
    candidates = {name: {"variables": found} for name, found in CANDIDATES.items()} | CAPABILITIES
    for name, candidate in candidates.items():
        result = swap(system, write_fmu(tmp_path / "new" / "candidate.fmu", **candidate))
        told[name] = lines(result)
        blocked = any(line.startswith("blocks") for line in told[name])
        assert (result.swapped is None) == blocked
    spring = write_fmu(tmp_path / "c.fmu", SPRING, {"force": []})
    told["depends no more"] = lines(swap(system, spring, component="spring"))
    assert told == snapshot


def test_a_copy_has_no_difference(system, tmp_path):
    fmu = write_fmu(tmp_path / "new" / "candidate.fmu")
    same = swap(system, fmu)
    assert same.differences == ()
    assert same.system == system
    place = same.swapped.component("plant", "test")
    assert (place.fmu, place.values) == (fmu, {"width": 0.07})


@pytest.mark.parametrize(("declared", "kept"), [("", {"mass": "g"}), (' unit="m"', {})])
def test_a_unit_that_the_system_names_is_for_want_of_a_declared_one(
    declared, kept, system, tmp_path
):
    plant, spring = system.components
    named = replace(system, components=(replace(plant, units={"mass": "g"}), spring))
    variables = changed("mass", 'start="0.5"', f'start="0.5"{declared}')
    swapped = swap(named, write_fmu(tmp_path / "c.fmu", variables)).swapped
    assert swapped.component("plant", "test").units == kept


@pytest.mark.parametrize(
    "more",
    [
        {"events": (Event({Port("plant", "mass"): 0.6}, when=Condition(GAP, "<", 0.01)),)},
        {"faults": (Fault(POSITION, "bias", {"value": 0.1}),)},
        {"connections": (Connection(GAP, POSITION, 2.0, 0.0), FORCE_CONNECTION)},
    ],
)
def test_numbers_that_the_system_states_in_the_originals_unit(system, tmp_path, more):
    fmu = write_fmu(tmp_path / "c.fmu", changed("gap", '"m"', '"mm"'))
    (line,) = lines(swap(replace(system, **more), fmu))
    assert line.startswith("blocks unit gap: is in mm, but ")
    assert line.endswith(" is meant in m")


def test_an_event_must_find_what_it_sets_tunable(system, tmp_path):
    event = Event({Port("plant", "mass"): 0.6}, when=Condition(GAP, "<", 0.01))
    fmu = write_fmu(tmp_path / "c.fmu", changed("mass", "tunable", "fixed"))
    line = "blocks variability mass: is fixed, but an event sets it; must be tunable"
    assert lines(swap(replace(system, events=(event,)), fmu)) == [line]


def able(version, **flags):
    return Interface(Path("x.fmu"), "", "x", (), version, capabilities=flags)


def test_fmi_3_names_of_capabilities_are_those_of_fmi_2():
    two = able("2.0", canGetAndSetFMUstate=True, providesDirectionalDerivative=True)
    three = able("3.0", canGetAndSetFMUState=True, providesDirectionalDerivatives=True)
    assert [d.variable for d in capability_differences(two, three, 1e-3)] == ["fmiVersion"]


def test_renamed_variables_are_compared_by_the_systems_names(system, tmp_path):
    theirs = {{"gap": "luft", "force": "kraft"}.get(n, n): t for n, t in PLANT.items()}
    path = write_fmu(tmp_path / "c.fmu", theirs, {"luft": ["kraft"], "touching": (), "spare": ()})
    result = swap(system, path, rename={"gap": "luft", "force": "kraft"})
    (difference,) = result.differences
    assert (difference.variable, difference.candidate) == ("gap", ["force"])


def test_values_go_to_the_system_that_has_the_variable(system, tmp_path):
    theirs = {**with_width(1000), "heat": f'{INPUT} | Real start="0" unit="K"'}
    path = write_fmu(tmp_path / "c.fmu", theirs)
    result = swap(system, path, values={"plant.width": "0.08", "plant.heat": "290"})
    assert result.system.component("plant", "test").values == {"width": 0.08}
    values = result.swapped.component("plant", "test").values
    assert values == {"width": pytest.approx(80.0), "heat": 290.0}


REFUSED = [
    ({"rename": {"gap": "luft"}}, r"^rename: 'gap' = 'luft': c.fmu has no variable 'luft'"),
    ({"rename": {"luft": "gap"}}, r"^rename: 'luft' = 'gap': the original has no variable"),
    ({"values": {"plant.widht": 1.0}}, r"^--set plant.widht: plant.fmu has no input, param"),
    ({"values": {"plant.width": 2.0}}, r"width = 2.0: must be a finite number from 0 to 1 m"),
    ({"component": "hand"}, r"^--as hand: no component 'hand'; valid: plant, spring"),
    ({"candidate": "none.fmu"}, r"none.fmu: no such FMU file"),
]


@pytest.mark.parametrize(("given", "message"), REFUSED)
def test_a_wrong_input_is_one_line(system, tmp_path, given, message):
    write_fmu(tmp_path / "c.fmu")
    given = {"candidate": "c.fmu", **given}
    with pytest.raises(InputError, match=message):
        swap(system, **{**given, "candidate": tmp_path / given["candidate"]})


FMI_1 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="1.0" modelName="Old" modelIdentifier="old" guid="{1}"
    numberOfContinuousStates="0" numberOfEventIndicators="0"><ModelVariables>
    <ScalarVariable name="force" valueReference="0" causality="input"><Real start="0"/>
    </ScalarVariable>
    <ScalarVariable name="gap" valueReference="1" causality="output"><Real/></ScalarVariable>
  </ModelVariables><Implementation><CoSimulation_StandAlone><Capabilities/>
  </CoSimulation_StandAlone></Implementation></fmiModelDescription>"""


def test_what_the_system_refuses_blocks_in_its_words(system, tmp_path):
    """FMI 1.0 is described all the same."""
    with zipfile.ZipFile(tmp_path / "old.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", FMI_1)
    result = swap(system, tmp_path / "old.fmu")
    assert result.swapped is None
    first, *others = lines(result)
    assert re.match("blocks system plant: .*old.fmu: is FMI 1.0, for co-simulation", first)
    assert "notes missing mass: parameter is missing" in others


@pytest.mark.parametrize(
    ("theirs", "ours", "refused"),
    [
        ((None, None), (None, None), False),
        ((1e-3, None), (None, None), True),
        ((None, 0.01), (None, None), True),
        ((1e-3, None), (1e-3, 0.0), False),
        ((None, None), (1e-3, None), True),
    ],
)
def test_a_system_file_whose_connections_pass_on_other_values_is_refused(
    theirs, ours, refused, system
):
    def scaled(by):
        return replace(system, connections=(FORCE_CONNECTION, Connection(GAP, POSITION, *by)))

    line = r"^loop.toml: plant.gap -> spring.position: has factor = .*; must be units of its"
    with pytest.raises(InputError, match=line) if refused else nullcontext():
        found = component_of(scaled(theirs), "plant", scaled(ours))
        assert found == system.components[0]


def test_a_factor_that_is_that_of_the_units_is_as_good(system, tmp_path):
    write_fmu(tmp_path / "mm.fmu", changed("gap", 'unit="m"', 'unit="mm"'))
    plant = replace(system.components[0], fmu=tmp_path / "mm.fmu")
    connections = (FORCE_CONNECTION, Connection(GAP, POSITION, 0.001))
    other = replace(system, components=(plant, system.components[1]), connections=connections)
    assert component_of(other, "plant", system) == plant
    with pytest.raises(InputError, match="no component 'box'; valid: plant, spring"):
        component_of(other, "box", system)
