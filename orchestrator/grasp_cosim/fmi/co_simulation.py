"""An instance of a co-simulation FMU, of FMI 2.0 or 3.0.

Of FMI 3.0 without intermediate update; event mode, and clocks, are in event_mode.py. Without event
mode an FMU is not allowed to end a step early: it handles its events itself. Binaries are left
alone.

The logger of FMI 2.0 is called like printf: a format, then arguments. Python cannot define such a
function. On Linux, with the processors below, the arguments lie where those of a function would
that has fixed ones: first in registers, of whole numbers and addresses or of doubles, then on the
stack. So the logger takes as many as these hold and some from the stack, wanted or not, and puts
them where C's vsnprintf looks for them: in a va_list.
"""

import ctypes
import platform
import re
import struct
import sys
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from ctypes import c_char_p, c_double, c_int, c_size_t, c_void_p
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import fmpy
import numpy as np
import numpy.typing as npt
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
    fmi2LastSuccessfulTime,
    fmi2Terminated,
)

from ..base.calls import STEP_2, STEP_3, Call, Native
from ..base.scratch import ScratchFolder
from ..base.system_calls import c_library
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..system.parts import Logging
from .fmpy_private import FMU2CoSimulation, FMU3CoSimulation, MissingFunctionError
from .instance import DUE, EARLY, EVENT, WARNING
from .loaded import LoadedInstance
from .messages import Messages

_NAMED = c_void_p, c_char_p, c_int, c_char_p, c_char_p
"""Environment, instance, status, category and the format."""

_STACKED = 32
"""The most arguments on the stack."""

_LONG = re.compile(rb"%[^A-Za-z%]*L")
"""A long double, which has registers of its own kind, or none."""


_CONVENTIONS: Mapping[str, tuple[int, Callable[[int, int], bytes]]] = {
    "x86_64": (6, lambda words, stack: struct.pack("IIPP", 40, 48, stack, words)),
    "aarch64": (8, lambda words, stack: struct.pack("PPPii", stack, words + 64, stack, -24, -128)),
}
"""Of the ABIs of System V and Arm for Linux.

The registers for whole numbers and addresses; there are eight for doubles. The va_list by the
addresses of what was in registers and, behind it, of what was on the stack.
"""

CONVENTION = _CONVENTIONS.get(platform.machine()) if sys.platform == "linux" else None


@cache
def logger_type() -> Any:
    """The type of a logger: a function of the five named arguments, and of all that may follow."""
    if CONVENTION is None:
        return ctypes.CFUNCTYPE(None, *_NAMED)
    words = [c_size_t] * (CONVENTION[0] - len(_NAMED))
    return ctypes.CFUNCTYPE(None, *_NAMED, *words, *[c_double] * 8, *[c_size_t] * _STACKED)


def formatted(form: bytes, passed: Sequence[float]) -> bytes:
    """The format with the arguments that a logger was passed behind it.

    As it comes where this processor is none of those above, where one of them is a long double, or
    where there are too many.
    """
    places = form.count(b"%") + form.count(b"*")
    if CONVENTION is None or not 0 < places <= _STACKED or _LONG.search(form):
        return form
    (registers, va_list), named = CONVENTION, len(_NAMED)
    layout = f"={8 * named}x{registers - named}Q{'d8x' * 8}{_STACKED}Q"
    area = ctypes.create_string_buffer(struct.pack(layout, *passed))
    words = ctypes.addressof(area)

    def printed(text: Any, size: int) -> int:
        read = va_list(words, words + 8 * registers + 128)
        return int(_vsnprintf()(text, size, form, ctypes.create_string_buffer(read)))

    size = printed(None, 0)
    if size < 0:
        return form
    text = ctypes.create_string_buffer(size + 1)
    printed(text, size + 1)
    return text.value


@cache
def _vsnprintf() -> Any:
    found = c_library().vsnprintf
    found.argtypes = c_void_p, c_size_t, c_char_p, c_void_p
    return found


def callbacks_for(messages: Messages) -> fmi2CallbackFunctions:
    """The functions that an FMU may call: its logger, which is its own, and memory."""

    def log(
        _: Any,
        instance: Any,
        status: int,
        category: bytes | None,
        message: bytes | None,
        *arguments: float,
    ) -> None:
        if messages.wants(status, category):
            messages.take(status, formatted(message or b"", arguments))

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = ctypes.cast(logger_type()(log), fmi2CallbackLoggerTYPE)
    callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
    return callbacks


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
        for name, value in values.items():
            self._set(self.interface.by_name[name], value)
        self._slave.setupExperiment(self.tolerance, startTime=start, stopTime=stop)
        self._slave.enterInitializationMode()

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
    """One instance of a native twin of ours: without global state, so all share one library.

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
        self._flags = np.zeros(3, np.bool_)
        self._last = np.zeros(1)
        self._limit = np.full(1, np.inf)
        """A step that does not end before this time, in s, has an event that is known already."""
        super().__init__(name, interface, tolerance, logging, trace)

    def _forget(self) -> None:
        """As LoadedInstance."""
        self._flags[:], self._last[:], self._limit[:] = False, 0.0, np.inf

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
        given = [(self.interface.by_name[name], value) for name, value in values.items()]
        structural = [(v, x) for v, x in given if v.causality == "structuralParameter"]
        others = [(v, x) for v, x in given if v.causality != "structuralParameter"]
        if structural:
            self._slave.enterConfigurationMode()
            self._assign(structural, fetch=False)
            self._slave.exitConfigurationMode()
        self._assign(others, fetch=False)
        self._slave.enterInitializationMode(self.tolerance, startTime=start, stopTime=stop)

    def saved(self) -> Any:
        """As LoadedInstance, with what the last step said."""
        return super().saved(), self._flags.tobytes(), float(self._last[0]), float(self._limit[0])

    def restore(self, saved: Any) -> None:
        """As LoadedInstance."""
        own, flags, self._last[0], self._limit[0] = saved
        self._flags[:] = np.frombuffer(flags, np.bool_)
        super().restore(own)

    def stepper(self, clock: npt.NDArray[np.float64], step: float) -> Call:
        bound, address = self._stepping(clock, step, ctypes.c_bool(True), *self._places())
        time = memoryview(clock)  # type: ignore[arg-type]
        limit = memoryview(self._limit)  # type: ignore[arg-type]

        def advance() -> int:
            return DUE if time[2] >= limit[0] else self._outcome(bound())

        flags, last, until = (a.ctypes.data for a in (self._flags, self._last, self._limit))
        component = self._slave.component
        native = Native(STEP_3, address, component, step=step, flags=flags, last=last, limit=until)
        return self._loop_call(advance, native)

    def _places(self) -> list[ctypes.c_void_p]:
        """Where DoStep puts its flags and the time that it came to."""
        flags, last = self._flags.ctypes.data, self._last.ctypes.data
        return [ctypes.c_void_p(place) for place in (flags, flags + 1, flags + 2, last)]

    def _do_step(self, time: float, step: float) -> int:
        """A step from a time over `step`, both in s; the FMI status."""
        self._flags[:] = False
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
        if self._flags[TERMINATE]:
            return EARLY
        if self._flags[NEEDED]:
            return EVENT
        return EARLY if self._flags[SHORT] else status

    def _wants_the_end(self) -> bool:
        return bool(self._flags[TERMINATE])

    def last_successful_time(self) -> float | None:
        """A step that was discarded did nothing; what the flags say is then of an earlier one."""
        said = self._flags[SHORT] or self._flags[TERMINATE]
        return float(self._last[0]) if said else self._time()
