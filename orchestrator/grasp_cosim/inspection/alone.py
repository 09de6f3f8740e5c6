"""A system of foreign FMUs alone: their default experiment, and each input at its start value."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..interface.interface import PARAMETERS, Interface
from ..system.parts import NANOSECONDS, Component
from .text import Row, component_table, key, number, start, table, told

HEAD = """# A system of FMUs. Run it: grasp-cosim run FILE

# From an output to an input. Each input has one source: a connection, or a value below its
# component. Units that differ are converted.
connections = [
  # "{name}.OUTPUT -> COMPONENT.INPUT",
]

[experiment]
step = {step}  # s, communication step
stop = {stop}  # s, a whole number of steps
{start}scheme = "sequential"  # in the order of the components below; or "jacobi", all at once
"""
MOST = 100
"""Parameters and outputs that are listed."""

STEPS = 1000
"""Steps of an experiment for which no FMU recommends one."""


def alone(fmus: Mapping[str, tuple[Path, str]]) -> tuple[str, list[str]]:
    """The text of a system of FMUs, by component, each with its path in the file; and notes."""
    interfaces = {name: Component(name, fmu, {}).interface for name, (fmu, _) in fmus.items()}
    step, start, stop, notes = _experiment(interfaces)
    head = HEAD.format(
        name=next(iter(fmus)),
        step=number(step),
        stop=number(stop),
        start=f"start = {number(start)}  # s\n" if start else "",
    )
    parts = [_component(name, i, fmus[name][1]) for name, i in interfaces.items()]
    return "\n".join([head, *parts]), notes


def _component(name: str, interface: Interface, path: str) -> str:
    variables = [v for v in interface.variables if v.supported]
    rows = [Row(v.name, number(start(v)), told(v)) for v in variables if v.causality == "input"]
    said = [
        f"{key(v.name)} = {number(start(v))}  # {told(v)}"
        for v in variables
        if v.causality in PARAMETERS
    ]
    said += [f"{v.name}, recorded: {told(v)}" for v in variables if v.causality == "output"]
    rows += [Row("", "", text) for text in said[:MOST]]
    if len(said) > MOST:
        rows.append(Row("", "", f"and {len(said) - MOST} more: grasp-cosim inspect {path}"))
    tables = component_table(name, path), table(f"[components.{name}.values]", rows)
    return "".join(f"{text}\n\n" for text in tables if text)[:-1]


def _experiment(interfaces: Mapping[str, Interface]) -> tuple[float, float, float, list[str]]:
    """Step, start and stop time in s: the shortest step and the longest span that the FMUs
    recommend, from where all of them begin; and notes.
    """
    steps, spans, notes = [], [], []
    begins = {_finite(i.experiment.get("start_time")) for i in interfaces.values()}
    start = begins.pop() if len(begins) == 1 else 0.0
    for name, interface in interfaces.items():
        told = interface.experiment
        begin, end, step = (_finite(told.get(k)) for k in ("start_time", "stop_time", "step_size"))
        if begin != start:
            notes.append(
                f"{name}: its default experiment begins at {begin:g} s, the run at {start:g} s"
            )
        spans += [end - begin] if end > begin else []
        steps += [step] if step > 0.0 else []
    span = max(spans, default=1.0)
    step = min(steps, default=span / STEPS)
    missing = [word for word, given in (("step", steps), ("stop time", spans)) if not given]
    if missing:
        notes.append(
            f"no FMU recommends a {' and a '.join(missing)}: chosen, step = {step:g} s, "
            f"stop = {start + span:g} s"
        )
    step_ns = max(1, round(step * NANOSECONDS))
    span_ns = max(1, round(span * NANOSECONDS / step_ns)) * step_ns
    stop = (round(start * NANOSECONDS) + span_ns) / NANOSECONDS
    if abs(span_ns / NANOSECONDS - span) > 1e-9:
        notes.append(f"stop = {start + span:g} s: {stop:g} s is a whole number of steps")
    return step_ns / NANOSECONDS, start, stop, notes


def _finite(value: Any) -> float:
    """A number of a default experiment; 0 where there is none."""
    return float(value) if isinstance(value, float) and math.isfinite(value) else 0.0
