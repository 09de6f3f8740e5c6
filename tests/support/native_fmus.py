"""Builds the C test FMUs of tests/support/models, for FMI 2.0 and 3.0, of either kind.

The equations are in MODEL.c; fmi.c makes an FMU of them, which refuses a call in the wrong mode.
The value reference of a variable is its place in the lists here, where it names no other one.
"""

import json
import shutil
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import fmpy
import pytest
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave

from .compiled import pack, shared_library

SOURCES = Path(__file__).with_name("models")
KINDS = ("ModelExchange", "CoSimulation")
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
needs_cvode = pytest.mark.skipif(
    not Path(fmpy.__file__).with_name("sundials").joinpath(fmpy.platform_tuple).is_dir(),
    reason="NO CVode: FMPy has none for this machine",
)
ARRAY_TYPES = (
    *("Float64", "Float32", "Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64"),
    *("UInt64", "Boolean", "Enumeration"),
)
"""The types of the arrays u_T and y_T = u_T, of 2 x k, of the state-space model."""

TYPES = {
    "2.0": {"Real": 0, "Integer": 6, "Boolean": 10, "Enumeration": 11, "String": 12},
    "3.0": {name: place for place, name in enumerate((*ARRAY_TYPES, "String"))},
}
"""By version, the types and what is added to 100 (u_T) or 200 (y_T) as value reference."""

PARAMETERS = (
    *("crash_at", "exit_at", "hang_at", "error_at", "discard_at", "early_at", "terminate_at"),
    *("gain", "interrupt_at", "interrupted"),
)
UNITS = {
    "m": {"m": 1},
    "mm": {"m": 1, "factor": 0.001},
    "N": {"kg": 1, "m": 1, "s": -2},
    "mN": {"kg": 1, "m": 1, "s": -2, "factor": 0.001},
    "K": {"K": 1},
    "degC": {"K": 1, "offset": 273.15},
    "degF": {"K": 1, "factor": 0.5555555555555556, "offset": 255.3722222222222},
}
"""The units the FMUs define, in SI base units; and one that is none of these."""

CAPABLE = {"canHandleVariableCommunicationStepSize": "true"}
EVENT_MODE = {**CAPABLE, "mightReturnEarlyFromDoStep": "true", "hasEventMode": "true"}
"""Of an FMU for FMI 3.0 that handles its events with its host."""


def starts(version):
    """A value for each input of models/native.c, by name."""
    own = {"Boolean": False, "String": "", "Enumeration": 1}
    return {f"u_{t}": own.get(t, 0) for t in TYPES[version]}


def starts_text(version, *but):
    """The same as what is in an inline table of TOML, but for some inputs."""
    given = {n: v for n, v in starts(version).items() if n not in but}
    return ", ".join(f"{n} = {json.dumps(v)}" for n, v in given.items())


class Variable(NamedTuple):
    """A variable; what it has not is None, or empty. Sizes are references, or "=2" for a fixed one.

    derivative names the state; depends what an output depends on, initially that at the start.
    """

    name: str
    type: str = "Float64"
    causality: str = "local"
    variability: str | None = "continuous"
    start: float | str | bool | None = None
    derivative: str = ""
    depends: Sequence[str] | None = None
    initially: Sequence[str] | None = None
    reference: int | None = None
    sizes: str = ""
    unit: str | None = None
    description: str | None = None


@dataclass(frozen=True)
class Model:
    """What the model description says: variables, and event indicators by name.

    completed says that the solver has to tell of each of its steps, categories are of its log.
    """

    variables: Sequence[Variable]
    indicators: Sequence[str] = ()
    completed: bool = False
    stop: float | None = 1.0
    step: float = 0.01
    choices: tuple[str, str] = ("one", "two")
    tolerance: float | None = None
    categories: Sequence[str] = ()


_TIME = Variable("time", causality="independent")


def _state(name, start):
    state = Variable(name, causality="output", start=start)
    return state, Variable(f"der({name})", derivative=name)


def _parameter(name, start, tunable=False, type_="Float64"):
    return Variable(name, type_, "parameter", "tunable" if tunable else "fixed", start)


