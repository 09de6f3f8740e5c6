"""What an FMU declares: its variables, as FMPy reads and validates them."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Literal

import fmpy

from ..errors import InputError, check_fmu_file, choices
from .units import Unit

Value = float | int | bool | str
Kind = Literal["Real", "Integer", "Boolean", "String"]


@dataclass(frozen=True, slots=True)
class Variable:
    """A variable; unit is None and start, low, high are absent where none is declared.

    type is the FMI type (Real, Float32, Int8, ...), kind what the system makes of it. dependencies
    are the inputs an output depends on directly, None where that is not declared, which means all;
    initial_dependencies the same in initialisation mode. shape is () but for an array.
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

    @cached_property
    def by_name(self) -> dict[str, Variable]:
        """The variables by their names."""
        return {v.name: v for v in self.variables}

    def of(self, *causalities: str) -> list[Variable]:
        """The variables of the given causalities, in the order of declaration."""
        return [v for v in self.variables if v.causality in causalities]

    def renamed(self, rename: Mapping[str, str]) -> "Interface":
        """The same under other names: rename maps a new name to the FMU's own."""
        if not rename:
            return self
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

        place names where the value comes from. With text, a string may stand for a number or a
        boolean, as on a command line.
        """
        settable = [v.name for v in self.of("input", "parameter")]
        if name not in settable:
            raise InputError(
                f"{place}: {self.path.name} has no input or parameter {name!r}; "
                f"valid: {choices(settable)}"
            )
        variable = self.by_name[name]
        converted = None
        if text or variable.kind == "String" or not isinstance(value, str):
            converted = _convert(variable, value)
        if converted is None:
            raise InputError(f"{place}: {name} = {value!r}: must be {_expected(variable)}")
        return converted


@lru_cache(maxsize=64)
def _read(path: Path, modified: int) -> Interface:
    try:
        description = fmpy.read_model_description(path, validate=False)
        if description.fmiVersion == "2.0":
            description = fmpy.read_model_description(path)
    except Exception as error:  # FMPy raises whatever its XML and ZIP libraries do
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: not a readable FMU: {reason}") from error
    if description.fmiVersion != "2.0":
        version = description.fmiVersion
        raise InputError(f"{path}: FMI {version}; must be an FMI 2.0 co-simulation FMU")
    if description.coSimulation is None:
        raise InputError(f"{path}: for model exchange only; must be a co-simulation FMU")
    return Interface(
        path,
        description.guid,
        description.coSimulation.modelIdentifier,
        tuple(_variable(v) for v in description.modelVariables),
    )


def read_interface(path: Path) -> Interface:
    """The interface of the FMU at path; InputError where there is none."""
    check_fmu_file(path)
    return _read(path.resolve(), path.stat().st_mtime_ns)


def _variable(v: fmpy.model_description.ScalarVariable) -> Variable:
    declared = v.declaredType
    kind: Kind = "Integer" if v.type == "Enumeration" else v.type
    low, high, unit = (
        getattr(v, key) or (getattr(declared, key, None) if declared else None)
        for key in ("min", "max", "unit")
    )
    return Variable(
        v.name,
        kind,
        v.causality or "local",
        v.valueReference,
        unit,
        v.start,
        -math.inf if low is None else float(low),
        math.inf if high is None else float(high),
        v.type,
        v.variability,
    )


def _convert(variable: Variable, value: Value) -> Value | None:
    """The value in the variable's type, or None where it does not fit."""
    if variable.kind == "String":
        return value if isinstance(value, str) else None
    if variable.kind == "Boolean":
        if isinstance(value, str):
            return {"true": True, "1": True, "false": False, "0": False}.get(value.lower())
        return value if isinstance(value, bool) else None
    if isinstance(value, bool):
        return None
    try:
        number = float(value)
    except (ValueError, OverflowError):
        return None
    if not math.isfinite(number) or not variable.low <= number <= variable.high:
        return None
    if variable.kind == "Integer":
        return int(number) if number == int(number) else None
    return number


def _expected(variable: Variable) -> str:
    if variable.kind == "Boolean":
        return "true or false"
    if variable.kind == "String":
        return "a string"
    noun = "a whole number" if variable.kind == "Integer" else "a finite number"
    unit = f" {variable.unit}" if variable.unit else ""
    if math.isinf(variable.low) and math.isinf(variable.high):
        return f"{noun}{f' in{unit}' if unit else ''}"
    return f"{noun} from {variable.low:g} to {variable.high:g}{unit}"
