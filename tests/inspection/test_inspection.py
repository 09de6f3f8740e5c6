"""What inspect says of an FMU: of ours and of hand-written ones of FMI 1.0, 2.0 and 3.0."""

import json

import pytest
from grasp_cosim.inspection import loading
from grasp_cosim.inspection.declarations import declarations_text, inspect_fmu
from grasp_cosim.interface import read
from ssp.hand_made import described
from support.native_fmus import needs_gcc, talker

FMI_1 = """<?xml version="1.0" encoding="ISO-8859-1"?>
<fmiModelDescription fmiVersion="1.0" modelName="Drive" modelIdentifier="drive" guid="{1}"
    numberOfContinuousStates="0" numberOfEventIndicators="0">
  <TypeDefinitions>
    <Type name="Torque"><RealType unit="N.m" min="-10" max="10" displayUnit="kN.m"/></Type>
  </TypeDefinitions>
  <ModelVariables>
    <ScalarVariable name="tau" valueReference="0" causality="input">
      <Real declaredType="Torque" start="0"/></ScalarVariable>
    <ScalarVariable name="speed" valueReference="1" causality="output" description="Drehzahl Größe">
      <Real/><DirectDependency><Name>tau</Name></DirectDependency></ScalarVariable>
    <ScalarVariable name="counter" valueReference="2" causality="output" variability="discrete">
      <Integer/><DirectDependency><Name/></DirectDependency></ScalarVariable>
    <ScalarVariable name="power" valueReference="3" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="ratio" valueReference="4" variability="parameter">
      <Real start="3.5"/></ScalarVariable>
    <ScalarVariable name="twin" valueReference="5"><Real/></ScalarVariable>
    <ScalarVariable name="twin" valueReference="6"><Real/></ScalarVariable>
  </ModelVariables>
  <Implementation><CoSimulation_StandAlone>
    <Capabilities canRejectSteps="true" maxOutputDerivativeOrder="2"/>
  </CoSimulation_StandAlone></Implementation>
</fmiModelDescription>"""

FMI_2 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="Valve" guid="{2}" generationTool="Tool 7"
    vendorExtra="1">
  <ModelExchange modelIdentifier="valve" providesDirectionalDerivative="true"
    completedIntegratorStepNotNeeded="1"/>
  <CoSimulation modelIdentifier="valve" canInterpolateInputs="true"/>
  <TypeDefinitions>
    <SimpleType name="Pressure"><Real unit="Pa" displayUnit="bar" min="0" max="1e7" nominal="1e5"/>
    </SimpleType>
    <SimpleType name="Mode"><Enumeration min="1" max="2"><Item name="open" value="1"/>
      <Item name="shut" value="2"/></Enumeration></SimpleType>
  </TypeDefinitions>
  <DefaultExperiment startTime="1" stopTime="2.5" tolerance="1e-6" stepSize="0.01"/>
  <ModelVariables>
    <!-- a comment -->
    <ScalarVariable name="p_in" valueReference="0" causality="input"
      description="inlet&#10;pressure">
      <Real declaredType="Pressure" start="101325.0"/></ScalarVariable>
    <ScalarVariable name="p_out" valueReference="1" causality="input">
      <Real declaredType="Pressure" unit="kPa" displayUnit="mbar" min="1" max="INF" nominal="50"
        start="-INF"/></ScalarVariable>
    <ScalarVariable name="flow" valueReference="2" causality="output">
      <Real max="5"/></ScalarVariable>
    <ScalarVariable name="state" valueReference="3" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="noise" valueReference="4" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="lost" valueReference="5" causality="output"><Real/></ScalarVariable>
    <ScalarVariable name="mode" valueReference="6" causality="parameter" variability="tunable">
      <Enumeration declaredType="Mode" start="2"/></ScalarVariable>
    <ScalarVariable name="table" valueReference="7" causality="parameter" variability="fixed">
      <String start="tables/of/the/vendor/measured/a.csv"/></ScalarVariable>
    <ScalarVariable name="stages" valueReference="8" causality="parameter" variability="fixed">
      <Integer min="1" start="3"/></ScalarVariable>
    <ScalarVariable name="fast" valueReference="9" causality="parameter" variability="fixed">
      <Boolean start="1"/></ScalarVariable>
    <ScalarVariable name="slow" valueReference="10" causality="parameter" variability="fixed">
      <Boolean start="false"/></ScalarVariable>
    <ScalarVariable name="odd" valueReference="11" causality="parameter" variability="fixed">
      <Real start="1,5"/></ScalarVariable>
    <ScalarVariable name="x" valueReference="12" initial="approx">
      <Real start="NaN"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs>
    <Unknown index="3" dependencies="1 2"/>
    <Unknown index="4" dependencies=""/>
    <Unknown index="5"/>
  </Outputs></ModelStructure>