def _pair(name, type_, discrete=None):
    """An input and an output of a type that passes it on."""
    discrete = type_[:5] not in ("Real", "Float") if discrete is None else discrete
    varies = "discrete" if discrete else "continuous"
    starts = {"Boolean": False, "String": "", "Binary": "00", "Enumeration": 1}
    return (
        Variable(f"u_{name}", type_, "input", varies, starts.get(type_, 0)),
        Variable(f"y_{name}", type_, "output", varies, depends=[f"u_{name}"]),
    )


def _feedthrough(version):
    first = "Real" if version == "2.0" else "Float64"
    types = [t for t in TYPES[version] if t not in (first, "Enumeration")]
    types += ["Enumeration"] if version == "2.0" else ["Binary", "Enumeration"]
    pairs = [_pair(first, first), _pair("Discrete", first, True), *(_pair(t, t) for t in types)]
    return Model((_TIME, *(v for pair in pairs for v in pair)))


def _native(version, strings=True):
    """Both versions have u_T and y_T = u_T for each type T of theirs, and see models/native.c."""
    real, whole = ("Real", "Integer") if version == "2.0" else ("Float64", "UInt64")
    variables = []
    for fmi_type, place in TYPES[version].items():
        u, y = _pair(fmi_type, fmi_type)
        variables.append(u._replace(reference=100 + place))
        if strings or fmi_type != "String":
            variables.append(y._replace(reference=200 + place))
    for place, name in enumerate(PARAMETERS, 1):
        parameter = _parameter(name, "1" if name == "gain" else "1e9", name == "gain", real)
        variables.append(parameter._replace(reference=place))
    ends = [("x", real, 20), ("now", real, 21), ("steps", whole, 30)]
    if version == "3.0":
        size = Variable("size", whole, "structuralParameter", "fixed", 3, reference=40)
        variables.append(size)
        ends.append(("size_out", whole, 41))
    for name, fmi_type, place in ends:
        varies = "continuous" if fmi_type == real else "discrete"
        output = Variable(name, fmi_type, "output", varies, depends=(), reference=place)
        variables.append(output)
    if version == "3.0":
        variables += (
            Variable("u_Binary", "Binary", "input", None, "00", reference=150),
            Variable("y_array", "String", "output", None, reference=151, sizes="=3"),
            Variable("y_clock", "Clock", "output", None, reference=152),
            _TIME._replace(reference=153),
        )
    return Model(variables, stop=None)


def _state_space(types):
    unit = "1 0 0 0 1 0 0 0 1"
    variables = [
        _TIME,
        *(Variable(name, "UInt64", "structuralParameter", "tunable", 3) for name in "mnrk"),
        *(
            _parameter(name, unit, tunable=True)._replace(sizes=sizes)
            for name, sizes in {"A": "2 2", "B": "2 1", "C": "3 2", "D": "3 1"}.items()
        ),
        _parameter("x0", 0)._replace(sizes="2"),
        Variable("u", causality="input", start="1 2 3", sizes="1"),
        Variable("y", "Float64", "output", "continuous", None, "", "CDux", ("C", "D", "x0", "u"),
                 sizes="3"),
        Variable("x", sizes="2"),
    ]  # fmt: skip
    for place, fmi_type in enumerate(ARRAY_TYPES if types else ()):
        u, y = _pair(fmi_type, fmi_type)
        variables.append(u._replace(reference=100 + place, sizes="=2 4"))
        variables.append(y._replace(reference=200 + place, sizes="=2 4"))
    return Model(variables, stop=None, choices=("slow", "fast"))


