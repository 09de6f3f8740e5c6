"""SSP 2.0: what it shares with 1.0 is read, what it adds is left out or refused by name."""

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.system.parts import Connection, Port
from ssp.hand_made import (
    archive,
    bind,
    component,
    connect,
    fmu,
    linear,
    parameter_set,
    structure,
    system,
)

FMU = fmu(
    "parameter Real length 1.0 m",
    "parameter Integer count 1",
    "parameter String label none",
    "input Real u 0.5 m",
    "output Real y - m",
)
ELEMENT = component("a", "input u Float64 m; output y Float32; structuralParameter count Int32")


def load(folder, top, **more):
    return System.load(archive(folder, structure(top, version="2.0", **more), {"a": FMU, "b": FMU}))


def values(parameters):
    """Its units may be those of the structure."""
    return bind(parameter_set(parameters, units="").replace('version="1.0"', 'version="2.0"'))


def test_connections_units_and_transformations_are_those_of_1(tmp_path):
    parts = ELEMENT + component("b", "input u Float64 mm".replace(" mm", " m"))
    loaded = load(tmp_path, system("top", parts, connect("a/y", "b/u", linear(2.0, 1.0))))
    assert loaded.connections == (Connection(Port("a", "y"), Port("b", "u"), 2.0, 1.0),)
    assert loaded.notes[0] == (
        "hand.ssp: SystemStructure.ssd: of SSP 2.0, read as far as it is shared with 1.0"
    )


def test_types_with_a_width_are_those_of_1(tmp_path):
    given = values("length Float64 250 mm; count UInt16 3")
    found = load(tmp_path, system("top", component("a", bindings=given))).components[0].values
    assert (found["length"], found["count"]) == (0.25, 3)


def test_one_value_of_a_list_is_the_value(tmp_path):
    text = values("label String x").replace(
        '<ssv:String value="x"/>', '<ssv:String><ssv:Value value="two words"/></ssv:String>'
    )
    loaded = load(tmp_path, system("top", component("a", bindings=text)))
    assert loaded.components[0].values["label"] == "two words"


def test_what_has_no_meaning_for_a_run_is_left_out_and_said(tmp_path):
    top = system("top", component("a", "input u; local state Float64; unspecified flange"))
    top = top.replace(
        'name="u" kind="input">',
        'name="u" kind="input"><ssd:ConnectorGeometry x="0" y="0.5" systemInnerX="0.1"/>',
    )
    after = '<ssd:DefaultExperiment stopTime="1"/><ssc:MetaData kind="general" type="text/xml"/>'
    notes = load(tmp_path, top, experiment=after).notes
    for said in (
        "MetaData is not used",
        "'state': a connector of kind 'local' is not used",
        "'flange': a connector of kind 'unspecified' is not used",
    ):
        assert any(said in note for note in notes), said


@pytest.mark.parametrize(
    ("top", "message"),
    [
        (
            system("top", component("a", "input u Real")).replace(
                "<ssc:Real/>", '<ssc:Real/><ssc:Dimension size="3"/>'
            ),
            "'u': Dimension: arrays of SSP 2.0 are not supported; must be scalar",
        ),
        (
            system("top", component("a", "input u Clock")),
            "'u': Clock: clocks of SSP 2.0 are not supported",
        ),
        (
            system("top", ELEMENT, connect("a/y", "a/u", startIndices="1")),
            "startIndices: elements of arrays of SSP 2.0 are not supported",
        ),
        (
            system("top", component("a", "input u; local y"), connect("a/y", "a/u")),
            "connector 'y': kind 'local' of SSP 2.0 is not supported on a connection",
        ),
        (
            system("top", component("a", bindings=values("label String x"))).replace(
                '<ssv:String value="x"/>',
                '<ssv:String><ssv:Value value="x"/><ssv:Value value="y"/></ssv:String>',
            ),
            "arrays of SSP 2.0 are not supported; must be one Value",
        ),
        (
            system("top", component("a", bindings=values("length Float64 1"))).replace(
                'value="1"', 'value="1 2 3"'
            ),
            "against the schema: Element 'ssv:Real', attribute 'value': '1 2 3' is not a valid",
        ),
        (
            system("top", component("a", implementation="ScheduledExecution")),
            "The value 'ScheduledExecution' is not an element of the set",
        ),
        (
            system("top", component("a").replace('source="resources/a.fmu"', "")),
            "Element 'ssd:Component': The attribute 'source' is required but missing",
        ),
    ],
)
def test_what_is_refused(tmp_path, top, message):
    with pytest.raises(InputError, match=r"^hand\.ssp: SystemStructure.ssd:\d+: ") as error:
        load(tmp_path, top)
    assert message in str(error.value)
    assert "\n" not in str(error.value)
