"""What a system is made of archives of others, as a whole: values, connections, times, notes."""

import re

import pytest
from grasp_cosim import System
from grasp_cosim.system.validity import transforms
from ssp.hand_made import (
    NAMESPACES,
    UNITS,
    annotated,
    archive,
    bind,
    component,
    connect,
    connector_list,
    described,
    fmu,
    linear,
    mapping,
    parameter_set,
    structure,
    system,
)

FMU = fmu(
    "parameter Real length 1.0 m",
    "parameter Real ratio 1.0",
    "parameter Real ell 1.0 cubit",
    "parameter Integer count 1",
    "parameter Boolean active false",
    "parameter String label none",
    "parameter Enumeration mode 1",
    "input Real u 0.5 m",
    "output Real y - m",
)
METRES, MILLIMETRES = fmu("output Real y - m"), fmu("input Real u 0.5 mm")
IN_METRES = fmu("input Real u 0.5 m")
KELVIN, CELSIUS = fmu("output Real y - K"), fmu("input Real u 0.0 degC")
GIVES, TAKES = fmu("output Real y -", step="0.01"), fmu("input Real u 0.5")
CUBITS = fmu("output Real y - cubit")
"""It does not define that unit, and nothing else does."""

PACKAGE, DEFINITION = "application/x-ssp-package", "application/x-ssp-definition"
A_TO_B = connect("a/y", "b/u")


def told(loaded):
    """All that a run takes of a system, and what was said."""
    times = f"{loaded.step_ns} ns from {loaded.start_ns} to {loaded.stop_ns}, {loaded.scheme}"
    parts = [
        f"{c.name} = {c.fmu.name}{' integrated' if c.integrated else ''} {c.step_ns or ''} "
        f"{dict(c.values)} {dict(c.units)} {dict(c.rename)}"
        for c in loaded.components
    ]
    drawn = [f"{c.source} -> {c.target}: {c.factor} {c.offset}" for c in loaded.connections]
    becomes = [f"{port}: {change}" for port, change in transforms(loaded).items()]
    notes = [note.partition(" otherwise: ")[0] for note in loaded.notes]  # then libxml2's words
    return [times, *parts, *drawn, *becomes, *notes]


def of(top, files=None, step=None, ssd=None, **fmus):
    return ssd or structure(top), fmus or {"a": FMU}, files, step


def given(parameters, mapped="", units=None, **attributes):
    chosen = parameter_set(parameters) if units is None else parameter_set(parameters, units)
    return bind(chosen, mapped, **attributes)


def valued(inner="", outer="", connectors="", connections="", **more):
    """One component with bindings of its own, and those of the system."""
    part = component("a", "input u; output y", inner)
    return of(system("top", part, connections, connectors, outer), **more)


def pair(a=METRES, b=MILLIMETRES, content="", ends=("output y Real", "input u Real"), **attributes):
    parts = component("a", ends[0]) + component("b", ends[1])
    return of(system("top", parts, connect("a/y", "b/u", content, **attributes)), a=a, b=b)


def through(first="", second="", unit="", a=METRES):
    """Into a nested system, with these transformations on the two hops."""
    entry = f"input in Real {unit}" if unit else "input in Real"
    sub = system("sub", component("b", "input u Real"), connect("in", "b/u", second), entry)
    top = system("top", component("a", "output y Real") + sub, connect("a/y", "sub/in", first))
    return of(top, a=a, b=MILLIMETRES)


def passed_on(outer, inner, unit="m"):
    """Of the component a, `length` is twice the system's parameter p, by a connection."""
    part = component("a", "parameter length", inner)
    drawn = connect("p", "a/length", linear(2.0))
    return of(system("top", part, drawn, f"parameter p Real {unit}", outer))


def first_of_the_way(outer):
    own = component("a", "parameter length", given("length Real 7"))
    sub = system("sub", own, connect("q", "a/length"), "parameter q", given("q Real 5"))
    return of(system("top", sub, connect("p", "sub/q"), "parameter p", outer))


def by_table(target, parameter, kind, **table):
    entries = "".join(
        f'<ssc:MapEntry source="{s.strip("_")}" target="{t}"/>' for s, t in table.items()
    )
    change = f"<ssc:{kind}MappingTransformation>{entries}</ssc:{kind}MappingTransformation>"
    return valued(given(parameter, mapping(("x", target, change))))


