"""An instance of a co-simulation FMU, of FMI 2.0 or 3.0.

Of FMI 3.0 without intermediate update; event mode, and clocks, are in event_mode.py. Without event
mode an FMU is not allowed to end a step early: it handles its events itself. Binaries are left
only.
"""

import ctypes
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    fmi2LastSuccessfulTime,
    fmi2Terminated,
)

from ..base.calls import READ, STEP_2, STEP_3, Call, Native
from ..base.scratch import ScratchFolder
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.variables import Variable
from ..system.parts import Logging
from .fmi2_logger import callbacks_for
from .fmpy_private import FMU2CoSimulation, FMU3CoSimulation, MissingFunctionError
from .instance import DUE, EARLY, EVENT, WARNING
from .loaded import LoadedInstance


class FmuInstance(LoadedInstance):
    """One instance of an FMI 2.0 FMU, for co-simulation."""

    SLAVE = FMU2CoSimulation
    NEEDS: ClassVar[Sequence[str]] = (
        *("Instantiate", "FreeInstance", "SetupExperiment", "EnterInitializationMode"),
        *("ExitInitializationMode", "DoStep", "Terminate"),
    )

    def _instantiate(self, folder: Path) -> Any:
        slave = self._opened(folder)
        callbacks = callbacks_for(self._messages)
        slave.instantiate(callbacks=callbacks, loggingOn=self._logs_at_once)
        return slave

    def _start(self, values: Mapping[str, Value], stop: float | None, start: float) -> None:
        by_name = self.interface.by_name
        self._assign((by_name[name], value) for name, value in values.items())
        self._slave.setupExperiment(self.tolerance, startTime=start, stopTime=stop)
        self._slave.enterInitializationMode()

    def transfer(self, action: str, variables: Sequence[Variable], data: npt.NDArray[Any]) -> Call:
        """As LoadedInstance; outputs of a native FMU made here are read where they are."""
        call = super().transfer(action, variables, data)
        values = getattr(self._slave.dll, "graspValues", None)
        in_a_row = [variables[0].reference + i for i in range(len(variables))]
        if (
            call.native is None
            or values is None
            or data.dtype != np.float64
            or any(v.causality != "output" for v in variables)
            or [v.reference for v in variables] != in_a_row
        ):
            return call
        values.restype, values.argtypes = ctypes.c_void_p, [ctypes.c_void_p]
        first = values(self._slave.component) + data.itemsize * in_a_row[0]
        return Call(call.python, Native(READ, 0, first, size=len(data), data=call.native.data))

    def stepper(self, clock: npt.NDArray[np.float64], step: float) -> Call:
        bound, address = self._stepping(clock, step, ctypes.c_int(1))
        native = Native(STEP_2, address, self._slave.component, step=step)
        return self._loop_call(bound, native)

    def _wants_the_end(self) -> bool:
        return bool(self._status(self._slave.getBooleanStatus, fmi2Terminated))

    def last_successful_time(self) -> float | None:
        return self._status(self._slave.getRealStatus, fmi2LastSuccessfulTime)

    def _status(self, inquire: Callable[[int], float], kind: int) -> float | None:
        """The status of that kind; None where the FMU does not say. It may log that it does not."""
        with self._messages.ignored():
            try:
                return inquire(kind)
            except (FMICallException, MissingFunctionError):
                return None


_libraries: dict[tuple[Path, int], tuple[FMU2CoSimulation, ScratchFolder | None]] = {}
"""What SharedInstance has loaded, and from where, by path and time of change of the FMU."""


class SharedInstance(FmuInstance):
    """One instance of a native twin of our own: without global state, so all share one library.

    It stays loaded. That saves most of what loading takes where a process does many runs.
    """

    def _unpacked(self) -> Path:
        _, folder = _libraries.get(self._key, (None, None))
        return Path(folder.name) if folder else super()._unpacked()

    def _opened(self, folder: Path) -> FMU2CoSimulation:
        if self._key not in _libraries:
            _libraries[self._key] = super()._opened(folder), self._folder
        self._folder = None  # stays, with the library
        slave = copy(_libraries[self._key][0])
        slave.instanceName, slave.messages = self.name, self._messages
        slave.trace = self._trace
        return slave

    @property
    def _key(self) -> tuple[Path, int]:
        path = self.interface.path
        return path, path.stat().st_mtime_ns

    def _free(self) -> None:
        self._slave.fmi2FreeInstance(self._slave.component)


# ------------------------------------------------------------------ FMI 3.0

NEEDED, TERMINATE, SHORT = range(3)
"""Places in the flags of a step: an event is to be handled; the end of the simulation is asked for;
the step ended early.
"""


