"""What a run moves between FMUs and master: what it passes to inputs, and what it fetches."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ..interface.variables import Variable
from ..system.connectors import read_at, taps
from ..system.description import System
from ..system.parts import PROXY_STATE, Port
from ..system.validity import driven_inputs


@dataclass(frozen=True, slots=True)
class Exchanged:
    """The numbers and Strings that a run moves, of each component in groups of one FMI type.

    passed are inputs that have a source, held those without, which keep what they were set to;
    fetched is all else that the run must know, and texts are the Strings of that.
    """

    fetched: Mapping[str, list[list[Variable]]]
    passed: Mapping[str, list[list[Variable]]]
    held: tuple[Port, ...]
    texts: tuple[Port, ...]

    def slots(self) -> dict[Port, int]:
        """The place of each value in the vector: fetched, then passed, then held; Strings last."""
        numbers = [
            Port(name, v.name)
            for moved in (self.fetched, self.passed)
            for name, groups in moved.items()
            for variables in groups
            for v in variables
        ]
        return {port: slot for slot, port in enumerate((*numbers, *self.held, *self.texts))}


def exchanged(system: System) -> Exchanged:
    """What a run of a system moves: arrays whole, as FMI does."""
    passed_on = system.once(sourced)
    sources = {connection.source for connection in system.connections}
    sources |= {tap.source for tap in system.once(taps).values()}
    needed = _with_whole_arrays(system, {*system.observed, *sources, *in_conditions(system)})
    fetched: dict[str, list[list[Variable]]] = {}
    passed: dict[str, list[list[Variable]]] = {}
    held: list[Port] = []
    texts: list[Port] = []
    for component in system.components:
        to_fetch: list[Variable] = []
        to_pass: list[Variable] = []
        inputs = {Port(component.name, v.name) for v in component.loaded.inputs}
        for v in component.loaded.variables:
            port = Port(component.name, v.name)
            if v.kind == "String" and port in needed:
                texts.append(port)
            elif v.is_number and port in passed_on:
                to_pass.append(v)
            elif v.is_number and port in needed and port in inputs:
                held.append(port)
            elif v.is_number and port in needed:
                to_fetch.append(v)
        fetched[component.name], passed[component.name] = _by_type(to_fetch), _by_type(to_pass)
    return Exchanged(fetched, passed, tuple(held), tuple(texts))


def sourced(system: System) -> frozenset[Port]:
    """The inputs that have a source, and the other elements of an array that has some."""
    targets = {connection.target for connection in system.connections}
    return _with_whole_arrays(system, {*targets, *driven_inputs(system)})


def used(system: System) -> frozenset[Port]:
    """The values on which a run depends, which a float64 must hold exactly."""
    sources = {connection.source for connection in system.connections}
    return system.once(sourced) | sources | in_conditions(system)


def in_conditions(system: System) -> frozenset[Port]:
    """The signals that conditions name, of events, faults, limits and a trigger, and the states of
    proxies.
    """
    conditions = [*(e.when for e in system.events), *(f.when for f in system.faults)]
    conditions += [limit.when for limit in system.limits]
    if system.record.trigger:
        conditions.append(system.record.trigger.when)
    signals = {read_at(system, c.port)[0] for c in conditions if c is not None}
    return frozenset(signals | {*system.once(states_of_proxies)})


def states_of_proxies(system: System) -> tuple[Port, ...]:
    """The state of each component that is a proxy."""
    ports = []
    for component in system.components:
        names = {v.name for v in component.loaded.of("output")}
        name = next(
            (n for n, name_in_fmu in component.rename.items() if name_in_fmu == PROXY_STATE),
            PROXY_STATE,
        )
        if name in names:
            ports.append(Port(component.name, name))
    return tuple(ports)


def _with_whole_arrays(system: System, ports: set[Port]) -> frozenset[Port]:
    """The ports and, of those that are elements of arrays, the other elements."""
    with_others = set(ports)
    for component in system.components:
        for array in component.loaded.arrays.values():
            elements = {Port(component.name, name) for name in array.names}
            if not ports.isdisjoint(elements):
                with_others |= elements
    return frozenset(with_others)


def _by_type(variables: Iterable[Variable]) -> list[list[Variable]]:
    """Numbers in groups of one FMI type, those of float64 first."""
    groups: dict[str, list[Variable]] = {}
    for v in variables:
        groups.setdefault(v.type, []).append(v)
    return [
        groups[fmi_type]
        for fmi_type in sorted(groups, key=lambda name: name not in ("Real", "Float64"))
    ]
