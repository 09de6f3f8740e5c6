"""What a candidate declares otherwise, with model descriptions made by hand."""

import re
import zipfile
from dataclasses import replace
from pathlib import Path

import pytest
from comparison.made import DEPENDENCIES, PLANT, changed, without, write_fmu, write_system
from grasp_cosim.base.errors import InputError
from grasp_cosim.comparison.interface_difference import capability_differences
from grasp_cosim.comparison.qualify import component_of, prepare_swap
from grasp_cosim.interface.interface import Interface, kind_of
from grasp_cosim.system.parts import Condition, Connection, Event, Fault, Initialisation, Port

GAP = Port("plant", "gap")
POSITION = Port("spring", "position")
FORCE_CONNECTION = Connection(Port("spring", "force"), Port("plant", "force"))


@pytest.fixture
def system(tmp_path):
    """A plant and a spring."""
    return write_system(tmp_path)


def swap(system, candidate, **given):
    rename, values = given.get("rename", {}), given.get("values", {})
    return prepare_swap(system, "plant", candidate, rename, values, "none")


def found(swap):
    return [(d.severity, d.kind, d.variable) for d in swap.differences]


def of_variables(system, folder, variables):
    return swap(system, write_fmu(folder / "new" / "candidate.fmu", variables))


def test_a_copy_has_no_difference(system, tmp_path):
    same = of_variables(system, tmp_path, PLANT)
    assert same.differences == ()
    assert same.swapped is not None
    place = same.swapped.component("plant", "test")
    assert place.fmu == tmp_path / "new" / "candidate.fmu"
    assert place.values == {"width": 0.07}
    assert same.system == system


@pytest.mark.parametrize(("declared", "kept"), [("", {"mass": "g"}), (' unit="m"', {})])
def test_a_unit_that_the_system_names_is_for_want_of_a_declared_one(
    declared, kept, system, tmp_path
):
    plant, spring = system.components
    named = replace(system, components=(replace(plant, units={"mass": "g"}), spring))
    variables = changed("mass", 'start="0.5"', f'start="0.5"{declared}')
    swapped = of_variables(named, tmp_path, variables).swapped
    assert swapped is not None
    assert swapped.component("plant", "test").units == kept


ONE = [
    (
        without("gap"),
        ("blocks", "missing", "gap"),
        r"output is connected .*; valid: touching, s",
    ),
    (without("force"), ("blocks", "missing", "force"), r"input is connected .*missing.*: none"),
    (
        without("width"),
        ("warns", "missing", "width"),
        r"parameter is set to 0.07 in .*left out",
    ),
    (without("spare"), ("warns", "missing", "spare"), r"^output is missing$"),
    (without("mass"), ("notes", "missing", "mass"), r"^parameter is missing$"),
    (without("inner"), ("", "", ""), ""),
    (
        {**PLANT, "more": 'causality="output" | Real'},
        ("notes", "extra", "more"),
        r"^new output$",
    ),
    (
        {**PLANT, "more": 'causality="input" | Real start="1"'},
        ("blocks", "extra", "more"),
        r"new input without a source; .*--set 'plant.more=VALUE'",
    ),
    (
        changed("gap", 'Real unit="m" nominal="0.1"', "Integer"),
        ("blocks", "type", "gap"),
        r"is Integer, must be Real",
    ),
    (
        {**PLANT, "spare": 'causality="output" variability="discrete" | Integer'},
        ("warns", "type", "spare"),
        r"is Integer, must be Real",
    ),
    (changed("gap", "output", "local"), ("blocks", "causality", "gap"), r"a local, must be an out"),
    (
        changed("force", 'causality="input"', 'causality="parameter" variability="fixed"'),
        ("blocks", "causality", "force"),
        r"is a parameter, must be an input",
    ),
    (
        changed("mass", 'causality="parameter" variability="tunable"', 'causality="input"'),
        ("blocks", "causality", "mass"),
        r"is an input, must be a parameter, or have a value: --set 'plant.mass=VALUE'",
    ),
    (
        changed("touching", ' variability="discrete" | Boolean', " | Real"),
        ("warns", "type", "touching"),
        r"is Real, must be Boolean",
    ),
    (
        changed("gap", 'causality="output"', 'causality="output" variability="discrete"'),
        ("warns", "variability", "gap"),
        r"is discrete instead of continuous",
    ),
    (
        changed("mass", "tunable", "fixed"),
        ("notes", "variability", "mass"),
        r"is fixed instead of tunable",
    ),
    (
        changed("gap", '"m"', '"N"'),
        ("blocks", "unit", "gap"),
        r"is in N, which cannot be converted to",
    ),
    (changed("spare", '"m"', '"N"'), ("warns", "unit", "spare"), r"is in N, which cannot be"),
    (changed("gap", '"m"', '"mm"'), ("warns", "unit", "gap"), r"^unit mm instead of m: converted$"),
    (changed("gap", '"m"', '"metre"'), ("notes", "unit", "gap"), r"metre .* m, which is the same$"),
    (
        changed("gap", ' unit="m"', ""),
        ("warns", "unit", "gap"),
        r"unit not declared instead of m: taken as the same",
    ),
    (
        changed("mass", 'start="0.5"', 'start="0.5" unit="1"'),
        ("notes", "unit", "mass"),
        r"unit 1 instead of not declared: taken as the same",
    ),
    (
        changed("width", 'max="1"', 'max="0.06"'),
        ("blocks", "range", "width"),
        r"value 0.07 m is set in the system; must be 0 to 0.06 m",
    ),
    (
        changed("width", 'max="1"', 'max="0.08"'),
        ("warns", "range", "width"),
        r"takes 0 to 0.08 m instead of 0 to 1 m",
    ),
    (changed("width", 'max="1"', 'max="2"'), ("", "", ""), ""),
    (
        changed("gap", "nominal", 'min="0" nominal'),
        ("notes", "range", "gap"),
        r"takes 0 to inf m instead of -inf to inf m",
    ),
    (
        changed("mass", "0.5", "0.6"),
        ("warns", "start", "mass"),
        r"starts with 0.6 instead of 0.5$",
    ),
    (changed("width", "0.05", "0.06"), ("", "", ""), ""),
    (changed("force", 'start="0"', 'start="1"'), ("notes", "start", "force"), r"with 1 N instead "),
    (changed("name", '"a"', '"b"'), ("warns", "start", "name"), r"starts with b instead of a$"),
]


