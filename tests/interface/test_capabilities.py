"""All capabilities of an FMU with their defaults, beside the schemas of the standard."""

from pathlib import Path

import fmpy
import pytest
from grasp_cosim.interface.fmi_types import typed
from grasp_cosim.interface.obstacles import NUMERIC_CAPABILITIES
from grasp_cosim.interface.read import describe
from lxml import etree
from ssp.hand_made import described

SCHEMAS = Path(fmpy.__file__).with_name("schema")
XSD = {"x": "http://www.w3.org/2001/XMLSchema"}
KINDS = ("CoSimulation", "ModelExchange", "ScheduledExecution")


def attributes(schema, path):
    """The attributes that a schema has at a path, each with its default value."""
    found = etree.parse(str(SCHEMAS / schema)).xpath(path, namespaces=XSD)
    return {a.get("name"): a.get("default") for a in found}


def defaults(version, kind):
    """The capabilities of the schema, as values."""
    if version == "2.0":
        inside = "//x:attribute[not(ancestor::x:element[@name='File'])]"
        texts = attributes("fmi2/fmi2ModelDescription.xsd", f"//x:element[@name='{kind}']{inside}")
    else:
        schema, of_type = (
            "fmi3/fmi3InterfaceType.xsd",
            "//x:complexType[@name='fmi3{}']//x:attribute",
        )
        texts = attributes(schema, of_type.format("InterfaceType"))
        texts |= attributes(schema, of_type.format(kind))
    del texts["modelIdentifier"]
    return {
        flag: typed(NUMERIC_CAPABILITIES.get(flag, "Boolean"), text) for flag, text in texts.items()
    }


def read(folder, version, kinds, more=""):
    token = "guid" if version == "2.0" else "instantiationToken"
    elements = "".join(f'<{kind} modelIdentifier="m" {more}/>' for kind in kinds)
    text = (
        f'<fmiModelDescription fmiVersion="{version}" modelName="m" {token}="1">{elements}'
        "<ModelVariables/></fmiModelDescription>"
    )
    return describe(described(folder / "x.fmu", text))


@pytest.mark.parametrize(
    ("version", "kind"),
    [
        *(("2.0", kind) for kind in KINDS[:2]),
        *(("3.0", kind) for kind in KINDS),
    ],
)
def test_what_is_not_declared_has_its_default(tmp_path, version, kind):
    assert read(tmp_path, version, [kind]).capabilities == defaults(version, kind)


def test_each_kind_has_all_of_its_own(tmp_path):
    more = 'canGetAndSetFMUState="true"'
    found = read(tmp_path, "3.0", ["CoSimulation", "ModelExchange"], more).capabilities
    first, later = (defaults("3.0", kind) for kind in ("CoSimulation", "ModelExchange"))
    later = {f"{flag} (model exchange)": value for flag, value in later.items()}
    changed = {"canGetAndSetFMUState": True, "canGetAndSetFMUState (model exchange)": True}
    assert found == first | later | changed
