"""What native FMUs say of themselves: in FMI 2.0 what those in Python say, in FMI 3.0 the same."""

import re
from pathlib import Path
from typing import Any, Literal
from xml.etree.ElementTree import Element, fromstring

import fmpy
import pytest
from grasp_fmus.model_description import Description, model_description
from grasp_fmus.native.description import build_description, native_description
from grasp_fmus.variable import Variable
from lxml import etree  # type: ignore[import-untyped]
from support.kinds import TRANSLATED

SCHEMA = Path(fmpy.__file__).parent / "schema"
VERSIONS: tuple[Literal[2, 3], ...] = (2, 3)


def described(name: str) -> Description:
    from grasp_fmus.package import shipped_model

    return shipped_model(name).description


def plain(element: Element) -> Any:
    """An element with all in it, without the white space."""
    return element.tag, dict(element.attrib), [plain(child) for child in element]


def valid(text: bytes, schema: str) -> None:
    etree.XMLSchema(file=str(SCHEMA / schema)).assertValid(etree.fromstring(text))


@pytest.mark.parametrize("name", TRANSLATED)
def test_in_fmi_2_it_differs_in_what_it_is_made_of(name: str) -> None:
    d = described(name)
    python, native = (
        fromstring(model_description(d, "G")),
        fromstring(native_description(d, "G", 2)),
    )
    assert "pythonfmu" in (python.attrib.pop("generationTool"))
    assert native.attrib.pop("generationTool") == "grasp-cosim"
    ours, theirs = native[0], python[0]
    for name_ in ("needsExecutionTool", "canNotUseMemoryManagementFunctions"):
        assert (ours.attrib.pop(name_), theirs.attrib.pop(name_)) == ("false", "true")
    (files,) = ours
    assert plain(files) == ("SourceFiles", {}, [("File", {"name": f"{name}.c"}, [])])
    ours.remove(files)
    assert plain(native) == plain(python)


@pytest.mark.parametrize("name", TRANSLATED)
def test_they_are_valid(name: str) -> None:
    d = described(name)
    valid(native_description(d, "G", 2), "fmi2/fmi2ModelDescription.xsd")
    valid(native_description(d, "G", 3), "fmi3/fmi3ModelDescription.xsd")
    for fmi in VERSIONS:
        valid(build_description(name, fmi), "fmi3/fmi3BuildDescription.xsd")


TYPES = {"Real": "Float64", "Boolean": "Boolean", "Integer": "Int32", "Enumeration": "Enumeration"}


@pytest.mark.parametrize("name", TRANSLATED)
def test_in_fmi_3_the_variables_are_the_same_and_then_the_time(name: str) -> None:
    d = described(name)
    two = fromstring(native_description(d, "G", 2)).findall("ModelVariables/ScalarVariable")
    *three, time = fromstring(native_description(d, "G", 3)).findall("ModelVariables/*")
    expected = [(TYPES[v[0].tag], {**v.attrib, **v[0].attrib}) for v in two]
    assert [(v.tag, dict(v.attrib)) for v in three] == expected
    assert (time.tag, time.get("name"), time.get("causality")) == ("Float64", "time", "independent")
    assert int(time.get("valueReference", "")) == len(two)


@pytest.mark.parametrize("name", TRANSLATED)
def test_in_fmi_3_units_types_categories_and_dependencies_are_the_same(name: str) -> None:
    d = described(name)
    two, three = (fromstring(native_description(d, "G", fmi)) for fmi in VERSIONS)
    for part in ("LogCategories", "DefaultExperiment"):
        assert plain(three.find(part)) == plain(two.find(part))  # type: ignore[arg-type]
    units = {u.get("name"): plain(u) for u in two.findall("UnitDefinitions/Unit")}
    ours = {u.get("name"): plain(u) for u in three.findall("UnitDefinitions/Unit")}
    assert ours == {**units, "s": ("Unit", {"name": "s"}, [("BaseUnit", {"s": "1"}, [])])}
    items = [[plain(i) for i in t[0]] for t in two.findall("TypeDefinitions/SimpleType")]
    enumerations = three.findall("TypeDefinitions/EnumerationType")
    assert [[plain(i) for i in t] for t in enumerations] == items
    for section in ("Output", "InitialUnknown"):
        known = [
            (int(u.get("index", "")) - 1, [int(k) - 1 for k in u.get("dependencies", "").split()])
            for u in two.findall(f"ModelStructure/{section}s/Unknown")
        ]
        found = [
            (int(u.get("valueReference", "")), [int(k) for k in u.get("dependencies", "").split()])
            for u in three.findall(f"ModelStructure/{section}")
        ]
        assert found == known != []


@pytest.mark.parametrize("name", TRANSLATED)
@pytest.mark.parametrize("fmi", VERSIONS)
def test_what_hosts_ask_for(name: str, fmi: Literal[2, 3]) -> None:
    root = fromstring(native_description(described(name), "G", fmi))
    assert root.get("guid" if fmi == 2 else "instantiationToken") == "G"
    interface = root.find("CoSimulation")
    assert interface is not None
    assert interface.get("modelIdentifier") == name
    assert interface.get("needsExecutionTool", "false") == "false"
    assert interface.get("canBeInstantiatedOnlyOncePerProcess", "false") == "false"
    experiment = root.find("DefaultExperiment")
    assert experiment is not None
    assert float(experiment.get("stepSize", "0")) > 0.0
    names = [v.get("name", "") for v in root.findall("ModelVariables/*")]
    assert max(map(len, names)) <= 55  # Simulink
    assert len({re.sub(r"\W", "_", name).lower() for name in names}) == len(names)  # ROS, Windows


@pytest.mark.parametrize("fmi", VERSIONS)
def test_how_it_is_built(fmi: Literal[2, 3]) -> None:
    root = fromstring(build_description("Mass", fmi))
    (configuration,) = root.findall("BuildConfiguration")
    (files,) = configuration.findall("SourceFileSet")
    assert (root.get("fmiVersion"), configuration.get("modelIdentifier")) == ("3.0", "Mass")
    assert files.get("language") == "C99"
    assert "-ffp-contract=off" in files.get("compilerOptions", "")
    assert [file.get("name") for file in files] == ["Mass.c"]


def test_the_time_has_a_name_of_its_own() -> None:
    taken = [Variable(name, float, "parameter", start=0.0, variability="fixed")
             for name in ("time", "time_")]  # fmt: skip
    root = fromstring(native_description(Description("Mass", "", taken), "G", 3))
    assert [v.get("name") for v in root.findall("ModelVariables/*")] == ["time", "time_", "time__"]


def test_the_sockets_of_windows_are_linked_on_windows_alone() -> None:
    first, windows = fromstring(build_description("P", 3, networked=True))
    assert first.get("platform") is None
    assert first.find("Library") is None
    assert windows.get("platform") == "x86_64-windows"
    assert [library.get("name") for library in windows.iter("Library")] == ["ws2_32"]
    assert [f.get("name") for f in windows.iter("SourceFile")] == ["P.c"]