MODELS = {
    "bouncing_ball": Model(
        (
            _TIME,
            *_state("h", 1.0),
            *_state("v", 0.0),
            _parameter("g", -9.81),
            _parameter("e", 0.7, tunable=True),
            _parameter("v_min", 0.1),
        ),
        indicators=("h",),
        stop=3.0,
    ),
    "dahlquist": Model(
        (
            _TIME,
            *_state("x", 1.0),
            _parameter("k", 1.0, tunable=True),
            Variable("u", causality="input", start=0.0),
            _parameter("d", 0.0),
            Variable("y", causality="output", depends=("x", "u")),
        ),
        stop=10.0,
        step=0.1,
    ),
    "stair": Model(
        (
            _TIME,
            Variable("counter", "Int32", "output", "discrete", 1),
            _parameter("width", 1.0),
            _parameter("last", 10, type_="Int32"),
        ),
        stop=10.0,
        step=0.2,
    ),
    "odd": Model(
        (
            _TIME,
            *_state("x", 0.0),
            Variable("rate", start=1.0),
            _parameter("kind", 0, type_="Int32"),
            Variable("events", "Int32", "output", "discrete", 0),
            Variable("u", "Boolean", "input", "discrete", False),
        ),
        indicators=("x",),
        completed=True,
    ),
    "late": Model(
        (
            _TIME,
            Variable("u", causality="input", start=0.0),
            Variable("y", causality="output", depends=("u",)),
            _parameter("base", 0.0),
            _parameter("gain", 1.0),
        ),
    ),
    "sampled": Model(
        (
            _TIME,
            Variable("x", causality="output", start=1.0),
            Variable("der(x)", derivative="x"),
            Variable("held", causality="output", start=0.0),
            Variable("ticks", "Int32", "output", "discrete", 0),
            Variable("last", causality="output", start=-1.0),
            Variable("events", "Int32", "output", "discrete", 0),
            Variable("offset", causality="input", start=0.0),
            Variable("trigger", "Float64", "input", "discrete", 0.0),
            _parameter("gain", 1.0),
            _parameter("period", 0.1, tunable=True),
            _parameter("first", 0.0),
            _parameter("delay", 0.0),
            _parameter("factor", 1.0),
            _parameter("named", 0.0),
        ),
    ),
    "sine": Model(
        (_TIME, Variable("count", "Int32", "output", "discrete", -1), _parameter("f", 1.0)),
        indicators=("count",),
    ),
    "rigid": Model(
        (
            _TIME,
            Variable("count", "Int32", "output", "discrete", 0),
            Variable("begin", causality="output", variability="discrete", start=0.0),
            Variable("length", causality="output", variability="discrete", start=0.0),
            _parameter("inside", 0.01),
            _parameter("longest", 1e9),
        )
    ),
    "feedthrough": None,
}
"""By the name of their C file; the feedthrough has u_T and y_T for each type T of its version."""

_INNER = (
    _TIME,
    Variable("x", start=0.0, unit="m"),
    Variable("der(x)", derivative="x"),
    _parameter("k", 2.0, tunable=True),
    Variable("u", causality="input", start=1.0),
    Variable("tau", causality="calculatedParameter", variability="tunable"),
    Variable("power[1]", unit="N"),
    Variable("count", "Int32", variability="discrete"),
    Variable("high", "Boolean", variability="discrete"),
    Variable("label", "String", variability="discrete"),
    Variable("empty"),
    Variable("y", causality="output", depends=("x",)),
    Variable("stamp", "UInt64", variability="discrete"),
)
"""Of models/inner.c; the last two may be left out."""


def inner(
    folder, version="3.0", outputs=False, stamp="", kinds=("CoSimulation",), more="", name="inner"
):
    """The FMU of models/inner.c as folder/NAME.fmu, with or without its output y.

    A stamp is "local" or "output", in FMI 3.0 alone; more are further variables of its description.
    """
    variables = [v for v in _INNER if v.name not in ("y", "stamp")]
    places = {v.name: place for place, v in enumerate(_INNER)}
    variables += [v for v in _INNER if v.name == "y" and outputs]
    variables += [v._replace(causality=stamp) for v in _INNER if v.name == "stamp" and stamp]
    variables = [v._replace(reference=places[v.name]) for v in variables]
    xml = description("inner", version, Model(variables), kinds, more=more)
    library = library_of("inner", version, "CoSimulation" in kinds)
    return pack(folder / f"{name}.fmu", version, "inner", xml, library)


