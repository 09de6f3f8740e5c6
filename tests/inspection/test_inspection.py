"""What inspect says of an FMU: of ours and of hand-written ones of FMI 1.0, 2.0 and 3.0."""

import io
import json
import zipfile
from itertools import pairwise

import fmpy
import pytest
from grasp_cosim.inspection.inspection import COLUMNS, as_text, inspect_fmu

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
      <String start="a.csv"/></ScalarVariable>
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
    <Binary name="raw" valueReference="6" causality="parameter"><Start value="ff00"/></Binary>
    <Clock name="tick" valueReference="7" causality="input" intervalVariability="triggered"/>
  </ModelVariables>
  <ModelStructure><Output valueReference="2" dependencies="3 1"/></ModelStructure>
</fmiModelDescription>"""


@pytest.fixture
def archive(tmp_path):
    """Writes an FMU of a modelDescription.xml and further, empty files."""

    def write(xml, *files):
        path = tmp_path / "some.fmu"
        encoding = "latin-1" if "ISO-8859-1" in xml else "utf-8"
        with zipfile.ZipFile(path, "w") as file:
            file.writestr("modelDescription.xml", xml.encode(encoding))
            for name in files:
                file.writestr(name, "")
        return path

    return write


@pytest.fixture
def valve(archive):
    """The report on the FMI 2.0 FMU."""
    return inspect_fmu(archive(FMI_2))


def column(report, key):
    return {v["name"]: v[key] for v in report["variables"]}


def table(text):
    """The table in the text, cut at where its column titles stand: row, column, cell."""
    titles, *rows = text.split("\n\n")[1].splitlines()
    edges = [titles.index(name) for name in COLUMNS]
    found = {}
    for row in rows:
        cells = [row.ljust(len(titles))[a:b] for a, b in pairwise([*edges, None])]
        assert all(cell.endswith("  ") for cell in cells[:-1]), row
        assert not any(cell.startswith(" ") and cell.strip() for cell in cells), row
        found[cells[0].strip()] = {k: c.strip() for k, c in zip(COLUMNS, cells, strict=True)}
    return found


def head(text):
    lines = text.split("\n\n")[0].splitlines()
    return {line[:20].strip(): line[20:] for line in lines}


def test_our_controller(fmus):
    path = fmus / "GraspController.fmu"
    report = inspect_fmu(path)
    assert report["fmu"] == str(path)
    assert report["model_name"] == "GraspController"
    assert (report["fmi_version"], report["kinds"]) == ("2.0", ["co-simulation"])
    assert report["python"] is True
    assert "linux64" in report["platforms"]
    assert report["capabilities"]["canHandleVariableCommunicationStepSize"] is True
    assert report["default_experiment"]["step_size"] == 1e-4
    position = report["variables"][0]
    assert position.items() >= {
        "name": "position[1]", "causality": "input", "variability": "continuous",
        "initial": "exact", "type": "Real", "unit": "m", "start": 0.11, "dependencies": None,
    }.items()  # fmt: skip
    rows = table(as_text(report))
    assert list(rows) == [v["name"] for v in report["variables"]]
    assert rows["simultaneous_contact.mass"]["range"] == "0.001 to 1000"
    assert rows["simultaneous_contact.enabled"]["start"] == "true"


@pytest.mark.parametrize("xml", [FMI_1, FMI_2, FMI_3])
def test_json_and_text_hold_the_same_variables(archive, xml):
    report = inspect_fmu(archive(xml))
    assert json.loads(json.dumps(report, allow_nan=False)) == report
    assert list(table(as_text(report))) == [v["name"] for v in report["variables"]]


def test_the_keys_of_the_report(valve):
    assert list(valve) == [
        "fmu", "model_name", "fmi_version", "kinds", "generation_tool", "guid",
        "default_experiment", "platforms", "this_machine", "sources", "python", "capabilities",
        "ambiguous", "variables",
    ]  # fmt: skip
    assert set(valve["variables"][0]) == {
        "name", "causality", "variability", "initial", "type", "dimensions", "sizes", "unit",
        "display_unit", "start", "min", "max", "nominal", "items", "dependencies", "description",
    }  # fmt: skip


def test_values_have_their_types(valve):
    assert column(valve, "start") == {
        "p_in": 101325.0, "p_out": "-inf", "flow": None, "state": None, "noise": None,
        "lost": None, "mode": 2, "table": "a.csv", "stages": 3, "fast": True, "slow": False,
        "odd": "1,5", "x": "nan",
    }  # fmt: skip
    assert isinstance(column(valve, "start")["p_in"], float)
    assert isinstance(column(valve, "start")["mode"], int)


def test_the_declared_type_fills_in(valve):
    p_in, p_out, *_ = valve["variables"]
    keys = ("unit", "display_unit", "min", "max", "nominal")
    assert [p_in[key] for key in keys] == ["Pa", "bar", 0.0, 1e7, 1e5]
    assert [p_out[key] for key in keys] == ["kPa", "mbar", 1.0, "inf", 50.0]
    mode = valve["variables"][6]
    assert (mode["type"], mode["min"], mode["max"]) == ("Enumeration", 1, 2)
    assert (mode["items"], p_in["items"]) == ({"open": 1, "shut": 2}, None)


def test_dependencies_not_declared_are_not_none_at_all(valve):
    assert column(valve, "dependencies") == {
        "flow": ["p_in", "p_out"], "state": [], "noise": None, "lost": None, "p_in": None,
        "p_out": None, "mode": None, "table": None, "stages": None, "fast": None, "slow": None,
        "odd": None, "x": None,
    }  # fmt: skip
    rows = table(as_text(valve))
    assert [rows[name]["dependencies"] for name in ("flow", "state", "noise", "lost", "mode")] == [
        "p_in, p_out", "none", "not declared", "not declared", "",
    ]  # fmt: skip


def test_every_column(valve):
    rows = table(as_text(valve))
    assert rows["p_in"] == {
        "name": "p_in", "causality": "input", "variability": "continuous", "type": "Real",
        "unit": "Pa", "start": "101325", "range": "0 to 10000000", "dependencies": "",
        "description": "inlet pressure",
    }  # fmt: skip
    assert rows["mode"] == {
        "name": "mode", "causality": "parameter", "variability": "tunable",
        "type": "Enumeration", "unit": "", "start": "shut", "range": "open, shut",
        "dependencies": "", "description": "",
    }  # fmt: skip
    assert [rows[name]["range"] for name in ("p_out", "flow", "state", "stages")] == [
        "1 to inf", "up to 5", "", "from 1",
    ]  # fmt: skip
    starts = [rows[name]["start"] for name in ("fast", "slow", "table", "x", "flow")]
    assert starts == ["true", "false", "a.csv", "nan", ""]


def test_fmi_1(archive):
    report = inspect_fmu(archive(FMI_1))
    assert (report["fmi_version"], report["kinds"]) == ("1.0", ["co-simulation"])
    assert report["capabilities"].items() >= {
        "canRejectSteps": True, "canHandleEvents": False, "maxOutputDerivativeOrder": 2,
    }.items()  # fmt: skip
    shown = head(as_text(report))["capabilities"]
    assert shown == "canRejectSteps, maxOutputDerivativeOrder = 2"
    assert column(report, "dependencies") == {
        "tau": None, "speed": ["tau"], "counter": [], "power": None, "ratio": None,
    }  # fmt: skip
    rows = table(as_text(report))
    assert rows["tau"]["unit"] == "N.m"
    assert rows["tau"]["range"] == "-10 to 10"
    assert rows["speed"]["description"] == "Drehzahl Größe"
    assert rows["ratio"]["causality"] == "parameter"


def test_fmi_1_model_exchange(archive):
    xml = FMI_1[: FMI_1.index("<Implementation>")] + "</fmiModelDescription>"
    report = inspect_fmu(archive(xml))
    assert (report["kinds"], report["capabilities"]) == (["model exchange"], {})


def test_fmi_3(archive):
    report = inspect_fmu(archive(FMI_3))
    assert report["kinds"] == ["co-simulation", "scheduled execution"]
    assert report["guid"] == "{3}"
    assert report["capabilities"].items() >= {
        "canGetAndSetFMUState": True, "canGetAndSetFMUState (scheduled execution)": False,
        "providesDirectionalDerivatives": True, "fixedInternalStepSize": 0.5, "hasEventMode": False,
    }.items()  # fmt: skip
    assert column(report, "dimensions") == {
        "n": [], "points": [3, 2], "gain": [], "labels": [2], "label": [], "raw": [], "tick": [],
        "cloud": [3, 2],
    }  # fmt: skip
    points = [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert column(report, "start") == {
        "n": 3, "points": points, "gain": 0.1, "labels": ["near by", "far"], "label": "one",
        "raw": "ff00", "tick": None, "cloud": points,
    }  # fmt: skip
    rows = table(as_text(report))
    assert rows["points"]["type"] == "Float64[n=3, 2]"
    assert rows["points"]["start"] == "1, 2, 3, 4, 5, 6"
    assert rows["n"]["range"] == "1 to 9"
    assert rows["points"]["dependencies"] == rows["cloud"]["dependencies"] == "gain, n"
    assert rows["cloud"]["description"] == "the same"


def test_long_arrays_do_not_widen_the_table(archive):
    xml = FMI_3.replace('"1 2 3 4 5 6"', f'"{"1 " * 999}"')
    report = inspect_fmu(archive(xml))
    assert len(column(report, "start")["points"]) == 999
    start = table(as_text(report))["points"]["start"]
    assert start == "1, 1, 1, 1, 1, 1, 1, 1, ... (991 more)"


def test_the_description_is_cut_to_the_terminal(valve):
    valve["variables"][0]["description"] = "d" * 200
    valve["variables"][7]["start"] = "path/" * 20
    uncut = table(as_text(valve))
    assert uncut["p_in"]["description"] == "d" * 200
    assert uncut["table"]["start"] == "path/" * 20
    text = as_text(valve, 140)
    assert max(map(len, text.split("\n\n")[1].splitlines())) == 140
    rows = table(text)
    assert rows["p_in"]["description"].endswith("dd…")
    assert rows["table"]["start"] == ("path/" * 20)[:31] + "…"
    assert rows["p_in"] | {"description": ""} == uncut["p_in"] | {"description": ""}


def test_no_variables(archive):
    cut = FMI_3[: FMI_3.index("<UInt64")] + "</ModelVariables></fmiModelDescription>"
    assert table(as_text(inspect_fmu(archive(cut)))) == {}


SLOPPY = {
    "a continuous parameter": ('variability="tunable"', ""),
    "spaces among dependencies": ('dependencies="1 2"', 'dependencies=" 1  2 "'),
    "no dependencies but a space": ('dependencies=""', 'dependencies=" "'),
    "a type that is not defined": ('declaredType="Pressure" unit', 'declaredType="P" unit'),
    "an attribute of a vendor": ('<Real unit="Pa"', '<Real vendor="1" unit="Pa"'),
    "a type without content": ("<TypeDefinitions>", '<TypeDefinitions><SimpleType name="A"/>'),
    "a broken exponent": (
        "<TypeDefinitions>",
        '<UnitDefinitions><Unit name="u"><BaseUnit m="0.5"/></Unit></UnitDefinitions>'
        "<TypeDefinitions>",
    ),
}


@pytest.mark.parametrize("mistake", SLOPPY)
def test_a_sloppy_fmu_is_shown_all_the_same(archive, valve, mistake):
    """FMPy refuses each of these even where it need not validate."""
    assert FMI_2.count(SLOPPY[mistake][0]) == 1
    path = archive(FMI_2.replace(*SLOPPY[mistake]))
    with pytest.raises(Exception, match=r"."):
        fmpy.read_model_description(io.BytesIO(path.read_bytes()), validate=False)
    report = inspect_fmu(path)
    if mistake == "a continuous parameter":
        assert column(report, "variability").pop("mode") == "continuous"
        report["variables"][6]["variability"] = "tunable"
    assert column(report, "initial")["x"] == "approx"
    if mistake == "a continuous parameter":
        assert column(report, "initial")["mode"] is None
        report["variables"][6]["initial"] = "exact"
    assert report == valve


@pytest.mark.parametrize("text", ["1" * 400, "1" * 5000, "", "one"])
def test_a_start_that_is_no_number_is_shown_as_it_is(archive, text):
    report = inspect_fmu(archive(FMI_2.replace('min="1" start="3"', f'min="1" start="{text}"')))
    assert column(report, "start")["stages"] == text
