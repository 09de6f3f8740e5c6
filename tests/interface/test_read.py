"""The reader against FMPy's, and what it takes although a master does not."""

import math
from tempfile import gettempdir

import fmpy
import pytest
from grasp_cosim.base.errors import InputError
from grasp_cosim.interface.obstacles import of_loading
from grasp_cosim.interface.read import describe, read_interface
from ssp.hand_made import described, zipped
from support.native_fmus import build, build_model, needs_gcc

FMI_2 = """<fmiModelDescription fmiVersion="2.0" modelName="M" guid="{1}">
  <CoSimulation modelIdentifier="m"/>
  <UnitDefinitions><Unit name="mm"><BaseUnit m="1" factor="0.001"/></Unit></UnitDefinitions>
  <TypeDefinitions><SimpleType name="Mode"><Enumeration><Item name="open" value="1"/>
    <Item name="shut" value="2"/></Enumeration></SimpleType></TypeDefinitions>
  <DefaultExperiment stepSize="0.01"/>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real start="0"/>
    </ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output">
      <Real min="1" max="2" nominal="3"/></ScalarVariable>
    <ScalarVariable name="mode" valueReference="2" causality="parameter" variability="fixed">
      <Enumeration declaredType="Mode" start="2"/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2" dependencies="1"/></Outputs></ModelStructure>
</fmiModelDescription>"""

FMI_3 = """<fmiModelDescription fmiVersion="3.0" modelName="M" instantiationToken="{1}">
  <CoSimulation modelIdentifier="m"/>
  <ModelVariables>
    <Float64 name="u" valueReference="7" causality="input" start="0" unit="m">
      <Alias name="v" description="again"/></Float64>
    <Float64 name="y" valueReference="8" causality="output" initial="calculated">
      <Dimension valueReference="9"/><Dimension start="2"/><Alias name="z"/></Float64>
    <UInt64 name="n" valueReference="9" causality="structuralParameter" start="3"/>
  </ModelVariables>
  <ModelStructure><Output valueReference="8" dependencies="7"/><InitialUnknown valueReference="8"/>
  </ModelStructure></fmiModelDescription>"""


@pytest.fixture
def write(tmp_path):
    """Writes an FMU of a description."""
    return lambda description: described(tmp_path / "x.fmu", description)


def number(text, absent):
    return absent if text is None else float(text)


def value(fmi_type, text):
    if text is None or fmi_type in ("String", "Binary"):
        return text
    if fmi_type == "Boolean":
        return text == "true"
    return float(text) if fmi_type.startswith(("Real", "Float")) else int(text)


def names(variables):
    return None if variables is None else tuple(v.name for v in variables)


def same_as_fmpy(path):
    """Compare each typed field with what FMPy reads, validating; return what is read."""
    ours, theirs = read_interface(path), fmpy.read_model_description(path)
    able = theirs.coSimulation
    assert (ours.guid, ours.version, ours.model_name) == (
        theirs.guid, theirs.fmiVersion, theirs.modelName,
    )  # fmt: skip
    assert (ours.identifier, ours.tool) == (able.modelIdentifier, theirs.generationTool)
    assert ours.can_vary_step == able.canHandleVariableCommunicationStepSize
    for flag in (
        "canGetAndSetFMUstate", "mightReturnEarlyFromDoStep", "canBeInstantiatedOnlyOncePerProcess",
    ):  # fmt: skip
        assert (ours.capability(flag) is True) == getattr(able, flag)
    experiment = theirs.defaultExperiment
    assert ours.step == (float(experiment.stepSize) if experiment else None)
    for unit in theirs.unitDefinitions:
        if unit.baseUnit is not None:
            base = unit.baseUnit
            assert ours.units[unit.name].exponents == (
                base.kg, base.m, base.s, base.A, base.K, base.mol, base.cd, base.rad,
            )  # fmt: skip
            assert ours.units[unit.name].factor == base.factor
            assert ours.units[unit.name].offset == base.offset
    now = {u.variable.name: names(u.dependencies) for u in theirs.outputs}
    initially = {u.variable.name: names(u.dependencies) for u in theirs.initialUnknowns}
    inputs = tuple(v.name for v in theirs.modelVariables if v.causality == "input")
    for mine, his in zip(ours.variables, theirs.modelVariables, strict=True):
        for key in ("name", "causality", "variability", "initial", "type", "unit", "start"):
            assert getattr(mine, key) == getattr(his, key), his.name
        assert (mine.reference, mine.description) == (his.valueReference, his.description)
        assert (mine.shape, mine.display_unit) == (his.shape, his.displayUnit)
        assert mine.start_value == value(his.type, his.start)
        assert (mine.low, mine.high) == (number(his.min, -math.inf), number(his.max, math.inf))
        assert mine.nominal == number(his.nominal, 1.0)
        assert mine.relative == bool(his.relativeQuantity)
        assert mine.dependencies == now.get(his.name)
        expected = initially.get(his.name)
        assert mine.initial_dependencies == (
            inputs if expected is None and his.name in initially else expected
        )
        items = his.declaredType.items if his.type == "Enumeration" and his.declaredType else ()
        assert mine.items == {item.name: int(item.value) for item in items}
    return ours