def build(
    folder,
    name="native",
    version="3.0",
    units=None,
    capabilities=None,
    token="{native}",
    complete=False,
    strings=True,
):
    """The FMU of models/native.c as NAME.fmu in folder: every scalar type, and failures on demand.

    Units by variable, capabilities as attributes (else CAPABLE). It has outputs that are Strings
    only with strings. It loads with the right token only. With complete, it has the functions of
    FMI 3.0 for other kinds of FMUs, too, without which FMPy does not load it.
    """
    model = _native(version, strings)
    units = units or {}
    variables = [v._replace(unit=units.get(v.name)) for v in model.variables]
    xml = description("native", version, Model(variables, stop=None), ["CoSimulation"],
                      CAPABLE if capabilities is None else capabilities, token)  # fmt: skip
    library = library_of("native", version, complete=complete)
    return pack(folder / f"{name}.fmu", version, "native", xml, library)


def build_model(
    name, folder, version="2.0", kinds=KINDS, file="", capabilities=CAPABLE, more="", options=(),
    step=None,
):  # fmt: skip
    """The FMU of one of MODELS, for the kinds given, as folder/FILE.fmu (by default NAME.fmu).

    More are further variables of its description, options further ones of the compiler. With a step
    its default experiment recommends that one.
    """
    model = MODELS[name] or _feedthrough(version)
    model = model if step is None else replace(model, step=step)
    library = library_of(name, version, "CoSimulation" in kinds, more=("-lm", *options))
    xml = description(name, version, model, kinds, capabilities, more=more)
    return pack(folder / f"{file or name}.fmu", version, name, xml, library)


TALKER = Model(
    (
        _TIME,
        Variable("y", causality="output", depends=()),
        Variable("tolerance", causality="output", depends=()),
        Variable("lines", "Int32", "output", "discrete", depends=()),
    ),
    categories=("logEvents", "logSecrets", "logStatusWarning", "logStatusError"),
)


def talker(
    folder, *options, version="2.0", kinds=("CoSimulation",), name="talker", capabilities=CAPABLE,
    **more,
):  # fmt: skip
    """The FMU of models/talker.c as folder/NAME.fmu, compiled with options such as -DDEAF.

    more are other fields of its Model.
    """
    xml = description("talker", version, replace(TALKER, **more), kinds, capabilities)
    options = ("-lm", *options)
    library = library_of("talker", version, "CoSimulation" in kinds, False, options)
    return pack(folder / f"{name}.fmu", version, "talker", xml, library)


def state_space(
    folder,
    name="ss",
    types=False,
    more="",
    kind="CoSimulation",
    binary=True,
    complete=False,
    capabilities=CAPABLE,
):
    """The FMU name.fmu in folder: m inputs u, n states x, r outputs y, 3 of each at the start.

    With types it has u_T and y_T for all types; more are further variables of its description. kind
    is CoSimulation or ModelExchange. One without a binary needs no compiler.
    """
    library = library_of("state_space", "3.0", complete=complete) if binary else b""
    xml = description("state_space", "3.0", _state_space(types), [kind], capabilities, more=more)
    return pack(folder / f"{name}.fmu", "3.0", "state_space", xml, library)


def library_of(name, version, steps=True, complete=True, more=("-lm",), code=""):
    """The binary of a model; only with steps it can do any, as in build() if it is complete."""
    asked = (FMU3Slave if steps else FMU3Model) if version == "3.0" else FMU2Slave
    asked = FMU2Model if version == "2.0" and not steps else asked
    options = [f"-DFMI={version[0]}", f'-DNAME="{name}"', *["-DNO_STEPS"][steps:], *more]
    return shared_library(
        SOURCES / f"{name}.c", code=code, options=(*options,), asked=asked if complete else None
    )