@pytest.mark.parametrize(("variables", "expected", "text"), ONE)
def test_one_difference(system, tmp_path, variables, expected, text):
    result = of_variables(system, tmp_path, variables)
    assert found(result) == ([expected] if any(expected) else [])
    assert (result.swapped is None) == (expected[0] == "blocks")
    assert all(re.search(text, d.text) for d in result.differences), result.differences


def test_all_differences_are_found_at_once_the_worst_first(system, tmp_path):
    variables = {n: t for n, t in PLANT.items() if n not in ("gap", "width", "mass")}
    variables["spare"] = 'causality="output" | Integer'
    result = of_variables(system, tmp_path, variables)
    assert found(result) == [
        ("blocks", "missing", "gap"),
        ("warns", "type", "spare"),
        ("warns", "missing", "width"),
        ("notes", "missing", "mass"),
    ]


def test_a_value_in_another_unit_is_converted(system, tmp_path):
    text = PLANT["width"].replace('"m"', '"mm"').replace("0.05", "50").replace('"1"', '"1000"')
    result = of_variables(system, tmp_path, {**PLANT, "width": text})
    assert [d.text for d in result.differences] == ["unit mm instead of m: 0.07 m becomes 70 mm"]
    assert result.swapped is not None
    value = result.swapped.component("plant", "test").values["width"]
    assert value == pytest.approx(70.0)


def test_a_range_and_a_value_are_compared_in_the_candidates_unit(system, tmp_path):
    text = PLANT["width"].replace('"m"', '"mm"').replace("0.05", "50").replace('"1"', '"60"')
    result = of_variables(system, tmp_path, {**PLANT, "width": text})
    assert found(result)[0] == ("blocks", "range", "width")
    assert "value 70 mm is set in the system; must be 0 to 60 mm" in result.differences[0].text


@pytest.mark.parametrize(
    "more",
    [
        {"events": (Event({Port("plant", "mass"): 0.6}, when=Condition(GAP, "<", 0.01)),)},
        {"faults": (Fault(Port("spring", "position"), "bias", {"value": 0.1}),)},
        {"connections": (Connection(GAP, Port("spring", "position"), 2.0, 0.0), FORCE_CONNECTION)},
    ],
)
def test_numbers_that_the_system_states_in_the_originals_unit(system, tmp_path, more):
    result = of_variables(replace(system, **more), tmp_path, changed("gap", '"m"', '"mm"'))
    assert found(result) == [("blocks", "unit", "gap")]
    assert "is meant in m" in result.differences[0].text


