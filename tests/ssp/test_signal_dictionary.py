"""Signal dictionaries: who is connected to an entry gives it its value, or takes it."""

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.system.parts import Connection, Port
from ssp.hand_made import (
    NAMESPACES,
    UNITS,
    archive,
    component,
    connect,
    connector_list,
    fmu,
    structure,
    system,
)

GIVES, TAKES = fmu("output Real y - m"), fmu("input Real u 0.5 m")
SSB = "http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"
DICTIONARY = (
    f'<ssb:SignalDictionary version="1.0" xmlns:ssb="{SSB}" {NAMESPACES}>'
    '<ssb:DictionaryEntry name="gap"><ssc:Real unit="mm"/></ssb:DictionaryEntry>'
    '<ssb:DictionaryEntry name="on"><ssc:Boolean/></ssb:DictionaryEntry>'
    f"<ssb:Units>{UNITS}</ssb:Units></ssb:SignalDictionary>"
)


def reference(name, connectors, dictionary="bus"):
    return (
        f'<ssd:SignalDictionaryReference name="{name}" dictionary="{dictionary}">'
        f"{connector_list(connectors)}</ssd:SignalDictionaryReference>"
    )


def load(folder, first, second, inline=False, drawn=""):
    """The output through the bus, by one reference in and by another, in a system, out."""
    sub = system(
        "sub", component("b", "input u") + reference("out", second), connect("out/gap", "b/u")
    )
    elements = component("a", "output y") + reference("in", first) + sub
    top = system("top", elements, connect("a/y", "in/gap") + drawn)
    given = (
        f'<ssd:SignalDictionary name="bus">{DICTIONARY}</ssd:SignalDictionary>'
        if inline
        else '<ssd:SignalDictionary name="bus" source="resources/bus.ssb"/>'
    )
    lists = f"<ssd:SignalDictionaries>{given}</ssd:SignalDictionaries>"
    top = top.removesuffix("</ssd:System>") + f"{lists}</ssd:System>"
    files = {} if inline else {"resources/bus.ssb": DICTIONARY}
    return System.load(archive(folder, structure(top), {"a": GIVES, "b": TAKES}, files))


@pytest.mark.parametrize("inline", [True, False])
@pytest.mark.parametrize(
    ("first", "second"),
    [("input gap", "output gap"), ("inout gap Real", "inout gap; inout on Boolean")],
)
def test_a_value_goes_through_the_bus(tmp_path, first, second, inline):
    loaded = load(tmp_path, first, second, inline)
    # m to mm and back to m
    assert loaded.connections == (Connection(Port("a", "y"), Port("sub_b", "u")),)


@pytest.mark.parametrize(
    ("first", "second", "drawn", "message"),
    [
        ("inout gap; inout no", "inout gap", "", "signal dictionary bus has no entry 'no'; valid"),
        (
            "input gap",
            "output gap",
            connect("a/y", "in/gap"),
            "top.<bus>.gap has two sources".removeprefix("top."),
        ),
        ("output gap", "output gap", "", "both give a value; must lead from one that gives"),
        (
            "inout gap; inout on",
            "inout gap",
            connect("in/gap", "in/on"),
            "both may give or take a value; must lead from one that gives",
        ),
    ],
)
def test_what_is_refused(tmp_path, first, second, drawn, message):
    with pytest.raises(InputError, match=r"^hand\.ssp: SystemStructure.ssd:2: ") as error:
        load(tmp_path, first, second, drawn=drawn)
    assert message in str(error.value)
