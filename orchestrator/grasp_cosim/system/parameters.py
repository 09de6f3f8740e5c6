"""The parameters of a system as a table: their values, units, ranges and meanings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import NamedTuple

from ..base.errors import UnknownNameError
from ..base.registry import registered
from ..base.text import columns, on_a_screen
from ..interface.fmi_types import Value
from ..interface.variables import PARAMETERS
from .structure import Structure

HEADS = ("parameter", "value", "unit", "range", "description")


class Parameter(NamedTuple):
    """A parameter: its value now, and what its FMU declares of it; None is what it does not."""

    value: Value | list[Value | None] | None
    unit: str | None
    minimum: Value | None
    maximum: Value | None
    description: str | None


class Parameters(Mapping[str, Parameter]):
    """The parameters that can be set, by names like plant.object_width, in the units of their FMUs.

    System.with_values() makes a system with others.
    """

    def __init__(self, parameters: Mapping[str, Parameter]) -> None:
        self._by_name = dict(parameters)

    def __getitem__(self, name: str) -> Parameter:
        """The parameter; KeyError, with the names nearest to it, where there is none."""
        if name not in self._by_name:
            raise UnknownNameError(name, tuple(self), "parameter")
        return self._by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self._by_name)

    def __repr__(self) -> str:
        return on_a_screen(columns(self.rows(), range(len(HEADS))))

    def _repr_html_(self) -> str:
        """A table of all, as notebooks show it."""
        return str(registered("html", "Parameters")(self))

    def _ipython_key_completions_(self) -> list[str]:
        """The names, for Tab behind a bracket in a notebook."""
        return [*self]

    def rows(self) -> list[list[str]]:
        """The parameters as texts: the heads of the columns, and a row for each."""
        return [[*HEADS], *(_row(name, p) for name, p in self.items())]


def parameters_of(system: Structure) -> Parameters:
    """The parameters of a system that can be set."""
    parameters = {}
    for component in system.components:
        for v in component.interface.variables:
            if v.causality in PARAMETERS and v.settable and v.supported:
                value = component.values.get(v.name, v.start_value)
                described = v.unit, v.minimum, v.maximum, v.description
                parameters[f"{component.name}.{v.name}"] = Parameter(value, *described)
    return Parameters(parameters)


def _row(name: str, p: Parameter) -> list[str]:
    low, high = ("" if x is None else f"{x:g}" for x in (p.minimum, p.maximum))
    between = f"{low} to {high}" if low and high else f"from {low}" if low else f"to {high}"
    number = f"{p.value:.6g}" if isinstance(p.value, float) else str(p.value)
    return [name, number, p.unit or "", between if low or high else "", p.description or ""]
