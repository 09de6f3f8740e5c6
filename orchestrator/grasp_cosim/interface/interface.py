"""The interface that an FMU declares: its variables, units and capabilities."""

import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cache, cached_property
from itertools import product
from pathlib import Path
from shlex import quote
from typing import Any, Literal, Protocol, get_args, runtime_checkable

from ..base.checks import EXACT, integer, known, point_advice, real
from ..base.errors import InputError, choices
from ..base.quantity import Quantity, as_quantity, unwrapped
from ..base.scratch import without_scratch
from ..base.si_units import Unit, known_unit, refusal, spelt_like
from .units import IDENTITY, Conversion, conversion, converted

Value = float | int | bool | str


@runtime_checkable
class Nested(Protocol):
    """An array like those of NumPy."""

    def tolist(self) -> Any:
        """The same as lists of lists."""


Given = Value | Quantity | tuple[Any, str] | Sequence["Given"] | Nested
"""A value for a variable, or those of an array as lists of lists or so.

A number is in the unit of its variable; one with a unit is a Quantity, (50, "mm") or "50 mm".
"""

Kind = Literal["Real", "Integer", "Boolean", "String", "Binary", "Clock"]
KINDS: tuple[str, ...] = get_args(Kind)
SUPPORTED = ("Real", "Integer", "Boolean", "String")
"""The kinds a master can set, connection and record; it leaves the others alone."""

