"""Parameter sets and mappings: which value holds, in which unit, and what is refused."""

import zipfile

import pytest
from grasp_cosim import InputError, System
from ssp.hand_made import (
    archive,
    bind,
    component,
    connect,
    fmu,
    linear,
    mapping,
    parameter_set,
    structure,
    system,
)

FMU = fmu(
    "parameter Real length 1.0 m",
    "parameter Real ratio 1.0",
    "parameter Integer count 1",
    "parameter Boolean active false",
    "parameter String label none",
    "parameter Enumeration mode 1",
    "input Real u 0.5 m",
    "output Real y - m",
)


def load(folder, inner="", outer="", files=None, connectors="", connections=""):
    top = system("top", component("a", "input u; output y", inner), connections, connectors, outer)
    return System.load(archive(folder, structure(top), {"a": FMU}, files))


def values(folder, inner="", outer="", **more):
    return load(folder, inner, outer, **more).components[0].values  # type: ignore[arg-type]


def given(parameters, mapped="", units=None, **attributes):
    chosen = parameter_set(parameters) if units is None else parameter_set(parameters, units)
    return bind(chosen, mapped, **attributes)


def test_every_type(tmp_path):
    found = values(
        tmp_path,
        given(
            "length Real 2.5; count Integer 3; active Boolean 1; label String text; "
            "mode Enumeration on"
        ),
    )
    assert dict(found) == {
        "length": 2.5,
        "count": 3,
        "active": True,
        "label": "text",
        "mode": 2,
        "u": 0.5,
    }


def test_an_integer_is_taken_for_a_real_and_an_enumeration(tmp_path):
    found = values(tmp_path, given("length Integer 2; mode Integer 2"))
    assert (found["length"], found["mode"]) == (2.0, 2)


def test_a_unit_is_converted_to_that_of_the_variable(tmp_path):
    assert values(tmp_path, given("length Real 250.0 mm"))["length"] == 0.25


def test_the_same_unit_leaves_every_bit(tmp_path):
    assert values(tmp_path, given("length Real 0.1 m"))["length"] == 0.1


def test_an_inline_set_may_name_the_units_of_the_structure(tmp_path):
    assert values(tmp_path, given("length Real 250.0 mm", units=""))["length"] == 0.25


def test_a_set_and_a_mapping_in_files(tmp_path):
    binding = (
        '<ssd:ParameterBinding source="resources/some%20set.ssv">'
        '<ssd:ParameterMapping source="./resources/map.ssm"/></ssd:ParameterBinding>'
    )
    files = {
        "resources/some set.ssv": parameter_set("L Real 250.0 mm"),
        "resources/map.ssm": mapping(("L", "length", linear(2.0, 1.0))),
    }
    # converted to 0.25 m, then 2 * 0.25 + 1
    assert load(tmp_path, binding, files=files).components[0].values["length"] == 1.5


def test_a_set_in_the_fmu_of_the_component(tmp_path):
    binding = (
        '<ssd:ParameterBinding source="resources/own.ssv" sourceBase="component">'
        '<ssd:ParameterMapping source="resources/map.ssm"/></ssd:ParameterBinding>'
    )
    inner = tmp_path / "inner.zip"
    with zipfile.ZipFile(inner, "w") as file:
        file.writestr("modelDescription.xml", FMU)
        file.writestr("resources/own.ssv", parameter_set("L Real 250.0 mm"))
    top = system("top", component("a", "input u", binding))
    files = {
        "resources/a.fmu": inner.read_bytes(),
        "resources/map.ssm": mapping(("L", "length", "")),
    }
    loaded = System.load(archive(tmp_path, structure(top), {}, files))
    assert loaded.components[0].values["length"] == 0.25


def test_a_system_has_no_files_of_its_own(tmp_path):
    binding = '<ssd:ParameterBinding source="resources/own.ssv" sourceBase="component"/>'
    with pytest.raises(InputError, match="'top': sourceBase 'component': must be at a component"):
        load(tmp_path, outer=binding)


def test_a_later_binding_goes_before_an_earlier_one(tmp_path):
    assert values(tmp_path, given("length Real 2") + given("length Real 3"))["length"] == 3.0


def test_the_system_goes_before_the_component(tmp_path):
    outer = given("a.length Real 7")
    assert values(tmp_path, given("length Real 2"), outer)["length"] == 7.0


def test_a_prefix_is_put_before_the_names(tmp_path):
    assert values(tmp_path, outer=given("length Real 7", prefix="a."))["length"] == 7.0


def test_a_mapping_sees_the_names_with_the_prefix(tmp_path):
    outer = given("L Real 7", mapping(("p_L", "a.length", "")), prefix="p_")
    assert values(tmp_path, outer=outer)["length"] == 7.0


