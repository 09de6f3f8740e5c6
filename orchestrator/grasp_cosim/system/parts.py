"""The parts of a system description: components, ports, connections, events and faults."""

from __future__ import annotations

import math
import operator
from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

from ..base.checks import choice, number, whole
from ..base.errors import InputError
from ..base.quantity import as_quantity
from ..base.si_units import Unit
from ..interface.expansion import expanded
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.obstacles import of_binary
from ..interface.read import read_interface
from ..interface.renaming import in_units, renamed
from ..interface.values import Given
from .python_code import PythonCode
from .times import LONGEST, NANOSECONDS, Time, in_seconds

Isolation = Literal["none", "process"]
ISOLATIONS: tuple[str, ...] = get_args(Isolation)
Relation = Literal["<", "<=", ">", ">=", "==", "!="]
RELATIONS: tuple[str, ...] = get_args(Relation)
Overrun = Literal["auto", "catch-up", "continue", "stop"]
Then = Literal["abort", "warn"]
THENS: tuple[str, ...] = get_args(Then)
Loops = Literal["iterate", "refuse"]
Logging = bool | tuple[str, ...]
"""What an FMU is to log next to warnings and errors: all, nothing, or some of its categories."""

PROXY_STATE = "proxy.state"
"""The output that tells a proxy from other FMUs, and what state its connection is in."""

FINEST, COARSEST = 1e-13, 0.1
"""Relative tolerances of a solver: beyond the first one there is only rounding."""


def literal(value: Given) -> str:
    """A value, or those of an array, as the system file writes it."""
    plain: Any = as_lists(value)
    if not isinstance(plain, str) and (quantity := as_quantity(plain)):
        return str(quantity)
    if isinstance(plain, bool):
        return str(plain).lower()
    if isinstance(plain, float):
        return float.__repr__(plain)
    return repr(plain) if isinstance(plain, int | str) else f"[{', '.join(map(literal, plain))}]"


def as_lists(value: Given) -> Any:
    """A value as it is, and those of an array as lists, which fit into JSON."""
    tolist = getattr(value, "tolist", None)  # to ask for a Nested takes 6 us
    return value if tolist is None else tolist()


@dataclass(frozen=True, slots=True)
class Solver:
    """The tolerances that CVode keeps to where it integrates an FMU of model exchange.

    An FMU that is only for co-simulation has its own solver, which gets relative_tolerance.

    The local error of a state in a step of the solver is below relative_tolerance times the state
    plus absolute_tolerance times its nominal value. absolute_tolerance is a hundredth of the former
    by default. maximum_step is in s; no step of the solver goes beyond a communication point.
    """

    relative_tolerance: float = 1e-10
    absolute_tolerance: float | None = None
    maximum_step: float | None = None

    def __post_init__(self) -> None:
        must = f"a number from {FINEST:g} to {COARSEST:g}"
        number("relative_tolerance", self.relative_tolerance, FINEST, COARSEST, must=must)
        for name, high in (("absolute_tolerance", 1.0), ("maximum_step", LONGEST)):
            if (value := getattr(self, name)) is not None:
                must = f"a number greater than 0, at most {high:g}"
                number(name, value, 0.0, high, above=True, must=must)