FAR = '<ssc:Unit name="m"><ssc:BaseUnit m="1" factor="0.001"/></ssc:Unit>'
SET = "length Real 2.5; count Integer 3; active Boolean 1; label String text; mode Enumeration on"
FILES = (
    '<ssd:ParameterBinding source="resources/some%20set.ssv">'
    '<ssd:ParameterMapping source="./resources/map.ssm"/></ssd:ParameterBinding>'
)
IN_FILES = {
    "resources/some set.ssv": parameter_set("L Real 250.0 mm"),
    "resources/map.ssm": mapping(("L", "length", linear(2.0, 1.0))),
}
PARAMETERS = {
    "every type": valued(given(SET)),
    "whole numbers": valued(given("length Integer 2; mode Integer 2")),
    "a unit": valued(given("length Real 250.0 mm")),
    "units of the structure": valued(given("length Real 250.0 mm", units="")),
    "files": valued(FILES, files=IN_FILES),
    "later before earlier": valued(given("length Real 2") + given("length Real 3")),
    "system before component": valued(given("length Real 2"), given("a.length Real 7")),
    "prefix": valued(outer=given("length Real 7", prefix="a.")),
    "prefix and mapping": valued(
        outer=given("L Real 7", mapping(("p_L", "a.length", "")), prefix="p_")
    ),
    "only what is mapped": valued(
        given(
            "L Real 3; active Boolean true; W Real 3 [m]; H Real 4 ells; x Real 1; x Real 1",
            mapping(
                ("L", "length", ""), ("L", "ratio", ""), ("none", "count", ""), ("", "mode", "")
            ),
        )
    ),
    "a mapping without units": valued(
        given("L Real 250 mm", mapping(("L", "length", linear(0.5)), suppress=True))
    ),
    "booleans by table": by_table("active", "x Boolean false", "Boolean", false="true"),
    "enumerations by table": by_table("mode", "x Enumeration hi", "Enumeration", lo="off", hi="on"),
    "along a connection": valued(
        outer=given("in Real 3"),
        connectors="input in Real mm",
        connections=connect("in", "a/u", linear(2.0)),
    ),
    "a parameter passed on": of(
        system(
            "top",
            component("a", "parameter active"),
            connect("on", "a/active"),
            "parameter on Boolean",
            given("on Boolean true"),
        )
    ),
    "nested systems": of(
        system(
            "top",
            system("sub", component("a"), bindings=given("a.length Real 2; a.ratio Real 3")),
            bindings=given("sub.a.length Real 5"),
        )
    ),
    "what fits nothing": valued(given("lenght Real 2")),
    "a connected input": valued(given("u Real 9"), connections=connect("a/y", "a/u")),
    "not connected": valued(),
    "passed on before its own": passed_on(given("p Real 3"), given("length Real 7")),
    "passed on before all": passed_on(
        given("p Real 3000 mm; a.length Real 8"), given("length Real 7")
    ),
    "nothing passed on": passed_on("", given("length Real 7")),
    "the first of the way": first_of_the_way(given("p Real 3")),
    "the second from outside": first_of_the_way(given("sub.q Real 4")),
    "an empty unit of a value": valued(given("length Real 2.5 ?").replace('"?"', '""')),
    "the unit of the FMU": valued(given("ell Real 3.0 cubit")),
    "a unit for none": valued(given("ratio Real 3.0 [m]", units="")),
    "a known unit": valued(given("length Real 250.0 mm", units="")),
    "a unit in brackets": valued(given("length Real 250.0 [mm]; ratio Real 2 []", units="")),
    "a bracketed unit of the set": valued(given("length Real 2.5 [m]", units=FAR)),
    "the FMU's unit in brackets": valued(given("ell Real 3.0 [cubit]", units="")),
    "metres that are far": valued(given("length Real 2.5 m", units=FAR)),
    "a known unit of a system": valued(
        outer=given("in Real 3"),
        connectors="input in Real cm",
        connections=connect("in", "a/u"),
    ),
}

