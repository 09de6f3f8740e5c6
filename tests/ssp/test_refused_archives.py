"""Archives that are wrong or ask for more than this master does: one line says what, and where."""

import re
import zipfile

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.interface import model_description
from grasp_cosim.ssp.to_archive import write_ssp
from ssp.hand_made import (
    archive,
    bind,
    binding_list,
    changed,
    component,
    connect,
    fmu,
    linear,
    mapping,
    parameter_set,
    structure,
    system,
)
from ssp.test_reading import (
    DEFINITION,
    GIVES,
    INNER,
    MILLIMETRES,
    SECOND,
    SHARED,
    TAKES,
    bus,
    given,
    nested,
    of,
    of_2,
    oms,
    osp,
    packed,
    pair,
    stepped,
    through,
    valued,
    values_2,
)

A = fmu("output Real y - m", "input Real u 0.0 m")
ELEMENT = component("a", "output y Real; input u Real")
TOP = system("top", ELEMENT)
SSD = structure(TOP)


def ssd(text):
    return of("", ssd=text, a=A)


def parts(*elements, **more):
    return of(system("top", "".join(elements), **more), a=A)


NO_BUS = '<ssd:SignalDictionaryReference name="r" dictionary="d"/>'
NO_DICTIONARY = (
    '<ssd:SignalDictionaries><ssd:SignalDictionary name="d" source="resources/d.ssb"/>'
    "</ssd:SignalDictionaries></ssd:System>"
)
LISTS = binding_list(bind(parameter_set("a.u Real 1"))) * 2
DEEP = f'<g:System xmlns:g="grasp-cosim:system">{"[" * 100_000}</g:System>'
OURS = (
    f'<ssd:Annotations><ssc:Annotation type="grasp-cosim">{DEEP}</ssc:Annotation></ssd:Annotations>'
)
SOURCES = ("../a.fmu", "/a", "file:///a.fmu", "resources/a.fmu#x")
STRUCTURES = {
    "version 3": ssd(structure(TOP, version="3.0")),
    "line": ssd(SSD.replace("<ssd:Component", "\n\n<ssd:Component").replace("kind=", "kid=")),
    "cut off": ssd(SSD[:-9]),
    "document type": ssd(SSD.replace("?>\n", "?>\n<!DOCTYPE x []>")),
    "too deep": ssd(SSD.replace("<ssd:Elements>", "<ssd:Elements>" + "<a>" * 20_000)),
    "deeper than the stack": ssd(
        structure(TOP, f'<ssd:DefaultExperiment stopTime="1">{OURS}</ssd:DefaultExperiment>')
    ),
    "two lists": ssd(SSD.replace("<ssd:Elements>", f"{LISTS}<ssd:Elements>")),
    "a prefix for no namespace": ssd(SSD.replace("ssd:Elements", "ssx:Elements")),
    "no components": of('<ssd:System name="top"/>', a=A),
    "no dictionary": of(TOP.replace("</ssd:System>", NO_DICTIONARY), a=A),
    "no reference": parts(NO_BUS),
    "a type": parts(component("a", type="text/x-modelica")),
    "an implementation": parts(component("a", implementation="ModelExchange")),
    "two elements": parts(ELEMENT, ELEMENT),
    "two connectors": parts(component("a", "output y; output y")),
    "inout": parts(component("a", "inout y")),
    "a type of value": parts(component("a", "output y Binary")),
    "another type": parts(component("a", "output y Integer")),
    "no such output": parts(component("a", "output z Real")),
    "another unit": parts(component("a", "output y Real mm")),
    "no such unit": parts(component("a", "output y Real ells")),
    "not the unit of the FMU": parts(component("a", "output y Real cm")),
    "no unit of an FMU": valued(connectors="input in Real ells"),
    "a unit for none": of(system("top", component("a", "parameter ratio Real ells"))),
    "a stop": ssd(structure(TOP, '<ssd:DefaultExperiment stopTime="-2"/>')),
    "a unit of nothing": ssd(SSD.replace('factor="0.001"', 'factor="0"')),
    "no stop": ssd(structure(TOP, "")),
    "no step": ssd(structure(TOP, '<ssd:DefaultExperiment stopTime="0.00025"/>')),
    "one name": parts(*(component(n, source="resources/a.fmu") for n in ("a.b", "a_b"))),
    "no such source": parts(component("b")),
    **{f"source {s}": parts(component("a", source=s)) for s in SOURCES},
    "no FMU": of(TOP, a=b"<x/>"),
    "an FMU of no kind": of(TOP, a=A.replace(b"CoSimulation", b"ScheduledExecution")),
    "several steps": stepped(osp("0.002"), oms("0.001")),
    "a step that is none": stepped(osp("fast")),
    "no entry": bus("inout gap; inout no", "inout gap", inline=True),
    "two sources of an entry": bus("input gap", "output gap", True, connect("a/y", "in/gap")),
    "either way": bus("inout gap; inout on", "inout gap", True, connect("in/gap", "in/on")),
}