@dataclass(frozen=True)
class Component:
    """An instance of an FMU and what it is given: the system's names, values, step and process.

    values differ from the FMU's own start values; of arrays they are by elements, as many as values
    of structural parameters say. rename maps the system's name of a variable to the FMU's; all else
    goes by the system's. step_ns is its own communication step, None for the system's. units are of
    variables that the FMU declares without one, or wrongly. native is the FMU that runs in the
    place of fmu, its twin with the same bits; as_named says that fmu itself is to run. Where
    neither is given a run takes the twin that there is. With a solver the equations of an FMU that
    is for model exchange, too, are integrated here, though it may have its own co-simulation. With
    code there is no FMU: fmu is what that is called. trace is the file that each call of the FMU is
    written to.
    """

    name: str
    fmu: Path
    values: Mapping[str, Value]
    rename: Mapping[str, str] = field(default_factory=dict)
    step_ns: Time | None = None
    isolation: Isolation = "none"
    units: Mapping[str, str] = field(default_factory=dict)
    native: Path | None = None
    as_named: bool = field(default=False, compare=False)
    solver: Solver | None = None
    logging: Logging = False
    code: PythonCode | None = None
    trace: Path | None = None

    @property
    def integrated(self) -> Solver | None:
        """The solver of its equations; None where it runs by co-simulation."""
        fmu = self.loaded
        if "CoSimulation" not in fmu.kinds:
            return self.solver or Solver()
        return self.solver if fmu.exchange else None

    @cached_property
    def interface(self) -> Interface:
        """The interface of the FMU in the system's names and units, with its arrays taken apart."""
        return in_units(self.declared, self.units, f"{self.name}: units")

    @cached_property
    def declared(self) -> Interface:
        """The same with the units that the FMU declares."""
        return renamed(self.sized(self._read[0]), self.rename, f"{self.name}: rename")

    @cached_property
    def loaded(self) -> Interface:
        """The interface of the FMU that runs: of its native twin, where it has one.

        Messages name that by the FMU whose place it takes.
        """
        if self.native is None:
            return self.interface
        twin = replace(self, fmu=self.native, native=None).interface
        named = partial(replace, twin, user_path=self.fmu)
        return twin.variant(("user_path", self.fmu), named)

    @property
    def is_proxy(self) -> bool:
        """True if a peer has its outputs, over a network."""
        return PROXY_STATE in self._read[0].by_name

    def of_proxy(self, setting: str) -> Value:
        """The start value of a parameter of a proxy, by its name behind proxy."""
        fmu_name = f"proxy.{setting}"
        variable = self._read[0].by_name[fmu_name]
        system_names = {declared: name for name, declared in self.rename.items()}
        name = system_names.get(fmu_name, fmu_name)
        value = self.values.get(name, variable.start)
        if variable.kind == "Boolean":
            return value in (True, "true", "1")
        return "" if value is None else value

    @property
    def is_current(self) -> bool:
        """True if its FMUs are still those that were read."""
        return all(map(operator.is_, self._read, self._declared_now()))

    @cached_property
    def _read(self) -> list[Interface]:
        return self._declared_now()

    def _declared_now(self) -> list[Interface]:
        """What the files of its FMUs declare now, or its code does."""
        if self.code:
            return [self.code.interface]
        return [read_interface(fmu) for fmu in (self.fmu, self.native) if fmu]

    def __hash__(self) -> int:
        return hash((self.name, self.fmu, self.native, frozenset(self.values.items())))

    def __getstate__(self) -> dict[str, Any]:
        """Only the things that it was made of: other processes read the FMUs themselves."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    @property
    def content(self) -> bytes:
        """What its results depend on: the bytes of its FMU, or its code."""
        return self.code.content if self.code else self.fmu.read_bytes()

    @property
    def is_chosen(self) -> bool:
        """True if nothing is open as to which FMU runs: there is but one, or it was chosen."""
        if self.native is not None or not self._read[0].python:
            return True
        return self.as_named and not self.needs_native

    @property
    def needs_native(self) -> bool:
        """True if no native twin is chosen, and the FMU is in Python, without a binary for here."""
        fmu = self._read[0]
        return self.native is None and fmu.python and of_binary(fmu) is not None

    def sized(self, interface: Interface) -> Interface:
        """The interface of an FMU, with its arrays taken apart, of the sizes that values give."""
        if interface.sized_by is None:
            return interface
        names = {fmu_name: name for name, fmu_name in self.rename.items()}
        lengths = {
            fmu_name: self.values.get(names.get(fmu_name, fmu_name))
            for fmu_name in interface.sized_by
        }
        return expanded(interface, lengths)


class Port(NamedTuple):
    """A variable of a component; without one, an input or output of the system itself."""

    component: str
    variable: str

    def __str__(self) -> str:
        return f"{self.component}.{self.variable}" if self.component else self.variable


def as_port(place: str, text: Any, must: str = "'component.variable'") -> Port:
    """The port that a text names; InputError where it names none, must says what is valid."""
    component, _, variable = text.partition(".") if isinstance(text, str) else ("", "", "")
    if not component or not variable:
        raise InputError(f"{place} = {text!r}: must be {must}")
    return Port(component, variable)


def as_signal(place: str, text: str) -> Port:
    """The port that a text names, of a component or of the system itself, which has no dot."""
    return as_port(place, text) if "." in text or not text else Port("", text)


@dataclass(frozen=True, slots=True)
class Connection:
    """From an output to an input: target = factor * source + offset.

    factor and offset are None where the units decide: the identity, or the conversion between them.
    of_arrays is the connection of arrays that this one is an element of, if it is one.
    """

    source: Port
    target: Port
    factor: float | None = None
    offset: float | None = None
    of_arrays: Connection | None = field(default=None, compare=False)

    def __str__(self) -> str:
        return f"{self.source} -> {self.target}"


@dataclass(frozen=True, slots=True)
class Link:
    """From a connector of the system to a variable: value behind = factor * value + offset.

    factor and offset are None where the units of both ends decide, as on a Connection.
    """

    port: Port
    factor: float | None = None
    offset: float | None = None


@dataclass(frozen=True, slots=True)
class SystemInput:
    """An input or parameter of the system itself: what is given to it goes along all its links.

    unit is None where values are taken as they are at the end of each link.
    """

    links: tuple[Link, ...]
    unit: Unit | None = None


@dataclass(frozen=True, slots=True)
class SystemOutput:
    """An output of the system itself: that of a component, in its own unit; None for the same.

    kind is Real, Integer, Boolean or String, None for that of the component's output.
    """

    link: Link
    unit: Unit | None = None
    kind: str | None = None
    description: str = ""


@dataclass(frozen=True, slots=True)
class Condition:
    """A signal compared with a constant, like plant.gap[1] < 0.01 or plant.contact[1] == true.

    value is in the signal's unit; of an Enumeration it may be the name of an item. It holds or not
    at a communication point, by the values there.
    """

    port: Port
    relation: Relation
    value: float | bool | str

    def __str__(self) -> str:
        value = literal(self.value)
        if isinstance(self.value, str):
            value = f'"{self.value}"' if "'" in self.value else f"'{self.value}'"
        return f"{self.port} {self.relation} {value}"


@dataclass(frozen=True, slots=True)
class Event:
    """Sets tunable parameters or unconnected inputs, also whole arrays, once, before a step.

    The step begins at the first communication point at or after at_ns, or the first one where the
    condition holds; exactly one of the two is given. Of components with their own step only
    their own points count.
    """

    set: Mapping[Port, Given]
    at_ns: Time | None = None
    when: Condition | None = None


@dataclass(frozen=True, slots=True)
class Fault:
    """A change of the values that a connection passes, in steps from t >= start_ns to t < end_ns.

    With a condition it begins where that holds first in this window, and stays. The connection is
    named by its target. The kinds and their parameters: faults.py. seed is that of a random kind.
    """

    target: Port
    kind: str
    parameters: Mapping[str, float | bool | str]
    start_ns: Time = 0
    end_ns: Time | None = None
    seed: int = 0
    when: Condition | None = None


@dataclass(frozen=True, slots=True)
class Limit:
    """A condition that must not hold at any communication point.

    Where it does, the run is aborted there, or it goes on, and a warning tells of it.
    """

    when: Condition
    then: Then = "abort"


@dataclass(frozen=True, slots=True)
class MetricLimit:
    """The lowest and the highest value of a metric, in its SI unit; None for no bound.

    Of a metric with several values the name without an index means each of them.
    """

    name: str
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True)
class Acceptance:
    """What a run with a bench, in real time or with limits may come to, and still pass.

    lost: how often a peer was lost; missed, overruns, implausible: shares of the steps; trips of
    peers; limited: commands that were clamped; lead: of a peer's clock in s; refused: what the
    operating system did not grant; initialised_anew: how often the loop was; warnings: limits that
    were exceeded; unfinished: 1 where the run did not come to its end. A run with limits of its
    metrics must keep these, whatever it is.
    """

    lost: int = 0
    missed: float = 0.01
    implausible: float = 0.01
    trips: int = 0
    limited: int = 0
    lead: float = 0.1
    initialised_anew: int = 0
    overruns: float = 0.01
    refused: int = 0
    warnings: int = 0
    unfinished: int = 0
    metrics: tuple[MetricLimit, ...] = ()

    def __post_init__(self) -> None:
        counts = "lost", "trips", "limited", "initialised_anew", "refused", "warnings", "unfinished"
        for name in counts:
            whole(name, getattr(self, name), 0, must="a whole number, at least 0")
        for name in ("missed", "implausible", "overruns"):
            number(name, getattr(self, name), 0.0, 1.0, must="a share of the steps, from 0 to 1")
        number("lead", self.lead, 0.0, must="a time in s, at least 0")


@dataclass(frozen=True, slots=True)
class Initialisation:
    """Options for algebraic loops at t = 0: refused, or iterated to a relative tolerance."""

    loops: Loops = "iterate"
    tolerance: float = 1e-10
    iterations: int = 50

    def __post_init__(self) -> None:
        choice("loops", self.loops, get_args(Loops))
        below, must = math.nextafter(1.0, 0.0), "a number between 0 and 1"
        number("tolerance", self.tolerance, 0.0, below, above=True, must=must)
        whole("iterations", self.iterations, 1, must="a whole number, at least 1")


@dataclass(frozen=True, slots=True)
class Realtime:
    """How a run keeps to the clock.

    Args:
        factor: The speed relative to real time: 2.0 runs twice as fast.
        overrun: What follows on a step that ends after the next one should have begun. "catch-up"
            keeps to the schedule: late steps are done without waiting. "continue" shifts the
            schedule by the delay. "stop" ends the run with a SimulationError where the delay is
            more than `tolerance`. "auto" is "catch-up", but "continue" where a component is a
            proxy: a burst of steps is nothing for hardware.
        priority: The priority of SCHED_FIFO, 1 to 99; None leaves the scheduling as it is.
        cpu: The number of the processor to stay on; None for any.
        lock_memory: True keeps the process from being swapped out.
        tolerance: The delay in s that "stop" lets pass.
        stall: The delay in s from which a run with proxies counts all its peers as lost.

    Raises:
        InputError: A value is none of these.

    Example:
        >>> from grasp_cosim import Realtime
        >>> Realtime(factor=2.0).factor
        2.0
    """

    factor: float = 1.0
    overrun: Overrun = "auto"
    priority: int | None = None
    cpu: int | None = None
    lock_memory: bool = False
    tolerance: float = 0.0
    stall: float = 0.1

    def __post_init__(self) -> None:
        number("factor", self.factor, 0.0, above=True, must="a finite number > 0")
        choice("overrun", self.overrun, get_args(Overrun))
        number("tolerance", self.tolerance, 0.0, LONGEST, must="a time in s, at least 0")
        number("stall", self.stall, 0.0, LONGEST, above=True, must="a time in s, over 0")
        if self.priority is not None:
            whole("priority", self.priority, 1, 99, must="a whole number from 1 to 99")
        if self.cpu is not None:
            whole("cpu", self.cpu, 0, 2**16, must=f"a whole number from 0 to {2**16}")
        if not isinstance(self.lock_memory, bool):
            raise InputError(f"lock_memory = {self.lock_memory!r}: must be True or False")

    def period(self, step_ns: Time) -> Fraction:
        """The wall time between the beginnings of two steps, without rounding.

        Args:
            step_ns: The communication step in ns.

        Returns:
            The time in ns.

        Raises:
            InputError: It is less than 1 ns, or more than a year.
        """
        period = step_ns / Fraction(repr(float(self.factor)))  # 0.1 is meant to be a tenth
        if not 1 <= period <= 366 * 24 * 3600 * NANOSECONDS:
            raise InputError(
                f"factor = {self.factor!r}: a step of {in_seconds(step_ns):g} s would begin every "
                f"{in_seconds(period):g} s; must be from 1 ns to a year"
            )
        return period
