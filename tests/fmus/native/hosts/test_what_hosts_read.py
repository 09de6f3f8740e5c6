"""modelDescription.xml of native FMUs: what hosts require is there, what they trip over is not."""

import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import pytest
from support.c_host import Host as CHost
from support.c_host import Script, Unpacked, bits
from support.hosts import Parts
from support.kinds import TRANSLATED
from support.platforms import needs_programs

PartsOf = Callable[[int], Parts]


pytestmark = needs_programs("gcc")


@pytest.fixture(params=TRANSLATED)
def fmu(request: pytest.FixtureRequest, parts: Parts) -> Unpacked:
    return parts[request.param].fmu


@pytest.fixture
def root(fmu: Unpacked) -> Element:
    return ElementTree.parse(fmu.folder / "modelDescription.xml").getroot()


def variables(root: Element) -> list[dict[str, str]]:
    """The attributes of each, those of its type included."""
    found = root.find("ModelVariables")
    assert found is not None
    return [{**(v[0].attrib if len(v) else {}), **v.attrib, "type": (v[0] if len(v) else v).tag}
            for v in found]  # fmt: skip


def test_runs_without_a_tool(root: Element) -> None:
    """Beckhoff, VeriStand and PyFMI refuse what needs one."""
    simulation = root.find("CoSimulation")
    assert simulation is not None
    assert simulation.get("needsExecutionTool", "false") == "false"
    assert simulation.get("canBeInstantiatedOnlyOncePerProcess", "false") == "false"
    assert root.find("ModelExchange") is None


def test_states_are_there_for_going_back(root: Element) -> None:
    """Simulink's fast restart needs both."""
    simulation = root.find("CoSimulation")
    assert simulation is not None
    found = {key.lower(): value for key, value in simulation.attrib.items()}
    assert found["cangetandsetfmustate"] == found["canserializefmustate"] == "true"


def test_the_default_step_is_above_0(root: Element) -> None:
    experiment = root.find("DefaultExperiment")
    assert experiment is not None
    assert float(experiment.attrib["stepSize"]) > 0.0


def test_names_fit_into_simulink(root: Element) -> None:
    """Which takes 63 characters, less what it puts before them."""
    assert max(len(v["name"]) for v in variables(root)) <= 55


def test_names_stay_different_where_all_else_becomes_an_underscore(root: Element) -> None:
    """In C, in ROS and in Simulink; also where case is lost."""
    names = [re.sub(r"\W", "_", v["name"], flags=re.ASCII).lower() for v in variables(root)]
    assert len(set(names)) == len(names)
    assert all(re.match("[a-z]", name) for name in names)


def test_inputs_have_a_start_and_no_initial(root: Element) -> None:
    inputs = [v for v in variables(root) if v["causality"] == "input"]
    assert inputs
    assert all("start" in v and "initial" not in v for v in inputs)


def test_no_host_has_a_reason_to_set_an_output(root: Element) -> None:
    """Dymola and FMI.jl set those with a start, or with initial="exact"."""
    outputs = [v for v in variables(root) if v["causality"] == "output"]
    assert outputs
    assert all("start" not in v and v.get("initial", "calculated") == "calculated" for v in outputs)


def test_parameters_are_numbers(root: Element) -> None:
    """Code generation takes no others; enumerations are numbers, Booleans switches."""
    types = {v["type"] for v in variables(root)}
    assert types <= {"Real", "Boolean", "Integer", "Enumeration", "Float64", "Int32"}


def test_ports_are_real_but_for_boolean_outputs(root: Element) -> None:
    """Some hosts have no other ports; nothing of the loop goes through a Boolean."""
    ports = {(v["causality"], v["type"]) for v in variables(root) if v["causality"] != "parameter"}
    real = {"Real", "Float64"}
    assert {t for c, t in ports if c == "input"} <= real
    assert {t for c, t in ports if c == "output"} <= {*real, "Boolean"}


def test_every_compiled_file_is_listed_once(root: Element, fmu: Unpacked) -> None:
    described = ElementTree.parse(fmu.folder / "sources" / "buildDescription.xml").getroot()
    assert described.get("fmiVersion") == "3.0"
    (configuration,) = described.findall("BuildConfiguration")
    assert configuration.get("modelIdentifier") == fmu.name
    assert "platform" not in configuration.attrib
    (files,) = configuration.findall("SourceFileSet")
    assert files.get("language") == "C99"
    assert [file.get("name") for file in files.iter("SourceFile")] == [f"{fmu.name}.c"]
    if fmu.fmi == 2:
        listed = [file.get("name") for file in root.iterfind("CoSimulation/SourceFiles/File")]
        assert listed == [f"{fmu.name}.c"]


@pytest.mark.slow
def test_both_versions_describe_the_same(parts_of: PartsOf) -> None:
    """Names, references, causality, variability, units, limits, starts; FMI 3.0 has the time."""
    keys = ("name", "valueReference", "causality", "variability", "unit", "min", "max", "start",
            "nominal", "displayUnit", "description")  # fmt: skip
    for name in TRANSLATED:
        two, three = (
            [
                {key: v.get(key) for key in keys}
                for v in variables(
                    ElementTree.parse(
                        parts_of(fmi)[name].fmu.folder / "modelDescription.xml"
                    ).getroot()
                )
            ]
            for fmi in (2, 3)
        )
        assert three[:-1] == two
        assert three[-1]["causality"] == "independent"


def test_outputs_follow_what_is_set_in_initialisation_mode(
    parts: Parts, host: CHost, tmp_path: Path
) -> None:
    """At once, before it ends, and as often as the host likes."""
    part = parts["ProximitySensor"]
    gap, seen = (part.fmu.reference(name) for name in ("gap", "intensity"))
    reflectance = part.fmu.reference("reflectance")
    script = Script().add("load", 0, part.fmu.fmi, part.library)
    script.add("new", 0, 0, "full", "it", part.fmu.token, None).add("init", 0, bits(0.0))
    for value in (0.1, 0.01, 0.1):
        script.add("set", 0, "real", gap, bits(value)).add("get", 0, "real", seen)
    script.add("set", 0, "real", reflectance, bits(0.5)).add("get", 0, "real", seen)
    script.add("leave", 0).add("get", 0, "real", seen)
    script.add("set", 0, "real", reflectance, bits(1.0)).add("get", 0, "real", seen)
    (answers,) = host.run(script, folder=tmp_path)
    assert not any(a.status or a.said for a in answers)
    far, near, again, dark, left, tuned = (a.found[0] for a in answers if a.command == "get")
    assert (again, left, tuned) == (far, dark, far)
    assert len({far, near, dark}) == 3