def test_with_a_mapping_only_what_is_mapped_is_applied(tmp_path):
    mapped = mapping(("L", "length", ""), ("L", "ratio", ""), ("none", "count", ""))
    loaded = load(tmp_path, given("L Real 3; active Boolean true", mapped))
    assert dict(loaded.components[0].values) == {"length": 3.0, "ratio": 3.0, "u": 0.5}
    assert any("parameter 'active': not in the mapping; not used" in n for n in loaded.notes)
    assert any("no parameter 'none'; not used" in n for n in loaded.notes)


def test_a_mapping_without_units(tmp_path):
    mapped = mapping(("L", "length", linear(0.5)), suppress=True)
    assert values(tmp_path, given("L Real 250 mm", mapped))["length"] == 125.0


TABLES = [
    ("active", "x Boolean false", "Boolean", {"false": "true"}, True),
    ("count", "x Integer 1", "Integer", {"1": "5", "2": "6"}, 5),
    ("mode", "x Enumeration high", "Enumeration", {"low": "off", "high": "on"}, 2),
]


@pytest.mark.parametrize(("target", "parameter", "kind", "table", "expected"), TABLES)
def test_mappings_by_table(tmp_path, target, parameter, kind, table, expected):
    entries = "".join(f'<ssc:MapEntry source="{s}" target="{t}"/>' for s, t in table.items())
    change = f"<ssc:{kind}MappingTransformation>{entries}</ssc:{kind}MappingTransformation>"
    mapped = mapping(("x", target, change))
    assert values(tmp_path, given(parameter, mapped))[target] == expected


def test_a_value_at_a_connector_of_the_system_follows_the_connections(tmp_path):
    # 3 mm at the connector are 0.003 m at the variable, then doubled
    found = values(
        tmp_path,
        outer=given("in Real 3"),
        connectors="input in Real mm",
        connections=connect("in", "a/u", linear(2.0)),
    )
    assert found["u"] == pytest.approx(0.006, rel=1e-15)


def test_a_parameter_of_the_system_is_passed_on_to_its_component(tmp_path):
    top = system(
        "top",
        component("a", "parameter active"),
        connect("on", "a/active"),
        "parameter on Boolean",
        given("on Boolean true"),
    )
    loaded = System.load(archive(tmp_path, structure(top), {"a": FMU}))
    assert loaded.components[0].values["active"] is True


def test_names_in_nested_systems(tmp_path):
    inner = system("sub", component("a"), bindings=given("a.length Real 2; a.ratio Real 3"))
    top = system("top", inner, bindings=given("sub.a.length Real 5"))
    found = System.load(archive(tmp_path, structure(top), {"a": FMU})).components[0].values
    assert (found["length"], found["ratio"]) == (5.0, 3.0)


def test_what_fits_nothing_is_said(tmp_path):
    loaded = load(tmp_path, given("lenght Real 2"))
    assert any("parameter 'lenght': nothing of that name to give it to" in n for n in loaded.notes)


def test_a_start_value_of_a_connected_input_is_not_used_and_said(tmp_path):
    loaded = load(tmp_path, given("u Real 9"), connections=connect("a/y", "a/u"))
    assert "u" not in loaded.components[0].values
    assert any("parameter 'u': a.u is connected to a.y; not used" in n for n in loaded.notes)


def test_an_input_that_is_not_connected_keeps_its_start_value(tmp_path):
    loaded = load(tmp_path)
    assert dict(loaded.components[0].values) == {"u": 0.5}
    assert "input a.u is not connected; keeps its start value 0.5" in loaded.notes


def passed_on(folder, outer, inner, unit=""):
    """Of the component a, `length` is twice the system's parameter p, by a connection."""
    top = system(
        "top",
        component("a", "parameter length", inner),
        connect("p", "a/length", linear(2.0)),
        f"parameter p Real {unit}" if unit else "parameter p",
        outer,
    )
    return System.load(archive(folder, structure(top), {"a": FMU}))


@pytest.mark.parametrize(
    ("outer", "inner"),
    [
        (given("p Real 3"), given("length Real 7")),
        (given("p Real 3; a.length Real 8"), given("length Real 7")),
        (given("p Real 3") + given("a.length Real 8"), ""),
        (given("p Real 3000 mm"), given("length Real 7")),
    ],
)
def test_a_value_by_a_connection_goes_before_all_bindings(tmp_path, outer, inner):
    """SSP 1.0.1, 5.3.2: the data flow decides; 5.2.3 ranks bindings among each other only."""
    loaded = passed_on(tmp_path, outer, inner, "m")
    assert loaded.components[0].values["length"] == 6.0
    said = "a.length has the value of p by a connection, which goes before it; not used"
    assert sum(said in note for note in loaded.notes) == 1


