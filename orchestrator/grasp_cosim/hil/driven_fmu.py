"""An FMU with at most one instance, which a peer of a proxy drives: step by step, or by a clock."""

from collections.abc import Callable, Sequence
from math import isclose, isfinite

import numpy as np
import numpy.typing as npt

from ..base.errors import SimulationError
from ..fmi.instance import DISCARD, DUE, EARLY, EVENT, WARNING, Instance, clock_of, dtype
from ..fmi.load import load_here
from ..fmu_export.link import LinkVariable, Signature
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.variables import Variable
from ..master.step_completion import finish_step

MAX_LOST_STEPS = 100_000
"""The most steps that are made up for at once."""

TIME_TOLERANCE, RELATIVE_TIME_TOLERANCE = 1e-9, 1e-12
"""By how much a request's time may differ from the model's: in s, and relative to the time."""

SAME_STEP = 1e-3
"""By how much a time may differ from a whole number of steps, in steps, and still be one."""


class DrivenFmu:
    """One FMU with at most one instance. Close it.

    SimulationError or InputError where the FMU fails; it must then be set up again.
    """

    def __init__(self, interface: Interface, signature: Signature) -> None:
        """Make an instance and free it: rather now than in the first session."""
        self.interface = interface
        self.time = 0.0
        self._signature = signature
        self._outputs = [interface.by_name[v.name] for v in signature.answer]
        self._booleans = [i for i, v in enumerate(signature.answer) if v.kind == "Boolean"]
        self._first_parameter = len(signature.of("input"))
        self._instance: Instance | None = None
        self._stepping = False
        self._values: list[Value] = []
        self._clock = clock_of(0.0, 0.0)
        self._steppers: dict[float, Callable[[], int]] = {}
        load_here(interface.identifier, interface).close()

    def initialise(self, time: float, values: Sequence[Value], fresh: bool) -> None:
        """Set `values` in initialisation mode, with `fresh` of a new instance, from `time` in s."""
        if not fresh and self._instance:
            self._set_changed(values)
            return
        self.close()
        self._instance = instance = load_here(self.interface.identifier, self.interface)
        starts = {v.name: x for v, x in zip(self._signature.request, values, strict=True)}
        instance.enter_initialization(starts, None, time)
        self._values, self.time = list(values), time
        self._inputs = _bound_calls(instance, "set", self._signature.of("input"))
        self._answer = _bound_calls(instance, "get", self._signature.answer)
        self._steppers = {}

    def step(self, time: float, step: float, values: Sequence[Value]) -> None:
        """Step from `time` over `step`, both in s, with these values.

        What is missing before `time` is made up for first, in steps of the same length.
        """
        self.set(values)
        self._catch_up(time, step)
        self.advance(time, step)

    def set(self, values: Sequence[Value]) -> None:
        """Set inputs, and the parameters that are not what they were; initialisation is over."""
        instance = self._required()
        if not self._stepping:
            instance.exit_initialization()
            if self.interface.event_mode:
                instance.enter_step_mode()
            self._stepping = True
        for places, data, call in self._inputs:
            data[:] = [values[i] for i in places]
            if (status := call()) > WARNING:
                raise instance.failure(status, 0.0)
        if values[self._first_parameter :] != self._values[self._first_parameter :]:
            self._set_changed(values, self._first_parameter)

    def advance(self, time: float, step: float) -> None:
        """Advance by `step` from `time`, both in s, with the values as they are."""
        instance = self._required()
        self._clock[:] = clock_of(time, time + step)
        if step not in self._steppers:
            self._steppers = {step: instance.stepper(self._clock, step).python}
        status = self._steppers[step]()
        if status in (DISCARD, EARLY, EVENT, DUE):
            ended = finish_step(instance, status, time, time + step)
            if ended is not None:
                raise SimulationError(
                    f"{self.interface.path.name} asked for the end of the simulation at "
                    f"t = {ended:.9g} s"
                )
        elif status > WARNING:
            raise instance.failure(status, time)
        self.time = time + step

    def outputs(self) -> list[Value]:
        """Return the outputs now, in the order of the signature."""
        instance = self._required()
        values = self._get(instance) if self._stepping else instance.get(self._outputs)
        if isfinite(sum(values)):  # type: ignore[arg-type]  # none is a text
            return values
        for v, value in zip(self._outputs, values, strict=True):
            if isinstance(value, float) and not isfinite(value):
                raise SimulationError(
                    f"{self.interface.path.name}: {v.name} = {value} at t = {self.time:.9g} s: "
                    "must be finite"
                )
        return values

    def close(self) -> None:
        """End and free the instance."""
        instance, self._instance, self._stepping = self._instance, None, False
        if instance is not None:
            instance.close()

    def _required(self) -> Instance:
        """The instance; SimulationError where there is none."""
        if self._instance is None:
            raise SimulationError(f"{self.interface.path.name}: stepped before it was initialised")
        return self._instance

    def _get(self, instance: Instance) -> list[Value]:
        """The outputs, in the order of the signature."""
        values: list[Value] = [0.0] * len(self._outputs)
        for places, data, call in self._answer:
            if (status := call()) > WARNING:
                raise instance.failure(status, 0.0)
            for i, value in zip(places, data.tolist(), strict=True):
                values[i] = value
        for i in self._booleans:
            values[i] = bool(values[i])
        return values

    def _set_changed(self, values: Sequence[Value], first: int = 0) -> None:
        """Set what is not what it was of the values from the place `first` on."""
        variables: list[Variable] = []
        changed: list[Value] = []
        request = self._signature.request[first:]
        for v, old, new in zip(request, self._values[first:], values[first:], strict=True):
            if (type(old), old) != (type(new), new):
                variables.append(self.interface.by_name[v.name])
                changed.append(new)
        self._values = list(values)
        if changed:
            self._required().set(variables, changed)

    def _catch_up(self, time: float, step: float) -> None:
        """Make up for the steps that are missing before `time`, in steps of `step`, both in s."""
        if isclose(time, self.time, rel_tol=RELATIVE_TIME_TOLERANCE, abs_tol=TIME_TOLERANCE):
            return
        begin, missing = self.time, (time - self.time) / step
        if not 0.0 < missing <= MAX_LOST_STEPS:
            raise SimulationError(
                f"{self.interface.path.name}: step from {time:.9g} s: must be from "
                f"{begin:.9g} s, or at most {MAX_LOST_STEPS} steps later"
            )
        is_whole = abs(missing - round(missing)) < SAME_STEP
        count = int(missing + 0.5) if is_whole else int(missing) + 1
        for k in range(count):
            start = begin + k * step
            end = time if k == count - 1 else begin + (k + 1) * step
            self.advance(start, end - start)


BoundCall = tuple[list[int], npt.NDArray[np.generic], Callable[[], int]]
"""Places in a list of values, and the call that passes them, of one FMI type, by an array."""


def _bound_calls(
    instance: Instance, action: str, variables: Sequence[LinkVariable]
) -> list[BoundCall]:
    """The calls that pass these variables, in a quarter of the time of Instance.get and set."""
    by_type: dict[str, dict[int, Variable]] = {}
    for place, v in enumerate(variables):
        variable = instance.interface.by_name[v.name]
        by_type.setdefault(variable.type, {})[place] = variable
    calls = []
    for fmi_type, of_type in by_type.items():
        data = np.zeros(len(of_type), dtype(instance.interface.version, fmi_type))
        call = instance.transfer(action, list(of_type.values()), data).python
        calls.append((list(of_type), data, call))
    return calls
