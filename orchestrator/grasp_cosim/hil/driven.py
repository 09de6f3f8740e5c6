"""An FMU driven by requests: set up anew by each session, stepped with the values of a request."""

from collections.abc import Callable, Sequence
from math import isclose, isfinite
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from grasp_fmus.link.signature import LinkVariable, Signature

from ..base.errors import SimulationError
from ..fmi.instance import DISCARD, EARLY, WARNING, Instance, dtype
from ..fmi.make_instance import load_here
from ..interface.interface import Interface, Value, Variable
from ..master.rejection import finish_step

MOST_LOST = 100_000
"""The most steps that are made up for at once."""

TOLERANCE = 1e-9
"""s by which a request's time may differ from the model's; relative to the time it is 1e-12."""


class DrivenFmu:
    """One FMU with at most one instance. Close it.

    SimulationError or InputError where the FMU fails; it must then be set up anew.
    """

    def __init__(self, interface: Interface, signature: Signature) -> None:
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
        self._step = 0.0
        self._bound: Callable[[], int] | None = None

    def try_out(self) -> None:
        """Make an instance and free it, to see that this can be done."""
        load_here(self.interface.identifier, self.interface).close()

    def initialise(self, time: float, values: Sequence[Value], fresh: bool) -> None:
        """Set `values` in initialisation mode, with `fresh` of a new instance, from `time` in s."""
        if fresh or self._instance is None:
            self._set_up(time, values)
        else:
            self._set_changed(values)

    def step(
        self,
        time: float,
        step: float,
        values: Sequence[Value],
        over: Callable[[], bool] = lambda: False,
    ) -> None:
        """Step from `time` over `step`, both in s, with these values.

        What is missing before `time` is made up for first, in steps of the same length, until
        `over` says that there is no time left.
        """
        self.begin()
        self.set(values)
        self._catch_up(time, step, over)
        self.advance(time, step, over)

    def begin(self) -> None:
        """Leave initialisation mode, if not done before."""
        if not self._stepping:
            self._required().exit_initialization()
            self._stepping = True

    def set(self, values: Sequence[Value]) -> None:
        """Set inputs, and the parameters that are not what they were."""
        instance = self._required()
        for places, data, call in self._inputs:
            data[:] = [values[i] for i in places]
            if (status := call()) > WARNING:
                raise instance.failure(status, 0.0)
        if values[self._first_parameter :] != self._values[self._first_parameter :]:
            self._set_changed(values, parameters_only=True)

    def advance(self, time: float, step: float, over: Callable[[], bool] = lambda: False) -> None:
        """Advance by `step` from `time`, both in s, with the values as they are.

        A step that the FMU takes only in parts is given up once `over` says so.
        """
        instance = self._required()
        self._clock[0] = time
        status = self._stepper(step)()
        if status in (DISCARD, EARLY):
            ended = finish_step(instance, status, time, time + step, over)
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

    def _set_up(self, time: float, values: Sequence[Value]) -> None:
        self.close()
        self._instance = instance = load_here(self.interface.identifier, self.interface)
        starts = {v.name: x for v, x in zip(self._signature.request, values, strict=True)}
        instance.enter_initialization(starts, None, time)
        self._values, self.time = list(values), time
        self._inputs = _bound(instance, "set", self._signature.of("input"))
        self._answer = _bound(instance, "get", self._signature.answer)
        self._step, self._bound = 0.0, None

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

    def _set_changed(self, values: Sequence[Value], parameters_only: bool = False) -> None:
        changed = [
            (self.interface.by_name[v.name], new)
            for v, old, new in zip(self._signature.request, self._values, values, strict=True)
            if (type(old), old) != (type(new), new)
            and not (parameters_only and v.causality == "input")
        ]
        self._values = list(values)
        if changed:
            self._required().set([v for v, _ in changed], [new for _, new in changed])

    def _catch_up(self, time: float, step: float, over: Callable[[], bool]) -> None:
        if isclose(time, self.time, rel_tol=1e-12, abs_tol=TOLERANCE):
            return
        missing = (time - self.time) / step
        if not 0.0 < missing <= MOST_LOST:
            raise SimulationError(
                f"{self.interface.path.name}: step from {time:.9g} s: must be from "
                f"{self.time:.9g} s, or at most {MOST_LOST} steps later"
            )
        begin = self.time
        whole = int(missing + 0.5) if abs(missing - round(missing)) < 1e-3 else int(missing) + 1
        for k in range(whole):
            if over():
                name = self.interface.path.name
                raise SimulationError(
                    f"{name}: the FMU ended it after {k} of {whole} lost steps were made up"
                )
            at = begin + k * step
            after = time if k == whole - 1 else begin + (k + 1) * step
            self.advance(at, after - at, over)

    def _stepper(self, step: float) -> Callable[[], int]:
        if self._bound is None or step != self._step:
            self._step = step
            self._bound = self._required().stepper(self._clock, step).python
        return self._bound


class _Bound(NamedTuple):
    """A call that passes the variables of one FMI type, which have these places in a list."""

    places: list[int]
    data: npt.NDArray[np.generic]
    call: Callable[[], int]


def _bound(instance: Instance, action: str, variables: Sequence[LinkVariable]) -> list[_Bound]:
    """The calls that pass these variables."""
    by_type: dict[str, dict[int, Variable]] = {}
    for place, v in enumerate(variables):
        variable = instance.interface.by_name[v.name]
        by_type.setdefault(variable.type, {})[place] = variable
    calls = []
    for fmi_type, found in by_type.items():
        data = np.zeros(len(found), dtype(instance.interface.version, fmi_type))
        call = instance.transfer(action, list(found.values()), data).python
        calls.append(_Bound(list(found), data, call))
    return calls
