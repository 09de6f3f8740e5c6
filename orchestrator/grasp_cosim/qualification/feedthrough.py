"""Direct dependence of a candidate's outputs on its inputs, and the loops that it closes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ..errors import choices
from ..system.description import System
from ..system.parts import Port
from .interface_difference import Described, Difference, Severity, Use

Reports = Mapping[str, Mapping[str, Any]]
"""What inspect_fmu() gives, under the system's names, by component."""


def feedthrough_differences(
    system: System, name: str, originals: Reports, candidate: Mapping[str, Any], use: Use
) -> Iterator[Difference]:
    """Of outputs that depend directly on other inputs than those of the original.

    system is the one with the original in the component of that name.
    """
    ours = {v["name"]: v for v in originals[name]["variables"]}
    swapped = {**originals, name: candidate}
    inputs = _inputs(candidate)
    for variable in candidate["variables"]:
        old = ours.get(variable["name"])
        if old is None or old["causality"] != "output" or variable["causality"] != "output":
            continue
        before = _inputs(originals[name]) if old["dependencies"] is None else old["dependencies"]
        now = inputs if variable["dependencies"] is None else variable["dependencies"]
        added = [i for i in now if i in inputs and i not in before]
        if added:
            loop = _loop(system, name, variable["name"], added, swapped)
            yield _added(variable, old, added, loop, use)
        elif variable["dependencies"] is not None and set(before) - set(now):
            gone = choices([i for i in before if i not in now])
            text = f"does not depend directly on {gone}: a change there shows one step later"
            yield _difference("notes", variable, old, text)


def _added(
    variable: Described, old: Described, added: Sequence[str], loop: Sequence[Port], use: Use
) -> Difference:
    how = "may depend" if variable["dependencies"] is None else "depends"
    declared = ", as it declares no dependencies" if variable["dependencies"] is None else ""
    text = f"{how} directly on {choices(added)}{declared}"
    if not loop:
        return _difference("notes", variable, old, f"{text}; closes no loop")
    path = " -> ".join(map(str, loop))
    severity: Severity = "blocks" if use.loops == "refuse" else "warns"
    return _difference(severity, variable, old, f"{text}: an algebraic loop {path}")


def _difference(severity: Severity, new: Described, old: Described, text: str) -> Difference:
    return Difference(
        severity, "dependency", new["name"], text, old["dependencies"], new["dependencies"]
    )


def _loop(
    system: System, name: str, output: str, inputs: Sequence[str], reports: Reports
) -> list[Port]:
    """The shortest way from the output of a component back to it by one of its inputs, or none."""
    start, ends = Port(name, output), {Port(name, i) for i in inputs}
    came_from: dict[Port, Port | None] = {start: None}
    queue = deque([start])
    while queue:
        port = queue.popleft()
        if port in ends:
            path = [start, port]
            while (before := came_from[path[-1]]) is not None:
                path.append(before)
            return path[::-1]
        for following in _followers(system, port, reports):
            if following not in came_from:
                came_from[following] = port
                queue.append(following)
    return []


def _followers(system: System, port: Port, reports: Reports) -> Iterator[Port]:
    """The ports whose values follow at once from that of a port."""
    yield from (connection.target for connection in system.connections if connection.source == port)
    report = reports[port.component]
    inputs = _inputs(report)
    if port.variable not in inputs:
        return
    for variable in report["variables"]:
        if variable["causality"] == "output":
            listed = variable["dependencies"]
            if port.variable in (inputs if listed is None else listed):
                yield Port(port.component, variable["name"])


def _inputs(report: Mapping[str, Any]) -> list[str]:
    return [v["name"] for v in report["variables"] if v["causality"] == "input"]