</fmiModelDescription>"""

FMI_3 = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="Lidar" instantiationToken="{3}">
  <CoSimulation modelIdentifier="lidar" canGetAndSetFMUState="true" fixedInternalStepSize="0.5"
    providesDirectionalDerivatives="true"/>
  <ScheduledExecution modelIdentifier="lidar"/>
  <ModelVariables>
    <UInt64 name="n" valueReference="1" causality="structuralParameter" min="1" max="9" start="3"/>
    <Float64 name="points" valueReference="2" causality="output" initial="exact"
      start="1 2 3 4 5 6"><Dimension valueReference="1"/><Dimension start="2"/>
      <Alias name="cloud" description="the same"/></Float64>
    <Float32 name="gain" valueReference="3" causality="parameter" start="0.1"/>
    <String name="labels" valueReference="4" causality="parameter"><Dimension start="2"/>
      <Start value="near by"/><Start value="far"/></String>
    <String name="label" valueReference="5" causality="parameter"><Start value="one"/></String>
    <Float64 name="long" valueReference="8" causality="local" start="1 2 3 4 5 6 7 8 9 10">
      <Dimension start="10"/></Float64>
    <Binary name="raw" valueReference="6" causality="parameter"><Start value="ff00"/></Binary>
    <Clock name="tick" valueReference="7" causality="input" intervalVariability="triggered"/>
  </ModelVariables>
  <ModelStructure><Output valueReference="2" dependencies="3 1"/></ModelStructure>
</fmiModelDescription>"""


@pytest.fixture
def archive(tmp_path):
    """Writes an FMU of a modelDescription.xml and further, empty files."""

    def write(xml, *files):
        encoding = "latin-1" if "ISO-8859-1" in xml else "utf-8"
        empty = dict.fromkeys(files, "")
        return described(tmp_path / "some.fmu", xml.encode(encoding), **empty)

    return write


BINARIES = ("binaries/win64/v.dll", "binaries/darwin64/v.dylib", "sources/v.c")


@pytest.mark.parametrize(
    ("xml", "files"),
    [(FMI_1, ()), (FMI_2, BINARIES), (FMI_3, ("resources/slavemodule.txt",))],
    ids=["1", "2", "3"],
)
def test_the_report_and_its_text(xml, files, archive, snapshot):
    report = inspect_fmu(archive(xml, *files)) | {"fmu": "some.fmu", "this_machine": "here"}
    assert json.loads(json.dumps(report, allow_nan=False)) == report
    variables = report["variables"]
    assert [
        json.dumps(part) for part in ({**report, "variables": len(variables)}, *variables)
    ] == snapshot
    assert declarations_text(report) == snapshot
    assert declarations_text(report, 127).split("\n\n")[1] == snapshot


SLOPPY = {
    "a continuous parameter": ('variability="tunable"', ""),
    "spaces among dependencies": ('dependencies="1 2"', 'dependencies=" 1  2 "'),
    "a type that is not defined": ('declaredType="Pressure" unit', 'declaredType="P" unit'),
    "an attribute of a vendor": ('<Real unit="Pa"', '<Real vendor="1" unit="Pa"'),
    "a broken exponent": (
        "<TypeDefinitions>",
        '<UnitDefinitions><Unit name="u"><BaseUnit m="0.5"/></Unit></UnitDefinitions>'
        "<TypeDefinitions>",
    ),
}


@pytest.mark.parametrize("mistake", SLOPPY)
def test_a_sloppy_fmu_is_shown_all_the_same(archive, mistake):
    valve = inspect_fmu(archive(FMI_2))
    path = archive(FMI_2.replace(*SLOPPY[mistake]))
    report = inspect_fmu(path)
    if mistake == "a continuous parameter":
        report["variables"][6]["variability"] = "tunable"
    assert report == valve


@pytest.mark.parametrize("text", ["1" * 400, "1" * 5000, "", "one"])
def test_a_start_that_is_no_number_is_shown_as_it_is(archive, text):
    report = inspect_fmu(archive(FMI_2.replace('min="1" start="3"', f'min="1" start="{text}"')))
    assert report["variables"][8]["start"] == text


@needs_gcc
def test_the_categories_of_its_log_are_listed(tmp_path):
    report = inspect_fmu(talker(tmp_path))
    names = ["logEvents", "logSecrets", "logStatusWarning", "logStatusError"]
    assert report["log_categories"] == names
    assert f"log categories      {', '.join(names)}\n" in declarations_text(report)


def test_an_fmu_is_read_once(archive, monkeypatch):
    """A large one takes seconds."""
    path, reads = archive(FMI_2), []
    plain = read.read_document
    monkeypatch.setattr(read, "read_document", lambda fmu: reads.append(fmu) or plain(fmu))
    inspect_fmu(path)
    loading.examine(path)
    assert reads == [path]
