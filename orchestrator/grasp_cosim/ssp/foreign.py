"""Annotations in which other tools keep the step: read, and written for them to run our archives.

OSP (libcosim): com.opensimulationplatform in the default experiment, and a hint on components with
a step of their own. It takes prefixes for names and their declarations for content, so that they
must be osp, and declared by the root. OMSimulator: org.openmodelica on the top system, which its
command line needs, first of the annotations there. Both let all components take a step at once.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from lxml import etree  # type: ignore[import-untyped]

from ..base.checks import real
from ..base.errors import InputError, choices
from ..system.parts import NANOSECONDS, in_nanoseconds
from .document import add, at, children

_OSP = "http://opensimulationplatform.com/SSP/OSPAnnotations"
_OMS = "https://raw.githubusercontent.com/OpenModelica/OMSimulator/master/schema/oms.xsd"
PREFIXES = {"osp": _OSP, "oms": _OMS}
_OSP_TYPE, _OMS_TYPE = "com.opensimulationplatform", "org.openmodelica"
FOREIGN = (_OSP_TYPE, "org.open-simulation-platform", _OMS_TYPE)
"""The types of the annotations that are read here; the second is an earlier one of OSP."""

_BASE = {"FixedStepAlgorithm": "baseStepSize", "FixedStepMaster": "stepSize"}
"""The elements that name a step, in any namespace, and in which attribute."""

_TOP: tuple[tuple[str, ...], ...] = (("ssd:DefaultExperiment",), ("ssd:System",), ())


@dataclass(frozen=True, slots=True)
class Steps:
    """The steps that other tools' annotations name in ns; base_ns is 0 where there is none.

    said tells whose it is, own_ns are those of components with a step of their own, by name.
    """

    base_ns: int = 0
    said: str = ""
    own_ns: Mapping[str, int] = field(default_factory=dict)


def read_steps(file: str, root: Any, given_ns: int | None) -> Steps:
    """The steps that an archive names for other tools; a given one goes before them.

    InputError where they contradict each other.
    """
    found: dict[int, str] = {}
    for step, place in _named(file, root):
        found.setdefault(step, place)
    if not found:
        return Steps()
    if len(found) > 1 and given_ns is None:
        listed = choices(f"{step / NANOSECONDS:g} s" for step in found)
        raise InputError(
            f"{file}: its annotations name several steps, {listed}; give one: "
            "--set experiment.step=..."
        )
    base, said = next(iter(found.items()))
    return Steps(base, said, _hints(file, root, given_ns or base))


def _named(file: str, root: Any) -> Iterator[tuple[int, str]]:
    """Yield the steps that are named for the whole system, and where."""
    for parent in _TOP:
        for annotation in children(root, *parent, "ssd:Annotations", "ssc:Annotation"):
            if annotation.get("type") not in FOREIGN:
                continue
            for name, attribute in _BASE.items():
                for element in annotation.iter(f"{{*}}{name}"):
                    place = f"{at(file, element)}: annotation {annotation.get('type')!r}"
                    yield _time(f"{place}: step", element.get(attribute)), place


def write_steps(experiment: Any, system: Any, step_ns: int) -> None:
    """Name the step in annotations of the default experiment and of the top system."""
    step = repr(step_ns / NANOSECONDS)
    algorithm = _add(add(experiment, "ssc:Annotation", type=_OSP_TYPE), _OSP, "Algorithm")
    _add(algorithm, _OSP, "FixedStepAlgorithm", baseStepSize=step)
    tool = _add(add(system, "ssc:Annotation", type=_OMS_TYPE), _OMS, "Annotations")
    information = _add(tool, _OMS, "SimulationInformation")
    master = {"description": "oms-ma", "stepSize": step, "relativeTolerance": "1e-4"}
    _add(information, _OMS, "FixedStepMaster", **master)


def write_hint(component: Any, step_ns: int) -> None:
    """Name the step of a component of its own."""
    annotation = add(add(component, "ssd:Annotations"), "ssc:Annotation", type=_OSP_TYPE)
    _add(annotation, _OSP, "StepSizeHint", value=repr(step_ns / NANOSECONDS))


def _add(parent: Any, namespace: str, name: str, **attributes: str) -> Any:
    return etree.SubElement(parent, f"{{{namespace}}}{name}", attributes)


def _time(place: str, text: str | None) -> int:
    try:
        return in_nanoseconds(place, real(text or ""))
    except ValueError:
        raise InputError(f"{place} = {text!r}: must be a number of s") from None


def _hints(file: str, root: Any, base: int) -> dict[str, int]:
    """The components' own steps: the multiples of the base step that are nearest to the hints."""
    own: dict[str, int] = {}
    path = ("ssd:System", "ssd:Elements", "ssd:Component")
    for component in children(root, *path):
        for hint in component.iter("{*}StepSizeHint"):
            hinted = _time(f"{at(file, hint)}: StepSizeHint", hint.get("value"))
            multiple = max(1, math.floor(hinted / base + 0.5)) * base
            if multiple != base:
                own[component.get("name").replace(".", "_")] = multiple
    return own