class Fmi3Instance(LoadedInstance):
    """One instance of an FMI 3.0 co-simulation FMU."""

    SLAVE = FMU3CoSimulation
    NEEDS: ClassVar[Sequence[str]] = (
        *("InstantiateCoSimulation", "FreeInstance", "EnterInitializationMode"),
        *("ExitInitializationMode", "DoStep", "Terminate"),
    )

    def __init__(
        self,
        name: str,
        interface: Interface,
        tolerance: float | None = None,
        logging: Logging = False,
        trace: Path | None = None,
    ) -> None:
        """As LoadedInstance."""
        self._step_flags = np.zeros(3, np.bool_)
        self._last_successful = np.zeros(1)
        self._event_limit = np.full(1, np.inf)
        """A step that does not end before this time, in s, has an event that is known already."""
        super().__init__(name, interface, tolerance, logging, trace)

    def _forget(self) -> None:
        """As LoadedInstance."""
        self._step_flags[:], self._last_successful[:], self._event_limit[:] = False, 0.0, np.inf

    def _instantiate(self, folder: Path) -> Any:
        slave = self._opened(folder)
        events = self.interface.event_mode
        slave.instantiate(
            loggingOn=self._logs_at_once,
            eventModeUsed=events,
            earlyReturnAllowed=events and self.interface.can_vary_step,
            logMessage=self._log,
        )
        return slave

    def _log(self, _: Any, status: int, category: bytes | None, message: bytes | None) -> None:
        if self._messages.wants(status, category):
            self._messages.take(status, message)

    def _start(self, values: Mapping[str, Value], stop: float | None, start: float) -> None:
        structural: list[tuple[Variable, Value]] = []
        ordinary: list[tuple[Variable, Value]] = []
        for name, value in values.items():
            variable = self.interface.by_name[name]
            is_structural = variable.causality == "structuralParameter"
            (structural if is_structural else ordinary).append((variable, value))
        if structural:
            self._slave.enterConfigurationMode()
            self._assign(structural, fetch=False)
            self._slave.exitConfigurationMode()
        self._assign(ordinary, fetch=False)
        self._slave.enterInitializationMode(self.tolerance, startTime=start, stopTime=stop)

    def saved(self) -> Any:
        """As LoadedInstance, with what the last step said."""
        return (
            super().saved(),
            self._step_flags.tobytes(),
            float(self._last_successful[0]),
            float(self._event_limit[0]),
        )

    def restore(self, saved: Any) -> None:
        """As LoadedInstance."""
        state, flags, self._last_successful[0], self._event_limit[0] = saved
        self._step_flags[:] = np.frombuffer(flags, np.bool_)
        super().restore(state)

    def stepper(self, clock: npt.NDArray[np.float64], step: float) -> Call:
        bound, address = self._stepping(clock, step, ctypes.c_bool(True), *self._places())
        time = memoryview(clock)  # type: ignore[arg-type]
        limit = memoryview(self._event_limit)  # type: ignore[arg-type]

        def advance() -> int:
            return DUE if time[2] >= limit[0] else self._outcome(bound())

        flags, last, until = (
            a.ctypes.data for a in (self._step_flags, self._last_successful, self._event_limit)
        )
        component = self._slave.component
        native = Native(STEP_3, address, component, step=step, flags=flags, last=last, limit=until)
        return self._loop_call(advance, native)

    def _places(self) -> list[ctypes.c_void_p]:
        """Where DoStep puts its flags and the time that it came to."""
        flags, last = self._step_flags.ctypes.data, self._last_successful.ctypes.data
        return [ctypes.c_void_p(place) for place in (flags, flags + 1, flags + 2, last)]

    def _do_step(self, time: float, step: float) -> int:
        """A step from a time over `step`, both in s; the FMI status."""
        self._step_flags[:] = False
        size = ctypes.c_double(time), ctypes.c_double(step), ctypes.c_bool(True)
        call, _ = self._function("DoStep", *size, *self._places())
        logged = self._messages.count
        status = call()
        if status == WARNING:
            self._messages.returned("fmi3DoStep", logged)
        return status

    def _outcome(self, status: int) -> int:
        """What came of a step that returned a status."""
        if status > WARNING:
            return status
        if self._step_flags[TERMINATE]:
            return EARLY
        if self._step_flags[NEEDED]:
            return EVENT
        return EARLY if self._step_flags[SHORT] else status

    def _wants_the_end(self) -> bool:
        return bool(self._step_flags[TERMINATE])

    def last_successful_time(self) -> float | None:
        """A step that was discarded did nothing; what the flags say is then of an earlier one."""
        has_returned_early = self._step_flags[SHORT] or self._step_flags[TERMINATE]
        return float(self._last_successful[0]) if has_returned_early else self._time()