PARAMETERS = ("parameter", "structuralParameter")
SETTABLE = ("input", *PARAMETERS)
_WHOLE = {
    **{f"Int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"UInt{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
}
TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")
TYPES_3 = ("Float64", "Float32", *_WHOLE, "Boolean", "String", "Binary", "Enumeration", "Clock")
"""The types of variables in FMI 1.0 and 2.0, and in FMI 3.0."""


MOST_ELEMENTS = 100_000
"""Of all arrays of an FMU that are taken apart; what would be more is left alone."""


_JOINED = re.compile(r"([-+]?[0-9.]+)([^0-9.,\s].*)")
"""A number and a unit without a space between them."""


@dataclass(frozen=True, slots=True)
class Element:
    """Where a variable is in an array of that name: its place, row by row from 0, of size."""

    array: str
    place: int
    size: int


@dataclass(frozen=True, slots=True)
class Array:
    """An array that was taken apart: its shape, and the names of its elements row by row."""

    shape: tuple[int, ...]
    names: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Clock:
    """When a clock of FMI 3.0 ticks.

    variability is that of its interval: constant, fixed, calculated, tunable, changing, countdown,
    or triggered where it has none. interval and shift, from the start to the first tick, are in s,
    None where that is not declared. fractions says that the FMU gives them as fractions.
    """

    variability: str
    interval: Fraction | None = None
    shift: Fraction = Fraction(0)
    fractions: bool = False


def size_of(shape: Sequence[int]) -> int:
    """The number of elements; no more than one beyond MOST_ELEMENTS where there are more."""
    size = 1
    for length in shape if 0 not in shape else [0]:
        size = min(size * length, MOST_ELEMENTS + 1)
    return size


def element_names(name: str, shape: Sequence[int]) -> tuple[str, ...]:
    """The names of the elements, row by row."""
    places = product(*(range(1, length + 1) for length in shape))
    return tuple(f"{name}[{','.join(map(str, place))}]" for place in places)


def limits(fmi_type: str, version: str) -> tuple[float, float]:
    """The smallest and largest value of a numeric FMI type in a version; exact for integers."""
    if fmi_type in ("Integer", "Enumeration"):
        return _WHOLE["Int64" if version.startswith("3") else "Int32"]
    if fmi_type == "Float32":
        largest = (2.0 - 2.0**-23) * 2.0**127
        return -largest, largest
    return _WHOLE.get(fmi_type, (-math.inf, math.inf))


@cache  # of few types, for each of a great many variables
def kind_of(fmi_type: str) -> Kind:
    """The kind that the system makes of an FMI type of any version."""
    if fmi_type.startswith(("Real", "Float")):
        return "Real"
    return fmi_type if fmi_type in KINDS else "Integer"  # type: ignore[return-value]


def typed(fmi_type: str, text: str | None) -> Value | None:
    """The value in its type; the text itself where it is none, and for what JSON has no number."""
    kind = kind_of(fmi_type)
    if text is None or kind in ("String", "Binary", "Clock"):
        return text
    if kind == "Boolean":
        return {"true": True, "1": True, "false": False, "0": False}.get(text.strip(), text)
    try:
        number = real(text) if kind == "Real" else integer(text)
        return number if math.isfinite(number) else str(number)
    except (ValueError, OverflowError):
        return text


def as_float(value: Value | None, absent: float) -> float:
    """A declared number as a float; `absent` where there is none, or none that is a number."""
    try:
        return absent if value is None else float(value)
    except ValueError:
        return absent


@dataclass(frozen=True, slots=True)
class Enumeration:
    """A type of whole numbers that have names."""

    name: str
    items: tuple[tuple[str, int], ...]


@dataclass(slots=True, unsafe_hash=True)  # to make a frozen one takes three times as long
class Variable:
    """A variable; unit, start, minimum, maximum and magnitude are None if they are not declared.

    initial is how its value at the start comes about: "exact", "approx" or "calculated", as the
    standard derives it where it is not declared; None where the standard has none.

    type is the FMI type (Real, Float32, Int8, ...), kind what the system makes of it. start is its
    text, of an array that of all elements or, in starts, of each. minimum, maximum and magnitude,
    the nominal value, are as typed() gives them. dependencies are the variables an output depends
    on directly, None where that is not declared, which means all inputs; initial_dependencies the
    same in initialisation mode. shape is () but for an array, and sizes then names by dimension the
    variable that holds its length, None where that is fixed. element is its place in an array that
    was taken apart. relative says that it is a difference, to which the offset of a unit does not
    apply. enumeration is the type of an Enumeration. alias says that it is another name of a
    variable that comes before, infinite that inf is a value of it, as of a distance to nothing.
    clock is there for a Clock, and clocks are the references of those with which the variable
    changes, where that is declared.
    """

    name: str
    kind: Kind
    causality: str
    reference: int
    unit: str | None
    start: str | None
    minimum: Value | None
    maximum: Value | None
    type: str = "Real"
    variability: str = "continuous"
    dependencies: tuple[str, ...] | None = None
    initial_dependencies: tuple[str, ...] | None = None
    shape: tuple[int, ...] = ()
    description: str | None = None
    magnitude: Value | None = None
    relative: bool = False
    enumeration: Enumeration | None = None
    initial: str | None = None
    display_unit: str | None = None
    starts: tuple[str, ...] = ()
    alias: bool = False
    infinite: bool = False
    sizes: tuple[str | None, ...] = ()
    element: Element | None = None
    clock: Clock | None = None
    clocks: tuple[int, ...] = ()

    @property
    def low(self) -> float:
        """The smallest value that is declared valid; beyond that a value must fit into its type."""
        return as_float(self.minimum, -math.inf)

    @property
    def high(self) -> float:
        """The largest value that is declared valid."""
        return as_float(self.maximum, math.inf)

    @property
    def nominal(self) -> float:
        """The magnitude that its values are compared with, 1 if none is declared, as FMI has it."""
        return abs(as_float(self.magnitude, 1.0)) or 1.0

    @property
    def start_value(self) -> Value | list[Value | None] | None:
        """The start value as typed() gives it, a list for an array."""
        if not self.shape or self.start is None:
            return typed(self.type, self.start)
        return [typed(self.type, text) for text in self.texts]

    @property
    def items(self) -> dict[str, int]:
        """Of an Enumeration, its numbers by name; empty for any other."""
        return dict(self.enumeration.items) if self.enumeration else {}

    @property
    def settable(self) -> bool:
        """True if it can be given a value before the initialisation."""
        if self.variability == "constant" and self.causality != "input":
            return False
        return self.causality in SETTABLE or self.initial in ("exact", "approx")

    @property
    def unsettable(self) -> str:
        """Why it cannot be given a value, as the end of a sentence that begins with its name."""
        if self.causality == "independent":
            return "is the time of the FMU"
        if self.variability == "constant":
            return "is a constant of the FMU"
        nouns = {"output": "an output", "calculatedParameter": "a calculated parameter"}
        noun = nouns.get(self.causality, "a local variable")
        return f"is {noun} that the FMU calculates from the start on"

    @property
    def supported(self) -> bool:
        """True if a master can set, connect and record it."""
        return self.kind in SUPPORTED and not self.shape

    @property
    def is_number(self) -> bool:
        """True if it is supported, and a Real, an Integer or a Boolean."""
        return self.supported and self.kind != "String"

    @property
    def nature(self) -> str:
        """Its type in words, as of what is not supported: array of Float64, Binary, Clock."""
        if size_of(self.shape) > MOST_ELEMENTS:
            return f"array of {self.type} with more than {MOST_ELEMENTS} elements"
        return f"array of {self.type}" if self.shape else self.type

    @property
    def texts(self) -> tuple[str, ...]:
        """Of an array, its start values as they are declared: of each element, or one for all."""
        return self.starts or tuple((self.start or "").split())


@dataclass(frozen=True)
class ModelExchange:
    """Needs of model exchange: the name of the binary, in FMI 2.0 the numbers of states and event
    indicators, and whether it is told of completed steps. Of FMI 3.0 the instance says the numbers.
    """

    identifier: str
    states: int = 0
    indicators: int = 0
    told: bool = True


@dataclass(frozen=True, repr=False)
class Interface:
    """The interface of an FMU; guid is the instantiation token, tool what it was made with.

    kinds are CoSimulation, ModelExchange, ScheduledExecution. capabilities are all of the first
    kind, then all of a later one as 'FLAG (model exchange)'; see obstacles.capabilities_of().
    experiment is the default one: start_time, stop_time, tolerance and step_size, as typed() gives
    them. log_categories are what its messages are sorted by. platforms are those it has a binary
    for, sources says that it has C. flaw is the first number that could not be read, for which no
    master takes the FMU. arrays are those that were taken apart, by name: see expansion.py.
    exchange is there where it is for model exchange, too.
    """

    path: Path
    guid: str
    identifier: str
    variables: tuple[Variable, ...]
    version: str = "2.0"
    units: Mapping[str, Unit] = field(default_factory=dict)
    kinds: tuple[str, ...] = ("CoSimulation",)
    capabilities: Mapping[str, Value | None] = field(default_factory=dict)
    experiment: Mapping[str, Value | None] = field(default_factory=dict)
    log_categories: tuple[str, ...] = ()
    platforms: tuple[str, ...] = ()
    sources: bool = False
    python: bool = False
    """True if it was made with pythonfmu: its binary calls Python, and keeps the GIL."""
    model_name: str | None = None
    tool: str | None = None
    flaw: str = ""
    ambiguous: tuple[str, ...] = ()
    """The names that several variables have, which are not among `variables`."""
    arrays: Mapping[str, Array] = field(default_factory=dict)
    exchange: ModelExchange | None = None
    given: Path | None = None
    """The path by which the user knows it, where that is not `path`."""

    @property
    def ours(self) -> bool:
        """True if it was made here."""
        return (self.tool or "").startswith("grasp-cosim")

    @property
    def called(self) -> str:
        """The FMU as messages name it."""
        return without_scratch(str(self.given or self.path))

    @cached_property
    def _made(self) -> dict[tuple[Any, ...], "Interface"]:
        return {}

    def kept(self, key: tuple[Any, ...], make: Callable[[], "Interface"]) -> "Interface":
        """What is made of this one by elements, names or units, once, as it is asked for again."""
        if key not in self._made:
            self._made[key] = make()
        return self._made[key]

    @cached_property
    def sized_by(self) -> tuple[str, ...] | None:
        """The variables that hold lengths of arrays; None where there are no arrays."""
        if not any(v.shape for v in self.variables):
            return None
        return tuple(dict.fromkeys(name for v in self.variables for name in v.sizes if name))

    @cached_property
    def by_name(self) -> dict[str, Variable]:
        """The variables by their names."""
        return {v.name: v for v in self.variables}

    def sample(self, name: str) -> Variable | None:
        """The variable of a name; of an array its first element. None where there is none."""
        names = self.elements(name)
        return self.by_name.get(names[0]) if names else None

    def elements(self, name: str) -> tuple[str, ...]:
        """The names of the variables that a name stands for: of an array its elements.

        Scalars that an FMU names like these, Gaps[1] and Gaps[2], are Gaps. Any other name stands
        for itself.
        """
        if name in self.arrays:
            return self.arrays[name].names
        if name in self.by_name:
            return (name,)
        element = re.compile(rf"{re.escape(name)}\[\d+(,\d+)*\]")
        return tuple(filter(element.fullmatch, self.by_name)) or (name,)

    def capability(self, flag: str) -> Value | None:
        """The value of a capability, under the name that FMI 2.0 or 3.0 has for it."""
        wanted = _plain(flag)
        return next((v for name, v in self.capabilities.items() if _plain(name) == wanted), None)

    def __repr__(self) -> str:
        """What FMU it is of, and how many variables that has of which causality."""
        found = Counter(v.causality for v in self.variables)
        counts = ", ".join(f"{count} {causality}" for causality, count in found.items())
        return f"Interface of {self.path.name}, FMI {self.version}: {counts or 'no variables'}"

    @property
    def can_vary_step(self) -> bool:
        """True if the communication step may vary."""
        return self.capability("canHandleVariableCommunicationStepSize") is True

    @property
    def has_states(self) -> bool:
        """True if its state can be saved and restored."""
        return self.capability("canGetAndSetFMUstate") is True

    @cached_property
    def input_clocks(self) -> tuple[Variable, ...]:
        """The clocks that a master has to tick."""
        return tuple(v for v in self.of("input") if v.clock)

    @property
    def event_mode(self) -> bool:
        """True if its events are handled with the master, where it runs co-simulation.

        It then may end a step at one. An FMU that cannot vary its step handles events itself, but
        for those of clocks.
        """
        has = self.version.startswith("3") and self.capability("hasEventMode") is True
        return has and (self.can_vary_step or bool(self.input_clocks))

    @property
    def step(self) -> float | None:
        """The communication step in s that its default experiment names."""
        step = self.experiment.get("step_size")
        return None if step is None else float(step)

    @property
    def tolerance(self) -> float | None:
        """The relative tolerance that its default experiment names."""
        tolerance = self.experiment.get("tolerance")
        return tolerance if isinstance(tolerance, float) and tolerance > 0.0 else None

    def unit(self, variable: Variable) -> Unit | None:
        """The unit that is declared for a variable, if it is defined, or known by its name."""
        name = variable.unit or ""
        return self.units.get(name) or known_unit(name)

    def of(self, *causalities: str) -> list[Variable]:
        """The variables of the given causalities, in the order of declaration.

        An input is there once, by its main name, as it has one source.
        """
        return [
            v
            for v in self.variables
            if v.causality in causalities and not (v.alias and v.causality == "input")
        ]

    @cached_property
    def main_names(self) -> Mapping[str, str]:
        """The main names of variables and arrays that can be set, by other names of them.

        FMI 3.0 declares such aliases; in FMI 2.0 variables of one value reference are the same one.
        Among them the input is the main one, or a parameter, or else what is declared first.
        """
        three = self.version.startswith("3")
        main: dict[tuple[int, str, int], Variable] = {}
        names: dict[str, str] = {}
        settable = [v for v in self.variables if v.settable]
        settable.sort(key=lambda v: (v.causality != "input", v.causality not in PARAMETERS))
        for v in settable:
            place = v.element.place if v.element else 0
            first = main.setdefault((v.reference, "" if three else v.kind, place), v)
            if first is v:
                continue
            names[v.name] = first.name
            if v.element and first.element:
                names[v.element.array] = first.element.array
        return names

    def main_name(self, name: str) -> str:
        """The main name of a variable or array."""
        return self.main_names.get(name, name)

    @property
    def inputs(self) -> list[Variable]:
        """The inputs, each by its main name alone."""
        return [v for v in self.of("input") if self.main_name(v.name) == v.name]

    def by_main_names(
        self, values: Mapping[str, Value], place: Callable[[str], str]
    ) -> dict[str, Value]:
        """Values by main names; InputError where two names of one variable have two values.

        place says of a name where its value comes from.
        """
        name_of: dict[str, str] = {}
        for name, value in values.items():
            other = name_of.setdefault(self.main_name(name), name)
            if values[other] != value:
                raise InputError(
                    f"{place(name)} = {value!r}: is another name of {other}, which is "
                    f"{values[other]!r}; must have one value"
                )
        return {main: values[name] for main, name in name_of.items()}

    def conversion(self, name: str, other: "Interface") -> Conversion | None:
        """The conversion of a variable into the unit that `other` has it in; None for no way.

        A unit that is not declared is taken as the other one.
        """
        source, target = self.by_name[name], other.by_name[name]
        if source.unit is None or target.unit is None or source.unit == target.unit:
            return IDENTITY
        start, end = self.unit(source), other.unit(target)
        return conversion(start, end) if start and end else None

    def renamed(self, rename: Mapping[str, str], place: str = "rename") -> "Interface":
        """The same under other names: rename maps a new name to the FMU's own.

        place says where the table comes from. InputError where an own name does not exist or is
        renamed twice, or a new one is taken. An array is renamed whole, or by elements; so are
        scalars that are named as its elements.
        """
        key = ("rename", *rename.items())
        return self.kept(key, lambda: self._renamed(rename, place)) if rename else self

    @property
    def listing(self) -> str:
        """The command that shows all variables, for messages."""
        return f"`grasp-cosim inspect {quote(without_scratch(str(self.path)))}`"

    @property
    def short(self) -> str:
        """The FMU in a message on a name that it does not have."""
        several = f", where several are called {choices(self.ambiguous)}," * bool(self.ambiguous)
        return f"{self.path.name}{several}"

    def _renamed(self, rename: Mapping[str, str], place: str) -> "Interface":
        names: dict[str, str] = {}
        arrays: dict[str, str] = {}
        elements: dict[str, str] = {}
        for new, own in rename.items():
            if own in self.arrays:
                arrays[own] = new
            elements |= {new + its.removeprefix(own): its for its in self.elements(own)}
        for new, own in elements.items():
            entry = f"{place}: {new!r} = {own!r}"
            known(f"{entry}: {self.short} has no variable", own, self.by_name, see=self.listing)
            if own in names:
                raise InputError(
                    f"{entry}: {own!r} is renamed to {names[own]!r} already; must have one name"
                )
            names[own] = new
        for own, new in names.items():
            if new in self.by_name and new not in names:
                raise InputError(
                    f"{place}: {new!r} = {own!r}: {self.path.name} has a variable {new!r} itself; "
                    "must be a name that is free, or rename that one, too"
                )

        def listed(own: tuple[str, ...] | None) -> tuple[str, ...] | None:
            return None if own is None else tuple(names.get(name, name) for name in own)

        variables = []
        for v in self.variables:
            element = v.element
            if element and element.array in arrays:
                element = replace(element, array=arrays[element.array])
            renamed = replace(
                v,
                name=names.get(v.name, v.name),
                dependencies=listed(v.dependencies),
                initial_dependencies=listed(v.initial_dependencies),
                element=element,
            )
            variables.append(renamed)
        taken_apart = {
            arrays.get(name, name): Array(a.shape, tuple(names.get(n, n) for n in a.names))
            for name, a in self.arrays.items()
        }
        return replace(self, variables=tuple(variables), arrays=taken_apart)

    def in_units(self, units: Mapping[str, str], place: str = "units") -> "Interface":
        """The same with other units: `units` maps a variable to the name of its unit.

        That is one of the FMU's own definitions, or else a known one, with a minus before it where
        the FMU counts the other way. place says where the table comes from. InputError where there
        is no such variable, or no such unit.
        """
        key = ("units", *units.items())
        return self.kept(key, lambda: self._in_units(units, place)) if units else self

    def _in_units(self, units: Mapping[str, str], place: str) -> "Interface":
        defined = dict(self.units)
        units = {element: unit for name, unit in units.items() for element in self.elements(name)}
        for name, unit in units.items():
            entry = f"{place}: {name!r} = {unit!r}"
            known(f"{entry}: {self.short} has no variable", name, self.by_name, see=self.listing)
            if self.by_name[name].kind != "Real":
                raise InputError(
                    f"{entry}: is of type {self.by_name[name].nature}; must be a Real, as only "
                    "these have units"
                )
            defined[unit] = self._unit(entry, unit, defined)
        variables = (
            replace(v, unit=units[v.name], display_unit=None) if v.name in units else v
            for v in self.variables
        )
        return replace(self, variables=tuple(variables), units=defined)

    def _unit(self, entry: str, name: str, defined: Mapping[str, Unit]) -> Unit:
        """The unit of a name that is defined or known, with a minus reversed; else InputError."""
        plain = name.removeprefix("-")
        found = defined.get(name) or known_unit(name) or defined.get(plain) or known_unit(plain)
        if found is None:
            alike = choices(spelt_like(plain, defined))
            like = "must be like 'mm', 'N.s/m', 'degC', '1', or '-mm' for what counts the other way"
            meant = like if alike == "none" else f"did you mean {alike}?"
            said = f"{entry}: no unit that {self.path.name} defines, or that is known; {meant}"
            raise InputError(said)
        return found if found.name == name else found.reversed(name)

    def parse(self, place: str, name: str, value: Any, text: bool = False) -> Value:
        """The value for input or parameter name, checked against type, range and finiteness.

        place names where the value comes from. An item of an enumeration may be given by its name,
        a number with its unit. With text, a string may stand for a number or a boolean, as on a
        command line.
        """
        value = unwrapped(value)
        variable = self.by_name.get(name)
        if variable is None:
            settable = [v.name for v in self.variables if v.settable]
            if name in self.arrays:
                first = choices(self.arrays[name].names[:1])
                raise InputError(f"{place}: {name} is an array; must be an element of it: {first}")
            lacking = f"{place}: {self.short} has no input, parameter or initial value"
            known(lacking, name, settable, see=self.listing)
            raise AssertionError(name)  # pragma: no cover
        if not variable.settable:
            raise InputError(
                f"{place}: {name} = {value!r}: {variable.unsettable}; must be an input, a "
                f"parameter, or a variable whose initial is exact or approx: {self.listing}"
            )
        if not variable.supported:
            raise InputError(
                f"{place}: {name} = {value!r}: {name} is of type {variable.nature}, which cannot "
                "be set; must be left out, it keeps the start value of its FMU"
            )
        given, fitting = value, None
        if isinstance(value, str):
            value = variable.items.get(value, value)
        if variable.kind != "String" or not isinstance(value, str):
            quantity = as_quantity(value)
            if quantity is not None:
                value = self.in_own_unit(f"{place}: {name}", name, quantity)
                given = str(quantity)
        if text or variable.kind == "String" or not isinstance(value, str):
            fitting = _convert(variable, value, self.version)
        if fitting is None:
            advice = _advice(variable, given)
            raise InputError(f"{place}: {name} = {given!r}: must be {_expected(variable)}{advice}")
        return fitting

    def in_own_unit(self, place: str, name: str, quantity: Quantity) -> float:
        """The number of a quantity in the unit of a variable; InputError where it has no such unit.

        place begins the error.
        """
        variable, given = self.by_name[name], f"{place} = {quantity}"
        if variable.kind != "Real":
            raise InputError(f"{given}: is of type {variable.nature}; must have no unit")
        if variable.unit is None:
            raise InputError(
                f"{given}: {self.short} declares no unit of it; must have none, or `units` must "
                "name one"
            )
        source = self.units.get(quantity.unit) or known_unit(quantity.unit)
        target = self.unit(variable)
        if quantity.unit == variable.unit:
            return float(quantity.value)
        if source is None:
            raise InputError(f"{given}: {refusal(quantity.unit)}")
        if target is None or conversion(source, target) is None:
            raise InputError(
                f"{given}: cannot be converted into {variable.unit}; must be in a unit of that "
                "quantity"
            )
        if variable.relative:
            source, target = source.without_offset, target.without_offset
        return converted(quantity.value, source, target)


def _advice(variable: Variable, given: Any) -> str:
    """What a text for a Real may have been meant to be; empty where nothing is likely."""
    if variable.kind != "Real":
        return ""
    joined = _JOINED.fullmatch(given.strip()) if isinstance(given, str) else None
    if joined and known_unit(joined[2]):
        return f"; with its unit it is '{joined[1]} {joined[2]}'"
    return point_advice(given)


def _plain(flag: str) -> str:
    """A capability by a name that FMI 2 and 3 have in common."""
    return flag.lower().removesuffix("s")


def _convert(variable: Variable, value: Value, version: str) -> Value | None:
    if variable.kind == "String":
        return value if isinstance(value, str) else None
    if variable.kind == "Boolean":
        if isinstance(value, str):
            return {"true": True, "1": True, "false": False, "0": False}.get(value.lower())
        return value if isinstance(value, bool) else None
    number = _number(value, variable.kind == "Integer")
    if number is None:
        return None
    low, high = limits(variable.type, version)
    fits = low <= number <= high and variable.low <= number <= variable.high
    fits = fits and (not variable.items or number in variable.items.values())
    return number if fits else None


def _number(value: Value, whole: bool) -> float | int | None:
    """A finite number; a whole one is exact where a float is not, 3.0 and "3.0" are whole, too.

    None for a whole one written as a float that cannot tell it from the next.
    """
    if isinstance(value, bool):
        return None
    if whole and not isinstance(value, float):
        with suppress(ValueError):
            return integer(value) if isinstance(value, str) else int(value)
    with suppress(ValueError, OverflowError):
        number = real(value) if isinstance(value, str) else float(value)
        if math.isfinite(number) and not whole:
            return number
        if number.is_integer() and abs(number) < EXACT:
            return int(number)
    return None


def _expected(variable: Variable) -> str:
    if variable.kind == "Boolean":
        return "true or false"
    if variable.kind == "String":
        return "a string"
    if variable.items:
        return f"one of {choices(variable.items)}"
    noun = "a whole number" if variable.kind == "Integer" else "a finite number"
    if variable.type not in ("Real", "Float64", "Integer"):
        noun = f"{noun} of type {variable.type}"
    unit = variable.unit if variable.unit != "1" else None
    if not (math.isinf(variable.low) and math.isinf(variable.high)):
        return " ".join(filter(None, [f"{noun} from {variable.low:g} to {variable.high:g}", unit]))
    return f"{noun} in {unit}" if unit else noun
