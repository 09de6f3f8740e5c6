"""A component that is Python code of this process, for trials: a function, or a class with step().

    class PI:
        inputs = {"gap": (0.1, "m")}        # a start value, a unit, or both
        outputs = {"force": "N"}
        parameters = {"gain": (40.0, "N/m")}

        def step(self, t, inputs):
            return {"force": self.gain * inputs["gap"]}

step() is called once at each communication point of the component, that of the start included: `t`
is its time in s, and inputs are the values there, by name. What it returns are the outputs from
then on, by name; of a single one the value is enough. A function (t, inputs) is the same
without a state. What is not declared is as the connections have it: their variables, in the types
and units of their other ends. A class is made again for each run, and an object is copied;
parameters are its attributes, which go before what is declared.
"""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple, Protocol

from ..base.errors import InputError
from ..base.quantity import unwrapped
from ..base.si_units import Unit, known_unit
from ..interface.fmi_types import Kind, Value
from ..interface.interface import Interface
from ..interface.variables import Variable

CAUSALITIES = {"inputs": "input", "outputs": "output", "parameters": "parameter"}
"""The causality of what a class declares under a name."""

KIND_OF_TYPE: Mapping[type, Kind] = {bool: "Boolean", int: "Integer", float: "Real"}

MUST_OF_VARIABLE = "a start value, a unit, or both, as in (0.1, 'm')"


class WithStep(Protocol):
    """An object with step()."""

    def step(self, t: float, inputs: dict[str, float], /) -> Any:
        """The outputs from `t` on, in s, of the inputs there."""


Function = Callable[[float, dict[str, float]], Any]
"""The same without a state."""


class End(NamedTuple):
    """What is known of a variable of such a component; None is what is not."""

    kind: Kind | None = None
    unit: Unit | None = None
    start: Value | None = None

    def or_as(self, peer: End) -> End:
        """The same, with what another knows where it does not."""
        known = {key: value for key, value in self._asdict().items() if value is not None}
        return peer._replace(**known)


@dataclass(frozen=True, slots=True, eq=False)
class PythonCode:
    """A function or a class with step(), or an object of one, and the interface it has."""

    code: Any
    interface: Interface

    def new(self) -> Function:
        """The function that is called at each communication point, as at the start of a run."""
        instance = self.code() if isinstance(self.code, type) else deepcopy(self.code)
        step: Function = getattr(instance, "step", instance)
        return step

    @property
    def content(self) -> bytes:
        """What its results depend on: its source, and the attributes of an object."""
        try:
            source = inspect.getsource(type_of(self.code))
        except (OSError, TypeError):  # typed into a console
            source = type_of(self.code).__qualname__
        attributes = "" if self.code is type_of(self.code) else vars(self.code)
        return f"{source}{attributes}".encode()


def is_code(entry: object) -> bool:
    """True for a function, or a class or an object with step()."""
    if isinstance(entry, ModuleType):  # a block
        return False
    return inspect.isroutine(entry) or callable(getattr(entry, "step", None))


def type_of(code: Any) -> Any:
    """The class of a class or of an object; a function itself."""
    return code if inspect.isroutine(code) or isinstance(code, type) else type(code)


def with_interface(place: str, code: Any, connected: Mapping[str, Mapping[str, End]]) -> PythonCode:
    """The code with the interface that it declares, or that is `connected` to it, by causality.

    InputError, which begins with the place, where it declares what makes no sense.
    """
    called = f"{type_of(code).__name__} (Python)"
    variables: list[Variable] = []
    causalities: dict[str, str] = {}
    units: dict[str, Unit] = {}
    for attribute, causality in CAUSALITIES.items():
        ends = connected.get(causality, {})
        declared = _declared_variables(f"{place}: {attribute}", getattr(code, attribute, None))
        if declared is None:
            declared = dict(ends)
        for name, declaration in declared.items():
            if not isinstance(name, str):
                raise InputError(f"{place}: {attribute}: {name!r}: must be a name, a text")
            if (first := causalities.setdefault(name, causality)) is not causality:
                raise InputError(
                    f"{place}: {attribute}: {name!r} is an {first}, too; must be one of them"
                )
            end = declaration.or_as(ends.get(name, End()))
            if causality == "parameter":
                end = _with_attribute(end, getattr(code, name, None))
            variables.append(_variable(name, causality, end, len(variables)))
            if end.unit:
                units[end.unit.name] = end.unit
    interface = Interface(
        path=Path(called),
        guid="",
        identifier=type_of(code).__name__,
        variables=tuple(variables),
        units=units,
        capabilities={"canHandleVariableCommunicationStepSize": True},
        model_name=called,
        tool="grasp-cosim",
    )
    return PythonCode(code, interface)


def _variable(name: str, causality: str, end: End, reference: int) -> Variable:
    kind = end.kind or "Real"
    usual = "continuous" if kind == "Real" else "discrete"
    start = None if end.start is None else str(end.start).lower()
    return Variable(
        name,
        kind,
        causality,
        reference,
        end.unit.name if end.unit else None,
        None if causality == "output" else start,
        None,
        None,
        type=kind,
        variability="tunable" if causality == "parameter" else usual,
    )


def _with_attribute(end: End, value: Any) -> End:
    """A parameter that starts as its attribute, if there is one; whole numbers have no unit."""
    value = unwrapped(value)
    start = value if type(value) in KIND_OF_TYPE else 0.0 if end.start is None else end.start
    return End("Real" if end.unit else KIND_OF_TYPE[type(start)], end.unit, start)


def _declared_variables(place: str, entries: Any) -> dict[str, End] | None:
    """What a class declares; None where it declares nothing."""
    if entries is None:
        return None
    if isinstance(entries, Mapping):
        return {name: _end_from(f"{place}: {name!r}", entry) for name, entry in entries.items()}
    if isinstance(entries, str) or not isinstance(entries, Iterable):
        raise InputError(f"{place} = {entries!r}: must be names, or names with {MUST_OF_VARIABLE}")
    return {name: End() for name in entries}


def _end_from(place: str, entry: Any) -> End:
    """A variable by its start value, its unit, both of them or neither."""
    start, unit = entry if isinstance(entry, tuple) and len(entry) == 2 else (entry, None)
    start = unwrapped(start)
    if isinstance(start, str):
        start, unit = None, start
    if (start is not None and type(start) not in KIND_OF_TYPE) or not isinstance(unit, str | None):
        raise InputError(f"{place} = {entry!r}: must be {MUST_OF_VARIABLE}")
    meaning = None if unit is None else known_unit(unit)
    if unit is not None and meaning is None:
        raise InputError(f"{place} = {entry!r}: no unit that is known; must be like 'mm', 'N.s/m'")
    return End("Boolean" if isinstance(start, bool) else None, meaning, start)