def description(name, version, model, kinds, capabilities=CAPABLE, token=None, more=""):
    """The text of modelDescription.xml."""
    three = version == "3.0"
    root = ElementTree.Element("fmiModelDescription", fmiVersion=version, modelName=name)
    root.set("instantiationToken" if three else "guid", token or f"{{{name}}}")
    if not three:
        root.set("numberOfEventIndicators", str(len(model.indicators)))
    silent = {"completedIntegratorStepNotNeeded": not model.completed}
    tells = {"needsCompletedIntegratorStep": model.completed} if three else silent
    for kind in KINDS:
        if kind in kinds:
            _add(root, kind, modelIdentifier=name, **(tells if kind == KINDS[0] else capabilities))
    units = _add(root, "UnitDefinitions")
    for unit, base in UNITS.items():
        _add(_add(units, "Unit", name=unit), "BaseUnit", **base)
    _add(units, "Unit", name="bare")
    types = _add(root, "TypeDefinitions")
    if three:
        choice = _add(types, "EnumerationType", name="Choice")
    else:
        choice = _add(_add(types, "SimpleType", name="Choice"), "Enumeration")
    for value, item in enumerate(model.choices, 1):
        _add(choice, "Item", name=item, value=value)
    if model.categories:
        categories = _add(root, "LogCategories")
        for name_ in model.categories:
            _add(categories, "Category", name=name_)
    if model.stop is not None:
        experiment = {"stopTime": model.stop, "tolerance": model.tolerance, "stepSize": model.step}
        _add(root, "DefaultExperiment", startTime=0.0, **experiment)
    variables = _add(root, "ModelVariables")
    keys = [v.reference if three and v.reference is not None else place + (not three)
            for place, v in enumerate(model.variables)]  # fmt: skip
    named = {v.name: key for v, key in zip(model.variables, keys, strict=True)}
    for place, v in enumerate(model.variables):
        _declare(variables, v, place, named, three)
    variables.extend(ElementTree.fromstring(f"<more>{more}</more>"))
    _structure(_add(root, "ModelStructure"), model, named, three)
    return '<?xml version="1.0"?>' + ElementTree.tostring(root, "unicode")


def _declare(variables, v, place, named, three):
    calculated = "calculated" if v.start is None else "exact"
    own = {
        "name": v.name,
        "valueReference": place if v.reference is None else v.reference,
        "causality": v.causality,
        "variability": v.variability,
        "description": v.description,
        "initial": calculated if v.causality in ("output", "local") else None,
    }
    typed = {
        "declaredType": "Choice" if v.type == "Enumeration" else None,
        "derivative": named[v.derivative] if v.derivative else None,
        "unit": v.unit,
        "intervalVariability": "triggered" if v.type == "Clock" else None,
    }
    if not three:
        kind = {"Float64": "Real", "Int32": "Integer"}.get(v.type, v.type)
        _add(_add(variables, "ScalarVariable", **own), kind, **typed, start=v.start)
        return
    if v.type in ("Clock", "Binary") or v.sizes:
        del own["initial"]
    text = v.type in ("String", "Binary")
    element = _add(variables, v.type, **own, **typed, start=None if text else v.start)
    for size in v.sizes.split():
        fixed = size.startswith("=")
        _add(element, "Dimension", **{"start" if fixed else "valueReference": size.lstrip("=")})
    if text and v.start is not None:
        _add(element, "Start", value=v.start)


def _structure(structure, model, named, three):
    """Outputs, derivatives, what follows from others at the start, and event indicators."""
    outputs = [v for v in model.variables if v.causality == "output"]
    derivatives = [v for v in model.variables if v.derivative]
    known = ("local", "output")
    initial = [v for v in model.variables if v.causality in known and v.start is None]
    initial = [v for v in initial if v.depends is not None or (not v.sizes and v.type != "Clock")]
    indicators = [v for v in model.variables if v.name in model.indicators and three]
    for group, element, listed in (
        ("Outputs", "Output", outputs),
        ("Derivatives", "ContinuousStateDerivative", derivatives),
        ("InitialUnknowns", "InitialUnknown", initial),
        ("", "EventIndicator", indicators),
    ):
        into = structure if three or not listed else _add(structure, group)
        for v in listed:
            first = element == "InitialUnknown" and v.initially is not None
            depends = v.initially if first else v.depends
            of = None if depends is None else " ".join(str(named[n]) for n in depends)
            key = "valueReference" if three else "index"
            _add(into, element if three else "Unknown", **{key: named[v.name], "dependencies": of})


def _add(parent, tag, **attributes):
    """An element more, with the attributes that are not None."""
    given = {key: v for key, v in attributes.items() if v is not None}
    lower = {key: str(v).lower() if isinstance(v, bool) else str(v) for key, v in given.items()}
    return ElementTree.SubElement(parent, tag, lower)