def test_the_algebraic_loop_that_a_candidate_closes(system, tmp_path):
    path = write_fmu(tmp_path / "c.fmu", dependencies={**DEPENDENCIES, "gap": ["force"]})
    result = swap(system, path)
    assert found(result) == [("warns", "dependency", "gap")]
    assert result.differences[0].text == (
        "depends directly on force: an algebraic loop "
        "plant.gap -> spring.position -> spring.force -> plant.force -> plant.gap"
    )
    refused = replace(system, initialisation=Initialisation("refuse"))
    assert found(swap(refused, path)) == [("blocks", "dependency", "gap")]


def test_a_direct_dependence_that_is_gone(system, tmp_path):
    spring = {
        "position": 'causality="input" | Real start="0" unit="m"',
        "force": 'causality="output" | Real unit="N"',
    }
    path = write_fmu(tmp_path / "c.fmu", spring, {"force": []})
    result = prepare_swap(system, "spring", path, {}, {}, "none")
    assert found(result) == [("notes", "dependency", "force")]


CAPABILITIES = [
    ('canGetAndSetFMUstate="true"', "0.001", [("notes", "canHandleVariable")]),
    ('canGetAndSetFMUstate="true"', "0.002", [("warns", "canHandleVariable")]),
    ('canHandleVariableCommunicationStepSize="true"', "0.001", [("warns", "canGetAndSetFMUstate")]),
    (
        'canHandleVariableCommunicationStepSize="true" canGetAndSetFMUstate="true" '
        'needsExecutionTool="true" canBeInstantiatedOnlyOncePerProcess="true"',
        "0.001",
        [("warns", "needsExecutionTool"), ("warns", "canBeInstantiatedOnlyOncePerProcess")],
    ),
]


@pytest.mark.parametrize(("flags", "step", "expected"), CAPABILITIES)
def test_capabilities(system, tmp_path, flags, step, expected):
    result = swap(system, write_fmu(tmp_path / "c.fmu", capabilities=flags, step=step))
    assert [d.kind for d in result.differences] == ["capability"] * len(expected)
    for difference, (severity, flag) in zip(result.differences, expected, strict=True):
        assert difference.severity == severity
        assert difference.variable.startswith(flag)


def test_a_candidate_for_model_exchange_is_noted(system, tmp_path):
    path = write_fmu(tmp_path / "c.fmu", kind="ModelExchange", capabilities="")
    (difference, *_) = [d for d in swap(system, path).differences if d.severity == "notes"]
    assert difference.text == "is for model exchange, and is integrated by CVode here"


def able(version, **flags):
    return Interface(Path("x.fmu"), "", "x", (), version, capabilities=flags)


def test_fmi_3_names_of_capabilities_are_those_of_fmi_2():
    two = able("2.0", canGetAndSetFMUstate=True, providesDirectionalDerivative=True)
    three = able("3.0", canGetAndSetFMUState=True, providesDirectionalDerivatives=True)
    assert [d.variable for d in capability_differences(two, three, 1e-3)] == ["fmiVersion"]


@pytest.mark.parametrize(("internal", "fits"), [(1e-4, True), (1e-3, True), (3e-4, False)])
def test_a_fixed_internal_step_must_divide_the_step(internal, fits):
    candidate = able("3.0", fixedInternalStepSize=internal)
    found = list(capability_differences(able("3.0"), candidate, 1e-3))
    assert [d.severity for d in found] == ([] if fits else ["warns"])


def test_types_of_fmi_3_are_those_of_fmi_2():
    assert kind_of("Float64") == kind_of("Real") == kind_of("Float32") == "Real"
    assert kind_of("Int8") == kind_of("UInt64") == kind_of("Enumeration") == kind_of("Integer")
    assert len({kind_of(t) for t in ("Real", "Integer", "Boolean", "String", "Clock")}) == 5


def test_renamed_variables_are_compared_by_the_systems_names(system, tmp_path):
    theirs = {"luft" if n == "gap" else "kraft" if n == "force" else n: t for n, t in PLANT.items()}
    path = write_fmu(tmp_path / "c.fmu", theirs, {"luft": ["kraft"], "touching": (), "spare": ()})
    result = swap(system, path, rename={"gap": "luft", "force": "kraft"})
    assert found(result) == [("warns", "dependency", "gap")]
    assert result.differences[0].candidate == ["force"]