ENUMERATIONS = fmu("output Enumeration y -", "input Enumeration u 1")
TWO = component("a", "input u Real ?; output y Real ?") + component("b", "input u Real ?")
BOTH_WAYS = system(
    "top", component("a", "output y") + component("b", "input u"), connect("b/u", "a/y")
)
CONNECTIONS = {
    "units decide": pair(),
    "ends in no order": of(BOTH_WAYS, a=METRES, b=MILLIMETRES),
    "suppressed": pair(suppressUnitConversion="true"),
    "suppressed and transformed": pair(content=linear(3.0, 0.25), suppressUnitConversion="true"),
    "converted, then transformed": pair(content=linear(3.0, 0.25)),
    "units with an offset": pair(KELVIN, CELSIUS, linear(2.0)),
    "units of the archive alone": pair(GIVES, TAKES, ends=("output y Real m", "input u Real mm")),
    "units for an FMU that defines none": pair(CUBITS, ends=("output y Real m", "input u Real")),
    "a known unit": pair(METRES.replace(b'<BaseUnit m="1"/>', b"")),
    "a unit that an FMU lacks": pair(GIVES, IN_METRES, ends=("output y Real mm", "input u Real")),
    "other millimetres": of(
        "",
        ssd=pair(GIVES, IN_METRES, ends=("output y Real mm", "input u"))[0].replace(
            "0.001", "0.002"
        ),
        a=GIVES,
        b=IN_METRES,
    ),
    "defined otherwise": of(
        "",
        ssd=pair(ends=("output y Real mm", "input u Real m"))[0].replace(
            'm="1" factor', 'kg="1" factor'
        ),
        a=fmu("output Real y - mm"),
        b=IN_METRES,
    ),
    "an enumeration without a name": pair(
        ENUMERATIONS, ENUMERATIONS, ends=("output y Enumeration", "input u Enumeration")
    ),
    "an integer to a real": pair(
        fmu("output Integer y -"), TAKES, linear(0.5), ("output y Integer", "input u Real")
    ),
    "nested": through(),
    "transformed twice": through(linear(2.0), linear(1.0, 1.0), "m"),
    "another unit between": through(unit="mm"),
    "the unit between for an FMU without": through(unit="m", a=GIVES),
    "empty units": of(system("top", TWO.replace('"?"', '""'), A_TO_B), a=FMU, b=MILLIMETRES),
    "a connector of the FMU's unit": of(system("top", component("a", "parameter ell Real cubit"))),
    "without connectors": pair(ends=("", "")),
}


def bus(first, second, inline, drawn=""):
    """The output through a dictionary, by one reference in and by another, in a system, out."""
    space = "http://ssp-standard.org/SSP1/SystemStructureSignalDictionary"
    entries = (
        f'<ssb:SignalDictionary version="1.0" xmlns:ssb="{space}" {NAMESPACES}>'
        '<ssb:DictionaryEntry name="gap"><ssc:Real unit="mm"/></ssb:DictionaryEntry>'
        '<ssb:DictionaryEntry name="on"><ssc:Boolean/></ssb:DictionaryEntry>'
        f"<ssb:Units>{UNITS}</ssb:Units></ssb:SignalDictionary>"
    )

    def reference(name, connectors):
        return (
            f'<ssd:SignalDictionaryReference name="{name}" dictionary="bus">'
            f"{connector_list(connectors)}</ssd:SignalDictionaryReference>"
        )

    inner = component("b", "input u") + reference("out", second)
    sub = system("sub", inner, connect("out/gap", "b/u"))
    elements = component("a", "output y") + reference("in", first) + sub
    held = f">{entries}</ssd:SignalDictionary>" if inline else ' source="resources/bus.ssb"/>'
    lists = (
        f'<ssd:SignalDictionaries><ssd:SignalDictionary name="bus"{held}</ssd:SignalDictionaries>'
    )
    top = system("top", elements, connect("a/y", "in/gap") + drawn).removesuffix("</ssd:System>")
    files = None if inline else {"resources/bus.ssb": entries}
    return of(f"{top}{lists}</ssd:System>", files, a=METRES, b=IN_METRES)


OSP, OMS = "com.opensimulationplatform", "org.openmodelica"


def osp(step):
    inner = f'<osp:Algorithm><osp:FixedStepAlgorithm baseStepSize="{step}"/></osp:Algorithm>'
    return annotated(OSP, inner)


def oms(step, around="oms:Annotations"):
    """Early archives have no element oms:Annotations in the annotation."""
    inner = f'<oms:FixedStepMaster description="oms-ma" stepSize="{step}"/>'
    inner = f"<oms:SimulationInformation>{inner}</oms:SimulationInformation>"
    return annotated(OMS, f"<{around}>{inner}</{around}>" if around else inner)


def stepped(experiment="", top="", hint="", step=None):
    takes = component("b", "input u").replace("</ssd:Component>", f"{hint}</ssd:Component>")
    whole = system("top", component("a", "output y") + takes, A_TO_B)
    whole = whole.removesuffix("</ssd:System>") + f"{top}</ssd:System>"
    times = f'<ssd:DefaultExperiment stopTime="1">{experiment}</ssd:DefaultExperiment>'
    ssd = structure(whole, times).replace(
        NAMESPACES, f'{NAMESPACES} xmlns:osp="urn:osp" xmlns:oms="urn:oms"', 1
    )
    return of("", None, step, ssd, a=GIVES, b=TAKES)