def test_a_connection_that_brings_no_value_leaves_the_own(tmp_path):
    loaded = passed_on(tmp_path, "", given("length Real 7"))
    assert loaded.components[0].values["length"] == 7.0
    assert not any("connection" in note for note in loaded.notes)


def test_the_first_value_on_the_way_through_systems_holds(tmp_path):
    sub = system(
        "sub",
        component("a", "parameter length", given("length Real 7")),
        connect("q", "a/length"),
        "parameter q",
        given("q Real 5"),
    )
    for outer, expected in ((given("p Real 3"), 3.0), ("", 5.0), (given("sub.q Real 4"), 4.0)):
        top = system("top", sub, connect("p", "sub/q"), "parameter p", outer)
        loaded = System.load(archive(tmp_path, structure(top), {"a": FMU}))
        assert loaded.components[0].values["length"] == expected


def test_a_name_that_is_given_twice_matters_only_where_it_is_used(tmp_path):
    mapped = mapping(("L", "length", ""))
    found = values(tmp_path, given("L Real 3; x Real 1; x Real 2", mapped))
    assert found["length"] == 3.0
    assert values(tmp_path, given("length Real 3; length Real 3"))["length"] == 3.0


def test_many_mappings_from_nothing_are_one_note(tmp_path):
    mapped = mapping(("L", "length", ""), ("", "ratio", ""), ("", "count", ""), ("", "count", ""))
    notes = load(tmp_path, given("L Real 3", mapped)).notes
    assert sum("no parameter ''; not used (2 such)" in note for note in notes) == 1


TABLE = "<ssc:BooleanMappingTransformation>{}</ssc:BooleanMappingTransformation>".format(
    '<ssc:MapEntry source="true" target="false"/>'
)
REFUSED = [
    (given("y Real 1"), "a.y is output; only inputs and parameters are set"),
    (given("count Real 2.0"), "Real; a.count is Integer, must be the same"),
    (given("active Integer 1"), "Integer; a.active is Boolean, must be the same"),
    (given("length Real NaN"), "length = nan: must be a finite number"),
    (given("length Real 2 N"), "N cannot be converted to m"),
    (given("length Real 2 cm"), "unit 'cm' is not defined; valid: m, mm, N, K, degC"),
    (given("length Binary 00"), "type Binary is not supported; valid: Real, Integer"),
    (given("mode Enumeration up"), "parameter 'mode': mode = 'up': must be one of off, on"),
    (given("length Real 1; length Real 2"), "parameter 'length': there are two; must be one"),
    (
        given("x Real 1", mapping(("x", "length", ""), ("x", "length", ""))),
        "mapping 'x -> length': 'length' has two sources",
    ),
    (
        given("x Boolean true", mapping(("x", "active", linear(2.0)))),
        "Boolean has a linear transformation; must be Real",
    ),
    (
        given("x Boolean false", mapping(("x", "active", TABLE))),
        "False is not in its ssc:BooleanMappingTransformation; valid: True",
    ),
    (
        given("x Integer 1", mapping(("x", "active", TABLE))),
        "Integer has ssc:BooleanMappingTransformation; must be Boolean",
    ),
    (
        '<ssd:ParameterBinding source="resources/x.ssv" sourceBase="component"/>',
        "source 'resources/x.ssv': not in the archive; valid: none",
    ),
    (
        given("x Real 1", type="text/csv"),
        "type 'text/csv' is not supported; must be application/x-ssp-parameter-set",
    ),
    (
        given("x Real 1", source="resources/x.ssv"),
        "must have either a source or an inline ssv:ParameterSet",
    ),
    ("<ssd:ParameterBinding/>", "must have either a source or an inline ssv:ParameterSet"),
    (
        '<ssd:ParameterBinding source="resources/x.ssv"/>',
        "source 'resources/x.ssv': not in the archive; did you mean resources/y.ssv?",
    ),
    (
        '<ssd:ParameterBinding source="https://here/x.ssv"/>',
        "must be the path of a file in the archive",
    ),
    (
        '<ssd:ParameterBinding source="resources/y.ssv"/>',
        "hand.ssp: resources/y.ssv:1: ssd:Wrong: must be ssv:ParameterSet",
    ),
    (
        bind(parameter_set("x Real 1").replace("Parameter name", "Parameter nam")),
        "SystemStructure.ssd:2: against the schema: Element 'ssv:Parameter', attribute 'nam'",
    ),
]


@pytest.mark.parametrize(("binding", "message"), REFUSED)
def test_what_is_refused(tmp_path, binding, message):
    wrong = '<ssd:Wrong xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"/>'
    with pytest.raises(InputError, match=r"hand\.ssp") as error:
        load(tmp_path, binding, files={"resources/y.ssv": wrong})
    assert message in str(error.value)
    assert "\n" not in str(error.value)
