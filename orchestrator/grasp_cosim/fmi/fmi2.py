"""An FMU instance behind calls that are bound once, before the first step.

FMPy loads the binary and runs the life cycle. In the loop its wrappers would allocate and convert
at every call (2.5 us instead of 0.5 us), so the loop calls the FMI functions directly, on buffers
that are parts of the master's vectors.
"""

import ctypes
import os
import re
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any
from urllib.parse import quote

import fmpy
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from fmpy.logging import addLoggerProxy

from ..errors import InputError, SimulationError
from ..system.interface import Interface, Value, Variable

Call = Callable[[], int]
"""A bound FMI call; returns the FMI status."""

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
WARNING, ERROR, FATAL = 1, 3, 4
"""FMI statuses. Up to WARNING a simulation goes on; after FATAL no call is allowed."""

_PYTHON_FUNCTION = ctypes.PYFUNCTYPE(ctypes.c_int)
_NATIVE_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_int)
"""Calls of a Python FMU keep the GIL, which it would have to take back at once."""

_SETTERS = {"Real": "setReal", "Integer": "setInteger", "Boolean": "setBoolean"}

_PYTHONFMU_PREFIX = re.compile(r"Fatal py exception encountered: \[\w+\] \w+\s")
"""What pythonfmu logs of an exception begins so; nothing else is kept where the FMU said more."""

_TRACEBACK = "Traceback (most recent call last)"

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


