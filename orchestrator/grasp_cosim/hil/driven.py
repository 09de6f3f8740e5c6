"""An FMU driven by requests: set up anew by each session, stepped with the values of a request."""

from collections.abc import Callable, Sequence
from math import isclose, isfinite

import numpy as np
import numpy.typing as npt
from grasp_fmus.link import LinkVariable, Signature

from ..base.errors import SimulationError
from ..fmi.instance import DISCARD, EARLY, WARNING, Instance, dtype
from ..fmi.process import load_here
from ..interface.interface import Interface, Value, Variable
from ..master.master import finish_step

MOST_LOST = 100_000
"""The most steps that are made up for at once."""

TOLERANCE = 1e-9
"""s by which a request's time may differ from the model's; relative to the time it is 1e-12."""


class DrivenFmu:
    """One FMU with at most one instance. Close it.

    SimulationError or InputError where the FMU fails; it must then be set up anew.
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
        self._clock = np.zeros(1)
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
        self._inputs = _bound(instance, "set", self._signature.of("input"))
        self._answer = _bound(instance, "get", self._signature.answer)
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
        self._clock[0] = time
        if step not in self._steppers:
            self._steppers = {step: instance.stepper(self._clock, step).python}
        status = self._steppers[step]()
        if status in (DISCARD, EARLY):
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
        if self._instance is None:
            raise SimulationError(f"{self.interface.path.name}: stepped before it was initialised")
        return self._instance

    def _get(self, instance: Instance) -> list[Value]:
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
        """Set the values that changed, from the first-th one on."""
        pairs = zip(self._signature.request, self._values, values, strict=True)
        changed = [
            (self.interface.by_name[v.name], new)
            for v, old, new in [*pairs][first:]
            if (type(old), old) != (type(new), new)
        ]
        self._values = list(values)
        if changed:
            self._required().set([v for v, _ in changed], [new for _, new in changed])

    def _catch_up(self, time: float, step: float) -> None:
        if isclose(time, self.time, rel_tol=1e-12, abs_tol=TOLERANCE):
            return
        begin, missing = self.time, (time - self.time) / step
        if not 0.0 < missing <= MOST_LOST:
            raise SimulationError(
                f"{self.interface.path.name}: step from {time:.9g} s: must be from "
                f"{begin:.9g} s, or at most {MOST_LOST} steps later"
            )
        whole = int(missing + 0.5) if abs(missing - round(missing)) < 1e-3 else int(missing) + 1
        for k in range(whole):
            at = begin + k * step
            after = time if k == whole - 1 else begin + (k + 1) * step
            self.advance(at, after - at)


Bound = tuple[list[int], npt.NDArray[np.generic], Callable[[], int]]
"""Places in a list of values, and the call that passes them, of one FMI type, by an array."""


def _bound(instance: Instance, action: str, variables: Sequence[LinkVariable]) -> list[Bound]:
    """The calls that pass these variables, in a quarter of the time of Instance.get and set."""
    by_type: dict[str, dict[int, Variable]] = {}
    for place, v in enumerate(variables):
        variable = instance.interface.by_name[v.name]
        by_type.setdefault(variable.type, {})[place] = variable
    calls = []
    for fmi_type, found in by_type.items():
        data = np.zeros(len(found), dtype(instance.interface.version, fmi_type))
        call = instance.transfer(action, list(found.values()), data).python
        calls.append((list(found), data, call))
    return calls
