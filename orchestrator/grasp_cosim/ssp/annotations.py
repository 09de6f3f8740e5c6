"""The annotations of an archive: ours, and those in which other tools keep the step.

Ours has all that SSP 1.0 has no form for, so that our run is the same: the communication step, the
scheme, own steps, processes, renamed variables and units; the initialisation, events, faults,
roles, presets, stimuli, recorded signals and the pacing. Where it is, the elements are in the order
of execution. Its content is JSON: the dataclasses of the system as objects, a port as a string.

Those of others are read, and written for them to run our archives. OSP (libcosim):
com.opensimulationplatform in the default experiment, and a hint on components with a step of their
own. It takes prefixes for names and their declarations for content, so that they must be osp, and
declared by the root. OMSimulator: org.openmodelica on the top system, which its command line needs,
first of the annotations there. Both let all components take a step at once.
"""

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from fractions import Fraction
from typing import Any

from lxml import etree  # type: ignore[import-untyped]

from ..base.checks import check_values
from ..base.errors import InputError, choices
from ..base.typed_json import Decoder, Text, json_in
from ..system.description import System
from ..system.parts import (
    Acceptance,
    Event,
    Fault,
    Initialisation,
    Isolation,
    Limit,
    Logging,
    Port,
    Realtime,
    Solver,
)
from ..system.record import Record
from ..system.stimuli import Stimuli
from ..system.structure import Diverging, Scheme
from ..system.times import Time, in_nanoseconds, in_seconds, written
from .xml_document import add, at, children

TYPE = "grasp-cosim"
_TAG = "{grasp-cosim:system}System"

_OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
_OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
PREFIXES = {"osp": _OSP, "oms": _OMS}
_OSP_TYPE, _OMS_TYPE = "com.opensimulationplatform", "org.openmodelica"
FOREIGN = (_OSP_TYPE, "org.open-simulation-platform", _OMS_TYPE)
"""The types of the annotations that are read here; the second is an earlier one of OSP."""

_STEP_ATTRIBUTES = {"FixedStepAlgorithm": "baseStepSize", "FixedStepMaster": "stepSize"}
"""The elements that name a step, in any namespace, and in which attribute."""

_PARENTS: tuple[tuple[str, ...], ...] = (("ssd:DefaultExperiment",), ("ssd:System",), ())


@dataclass(frozen=True, slots=True)
class Beside:
    """The attributes of a component that SSP has no form for; earlier archives lack the last ones,
    which have a default.
    """

    rename: Mapping[str, str]
    step_ns: Time | None
    isolation: Isolation
    units: Mapping[str, str] = field(default_factory=dict)
    solver: Solver | None = None
    logging: Logging = False


@dataclass(frozen=True, slots=True)
class Extras:
    """The attributes of a system that SSP has no form for; earlier archives lack the last ones,
    which have a default.
    """

    step_ns: Time
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
    record: Record = Record()
    limits: tuple[Limit, ...] = ()
    verdict: Acceptance = Acceptance()


def extras_of(system: System) -> Extras:
    """The extras of a system."""
    shared = {f.name: getattr(system, f.name) for f in fields(Extras)}
    if system.input:
        shared["input"] = replace(system.input, path=None)  # the samples are in the archive
    beside = {
        c.name: Beside(dict(c.rename), c.step_ns, c.isolation, dict(c.units), c.solver, c.logging)
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
    text = None if element is None else element.text
    content = json_in(f"{place}: annotation {TYPE!r}", text or "")
    extras = _DECODER.decoded(Extras, f"{place}: annotation {TYPE!r}", content)
    for name, values in extras.presets.items():
        check_values(f"{place}: annotation {TYPE!r}: preset {name!r}", values)
    return extras


def _port(text: str) -> Port:
    """The port that a text stands for; without a dot one of the system itself."""
    component, dot, variable = text.partition(".")
    return Port(component, variable) if dot else Port("", text)


_DECODER = Decoder({Port: Text("'component.variable'", _port)})


def _plain(value: Any) -> Any:
    """A value of the system as JSON has it."""
    if isinstance(value, Port | Fraction):
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


def read_foreign(
    file: str, root: Any, components: Iterable[str], chosen_ns: Time | None
) -> tuple[Extras, str]:
    """The extras of an archive without our annotation, and who names its step in another.

    Who names a step means that all components take it at once; without one it is 0, and nobody.
    InputError where the annotations contradict each other, and no step is chosen.
    """
    places: dict[Time, str] = {}
    for step, place in _system_steps(file, root):
        places.setdefault(step, place)
    if len(places) > 1 and chosen_ns is None:
        steps = choices(f"{written(step)} s" for step in places)
        raise InputError(
            f"{file}: its annotations name several steps, {steps}; give one: "
            "--set experiment.step=..."
        )
    base, base_place = next(iter(places.items()), (0, ""))
    component_steps = _hints(file, root, chosen_ns or base) if base else {}
    beside = {name: Beside({}, component_steps.get(name), "none") for name in components}
    scheme: Scheme = "jacobi" if base else "sequential"
    return Extras(base, scheme, beside, Initialisation(), (), ()), base_place


def _system_steps(file: str, root: Any) -> Iterator[tuple[Time, str]]:
    """Yield the steps that are named for the whole system, and where."""
    for parent in _PARENTS:
        for annotation in children(root, *parent, "ssd:Annotations", "ssc:Annotation"):
            if annotation.get("type") not in FOREIGN:
                continue
            for name, attribute in _STEP_ATTRIBUTES.items():
                for element in annotation.iter(f"{{*}}{name}"):
                    place = f"{at(file, element)}: annotation {annotation.get('type')!r}"
                    yield _time(f"{place}: step", element.get(attribute)), place


def write_steps(experiment: Any, system: Any, step_ns: Time) -> None:
    """Name the step in annotations of the default experiment and of the top system."""
    step = repr(in_seconds(step_ns))
    algorithm = _add(add(experiment, "ssc:Annotation", type=_OSP_TYPE), _OSP, "Algorithm")
    _add(algorithm, _OSP, "FixedStepAlgorithm", baseStepSize=step)
    tool = _add(add(system, "ssc:Annotation", type=_OMS_TYPE), _OMS, "Annotations")
    information = _add(tool, _OMS, "SimulationInformation")
    master = {"description": "oms-ma", "stepSize": step, "relativeTolerance": "1e-4"}
    _add(information, _OMS, "FixedStepMaster", **master)


def write_hint(component: Any, step_ns: Time) -> None:
    """Name the step of the component of this archive."""
    annotation = add(add(component, "ssd:Annotations"), "ssc:Annotation", type=_OSP_TYPE)
    _add(annotation, _OSP, "StepSizeHint", value=repr(in_seconds(step_ns)))


def _add(parent: Any, namespace: str, name: str, **attributes: str) -> Any:
    return etree.SubElement(parent, f"{{{namespace}}}{name}", attributes)


def _time(place: str, text: str | None) -> Time:
    return in_nanoseconds(place, text or "")


def _hints(file: str, root: Any, base: Time) -> dict[str, Time]:
    """The components' own steps: the multiples of the base step that are nearest to the hints."""
    steps: dict[str, Time] = {}
    path = ("ssd:System", "ssd:Elements", "ssd:Component")
    for component in children(root, *path):
        for hint in component.iter("{*}StepSizeHint"):
            hinted = _time(f"{at(file, hint)}: StepSizeHint", hint.get("value"))
            multiple = max(1, math.floor(Fraction(hinted) / base + Fraction(1, 2))) * base
            if multiple != base:
                steps[component.get("name").replace(".", "_")] = multiple
    return steps
