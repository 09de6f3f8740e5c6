"""The annotation of an archive with all that SSP 1.0 has no form for, so that our run is the same.

The communication step, the scheme, the components' own steps, processes, renamed variables and
units, the initialisation, events, faults, roles, presets, stimuli and the pacing. Where it is, the
elements are in the order of execution. Its content is JSON: the dataclasses of the system as
objects, a port as a string.
"""

import json
from array import array
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, is_dataclass
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from lxml import etree  # type: ignore[import-untyped]

from ..base.checks import check_values
from ..base.errors import InputError, choices, nearest
from ..system.description import System
from ..system.parts import Event, Fault, Initialisation, Isolation, Port, Solver
from ..system.realtime import Realtime
from ..system.stimuli import Stimuli
from ..system.structure import Diverging, Scheme
from .document import add
from .foreign import Steps

TYPE = "grasp-cosim"
_TAG = "{grasp-cosim:system}System"


@dataclass(frozen=True, slots=True)
class Beside:
    """The attributes of a component that SSP has no form for; earlier ones lack the last two."""

    rename: Mapping[str, str]
    step_ns: int | None
    isolation: Isolation
    units: Mapping[str, str] = field(default_factory=dict)
    solver: Solver | None = None


@dataclass(frozen=True, slots=True)
class Extras:
    """The attributes of a system that SSP has no form for; earlier archives lack the last five."""

    step_ns: int
    scheme: Scheme
    components: Mapping[str, Beside]
    initialisation: Initialisation
    events: tuple[Event, ...]
    faults: tuple[Fault, ...]
    roles: Mapping[str, str] = field(default_factory=dict)
    presets: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    diverging: Diverging = "stop"
    input: Stimuli | None = None
    realtime: Realtime = Realtime()
    metrics: tuple[str, ...] = ()


def no_extras(components: Iterable[str], steps: Steps) -> Extras:
    """The extras of an archive without our annotation; steps are those of other tools.

    Who names a step means that all components take it at once.
    """
    beside = {name: Beside({}, steps.own_ns.get(name), "none") for name in components}
    scheme: Scheme = "jacobi" if steps.base_ns else "sequential"
    return Extras(steps.base_ns, scheme, beside, Initialisation(), (), ())


def extras_of(system: System) -> Extras:
    """The extras of a system."""
    shared = {f.name: getattr(system, f.name) for f in fields(Extras)}
    beside = {
        c.name: Beside(dict(c.rename), c.step_ns, c.isolation, dict(c.units), c.solver)
        for c in system.components
    }
    return Extras(**{**shared, "components": beside})


def write_extras(annotations: Any, extras: Extras) -> None:
    """Add the annotation."""
    element = etree.SubElement(
        add(annotations, "ssc:Annotation", type=TYPE), _TAG, nsmap={"grasp": "grasp-cosim:system"}
    )
    element.text = json.dumps(_plain(extras), indent=1)


def read_extras(place: str, annotation: Any) -> Extras:
    """The extras of our annotation; InputError where it is not as we write it."""
    element = annotation.find(_TAG)
    try:
        extras: Extras = _typed(Extras, json.loads("" if element is None else element.text or ""))
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        raise InputError(f"{place}: annotation {TYPE!r}: not as it was written: {error}") from error
    for name, values in extras.presets.items():
        check_values(f"{place}: annotation {TYPE!r}: preset {name!r}", values)
    return extras


def _plain(value: Any) -> Any:
    """A value of the system as JSON has it."""
    if isinstance(value, Port):
        return str(value)
    if is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, Mapping):
        return {_plain(key): _plain(entry) for key, entry in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(entry) for entry in value]
    if hasattr(value, "tolist"):
        return value.tolist()
    return value


def _typed(kind: Any, value: Any) -> Any:
    """The reverse: a value of the given type; ValueError or TypeError where it is none."""
    origin, arguments = get_origin(kind), get_args(kind)
    if kind is Any:
        return value
    if kind is Port:
        return Port(*_typed(str, value).split(".", 1))
    if is_dataclass(kind) and isinstance(kind, type):
        hints = get_type_hints(kind)
        unknown = [key for key in _typed(dict, value) if key not in hints]
        if unknown:
            raise ValueError(f"unknown entry {unknown[0]!r}; {nearest(unknown[0], hints)}")
        return kind(**{key: _typed(hints[key], entry) for key, entry in value.items()})
    if origin is not None and isinstance(origin, type) and issubclass(origin, Mapping):
        return {
            _typed(arguments[0], key): _typed(arguments[1], entry)
            for key, entry in _typed(dict, value).items()
        }
    if origin is Sequence:
        return array("d" if arguments[0] is float else "q", _typed(list, value))
    if origin is tuple:
        return tuple(_typed(arguments[0], entry) for entry in _typed(list, value))
    if origin in (Union, UnionType):
        fitting = [alternative for alternative in arguments if alternative is type(value)]
        return _typed((fitting or arguments)[0], value)
    if origin is Literal:
        if value not in arguments:
            raise ValueError(f"{value!r}: must be one of {choices(arguments)}")
        return value
    if type(value) is not kind and (kind, type(value)) != (float, int):
        raise ValueError(f"{value!r}: must be of type {kind.__name__}")
    return value