def of_table(kind, value, table="true"):
    change = (
        "<ssc:BooleanMappingTransformation>"
        f'<ssc:MapEntry source="{table}" target="false"/></ssc:BooleanMappingTransformation>'
    )
    return given(f"x {kind} {value}", mapping(("x", "active", change)))


def source(name, more=""):
    return f'<ssd:ParameterBinding source="{name}" {more}/>'


BINDINGS = {
    "real for integer": given("count Real 2.0"),
    "integer for boolean": given("active Integer 1"),
    "nan": given("length Real NaN"),
    "many digits": given(f"count Integer {'9' * 50}"),
    "another quantity": given("length Real 2 N"),
    "ells": given("length Real 2 ells", units=""),
    "type of value": given("length Binary 00"),
    "no item": given("mode Enumeration up"),
    "twice": given("length Real 1; length Real 2"),
    "linear": given("x Boolean true", mapping(("x", "active", linear(2.0)))),
    "not in the table": of_table("Boolean", "false"),
    "not in the FMU": source("resources/x.ssv", 'sourceBase="component"'),
    "csv": given("x Real 1", type="text/csv"),
    "neither": "<ssd:ParameterBinding/>",
    "no set": source("resources/y.ssv"),
    "the schema": bind(parameter_set("x Real 1").replace("Parameter name", "Parameter nam")),
}
WRONG = '<ssd:Wrong xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"/>'
BOTH = component("a", "output y Real") + component("b", "input u Real")
TABLE = (
    "<ssc:IntegerMappingTransformation>"
    '<ssc:MapEntry source="1" target="2"/></ssc:IntegerMappingTransformation>'
)


def drawn(*connections):
    entries = "input in Real; output out Real"
    return of(system("top", BOTH, "".join(connections), entries), a=A, b=MILLIMETRES)


CALCULATED = fmu("calculatedParameter Real y -")
AROUND = system(
    "sub",
    component("b", "input u"),
    connect("in", "out") + connect("in", "b/u"),
    "input in; output out",
)
INTO = system("sub", component("b", "input u"), connect("in", "b/u"), "input in")


def kinds(a, b, content=""):
    return pair(fmu(f"output {a} y -"), fmu(f"input {b}"), content, ("output y", "input u"))


CONNECTIONS = {
    "another quantity on it": pair(A, fmu("input Real u 0.0 N")),
    "not clear": through(linear(1000.0)),
    "no element": drawn(connect("a/y", "c/u")),
    "no connector": drawn(connect("a/z", "b/u")),
    "both give a value": drawn(connect("a/y", "in")),
    "a second": drawn(connect("a/y", "b/u"), connect("in", "b/u")),
    "a table": drawn(connect("a/y", "b/u", TABLE)),
    "a circle": parts(
        component("a"), AROUND.replace("/b.", "/a."), connections=connect("sub/out", "sub/in")
    ),
    "boolean to real": kinds("Boolean", "Real u 0.0"),
    "a transformed boolean": kinds("Boolean", "Boolean u false", linear(2.0)),
    "a transformed string": kinds("String", "String u -", linear(2.0)),
    "real to integer": kinds("Real", "Integer u 0"),
    "to a parameter": pair(
        CALCULATED, fmu("parameter Real u 0.0"), ends=("calculatedParameter y", "parameter u")
    ),
    "from a parameter": of(
        system("top", component("a", "calculatedParameter y") + INTO, connect("a/y", "sub/in")),
        a=CALCULATED,
        b=TAKES,
    ),
    "a transformed value": of(
        system(
            "top",
            component("a", "parameter active"),
            connect("on", "a/active", linear(2.0)),
            "parameter on Boolean",
            given("on Boolean true"),
        )
    ),
    "no definition": pair(fmu("output Real y - cubit")),
}
LABEL = system("top", component("a", bindings=values_2("label String x")))
LENGTH = system("top", component("a", bindings=values_2("length Float64 1")))
REAL = component("a", "input u Real")
VERSION_2 = {
    "an array": of_2(
        system("top", REAL.replace("<ssc:Real/>", '<ssc:Real/><ssc:Dimension size="3"/>'))
    ),
    "a clock": of_2(system("top", component("a", "input u Clock"))),
    "an index": of_2(system("top", ELEMENT, connect("a/y", "a/u", startIndices="1"))),
    "a local": of_2(system("top", component("a", "input u; local y"), connect("a/y", "a/u"))),
    "two values": of_2(
        LABEL.replace('<ssv:String value="x"/>', f"<ssv:String>{'<ssv:Value/>' * 2}</ssv:String>")
    ),
    "scheduled": of_2(system("top", component("a", implementation="ScheduledExecution"))),
    "no source": of_2(system("top", component("a").replace('source="resources/a.fmu"', ""))),
}
LOOP = structure(system("s", component("b", type=DEFINITION, source="x.ssd")))


def again(second, inside=""):
    first = SHARED.replace('"first"', '"first" id="S"').replace(
        "</ssd:Elements>", f"{inside}</ssd:Elements>"
    )
    return of(system("top", component("a", "output y") + first + second), a=GIVES, b=TAKES)