@pytest.mark.parametrize("name", ["GripperPlant", "GraspControllerAdaptive"])
def test_our_fmus_are_read_as_fmpy_reads_them(fmus, name):
    interface = same_as_fmpy(fmus / f"{name}.fmu")
    assert interface.python
    assert interface.units


@needs_gcc
@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_native_fmus_are_read_as_fmpy_reads_them(tmp_path, version):
    interface = same_as_fmpy(build(tmp_path, version=version, units={"x": "m"}))
    assert not interface.python
    assert interface.by_name["x"].unit == "m"


def test_all_of_a_small_one(write):
    interface = same_as_fmpy(write(FMI_2))
    assert interface.by_name["mode"].items == {"open": 1, "shut": 2}
    assert interface.by_name["y"].dependencies == ("u",)


def test_aliases_and_dimensions_of_fmi_3(write):
    path = write(FMI_3)
    everything, runs = describe(path), read_interface(path)
    assert [v.name for v in runs.variables] == ["u", "y", "n", "v", "z"]
    assert [v.name for v in runs.of("input")] == ["u"]
    assert runs.main_name("v") == "u"
    assert everything.by_name["v"].description == "again"
    assert everything.by_name["v"].unit == "m"
    assert runs.by_name["z"].shape == (3, 2)
    assert runs.by_name["z"].dependencies == ("u",)
    assert runs.by_name["y"].initial_dependencies == ("u",)


FLAWS = [
    ('min="1"', 'min="x"', "variable 'y': min = 'x': must be a number"),
    ('max="2"', 'max="1_0"', "variable 'y': max = '1_0': must be a number"),
    ('m="1"', 'm="0.5"', "unit 'mm': m = '0.5': must be a whole number"),
    (
        '"0.001"',
        '"inf"',
        "unit 'mm': factor = inf, offset = 0: must be finite, and the factor other than 0",
    ),
    ('value="1"', 'value="I"', "type 'Mode': item 'open' = 'I': must be a whole number"),
    ('stepSize="0.01"', 'stepSize="1ms"', "DefaultExperiment: stepSize = '1ms': must be a number"),
]


@pytest.mark.parametrize(("before", "after", "message"), FLAWS)
def test_a_number_that_only_a_master_needs(write, before, after, message):
    assert FMI_2.count(before) == 1
    path = write(FMI_2.replace(before, after))
    assert describe(path).flaw == message
    with pytest.raises(InputError) as caught:
        read_interface(path)
    assert str(caught.value) == f"{path}: not a readable FMU: {message}"


@pytest.mark.parametrize(
    ("xml", "before", "after", "message"),
    [
        (FMI_2, 'index="2"', 'index="0"', "Output: index = '0': must be the index of a variable"),
        (FMI_2, '<Real start="0"/>', "", "variable 'u': has no type; must be one of Real, Integer"),
        (FMI_3, "UInt64", "UInt128", "variable 'n': has no type; must be one of Float64"),
        (FMI_3, 'dependencies="7"', 'dependencies="6"', "Output 'y': dependencies = '6': must be"),
        (FMI_3, 'start="3"', "", "variable 'y': Dimension = missing: must be a whole number"),
        (FMI_3, 'n start="2"', 'n start="-2"', "variable 'y': Dimension = '-2'"),
        (FMI_3, "ModelVariables", "Variables", "no ModelVariables"),
    ],
)
def test_what_makes_no_sense_to_anybody(write, xml, before, after, message):
    assert before in xml
    path = write(xml.replace(before, after))
    with pytest.raises(InputError) as caught:
        describe(path)
    assert str(caught.value).startswith(f"{path}: not a readable FMU: {message}")


def test_a_file_is_read_once_until_it_changes(write):
    path = write(FMI_2)
    first = read_interface(path)
    assert read_interface(path) is first
    write(FMI_2.replace('"u"', '"w"'))
    assert "w" in read_interface(path).by_name


@pytest.mark.parametrize("name", ["top/modelDescription.xml", "ModelDescription.xml"])
def test_a_description_in_another_place_is_named(tmp_path, name):
    zipped(tmp_path / "x.fmu", {name: FMI_2})
    with pytest.raises(InputError, match=rf"must be there, and called so: there is {name}$"):
        describe(tmp_path / "x.fmu")


@needs_gcc
@pytest.mark.parametrize(
    ("said", "what"),
    [
        ("No license for feature X", "needs a licence on this machine; have that of "),
        ("libflexlm.so: cannot open shared object file", "needs a licence"),
        ("x.so: undefined symbol: licence_check", None),
        ("undefined symbol: licence_check (no licence)", "needs a licence"),
        # the words of glibc, where TMPDIR is mounted with noexec
        ("x.so: failed to map segment from shared object", f"was extracted to {gettempdir()}, on"),
    ],
)
def test_why_an_fmu_does_not_load_by_what_is_said(said, what, tmp_path):
    obstacle = of_loading(describe(build_model("stair", tmp_path)), said)
    assert str(obstacle).startswith(what or "None")