def declared(*steps, start="0", stop="1", more=""):
    """The step of FMUs that name these, and the stop time if there is one."""
    names = "abc"[: len(steps)]
    fmus = {
        n: fmu("parameter Real p 1.0", step=s).replace(
            b"<DefaultExperiment ", f"<DefaultExperiment {more} ".encode()
        )
        for n, s in zip(names, steps, strict=True)
    }
    experiment = f'<ssd:DefaultExperiment startTime="{start}" stopTime="{stop}"/>' if stop else ""
    top = system("top", "".join(map(component, names)))
    return of("", None, None, structure(top, experiment), **fmus)


FLOW = ("sink", "twin", "mid", "source")
LOOP = ("after", "x", "y", "before")
NOISE = structure(system("top", component("a")), annotations=annotated("com.maker", ""))
TIMES = {
    "a step of OMSimulator": stepped(top=oms("0.002000")),
    "an early one": stepped(top=oms("0.002", "").replace("oms:", "")),
    "a step of OSP": stepped(osp("5e-3")),
    "both": stepped(osp("0.002"), oms("0.002000")),
    "a given step": stepped(osp("0.005"), oms("0.002"), step=0.001),
    "a hint": stepped(osp("0.01"), hint=annotated(OSP, '<osp:StepSizeHint value="0.021"/>')),
    "a step that varies": stepped(top=annotated(OMS, "<oms:VariableStepMaster/>")),
    "the smallest step": declared("0.01", "0.001", ""),
    "one that divides": declared("0.01", "0.0003"),
    "one that divides the span": declared("0.01", "0.0003", start="0.1", stop="1"),
    "steps that are none": declared("-1", "1e-20", "0.5"),
    "no whole nanosecond": declared("1.4e-9", "0.5"),
    "the stop of the FMUs": declared("0.5", "0.5", stop="", more='stopTime="2.5"'),
    "along the flow": of(
        system(
            "top",
            "".join(component(n, "input u; output y") for n in FLOW),
            connect("source/y", "mid/u") + connect("mid/y", "twin/u") + connect("twin/y", "sink/u"),
        ),
        **dict.fromkeys(FLOW, FMU),
    ),
    "a loop": of(
        system(
            "top",
            "".join(component(n, "input u; output y") for n in LOOP),
            connect("before/y", "after/u") + connect("x/y", "y/u") + connect("y/y", "x/u"),
        ),
        **dict.fromkeys(LOOP, FMU),
    ),
    "no bearing": of("", {"B.ssd": NOISE, "A.ssd": NOISE, "x/C.ssd": NOISE}, ssd=NOISE, a=FMU),
    "integrated": of(
        system("top", component("a")), a=FMU.replace(b"CoSimulation", b"ModelExchange")
    ),
}

WIDE = component("a", "input u Float64 m; output y Float32; structuralParameter count Int32")


def values_2(parameters):
    return given(parameters, units="").replace('version="1.0"', 'version="2.0"')


def of_2(top, experiment=None):
    more = {} if experiment is None else {"experiment": experiment}
    return of("", ssd=structure(top, version="2.0", **more), a=FMU, b=FMU)


LOCAL = system("top", component("a", "input u; local state Float64; unspecified flange"))
VERSION_2 = {
    "connections of 2": of_2(
        system(
            "top",
            WIDE + component("b", "input u Float64 m"),
            connect("a/y", "b/u", linear(2.0, 1.0)),
        )
    ),
    "types of 2": of_2(
        system("top", component("a", bindings=values_2("length Float64 250 mm; count UInt16 3")))
    ),
    "one value of a list": of_2(
        system("top", component("a", bindings=values_2("label String x"))).replace(
            '<ssv:String value="x"/>', '<ssv:String><ssv:Value value="two words"/></ssv:String>'
        )
    ),
    "left out of 2": of_2(
        LOCAL.replace(
            'name="u" kind="input">',
            'name="u" kind="input"><ssd:ConnectorGeometry x="0" y="0.5" systemInnerX="0.1"/>',
        ),
        '<ssd:DefaultExperiment stopTime="1"/><ssc:MetaData kind="general" type="text/xml"/>',
    ),
    "types of 2 in 1": pair(ends=("output y Float64", "input u Float64")),
}

INNER = system(
    "inside",
    component("b", "input u"),
    connect("in", "b/u", linear(2.0)),
    "input in",
    given("b.k Real 1; b.u Real 2"),
)


def nested(sub, bindings="", unit="", **files):
    """A component that is the archive in resources/sub.ssp, or a structure of its archive."""
    kind = PACKAGE if ".ssp" in sub else DEFINITION
    part = component("sub", f"input in {unit}", bindings, source=sub, type=kind)
    top = system("top", component("a", "output y Real") + part, connect("a/y", "sub/in"))
    return of(top, files, a=METRES, b=fmu("input Real u 0.5 m", "parameter Real k 1.0 m"))


