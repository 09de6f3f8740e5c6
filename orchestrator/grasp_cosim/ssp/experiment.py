"""The times and the step of an archive: given, named by it, or those of its FMUs."""

import math
from collections.abc import Iterable
from typing import Any

from ..base.errors import InputError, choices
from ..system.parts import LONGEST, NANOSECONDS, in_nanoseconds
from .annotation import Extras
from .connectors import Part
from .document import at, child
from .foreign import Steps


def times(
    file: str, root: Any, parts: Iterable[Part], given: float | None, notes: list[str]
) -> tuple[int, int]:
    """The start time in ns, that of the archive or 0, and the stop time.

    That is the one given, or of the archive, or the longest that its FMUs name.
    """
    experiment = child(root, "ssd:DefaultExperiment")
    attributes = {} if experiment is None else experiment.attrib
    start = float(attributes.get("startTime", "0"))
    place = file if experiment is None else at(file, experiment)
    start_ns = in_nanoseconds(f"{place}: startTime", start, zero=True, low=-LONGEST)
    if given is not None:
        return start_ns, in_nanoseconds("stop", given)
    if "stopTime" in attributes:
        return start_ns, in_nanoseconds(f"{place}: stopTime", float(attributes["stopTime"]))
    declared = [part.interface.experiment.get("stop_time") for part in parts]
    stop = max((float(time) for time in declared if time is not None), default=0.0)
    if not 0.0 < stop < math.inf:
        raise InputError(
            f"{file}: no stopTime in a DefaultExperiment; give one: --set experiment.stop=..."
        )
    notes.append(f"stop = {stop:g} s, the longest that its FMUs name; the archive names none")
    return start_ns, in_nanoseconds(f"{file}: stop time of its FMUs", stop)


def step_time(
    file: str,
    parts: Iterable[Part],
    span_ns: int,
    given_ns: int | None,
    annotated: Extras | None,
    steps: Steps,
    notes: list[str],
) -> int:
    """The step in ns: given, ours, another tool's, or the FMUs' smallest that divides the stop."""
    if given_ns is not None:
        return given_ns
    if annotated:
        return annotated.step_ns
    if steps.base_ns:
        notes.append(f"step = {steps.base_ns / NANOSECONDS:g} s, by {steps.said}")
        return steps.base_ns
    declared_steps = sorted({part.interface.step for part in parts if part.interface.step})
    for step in declared_steps:
        if not 0.0 < step * NANOSECONDS <= span_ns:
            continue
        step_ns = round(step * NANOSECONDS)
        if step_ns and span_ns % step_ns == 0 and math.isclose(step_ns / NANOSECONDS, step):
            notes.append(f"step = {step:g} s, the smallest that its FMUs name; SSP has none")
            return step_ns
    listed = choices(f"{step:g} s" for step in declared_steps)
    raise InputError(
        f"{file}: names no step, as SSP has none, and of those of its FMUs ({listed}) none "
        f"divides the stop of {span_ns / NANOSECONDS:g} s; give one: --set experiment.step=..."
    )
