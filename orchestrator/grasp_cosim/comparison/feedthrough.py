"""Direct dependence of a candidate's outputs on its inputs, and the loops that it closes."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping, Sequence

from ..base.errors import choices
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
        gone = [i for i in before if i not in now]
        severity: Severity = "notes"
        if added:
            text = f"depends directly on {choices(added)}"
            if variable.dependencies is None:
                text = f"may depend directly on {choices(added)}, as it declares no dependencies"
            if loop := _loop(system, Port(name, variable.name), added, swapped):
                severity = "blocks" if use.loops == "refuse" else "warns"
                text = f"{text}: an algebraic loop {' -> '.join(map(str, loop))}"
            else:
                text = f"{text}; closes no loop"
        elif variable.dependencies is not None and gone:
            text = (
                f"does not depend directly on {choices(gone)}: a change there shows one step later"
            )
        else:
            continue
        listed = [None if v.dependencies is None else list(v.dependencies) for v in (old, variable)]
        yield Difference(severity, "dependency", variable.name, text, *listed)


def _loop(
    system: System, output: Port, inputs: Sequence[str], interfaces: Interfaces
) -> list[Port]:
    """The shortest way from an output back to it by one of its component's inputs, or none."""
    ends = {Port(output.component, i) for i in inputs}
    queue, seen = deque([[output]]), {output}
    while queue:
        path = queue.popleft()
        if path[-1] in ends:
            return [*path, output]
        for following in _followers(system, path[-1], interfaces):
            if following not in seen:
                seen.add(following)
                queue.append([*path, following])
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
    """Inputs that an output depends on directly: all where that is not declared."""
    return _inputs(interface) if variable.dependencies is None else variable.dependencies