class FmuInstance:
    """One instance of an FMI 2.0 co-simulation FMU. Use as a context manager."""

    def __init__(self, name: str, interface: Interface) -> None:
        """Extract and instantiate; InputError where the FMU does not load."""
        self.name = name
        self.interface = interface
        self._worst = FATAL  # until it is instantiated
        self._keep: list[Any] = []
        self._running = False
        self._messages()  # forgets what an earlier instance of this name said
        self._folder = tempfile.TemporaryDirectory(prefix="grasp_fmu_")
        self._resources = Path(self._folder.name, "resources")
        try:
            self._slave = self._instantiate(Path(self._folder.name))
        except BaseException:
            self.close()
            raise

    def _instantiate(self, folder: Path) -> FMU2Slave:
        try:
            fmpy.extract(self.interface.path, folder)
        except Exception as error:  # FMPy and zipfile raise whatever they like
            raise InputError(f"{self.name}: {self.interface.path} is damaged: {error}") from error
        self._python = (self._resources / "slavemodule.txt").exists()
        plain = str(folder).replace(" ", "")
        if self._python and quote(plain) != plain:
            raise InputError(
                f"{self.name}: temporary folder {folder}: a Python FMU crashes on its characters; "
                "set TMPDIR to a folder of plain ASCII letters"
            )
        here = Path.cwd()
        try:
            slave = FMU2Slave(
                guid=self.interface.guid,
                unzipDirectory=folder,
                modelIdentifier=self.interface.identifier,
                instanceName=self.name,
            )
            slave.instantiate(callbacks=_callbacks, loggingOn=True)
        except Exception as error:  # FMPy raises plain Exception
            raise InputError(
                f"{self.name}: {self.interface.path} does not load: {self._reason(error)}"
            ) from error
        finally:
            os.chdir(here)  # where loading fails, FMPy stays in the library's folder
        self._worst = 0
        return slave

    def __enter__(self) -> "FmuInstance":
        return self

    def __exit__(self, *_: object) -> None:
        """Close the instance."""
        self.close()

    def close(self) -> None:
        """Terminate and free the FMU as far as it permits; remove what was extracted."""
        if self._running and self._worst < ERROR:
            try:
                self._slave.terminate()
            except FMICallException as error:
                self._worst = error.status
                said = _as_reason(self._messages())
                warnings.warn(f"{self.name}: {error}{said}", stacklevel=2)
        if self._worst < FATAL:
            self._slave.freeInstance()
        if str(self._resources) in sys.path:  # pythonfmu puts it there and leaves it
            sys.path.remove(str(self._resources))
        self._folder.cleanup()

    def enter_initialization(self, values: Mapping[str, Value], stop: float) -> None:
        """Set start values, set up the experiment (stop in s) and enter initialisation mode."""
        with self._refusals():
            for name, value in values.items():
                variable = self.interface.by_name[name]
                if variable.kind == "String":
                    self._slave.setString([variable.reference], [value])
                else:
                    setter = getattr(self._slave, _SETTERS[variable.kind])
                    setter([variable.reference], [value])
            self._slave.setupExperiment(startTime=0.0, stopTime=stop)
            self._slave.enterInitializationMode()

    def exit_initialization(self) -> None:
        """Leave initialisation mode."""
        with self._refusals():
            self._slave.exitInitializationMode()
        self._running = True

    def setters(self, variables: Sequence[Variable], reals: Any, integers: Any) -> list[Call]:
        """Calls that pass reals (float64) and integers (int32) to the given inputs, in order."""
        return self._bound("fmi2Set", variables, reals, integers)

    def getters(self, variables: Sequence[Variable], reals: Any, integers: Any) -> list[Call]:
        """Calls that fetch outputs into reals (float64) and integers (int32), in order."""
        return self._bound("fmi2Get", variables, reals, integers)

    def stepper(self, time: ctypes.c_double, step: float) -> Call:
        """The call that advances by step seconds from the time in the given box."""
        return self._function("fmi2DoStep", time, ctypes.c_double(step), ctypes.c_int(1))

    def failure(self, status: int, time: float) -> SimulationError:
        """The error for a call that returned status at time in s. The FMU is not used again."""
        self._worst = status
        name = STATUS[status] if status < len(STATUS) else str(status)
        said = self._messages()
        error = SimulationError(
            f"{self.name}: {self.interface.path.name} returned {name} at t = {time:.9g} s"
            f"{_as_reason(said)}"
        )
        for text in said:
            error.add_note(text)
        return error

    def _bound(
        self, prefix: str, variables: Sequence[Variable], reals: Any, integers: Any
    ) -> list[Call]:
        """One call per kind; the buffers' values follow the order of the variables of the kind."""
        calls = []
        offset = 0
        for kind, buffer in (("Real", reals), ("Integer", integers), ("Boolean", integers)):
            references = [v.reference for v in variables if v.kind == kind]
            if not references:
                continue
            part = buffer[: len(references)] if kind == "Real" else buffer[offset:]
            offset += len(references) if kind == "Integer" else 0
            pointer = part.ctypes.data_as(ctypes.c_void_p)
            vector = (ctypes.c_uint * len(references))(*references)
            size = ctypes.c_size_t(len(references))
            calls.append(self._function(prefix + kind, ctypes.byref(vector), size, pointer))
            self._keep += [vector, buffer]
        return calls

    def _function(self, name: str, *arguments: Any) -> Call:
        component = ctypes.c_void_p(self._slave.component)
        prototype = _PYTHON_FUNCTION if self._python else _NATIVE_FUNCTION
        return partial(prototype((name, self._slave.dll)), component, *arguments)

    @contextmanager
    def _refusals(self) -> Iterator[None]:
        """Turns a failed call of the life cycle into an InputError."""
        try:
            yield
        except FMICallException as error:
            self._worst = error.status
            raise InputError(
                f"{self.name}: {self.interface.path.name} refused its initialisation: "
                f"{self._reason(error)}"
            ) from error

    def _reason(self, error: Exception) -> str:
        return _as_reason(self._messages()).removeprefix(": ") or " ".join(str(error).split())

    def _messages(self) -> list[str]:
        """What this instance logged and nobody has read yet."""
        said = [text for instance, text in _messages if instance == self.name]
        _messages[:] = [m for m in _messages if m[0] != self.name]
        own = re.compile(rf"{re.escape(self.name)}, t = \S+ s: ")  # so our FMUs begin
        said = [own.sub("", text, count=1) if own.match(text) else text for text in said]
        return [text for text in said if not _PYTHONFMU_PREFIX.match(text)] or said


def _as_reason(said: list[str]) -> str:
    """Messages as the end of a one-line error; of a traceback only what it comes to."""
    last = [text.strip().rpartition("\n")[2] if _TRACEBACK in text else text for text in said]
    text = " ".join(" ".join(last).split())
    return f": {_PYTHONFMU_PREFIX.sub('', text)}" if text else ""
