"""Units that an FMU defines, in place of those known by their names."""

import zipfile

import pytest
from grasp_cosim.interface.read import read_interface
from si_units import BASE, Unit, known_unit

LAZY = """<fmiModelDescription fmiVersion="2.0" modelName="lazy" guid="1">
<CoSimulation modelIdentifier="lazy"/>
<UnitDefinitions><Unit name="{name}"><BaseUnit/></Unit></UnitDefinitions>
<ModelVariables><ScalarVariable name="y" valueReference="0" causality="output"><Real unit="{name}"/>
</ScalarVariable></ModelVariables>
<ModelStructure><Outputs><Unknown index="1"/></Outputs></ModelStructure></fmiModelDescription>"""


@pytest.mark.parametrize(
    ("name", "defined"), [("mm", False), ("N", False), ("rad", True), ("%", True), ("cubit", True)]
)
def test_a_definition_without_a_dimension_is_none_of_a_unit_that_has_one(tmp_path, name, defined):
    path = tmp_path / "lazy.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", LAZY.format(name=name))
    interface = read_interface(path)
    assert (name in interface.units) is defined
    found = interface.unit(interface.by_name["y"])
    assert found == (Unit(name, (0,) * len(BASE)) if defined else known_unit(name))