NESTED = {
    "no variant": nested("resources/sub.ssp#None.ssd"),
    "two units": nested("resources/sub.ssp", unit="Real N"),
    "no connector inside": nested("resources/sub.ssp", unit="; input at"),
    "itself": nested("resources/x.ssd", **{"resources/x.ssd": LOOP}),
    "itself by its id": again(SECOND, component("loop", type=DEFINITION, source="#S")),
}
CASES = STRUCTURES | CONNECTIONS | VERSION_2 | NESTED
CASES |= {
    f"binding: {name}": valued(binding, files={"resources/y.ssv": WRONG})
    for name, binding in BINDINGS.items()
}
CASES["binding: of no component"] = valued(
    outer=source("resources/own.ssv", 'sourceBase="component"')
)


def message_of(path):
    """The error at loading the archive, in one line."""
    with pytest.raises(InputError) as error:
        System.load(path)
    assert "\n" not in str(error.value)
    return str(error.value)


@pytest.mark.parametrize("name", CASES)
def test_what_is_refused(name, tmp_path, snapshot):
    """Without the words of libxml2 and of Python."""
    text, fmus, files, _ = CASES[name]
    if "resources/sub.ssp" in text:
        connector = '<ssd:Connector name="in" kind="input">'
        inner = INNER.replace(connector, f'{connector}<ssc:Real unit="m"/>')
        files = {"resources/sub.ssp": packed(tmp_path, inner)}
    said = message_of(archive(tmp_path, text, fmus, files))
    assert said.startswith("hand.ssp")
    cut = re.sub(
        r"(against the schema: Element '\S+'|not readable as XML:|not JSON in UTF-8:).*",
        r"\1",
        said,
    )
    assert cut == snapshot


def not_a_zip(path):
    path.write_text("[experiment]")


def without_structure(path):
    with zipfile.ZipFile(path, "w") as file:
        file.writestr("resources/a.fmu", b"")


def damaged(path):
    data = bytearray(path.read_bytes())
    data[data.index(b"ssd:System ")] ^= 1  # inside the content, which is stored as it is
    path.write_bytes(data)


def missing(path):
    path.unlink()


@pytest.mark.parametrize(
    ("spoil", "message"),
    [
        (not_a_zip, "not readable as an SSP archive"),
        (without_structure, "no SystemStructure.ssd in it; must be an SSP archive"),
        (damaged, "SystemStructure.ssd: not readable: Bad CRC-32"),
        (missing, "no such system file"),
    ],
)
def test_wrong_files(tmp_path, spoil, message):
    path = archive(tmp_path, SSD, {"a": A})
    spoil(path)
    text = message_of(path)
    assert text.startswith(str(path))
    assert message in text


def test_an_archive_has_its_own_fmus(grasp, fmus, tmp_path):
    write_ssp(grasp, tmp_path / "grasp.ssp")
    with pytest.raises(InputError, match="has its own FMUs"):
        System.load(tmp_path / "grasp.ssp", fmus)


def test_an_entity_is_not_followed(tmp_path):
    secret = tmp_path / "secret"
    secret.write_text("told")
    entity = f'<!DOCTYPE x [<!ENTITY e SYSTEM "{secret.as_uri()}">]>'
    text = structure(TOP).replace("?>\n", f"?>\n{entity}").replace('name="top"', 'name="&e;"')
    assert "told" not in message_of(archive(tmp_path, text, {"a": A}))


def test_an_entry_that_leads_out_of_the_archive_is_not_written(tmp_path):
    path = archive(tmp_path, structure(TOP), {"a": A}, {"../evil": "x", "/tmp/evil": "x"})
    assert System.load(path).components[0].fmu.name == "a.fmu"
    assert not (tmp_path.parent / "evil").exists()


ANNOTATED = [
    (
        '"scheme": "sequential"',
        '"scheme": "best"',
        "scheme = 'best'; must be one of sequential, jacobi",
    ),
    (
        '"step_ns": 100000',
        '"step_ns": "fast"',
        "step_ns = 'fast'; must be a whole number or a fraction",
    ),
    ('"step_ns": 100000', '"step": 100000', "unknown entry 'step'; did you mean step_ns?"),
    ('"events": []', '"events": [', "is damaged, not JSON in UTF-8: Expecting"),
    ('"sensor_1": {', '"sensor_3": {', "annotation 'grasp-cosim' is about other components"),
]


@pytest.mark.parametrize(("before", "after", "message"), ANNOTATED)
def test_a_spoilt_annotation(grasp, tmp_path, before, after, message):
    write_ssp(grasp, tmp_path / "grasp.ssp")

    def spoil(ssd):
        assert before.encode() in ssd
        return ssd.replace(before.encode(), after.encode(), 1)

    changed(tmp_path / "grasp.ssp", spoil)
    assert message in message_of(tmp_path / "grasp.ssp")


def test_an_archive_of_which_more_would_be_unpacked_than_there_is(tmp_path, monkeypatch):
    path = archive(tmp_path, structure(TOP), {"a": A})
    with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED) as file:
        file.writestr("resources/zeros", bytes(1_000_000))
    monkeypatch.setattr(model_description, "MAX_UNPACKED_BYTES", 100_000)
    assert re.search(r"its files have \d+ bytes unpacked; must have at most \d+$", message_of(path))
