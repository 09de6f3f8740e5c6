"""Parameters of the node: its own, and those of the model with their ranges and descriptions."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import fields
from math import isfinite
from typing import Any

from grasp_cosim import InputError
from grasp_cosim.interface.values import Given
from grasp_cosim.interface.variables import Variable
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.exceptions import ParameterException

from .model import Model
from .settings import DESCRIPTIONS, Settings

FROM, TO = -(2**63), 2**63 - 1
"""The range of a parameter of ROS that is a whole number."""


def declare(node: Any) -> None:
    """Declare the parameters at a node. A time may also be given as a whole number."""
    for field in fields(Settings):
        description = DESCRIPTIONS[field.name]
        is_time = isinstance(field.default, float)
        descriptor = ParameterDescriptor(description=description, dynamic_typing=is_time)
        node.declare_parameter(field.name, field.default, descriptor)


def settings_of(node: Any) -> Settings:
    """The settings of a node.

    Raises:
        InputError: One of them is not as it must be.
    """
    return Settings(**{f.name: node.get_parameter(f.name).value for f in fields(Settings)})


class ModelParameters:
    """The parameters of a model at a node: declared with it, and removed with it."""

    def __init__(self, node: Any, model: Model, driven: Collection[str]) -> None:
        """Declare them; values that the node was started with are set.

        Raises:
            InputError: A value does not fit.
        """
        self._node, self._model = node, model
        self._known = model.parameters(driven)
        node.add_on_set_parameters_callback(self._set)
        self._declared: list[str] = []
        for name, (variable, tunable) in self._known.items():
            value = _in_ros(variable, model.start(name, variable))
            try:
                node.declare_parameter(name, value, _descriptor(variable, tunable))
            except ParameterException as error:
                self.remove()
                raise InputError(f"parameter {name}: {' '.join(str(error).split())}") from error
            self._declared.append(name)

    def remove(self) -> None:
        """Take them away from the node."""
        self._node.remove_on_set_parameters_callback(self._set)
        for name in self._declared:
            self._node.undeclare_parameter(name)

    def _set(self, parameters: Any) -> SetParametersResult:
        """Set parameters of the model in the order of the request, up to one that does not fit."""
        for parameter in parameters:
            known = self._known.get(parameter.name)
            if known is None:
                continue
            variable, tunable = known
            try:
                if parameter.value != self._now(parameter.name, variable):
                    self._model.set(parameter.name, parameter.value, tunable)
            except InputError as error:
                return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def _now(self, name: str, variable: Variable) -> Any:
        """The value that the node has for a parameter, or before it is declared the model's."""
        if self._node.has_parameter(name):
            return self._node.get_parameter(name).value
        return _in_ros(variable, self._model.start(name, variable))


def _in_ros(variable: Variable, value: Given) -> Any:
    """A value as ROS has it: of an enumeration the name of the item."""
    names = {number: name for name, number in variable.items.items()}
    return names.get(value, value) if isinstance(value, int) else value


def _descriptor(variable: Variable, tunable: bool) -> ParameterDescriptor:
    """What ROS tells of a parameter."""
    unit = "" if variable.unit in (None, "1") else f" [{variable.unit}]"
    fixed = "" if tunable else "; fixed while the node is active"
    descriptor = ParameterDescriptor(
        description=f"{variable.description or variable.name}{unit}{fixed}"
    )
    low, high = variable.low, variable.high
    if variable.items:
        descriptor.additional_constraints = f"one of {', '.join(variable.items)}"
    elif variable.kind == "Real" and isfinite(low) and isfinite(high):
        descriptor.floating_point_range = [FloatingPointRange(from_value=low, to_value=high)]
    elif variable.kind == "Real" and (isfinite(low) or isfinite(high)):
        bound = f"at least {low:g}" if isfinite(low) else f"at most {high:g}"
        descriptor.additional_constraints = bound
    elif variable.kind == "Integer" and (isfinite(low) or isfinite(high)):
        least = int(low) if isfinite(low) else FROM
        greatest = int(high) if isfinite(high) else TO
        descriptor.integer_range = [IntegerRange(from_value=least, to_value=greatest, step=1)]
    return descriptor
