"""Builds FMUs of the small models in tests/support/models: for FMI 2.0 and 3.0, of either kind.

The equations are in MODEL.c, the functions of FMI in fmi2.c and fmi3.c, which refuse a call in the
wrong mode. The value reference of a variable is its place in the list here and in the C.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import NamedTuple

import fmpy
import pytest
from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model

from .compiled import pack, shared_library

SOURCES = Path(__file__).with_name("models")
KINDS = ("ModelExchange", "CoSimulation")
needs_cvode = pytest.mark.skipif(
    not Path(fmpy.__file__).with_name("sundials").joinpath(fmpy.platform_tuple).is_dir(),
    reason="NO CVode: FMPy has none for this machine",
)
TYPES_2 = {"Float64": "Real", "Int32": "Integer"}
"""The types of FMI 2.0, where they have other names than in 3.0."""


class Variable(NamedTuple):
    """A variable; its start value is None where it has none, derivative names the state."""

    name: str
    type: str = "Float64"
    causality: str = "local"
    variability: str = "continuous"
    start: float | str | bool | None = None
    derivative: str = ""
    depends: tuple[str, ...] = ()


@dataclass(frozen=True)
class Model:
    """What the model description says: variables after the time, and event indicators by name.

    completed says that the solver has to tell of each of its steps.
    """

    variables: Sequence[Variable]
    indicators: Sequence[str] = ()
    completed: bool = False
    stop: float = 1.0
    step: float = 0.01
    names: dict[str, int] = field(default_factory=dict)

    def __post_init__(self):
        self.names.update({v.name: place for place, v in enumerate(self.variables, 1)})


def _state(name, start):
    state = Variable(name, causality="output", start=start)
    return state, Variable(f"der({name})", derivative=name)


def _parameter(name, start, tunable=False, type_="Float64"):
    return Variable(name, type_, "parameter", "tunable" if tunable else "fixed", start)


def _pair(name, type_, start, discrete):
    varies = "discrete" if discrete else "continuous"
    return (
        Variable(f"u_{name}", type_, "input", varies, start),
        Variable(f"y_{name}", type_, "output", varies, depends=(f"u_{name}",)),
    )


_WHOLE = ("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64")
_PASSED = {
    "2.0": (
        *_pair("Real", "Float64", 0.0, False),
        *_pair("Discrete", "Float64", 0.0, True),
        *_pair("Integer", "Int32", 0, True),
        *_pair("Boolean", "Boolean", False, True),
        *_pair("String", "String", "", True),
        *_pair("Enumeration", "Enumeration", 1, True),
    ),
    "3.0": (
        *_pair("Float64", "Float64", 0.0, False),
        *_pair("Discrete", "Float64", 0.0, True),
        *_pair("Float32", "Float32", 0.0, False),
        *(v for name in _WHOLE for v in _pair(name, name, 0, True)),
        *_pair("Boolean", "Boolean", False, True),
        *_pair("String", "String", "", True),
        *_pair("Binary", "Binary", "00", True),
        *_pair("Enumeration", "Enumeration", 1, True),
    ),
}
MODELS = {
    "bouncing_ball": Model(
        (
            *_state("h", 1.0),
            *_state("v", 0.0),
            _parameter("g", -9.81),
            _parameter("e", 0.7, tunable=True),
            _parameter("v_min", 0.1),
        ),
        indicators=("h",),
        stop=3.0,
    ),
    "van_der_pol": Model(
        (*_state("x0", 2.0), *_state("x1", 0.0), _parameter("mu", 1.0, tunable=True)), stop=20.0
    ),
    "dahlquist": Model(
        (
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
            Variable("counter", "Int32", "output", "discrete", 1),
            _parameter("width", 1.0),
            _parameter("last", 10, type_="Int32"),
        ),
        stop=10.0,
        step=0.2,
    ),
    "odd": Model(
        (
            *_state("x", 0.0),
            Variable("rate", start=1.0),
            _parameter("kind", 0, type_="Int32"),
            Variable("events", "Int32", "output", "discrete", 0),
            Variable("u", "Boolean", "input", "discrete", False),
        ),
        indicators=("x",),
        completed=True,
    ),
    "sine": Model(
        (Variable("count", "Int32", "output", "discrete", -1), _parameter("f", 1.0)),
        indicators=("count",),
    ),
    "feedthrough": Model(()),
}
"""By the name of their C file; the feedthrough has u_T and y_T for each type T of its version."""


def build_model(name, folder, version="2.0", kinds=KINDS, file=""):
    """The FMU of a model, for the kinds given, as folder/FILE.fmu (by default NAME.fmu)."""
    model = MODELS[name] if name != "feedthrough" else Model(_PASSED[version])
    describe = _description_2 if version == "2.0" else _description_3
    library = _library(name, version, "CoSimulation" in kinds)
    return pack(
        folder / f"{file or name}.fmu", version, name, describe(name, model, kinds), library
    )


def _library(name, version, steps):
    """The binary, with all functions that FMPy asks for; only with steps it can do any."""
    fmi = f"fmi{version[0]}"
    asked = FMU3Model if version == "3.0" else FMU2Slave if steps else FMU2Model
    options = (f"-D{fmi.upper()}", f'-DFMI="{fmi}.c"', *["-DNO_STEPS"][steps:], "-lm")
    return shared_library(SOURCES / f"{name}.c", options=options, asked=asked)


def _attributes(**values):
    """Those that are not None."""
    given = {key: v for key, v in values.items() if v is not None}
    lower = {key: str(v).lower() if isinstance(v, bool) else v for key, v in given.items()}
    return "".join(f' {key}="{v}"' for key, v in lower.items())


def _initial(v):
    """The attribute initial: exact for what has a start value, but for inputs, which have none."""
    if v.causality in ("input", "independent"):
        return None
    return "calculated" if v.start is None else "exact"


def _unknowns(model, element, listed, key, first):
    """Elements of the ModelStructure; key and first say how they name a variable."""
    found = ""
    for v in listed:
        of = " ".join(str(model.names[n] + first) for n in v.depends)
        place = {key: model.names[v.name] + first}
        found += f"<{element}{_attributes(**place, dependencies=of or None)}/>"
    return found


def _parts(model):
    """Outputs, derivatives, and what follows from others at the start."""
    outputs = [v for v in model.variables if v.causality == "output"]
    derivatives = [v for v in model.variables if v.derivative]
    initial = [v for v in model.variables if _initial(v) == "calculated"]
    return outputs, derivatives, initial


def _kinds(name, kinds, exchange):
    own = {
        "ModelExchange": exchange,
        "CoSimulation": ' canHandleVariableCommunicationStepSize="true"',
    }
    return "".join(f'<{k} modelIdentifier="{name}"{own[k]}/>' for k in KINDS if k in kinds)


def _experiment(model):
    times = _attributes(startTime=0.0, stopTime=model.stop, stepSize=model.step)
    return f"<DefaultExperiment{times}/>"


def _description_2(name, model, kinds):
    time = Variable("time", causality="independent")
    variables = ""
    for reference, v in enumerate((time, *model.variables)):
        of = model.names[v.derivative] + 1 if v.derivative else None
        kind = TYPES_2.get(v.type, v.type)
        declared = "Choice" if v.type == "Enumeration" else None
        variables += (
            f'<ScalarVariable name="{v.name}" valueReference="{reference}"'
            f"{_attributes(causality=v.causality, variability=v.variability, initial=_initial(v))}>"
            f"<{kind}{_attributes(declaredType=declared, derivative=of)}{_start(v)}/>"
            "</ScalarVariable>"
        )
    outputs, derivatives, initial = _parts(model)
    structure = "".join(
        f"<{group}>{_unknowns(model, 'Unknown', listed, 'index', 1)}</{group}>"
        for group, listed in (
            ("Outputs", outputs),
            ("Derivatives", derivatives),
            ("InitialUnknowns", initial),
        )
        if listed
    )
    exchange = _attributes(completedIntegratorStepNotNeeded=not model.completed)
    return (
        f'<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="{name}" '
        f'guid="{{{name}}}" numberOfEventIndicators="{len(model.indicators)}">'
        f"{_kinds(name, kinds, exchange)}"
        '<TypeDefinitions><SimpleType name="Choice"><Enumeration><Item name="one" value="1"/>'
        '<Item name="two" value="2"/></Enumeration></SimpleType></TypeDefinitions>'
        f"{_experiment(model)}<ModelVariables>{variables}</ModelVariables>"
        f"<ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


def _start(v):
    return "" if v.start is None else f' start="{str(v.start).lower()}"'


def _description_3(name, model, kinds):
    time = Variable("time", causality="independent")
    variables = ""
    for reference, v in enumerate((time, *model.variables)):
        of = model.names[v.derivative] if v.derivative else None
        declared = "Choice" if v.type == "Enumeration" else None
        child = v.type in ("String", "Binary") and v.start is not None
        variables += (
            f'<{v.type} name="{v.name}" valueReference="{reference}"'
            f"{_attributes(causality=v.causality, variability=v.variability, initial=_initial(v))}"
            f"{_attributes(declaredType=declared, derivative=of)}{'' if child else _start(v)}>"
            f"{'<Start' + _attributes(value=v.start) + '/>' if child else ''}</{v.type}>"
        )
    outputs, derivatives, initial = _parts(model)
    found = [v for v in model.variables if v.name in model.indicators]
    structure = "".join(
        _unknowns(model, element, listed, "valueReference", 0)
        for element, listed in (
            ("Output", outputs),
            ("ContinuousStateDerivative", derivatives),
            ("InitialUnknown", initial),
            ("EventIndicator", found),
        )
    )
    exchange = _attributes(needsCompletedIntegratorStep=model.completed)
    return (
        f'<?xml version="1.0"?><fmiModelDescription fmiVersion="3.0" modelName="{name}" '
        f'instantiationToken="{{{name}}}">{_kinds(name, kinds, exchange)}'
        '<TypeDefinitions><EnumerationType name="Choice"><Item name="one" value="1"/>'
        '<Item name="two" value="2"/></EnumerationType></TypeDefinitions>'
        f"{_experiment(model)}<ModelVariables>{variables}</ModelVariables>"
        f"<ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )
