"""Units as archives in circulation have them: empty, not defined, defined otherwise."""

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.system.parts import Port
from grasp_cosim.system.validity import transforms
from ssp.hand_made import (
    archive,
    bind,
    component,
    connect,
    fmu,
    mapping,
    parameter_set,
    structure,
    system,
)

FMU = fmu(
    "parameter Real length 1.0 m",
    "parameter Real ell 1.0 cubit",
    "parameter Real ratio 1.0",
    "input Real u 0.5 m",
    "output Real y - mm",
)
FAR = '<ssc:Unit name="m"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>'
OTHER = '<ssc:Unit name="m"><ssc:BaseUnit kg="1"/></ssc:Unit>'


def load(folder, elements, *connections, connectors=""):
    top = system("top", elements, "".join(connections), connectors)
    return System.load(archive(folder, structure(top), {"a": FMU, "b": FMU}))


def given(folder, parameters, units="", mapped=""):
    return load(folder, component("a", "", bind(parameter_set(parameters, units), mapped)))


def value(loaded, name):
    return loaded.components[0].values[name]


def note(loaded, said):
    (found,) = (note for note in loaded.notes if said in note)
    return found


def test_an_empty_unit_of_a_connector_is_none_and_said_once(tmp_path):
    parts = component("a", "input u Real ?; output y Real ?") + component("b", "input u Real ?")
    loaded = load(tmp_path, parts.replace('"?"', '""'), connect("a/y", "b/u"))
    assert transforms(loaded)[Port("b", "u")] == (0.001, 0.0)  # by the units of the FMUs
    assert note(loaded, "unit ''").endswith(":2: 'u': unit '' is taken as no unit (2 such)")


def test_an_empty_unit_of_a_value_is_none(tmp_path):
    top = system("top", component("a", "", bind(parameter_set("length Real 2.5 ?"))))
    path = archive(tmp_path, structure(top.replace('"?"', '""')), {"a": FMU})
    loaded = System.load(path)
    assert value(loaded, "length") == 2.5
    assert note(loaded, "parameter 'length': unit '' is taken as no unit")


def test_a_unit_that_is_not_defined_is_the_fmus_of_that_name(tmp_path):
    top = system("top", component("a", "", bind(parameter_set("ell Real 3.0 cubit"))))
    loaded = System.load(archive(tmp_path, structure(top), {"a": FMU}))
    assert value(loaded, "ell") == 3.0
    assert note(loaded, "parameter 'ell': unit 'cubit' is not defined; taken as the FMU's")


def test_a_unit_that_is_not_defined_says_nothing_of_a_variable_without(tmp_path):
    loaded = given(tmp_path, "ratio Real 3.0 [m]")
    assert value(loaded, "ratio") == 3.0
    assert note(loaded, "unit '[m]' is not defined, and a.ratio has none; taken as it is")


def test_a_unit_that_is_not_defined_matters_only_where_it_is_used(tmp_path):
    """Sets of other tools hold hundreds of values, of which a mapping takes a few."""
    mapped = mapping(("L", "length", ""))
    loaded = given(tmp_path, "L Real 2 m; W Real 3 [m]; H Real 4 ells; Z Real 1 [m]", mapped=mapped)
    assert dict(loaded.components[0].values) == {"length": 2.0, "u": 0.5}
    assert note(loaded, "parameter 'W': not in the mapping; not used (3 such)")


@pytest.mark.parametrize("units", [FAR, OTHER])
def test_a_unit_of_the_fmus_name_is_the_fmus_however_it_is_defined(tmp_path, units):
    loaded = given(tmp_path, "length Real 2.5 m", units)
    assert value(loaded, "length") == 2.5
    assert note(loaded, "parameter 'length': unit 'm' is defined otherwise by the FMU, whose")


def test_the_same_of_a_connector(tmp_path):
    top = system(
        "top",
        component("a", "output y Real mm") + component("b", "input u Real m"),
        connect("a/y", "b/u"),
    )
    ssd = structure(top).replace('<ssc:BaseUnit m="1" factor="0.001"/>', '<ssc:BaseUnit kg="1"/>')
    loaded = System.load(archive(tmp_path, ssd, {"a": FMU, "b": FMU}))
    assert transforms(loaded)[Port("b", "u")] == (0.001, 0.0)
    assert note(loaded, "connector 'y': unit 'mm' is defined otherwise by the FMU, whose")


def test_a_connector_of_the_fmus_unit_needs_no_definition(tmp_path):
    top = system("top", component("a", "parameter ell Real cubit"))
    loaded = System.load(archive(tmp_path, structure(top), {"a": FMU}))
    assert note(loaded, "'ell': unit 'cubit' is not defined; taken as the FMU's")


def test_a_connector_of_a_system_is_in_a_unit_that_is_known_by_its_name(tmp_path):
    top = system(
        "top",
        component("a", "input u"),
        connect("in", "a/u"),
        "input in Real cm",
        bind(parameter_set("in Real 3")),
    )
    loaded = System.load(archive(tmp_path, structure(top), {"a": FMU}))
    assert value(loaded, "u") == pytest.approx(0.03, rel=1e-15)
    assert note(loaded, "'in': unit 'cm' is not defined; known by its name")


@pytest.mark.parametrize(
    ("elements", "connectors", "message"),
    [
        (component("a", "", bind(parameter_set("length Real 2 ells"))), "", "unit 'ells' is not"),
        (component("a", "", bind(parameter_set("length Real 2 cm"))), "", "unit 'cm' is not"),
        (component("a", "input u Real ells"), "", "'u': unit 'ells' is not defined; valid: m, "),
        (component("a", "parameter ratio Real ells"), "", "'ratio': unit 'ells' is not defined"),
        (component("a"), "input in Real ells", "'in': unit 'ells' is not defined; valid: m, mm"),
    ],
)
def test_units_that_are_refused(tmp_path, elements, connectors, message):
    with pytest.raises(InputError, match=r"^hand\.ssp: SystemStructure.ssd:2: ") as error:
        load(tmp_path, elements, connectors=connectors)
    assert message in str(error.value)
