"""What must hold of a system before it is run: every input has one source, every port exists."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..errors import InputError, choices
from .parts import LOOPS, NANOSECONDS, Port, Wire

if TYPE_CHECKING:
    from .description import System


def check_wires(system: System) -> None:
    """InputError at the first wire or input that is not as it must be."""
    sources: dict[Port, Wire] = {}
    for i, wire in enumerate(system.wires):
        place = f"{system.name}: wires[{i}] '{wire.source} -> {wire.target}'"
        kinds = []
        for port, causality in ((wire.source, "output"), (wire.target, "input")):
            interface = system.component(port.component, place).interface
            valid = [v.name for v in interface.of(causality)]
            if port.variable not in valid:
                raise InputError(
                    f"{place}: {port.component} has no {causality} {port.variable!r}; "
                    f"valid: {choices(valid)}"
                )
            kinds.append(interface.by_name[port.variable].kind)
        if kinds[0] != kinds[1] or kinds[0] == "String":
            raise InputError(
                f"{place}: {wire.source} is {kinds[0]} and {wire.target} is {kinds[1]}; "
                "must be both Real, both Integer or both Boolean"
            )
        if wire.target.variable in system.component(wire.target.component, place).values:
            raise InputError(
                f"{place}: {wire.target} has two sources, the wire and a value; must have one"
            )
        if wire.target in sources:
            raise InputError(
                f"{place}: {wire.target} has two sources, {sources[wire.target].source} and "
                f"{wire.source}; must have one"
            )
        sources[wire.target] = wire
    outputs = [
        str(Port(c.name, v.name)) for c in system.components for v in c.interface.of("output")
    ]
    for component in system.components:
        for variable in component.interface.of("input"):
            port = Port(component.name, variable.name)
            if port not in sources and variable.name not in component.values:
                raise InputError(
                    f"{system.name}: input {port} has no source; wire one of {choices(outputs)} "
                    f"to it, or give it a value: --set {port}=VALUE, or in the system file"
                )


def check_initialisation(system: System) -> None:
    """InputError where an option of the initialisation is not as it must be."""
    place, chosen = f"{system.name}: [initialisation]", system.initialisation
    if chosen.loops not in LOOPS:
        raise InputError(f"{place}: loops = {chosen.loops!r}: must be one of {choices(LOOPS)}")
    number = isinstance(chosen.tolerance, float | int) and not isinstance(chosen.tolerance, bool)
    if not number or not 0.0 < chosen.tolerance < 1.0:
        raise InputError(
            f"{place}: tolerance = {chosen.tolerance!r}: must be a number between 0 and 1"
        )
    whole = isinstance(chosen.iterations, int) and not isinstance(chosen.iterations, bool)
    if not whole or chosen.iterations < 1:
        raise InputError(
            f"{place}: iterations = {chosen.iterations!r}: must be a whole number, at least 1"
        )


def check_steps(system: System) -> None:
    """InputError where a step does not divide what it must."""
    step, stop = system.step_ns / NANOSECONDS, system.stop_ns / NANOSECONDS
    if system.stop_ns % system.step_ns:
        count = max(1, round(system.stop_ns / system.step_ns))
        raise InputError(
            f"step = {step:.9g} s does not divide stop = {stop:.9g} s; "
            f"stop could be {count * system.step_ns / NANOSECONDS:.9g} s"
        )
    for component in system.components:
        own = component.step_ns
        if own is not None and own % system.step_ns:
            count = max(1, round(own / system.step_ns))
            raise InputError(
                f"{system.name}: {component.name}: step = {own / NANOSECONDS:.9g} s is no whole "
                f"multiple of the base step {step:.9g} s; "
                f"could be {count * system.step_ns / NANOSECONDS:.9g} s"
            )
        if own is not None and system.stop_ns % own:
            raise InputError(
                f"{system.name}: {component.name}: step = {own / NANOSECONDS:.9g} s does not "
                f"divide stop = {stop:.9g} s; must end with a whole step"
            )
