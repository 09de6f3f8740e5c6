"""Direct dependence of a candidate's outputs on its inputs, and the loops that it closes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence

from ..errors import choices
from ..interface.interface import Interface, Variable
from ..system.description import System
from ..system.parts import Port
from .interface_difference import Difference, Severity, Use

Interfaces = Mapping[str, Interface]
"""What the FMUs of a system declare, under the system's names, by component."""


def feedthrough_differences(
    system: System, name: str, originals: Interfaces, candidate: Interface, use: Use
) -> Iterator[Difference]:
    """Of outputs that depend directly on other inputs than those of the original.

    system is the one with the original in the component of that name.
    """
    ours, swapped = originals[name].by_name, {**originals, name: candidate}
    inputs = _inputs(candidate)
    for variable in candidate.of("output"):
        old = ours.get(variable.name)
        if old is None or old.causality != "output":
            continue
        before, now = _needs(old, originals[name]), _needs(variable, candidate)
        added = [i for i in now if i in inputs and i not in before]
        if added:
            loop = _loop(system, name, variable.name, added, swapped)
            yield _added(variable, old, added, loop, use)
        elif variable.dependencies is not None and set(before) - set(now):
            gone = choices([i for i in before if i not in now])
            text = f"does not depend directly on {gone}: a change there shows one step later"
            yield _difference("notes", variable, old, text)


def _added(
    variable: Variable, old: Variable, added: Sequence[str], loop: Sequence[Port], use: Use
) -> Difference:
    how = "may depend" if variable.dependencies is None else "depends"
    declared = ", as it declares no dependencies" if variable.dependencies is None else ""
    text = f"{how} directly on {choices(added)}{declared}"
    if not loop:
        return _difference("notes", variable, old, f"{text}; closes no loop")
    path = " -> ".join(map(str, loop))
    severity: Severity = "blocks" if use.loops == "refuse" else "warns"
    return _difference(severity, variable, old, f"{text}: an algebraic loop {path}")


def _difference(severity: Severity, new: Variable, old: Variable, text: str) -> Difference:
    listed = [None if v.dependencies is None else list(v.dependencies) for v in (old, new)]
    return Difference(severity, "dependency", new.name, text, *listed)


def _loop(
    system: System, name: str, output: str, inputs: Sequence[str], interfaces: Interfaces
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
        for following in _followers(system, port, interfaces):
            if following not in came_from:
                came_from[following] = port
                queue.append(following)
    return []


def _followers(system: System, port: Port, interfaces: Interfaces) -> Iterator[Port]:
    """The ports whose values follow at once from that of a port."""
    yield from (connection.target for connection in system.connections if connection.source == port)
    interface = interfaces[port.component]
    if port.variable not in _inputs(interface):
        return
    for variable in interface.of("output"):
        if port.variable in _needs(variable, interface):
            yield Port(port.component, variable.name)


def _inputs(interface: Interface) -> list[str]:
    return [v.name for v in interface.of("input")]


def _needs(variable: Variable, interface: Interface) -> Sequence[str]:
    """What an output depends on directly: all inputs where that is not declared."""
    return _inputs(interface) if variable.dependencies is None else variable.dependencies
