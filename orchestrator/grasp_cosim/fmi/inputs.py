"""The inputs that an FMU was given last, as its failure names them."""

from collections.abc import Sequence
from math import isfinite
from typing import Any

import numpy.typing as npt

from ..base.errors import choices
from ..interface.interface import Value, Variable
from ..system.parts import literal

MOST = 6
"""The most inputs that are named; those that are not finite or out of their range come first."""


class Inputs:
    """What an instance was given: values set one by one, and in the run those of its buffers."""

    def __init__(self) -> None:
        self.running = False
        """True once the buffers hold what the FMU gets."""
        self._given: dict[Variable, Value] = {}
        self._bound: list[tuple[Sequence[Variable], npt.NDArray[Any]]] = []

    def set(self, variable: Variable, value: Value) -> None:
        """Note a value that is about to be set; one of a parameter is not kept."""
        if variable.causality == "input":
            self._given[variable] = value

    def bind(self, variables: Sequence[Variable], data: npt.NDArray[Any]) -> None:
        """Note the buffer from which the variables are set in the run."""
        self._bound.append((variables, data))

    def __str__(self) -> str:
        """The end of a one-line error, like " (inputs: gap = 45 m)"; empty without inputs."""
        found: dict[Variable, Value] = {}
        for variables, data in self._bound:  # the connected ones before those that stay as they are
            found |= zip(variables, data.tolist(), strict=True)
        if not self.running:
            found = {v: self._given[v] for v in found if v in self._given}
        found |= {v: value for v, value in self._given.items() if v not in found}
        named = sorted(found, key=lambda v: _usual(v, found[v]))
        return f" (inputs: {choices((_named(v, found[v]) for v in named), MOST)})" if found else ""


def _usual(variable: Variable, value: Value) -> bool:
    """False for a number that is not finite, or out of its declared range."""
    if isinstance(value, str):
        return True
    return isfinite(value) and variable.low <= value <= variable.high


def _named(variable: Variable, value: Value) -> str:
    if variable.kind == "Boolean":
        value = bool(value)
    text = f"{value:.6g}" if isinstance(value, float) else literal(value)
    return f"{variable.name} = {text} {variable.unit or ''}".rstrip()
