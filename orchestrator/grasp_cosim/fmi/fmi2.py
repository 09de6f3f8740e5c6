"""An instance of an FMI 2.0 co-simulation FMU."""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, overload

import fmpy
import numpy as np
import numpy.typing as npt
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2LastSuccessfulTime,
    fmi2Terminated,
)
from fmpy.logging import addLoggerProxy

from ..errors import SimulationError
from ..system.interface import Value, Variable
from . import instance
from .instance import STEP_2, TRANSFER_2, WARNING, Native
from .loaded import LoadedInstance

__all__ = ["WARNING", "Call", "FmuInstance"]

Call = Callable[[], int]
"""A bound FMI call; returns the FMI status."""

_messages: list[tuple[str, str]] = []
"""What FMUs logged: instance and text. FMPy's logger proxy is one per process, so is this."""


def _log(_: Any, instance: bytes | None, status: int, category: Any, message: bytes | None) -> None:
    if status > 0:
        text = (message or b"").decode(errors="replace")
        _messages.append(((instance or b"").decode(errors="replace"), text))


_callbacks = fmi2CallbackFunctions()
_callbacks.logger = fmi2CallbackLoggerTYPE(_log)
_callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
_callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
addLoggerProxy(ctypes.byref(_callbacks))


class FmuInstance(LoadedInstance):
    """One instance of an FMI 2.0 co-simulation FMU. Use as a context manager."""

    PREFIX = "fmi2"

    def _instantiate(self, folder: Path) -> FMU2Slave:
        slave = FMU2Slave(
            guid=self.interface.guid,
            unzipDirectory=folder,
            modelIdentifier=self.interface.identifier,
            instanceName=self.name,
        )
        slave.instantiate(callbacks=_callbacks, loggingOn=True)
        return slave

    def _read_log(self) -> list[str]:
        said = [text for instance, text in _messages if instance == self.name]
        _messages[:] = [m for m in _messages if m[0] != self.name]
        return said

    def _start(self, values: Mapping[str, Value], stop: float) -> None:
        for name, value in values.items():
            self._set(self.interface.by_name[name], value)
        self._slave.setupExperiment(startTime=0.0, stopTime=stop)
        self._slave.enterInitializationMode()

    def _suffix(self, fmi_type: str) -> str:
        return "Integer" if fmi_type == "Enumeration" else fmi_type

    def transfer(
        self, action: str, variables: Sequence[Variable], data: npt.NDArray[Any]
    ) -> instance.Call:
        """The call that passes data to inputs ("set") or fetches outputs into it ("get")."""
        count = len(variables)
        references = (ctypes.c_uint * count)(*(v.reference for v in variables))
        self._keep += [references, data]
        bound, address = self._function(
            action.capitalize() + self._suffix(variables[0].type),
            ctypes.byref(references),
            ctypes.c_size_t(count),
            ctypes.c_void_p(data.ctypes.data),
        )
        native = Native(
            TRANSFER_2,
            address,
            self._slave.component,
            ctypes.addressof(references),
            count,
            data.ctypes.data,
        )
        return instance.Call(bound, native)

    @overload
    def stepper(self, clock: npt.NDArray[np.float64], step: float) -> instance.Call: ...
    @overload
    def stepper(self, clock: ctypes.c_double, step: float) -> Call: ...
    def stepper(
        self, clock: npt.NDArray[np.float64] | ctypes.c_double, step: float
    ) -> instance.Call | Call:
        """The call that advances by step seconds from the time in clock[0]."""
        if isinstance(clock, ctypes.c_double):
            return self._function("DoStep", clock, ctypes.c_double(step), ctypes.c_int(1))[0]
        self._clock = clock
        box = ctypes.c_double.from_buffer(clock)  # type: ignore[arg-type]  # numpy's 3.11 stubs
        bound, address = self._function("DoStep", box, ctypes.c_double(step), ctypes.c_int(1))
        return instance.Call(bound, Native(STEP_2, address, self._slave.component, step=step))

    def ended_early(self) -> bool:
        """Never: a step that ends early is discarded in FMI 2.0."""
        return False

    def last_successful_time(self) -> float | None:
        """Where a discarded step ended, in s; None where the FMU does not say.

        SimulationError where it was discarded because the FMU wants the simulation to end.
        """
        try:
            if self._slave.getBooleanStatus(fmi2Terminated):
                raise SimulationError(
                    f"{self.name}: {self.interface.path.name} asked for the end of the simulation "
                    f"in the step from t = {float(self._clock[0]):.9g} s"
                )
        except FMICallException:
            pass  # it does not say
        try:
            return float(self._slave.getRealStatus(fmi2LastSuccessfulTime))
        except FMICallException:
            return None

    def save(self) -> None:
        """Save the state, for one restore. Only where interface.can_save_state."""
        with self._failures():
            self._slave.fmi2GetFMUstate(self._slave.component, ctypes.byref(self._state))

    def restore(self) -> None:
        """Go back to the state saved last."""
        with self._failures():
            self._slave.fmi2SetFMUstate(self._slave.component, self._state)

    def setters(self, variables: Sequence[Variable], reals: Any, integers: Any) -> list[Call]:
        """Calls that pass reals (float64) and integers (int32) to the given inputs, in order."""
        return self._bound("set", variables, reals, integers)

    def getters(self, variables: Sequence[Variable], reals: Any, integers: Any) -> list[Call]:
        """Calls that fetch outputs into reals (float64) and integers (int32), in order."""
        return self._bound("get", variables, reals, integers)

    def _bound(
        self, action: str, variables: Sequence[Variable], reals: Any, integers: Any
    ) -> list[Call]:
        """One call per kind; the buffers' values follow the order of the variables of the kind."""
        calls: list[Call] = []
        offset = 0
        for kind, buffer in (("Real", reals), ("Integer", integers), ("Boolean", integers)):
            own = [v for v in variables if v.kind == kind]
            if own:
                part = buffer if kind == "Real" else buffer[offset:]
                offset += len(own) if kind == "Integer" else 0
                calls.append(self.transfer(action, own, part).python)
        return calls