SHARED = system("first", component("b", "input u"), connect("in", "b/u"), "input in")
SECOND = component("second", "input in", type=DEFINITION, source="#S")
WHOLE = system("top", component("a", "output y Real") + component("b", "input u Real"), A_TO_B)
ODD = '<ssd:Annotations><ssc:Annotation type="x"/></ssd:Annotations><ssd:Connectors/>'
EARLY = annotated("org.open-simulation-platform", '<osp:Master stepSize="1e-4"/>')
SET_FILE = '<ssd:ParameterBinding source="a.ssv"/>'
NO_SPACE = re.sub(r' xmlns:ss[a-z]="[^"]*"', "", parameter_set("length Real 2.5 m"))
WRONG_SPACE = NO_SPACE.replace("Set ", 'Set xmlns:ssv="http://ssp-standard.org/SSP1/Values" ', 1)
FORMS = {
    "another order, empty lists": of(
        WHOLE.replace('name="top">', f'name="top">{ODD}'), a=METRES, b=MILLIMETRES
    ),
    "a prefix for no namespace": of(
        WHOLE.replace('name="top">', f'name="top">{EARLY}'), a=METRES, b=MILLIMETRES
    ),
    "no namespace": valued(SET_FILE, files={"a.ssv": NO_SPACE}),
    "a wrong namespace": valued(SET_FILE, files={"a.ssv": WRONG_SPACE}),
    "not ASCII": of(
        system("Übersicht", component("Größe 1", "input u", source="resources/gr%C3%B6.fmu")),
        grö=FMU,
    ),
}
NESTED = {
    "an archive": nested("resources/sub.ssp"),
    "a variant of it": nested("resources/sub.ssp#Other.ssd"),
    "its bindings beaten": nested("resources/sub.ssp", given("b.k Real 3 mm")),
    "a unit of the component": nested("resources/sub.ssp", unit="Real mm"),
    "a structure": nested(
        "x/sub.ssd",
        **{"x/sub.ssd": structure(INNER.replace("resources/b", "../resources/b"))},
    ),
    "by its id": of(
        system(
            "top",
            component("a", "output y") + SHARED.replace('"first"', '"first" id="S"') + SECOND,
            connect("a/y", "second/in"),
        ),
        a=METRES,
        b=IN_METRES,
    ),
    "a bus": bus("input gap", "output gap", inline=False),
    "a bus inline": bus("inout gap Real", "inout gap; inout on Boolean", inline=True),
}


def packed(folder, top):
    """An archive to be in another, with an experiment of its own, and a variant."""
    (folder / "inner").mkdir()
    ssd = structure(top, '<ssd:DefaultExperiment startTime="5" stopTime="9"/>')
    takes = fmu("input Real u 0.5 m", "parameter Real k 1.0 m")
    return archive(folder / "inner", ssd, {"b": takes}, {"Other.ssd": ssd}).read_bytes()


CASES = PARAMETERS | CONNECTIONS | TIMES | VERSION_2 | FORMS | NESTED


@pytest.mark.parametrize("name", CASES)
def test_what_is_made_of_an_archive(name, tmp_path, snapshot):
    ssd, fmus, files, step = CASES[name]
    if "resources/sub.ssp" in ssd:
        files = {"resources/sub.ssp": packed(tmp_path, INNER)}
    assert told(System.load(archive(tmp_path, ssd, fmus, files), step=step)) == snapshot


def test_a_set_in_the_fmu_of_the_component(tmp_path):
    binding = (
        '<ssd:ParameterBinding source="resources/own.ssv" sourceBase="component">'
        '<ssd:ParameterMapping source="resources/map.ssm"/></ssd:ParameterBinding>'
    )
    own = {"resources/own.ssv": parameter_set("L Real 250.0 mm")}
    files = {
        "resources/a.fmu": described(tmp_path / "inner.zip", FMU, **own).read_bytes(),
        "resources/map.ssm": mapping(("L", "length", "")),
    }
    top = system("top", component("a", "input u", binding))
    loaded = System.load(archive(tmp_path, structure(top), {}, files))
    assert loaded.components[0].values["length"] == 0.25


def test_a_step_and_a_stop_can_be_given(tmp_path):
    ssd = structure(system("top", component("a")), "")
    loaded = System.load(archive(tmp_path, ssd, {"a": FMU}), step=0.25, stop=2.0)
    assert (loaded.step_ns, loaded.stop_ns) == (250_000_000, 2_000_000_000)