def test_values_go_to_the_system_that_has_the_variable(system, tmp_path):
    theirs = {
        **changed("width", '"m"', '"mm"'),
        "heat": 'causality="input" | Real start="0" unit="K"',
    }
    theirs["width"] = theirs["width"].replace('max="1"', 'max="1000"')
    path = write_fmu(tmp_path / "c.fmu", theirs)
    result = swap(system, path, values={"plant.width": "0.08", "plant.heat": "290"})
    assert result.system.component("plant", "test").values == {"width": 0.08}
    assert result.swapped is not None
    values = result.swapped.component("plant", "test").values
    assert values == {"width": pytest.approx(80.0), "heat": 290.0}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"rename": {"gap": "luft"}}, r"^rename: 'gap' = 'luft': c.fmu has no variable 'luft'"),
        ({"rename": {"luft": "gap"}}, r"^rename: 'luft' = 'gap': the original has no variable"),
        ({"rename": {"gap": "spare"}}, r"^rename: 'gap' = 'spare': c.fmu has a variable 'gap'"),
        ({"values": {"plant.widht": 1.0}}, r"^--set plant.widht: plant.fmu has no input or par"),
        (
            {"values": {"plnt.width": 1.0}},
            r"^--set plnt.width: no component 'plnt'; did you mean",
        ),
        ({"values": {"plant.width": 2.0}}, r"width = 2.0: must be a finite number from 0 to 1 m"),
    ],
)
def test_a_wrong_input_is_one_line(system, tmp_path, given, message):
    with pytest.raises(InputError, match=message):
        swap(system, write_fmu(tmp_path / "c.fmu"), **given)


FMI_1 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="1.0" modelName="Old" modelIdentifier="old" guid="{1}"
    numberOfContinuousStates="0" numberOfEventIndicators="0">
  <ModelVariables>
    <ScalarVariable name="force" valueReference="0" causality="input"><Real start="0"/>
    </ScalarVariable>
    <ScalarVariable name="gap" valueReference="1" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="width" valueReference="2" variability="parameter" causality="internal">
      <Real start="0.05"/></ScalarVariable>
  </ModelVariables>
  <Implementation><CoSimulation_StandAlone><Capabilities/></CoSimulation_StandAlone>
  </Implementation>
</fmiModelDescription>"""


def test_what_the_system_refuses_blocks_in_its_words(system, tmp_path):
    """FMI 1.0 is described all the same."""
    with zipfile.ZipFile(tmp_path / "old.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", FMI_1)
    result = swap(system, tmp_path / "old.fmu")
    assert result.swapped is None
    assert found(result)[0] == ("blocks", "system", "plant")
    assert "old.fmu: is FMI 1.0, for co-simulation" in result.differences[0].text
    assert {("notes", "missing", "mass"), ("warns", "unit", "gap")} <= set(found(result))


def test_wrong_components_and_candidates(system, tmp_path):
    with pytest.raises(InputError, match=r"^--as hand: no component 'hand'; valid: plant, spring"):
        prepare_swap(system, "hand", tmp_path / "plant.fmu", {}, {}, "none")
    with pytest.raises(InputError, match=r"none.fmu: no such FMU file"):
        swap(system, tmp_path / "none.fmu")
    (tmp_path / "text.fmu").write_text("no archive")
    with pytest.raises(InputError, match=r"text.fmu: not a readable FMU"):
        swap(system, tmp_path / "text.fmu")


@pytest.mark.parametrize(
    ("theirs", "ours", "refused"),
    [
        ((None, None), (None, None), False),
        ((1e-3, None), (None, None), True),
        ((None, 0.01), (None, None), True),
        ((1.0, None), (None, None), False),
        ((1e-3, None), (1e-3, 0.0), False),
        ((None, None), (1e-3, None), True),
    ],
)
def test_a_system_file_whose_connections_pass_on_other_values_is_refused(
    theirs, ours, refused, system
):
    def scaled(by):
        return replace(system, connections=(FORCE_CONNECTION, Connection(GAP, POSITION, *by)))

    if refused:
        line = r"^loop.toml: plant.gap -> spring.position: has factor = .*; must be units of its"
        with pytest.raises(InputError, match=line):
            component_of(scaled(theirs), "plant", scaled(ours))
    else:
        assert component_of(scaled(theirs), "plant", scaled(ours)) == system.components[0]


def test_a_factor_that_is_that_of_the_units_is_as_good(system, tmp_path):
    write_fmu(tmp_path / "mm.fmu", changed("gap", 'unit="m"', 'unit="mm"'))
    plant = replace(system.components[0], fmu=tmp_path / "mm.fmu")
    theirs = Connection(GAP, POSITION, 0.001)
    other = replace(
        system,
        components=(plant, system.components[1]),
        connections=(FORCE_CONNECTION, theirs),
    )
    assert component_of(other, "plant", system) == plant
    with pytest.raises(InputError, match="no component 'box'; valid: plant, spring"):
        component_of(other, "box", system)
