"""What an FMU declares: its variables, units and capabilities."""

import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any, Literal, get_args
from xml.etree import ElementTree

from ..errors import InputError, choices
from ..files import check_fmu_file
from .model_description import FROM_TYPE, read_description
from .units import BASE, Unit

Value = float | int | bool | str
Kind = Literal["Real", "Integer", "Boolean", "String", "Binary", "Clock"]
KINDS: tuple[str, ...] = get_args(Kind)
SUPPORTED = ("Real", "Integer", "Boolean", "String")
"""The kinds a master can set, connection and record; it leaves the others alone."""

SETTABLE = ("input", "parameter", "structuralParameter")
_WHOLE = {
    f"{prefix}Int{bits}": (
        (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if not prefix else (0, 2**bits - 1)
    )
    for prefix in ("", "U")
    for bits in (8, 16, 32, 64)
}
LARGEST_SINGLE = (2.0 - 2.0**-23) * 2.0**127
"""The largest finite Float32."""


def limits(fmi_type: str, version: str) -> tuple[float, float]:
    """The smallest and largest value of a numeric FMI type in a version; exact for integers."""
    if fmi_type in ("Integer", "Enumeration"):
        return _WHOLE["Int64" if version.startswith("3") else "Int32"]
    if fmi_type == "Float32":
        return -LARGEST_SINGLE, LARGEST_SINGLE
    return _WHOLE.get(fmi_type, (-math.inf, math.inf))


@dataclass(frozen=True, slots=True)
class Enumeration:
    """A type of whole numbers that have names."""

    name: str
    items: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable; unit is None and start, low, high are absent where none is declared.

    type is the FMI type (Real, Float32, Int8, ...), kind what the system makes of it. dependencies
    are the inputs an output depends on directly, None where that is not declared, which means all;
    initial_dependencies the same in initialisation mode. shape is () but for an array. low and high
    are what is declared; beyond that a value must fit into its type. nominal is the magnitude that
    its values are compared with, 1 where none is declared, as FMI has it. relative says that it is
    a difference, to which the offset of a unit does not apply. enumeration is the type of an
    Enumeration.
    """

    name: str
    kind: Kind
    causality: str
    reference: int
    unit: str | None
    start: str | None
    low: float
    high: float
    type: str = "Real"
    variability: str = "continuous"
    dependencies: tuple[str, ...] | None = None
    initial_dependencies: tuple[str, ...] | None = None
    shape: tuple[int, ...] = ()
    description: str = ""
    nominal: float = 1.0
    relative: bool = False
    enumeration: Enumeration | None = None

    @property
    def items(self) -> dict[str, int]:
        """Of an Enumeration, its numbers by name; empty for any other."""
        return dict(self.enumeration.items) if self.enumeration else {}

    @property
    def supported(self) -> bool:
        """Whether a master can set, connection and record it."""
        return self.kind in SUPPORTED and not self.shape

    @property
    def nature(self) -> str:
        """Its type in words, as of what is not supported: array of Float64, Binary, Clock."""
        return f"array of {self.type}" if self.shape else self.type


@dataclass(frozen=True)
class Interface:
    """The interface of a co-simulation FMU of FMI 2.0 or 3.0; guid is the instantiation token."""

    path: Path
    guid: str
    identifier: str
    variables: tuple[Variable, ...]
    version: str = "2.0"
    units: Mapping[str, Unit] = field(default_factory=dict)
    can_save_state: bool = False
    """Whether states can be saved and restored."""
    can_vary_step: bool = False
    """Whether the communication step may vary."""
    python: bool = False
    """Whether it was made with pythonfmu: its binary calls Python, and keeps the GIL."""
    early_return: bool = False
    """Whether a step may end early, FMI 3.0."""
    once_per_process: bool = False
    """Whether a process can have one instance of it only."""
    step: float | None = None
    """The communication step in s that its default experiment names."""

    @cached_property
    def by_name(self) -> dict[str, Variable]:
        """The variables by their names."""
        return {v.name: v for v in self.variables}

    def of(self, *causalities: str) -> list[Variable]:
        """The variables of the given causalities, in the order of declaration."""
        return [v for v in self.variables if v.causality in causalities]

    def renamed(self, rename: Mapping[str, str], place: str = "rename") -> "Interface":
        """The same under other names: rename maps a new name to the FMU's own.

        place says where the table comes from. InputError where an own name does not exist or is
        renamed twice, or a new one is taken.
        """
        if not rename:
            return self
        check_rename(rename, self.by_name, self.path, place)
        names = {own: new for new, own in rename.items()}

        def new_names(listed: tuple[str, ...] | None) -> tuple[str, ...] | None:
            return None if listed is None else tuple(names.get(name, name) for name in listed)

        variables = (
            replace(
                v,
                name=names.get(v.name, v.name),
                dependencies=new_names(v.dependencies),
                initial_dependencies=new_names(v.initial_dependencies),
            )
            for v in self.variables
        )
        return replace(self, variables=tuple(variables))

    def parse(self, place: str, name: str, value: Value, text: bool = False) -> Value:
        """The value for input or parameter name, checked against type, range and finiteness.

        place names where the value comes from. An item of an enumeration may be given by its name.
        With text, a string may stand for a number or a boolean, as on a command line.
        """
        settable = [v.name for v in self.of(*SETTABLE)]
        if name not in settable:
            raise InputError(
                f"{place}: {self.path.name} has no input or parameter {name!r}; "
                f"valid: {choices(settable)}"
            )
        variable = self.by_name[name]
        if not variable.supported:
            raise InputError(
                f"{place}: {name} = {value!r}: {name} is of type {variable.nature}, which cannot "
                "be set; must be left out, it keeps the start value of its FMU"
            )
        given, converted = value, None
        if isinstance(value, str):
            value = variable.items.get(value, value)
        if text or variable.kind == "String" or not isinstance(value, str):
            converted = _convert(variable, value, self.version)
        if converted is None:
            raise InputError(f"{place}: {name} = {given!r}: must be {_expected(variable)}")
        return converted


def check_rename(rename: Mapping[str, str], names: Collection[str], path: Path, place: str) -> None:
    """InputError where rename, new names to own, does not fit the names in the FMU at path.

    An own name must exist and be renamed once, a new one must be free. place says where rename
    comes from.
    """
    first: dict[str, str] = {}
    for new, own in rename.items():
        entry = f"{place}: {new!r} = {own!r}"
        if own not in names:
            raise InputError(
                f"{entry}: {path.name} has no variable {own!r}; valid: {choices(names)}"
            )
        if own in first:
            raise InputError(
                f"{entry}: {own!r} is renamed to {first[own]!r} already; must have one name"
            )
        first[own] = new
    for new, own in rename.items():
        if new in names and new not in first:
            raise InputError(
                f"{place}: {new!r} = {own!r}: {path.name} has a variable {new!r} itself; "
                "must be a name that is free, or rename that one, too"
            )


@lru_cache(maxsize=64)
def _read(path: Path, modified: int) -> Interface:
    model, root, files = read_description(path)
    version, experiment = model.fmiVersion, model.defaultExperiment
    if version.partition(".")[0] not in ("2", "3"):
        raise InputError(f"{path}: FMI {version}; must be an FMI 2.0 or 3.0 co-simulation FMU")
    if model.coSimulation is None:
        kind = "model exchange" if model.modelExchange else "scheduled execution"
        raise InputError(f"{path}: for {kind} only; must be a co-simulation FMU")
    try:
        variables, units = tuple(_variables(model, root)), tuple(read_units(root))
        step = experiment.stepSize if experiment else None
        step = None if step is None else float(step)
    except ValueError as error:
        raise InputError(f"{path}: not a readable FMU: {error}") from error
    return Interface(
        path,
        model.guid or "",
        model.coSimulation.modelIdentifier,
        variables,
        version,
        {unit.name: unit for unit in units},
        model.coSimulation.canGetAndSetFMUstate,
        model.coSimulation.canHandleVariableCommunicationStepSize,
        "resources/slavemodule.txt" in files,
        model.coSimulation.mightReturnEarlyFromDoStep,
        model.coSimulation.canBeInstantiatedOnlyOncePerProcess,
        step,
    )


def read_interface(path: Path) -> Interface:
    """The interface of the FMU at path; InputError where there is none."""
    check_fmu_file(path)
    return _read(path.resolve(), path.stat().st_mtime_ns)


def read_units(root: ElementTree.Element) -> Iterator[Unit]:
    """The units that are defined in terms of the SI base units; ValueError for one that is none."""
    for element in root.iterfind("UnitDefinitions/Unit"):
        base = element.find("BaseUnit")
        if base is None:
            continue
        name = element.get("name", "")
        factor, offset = float(base.get("factor", "1")), float(base.get("offset", "0"))
        if not factor or not math.isfinite(factor) or not math.isfinite(offset):
            raise ValueError(f"unit {name!r}: factor = {factor:g}, offset = {offset:g}")
        yield Unit(name, tuple(int(base.get(key, "0")) for key in BASE), factor, offset)


def _variables(model: Any, root: ElementTree.Element) -> Iterator[Variable]:
    """The variables; of an input's alias names none, as an input has one source."""
    elements = {e.get("name"): e for e in root.iterfind("ModelVariables/*")}
    inputs = tuple(v.name for v in model.modelVariables if v.causality == "input" and not v.alias)
    now = _dependencies(model.outputs, inputs, None)
    initially = _dependencies(model.initialUnknowns, inputs, inputs)
    for v in model.modelVariables:
        if v.alias is None or v.causality != "input":
            own = (v.alias or v).name
            yield _variable(v, elements[own], now.get(own), initially.get(own))


def _dependencies(
    unknowns: Any, inputs: tuple[str, ...], undeclared: tuple[str, ...] | None
) -> dict[str, tuple[str, ...] | None]:
    """By name of an unknown, the inputs it depends on; undeclared where the FMU does not say."""
    found = {}
    for unknown in unknowns:
        names = {v.name for v in unknown.dependencies or ()}
        declared = tuple(name for name in inputs if name in names)
        found[unknown.variable.name] = undeclared if unknown.dependencies is None else declared
    return found


def _variable(
    v: Any,
    element: ElementTree.Element,
    dependencies: tuple[str, ...] | None,
    initial_dependencies: tuple[str, ...] | None,
) -> Variable:
    declared = {
        key: getattr(v, key) or element.get(key) or getattr(v.declaredType, key, None)
        for key in FROM_TYPE
    }
    kind = _kind(v.type)
    numeric = kind in ("Real", "Integer")
    low, high = (declared[key] if numeric else None for key in ("min", "max"))
    return Variable(
        v.name,
        kind,
        v.causality or "local",
        v.valueReference,
        declared["unit"],
        v.start,
        -math.inf if low is None else float(low),
        math.inf if high is None else float(high),
        v.type,
        v.variability,
        dependencies,
        initial_dependencies,
        tuple(v.shape or ()),
        v.description or "",
        abs(float(declared["nominal"] or 1.0)) or 1.0,
        _relative(v, element),
        _enumeration(v),
    )


def _enumeration(v: Any) -> Enumeration | None:
    declared = v.declaredType if v.type == "Enumeration" else None
    if not declared:
        return None
    return Enumeration(declared.name, tuple((i.name, int(i.value)) for i in declared.items))


def _relative(v: Any, element: ElementTree.Element) -> bool:
    """Whether it is a difference; FMPy overlooks where a variable itself says so."""
    said = [text for e in (element, *element) if (text := e.get("relativeQuantity"))]
    return (
        said[0] in ("true", "1") if said else bool(getattr(v.declaredType, "relativeQuantity", 0))
    )


def _kind(fmi_type: str) -> Kind:
    """What the system makes of an FMI type."""
    if fmi_type in ("Real", "Float64", "Float32"):
        return "Real"
    if fmi_type in KINDS:
        return fmi_type  # type: ignore[return-value]
    return "Integer"


def _convert(variable: Variable, value: Value, version: str) -> Value | None:
    """The value in the variable's type, or None where it does not fit."""
    if variable.kind == "String":
        return value if isinstance(value, str) else None
    if variable.kind == "Boolean":
        if isinstance(value, str):
            return {"true": True, "1": True, "false": False, "0": False}.get(value.lower())
        return value if isinstance(value, bool) else None
    if isinstance(value, bool):
        return None
    number = _whole(value) if variable.kind == "Integer" else _real(value)
    if number is None or not math.isfinite(number):
        return None
    low, high = limits(variable.type, version)
    fits = low <= number <= high and variable.low <= number <= variable.high
    fits = fits and (not variable.items or number in variable.items.values())
    return number if fits else None


def _real(value: float | int | str) -> float | None:
    try:
        return float(value)
    except (ValueError, OverflowError):
        return None


def _whole(value: float | int | str) -> int | None:
    """Exact, also where a float is not; 3.0 and "3.0" are whole, too."""
    try:
        return int(value) if isinstance(value, int | str) else _whole_float(value)
    except ValueError:
        number = _real(value)
        return None if number is None else _whole_float(number)


def _whole_float(number: float) -> int | None:
    return int(number) if number.is_integer() else None


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
    unit = f" {variable.unit}" if variable.unit else ""
    if math.isinf(variable.low) and math.isinf(variable.high):
        return f"{noun}{f' in{unit}' if unit else ''}"
    return f"{noun} from {variable.low:g} to {variable.high:g}{unit}"
