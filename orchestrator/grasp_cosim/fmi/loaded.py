"""An instance of an FMU in this process: the parts that FMI 2.0 and 3.0 have in common.

FMPy loads the binary and runs the life cycle. In the loop its wrappers would allocate and convert
at every call (2.5 us instead of 0.5 us). So the loop calls the FMI functions directly, on parts of
the master's vectors.
"""

import atexit
import ctypes
import logging
import os
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, ClassVar
from urllib.parse import quote

import fmpy
import numpy as np
import numpy.typing as npt
from fmpy.fmi1 import FMICallException

from ..base.calls import TRANSFER_2, TRANSFER_3, Call, Native
from ..base.errors import InputError, SimulationError
from ..base.files import CURRENT_FOLDER, FULL, not_its_fault
from ..base.scratch import ScratchFolder, without_scratch
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.obstacles import of_binary, of_loading, this_machine
from ..interface.variables import Element, Variable
from ..system.parts import Logging
from .call_trace import CallTrace
from .fmpy_private import (
    FAILED_TO_INSTANTIATE,
    MissingFunctionError,
    library_file,
    with_known_signatures,
)
from .instance import (
    DISCARD,
    EARLY,
    ERROR,
    FATAL,
    OK,
    STATUS,
    WARNING,
    Inputs,
    RefusedValueError,
)
from .messages import SEVERE, Messages
from .numbers import state_numbers, take_numbers
from .states import States

_PYTHON_FUNCTION = ctypes.PYFUNCTYPE(ctypes.c_int)
_NATIVE_FUNCTION = ctypes.CFUNCTYPE(ctypes.c_int)
"""Calls of a Python FMU keep the GIL, which it would have to take back at once."""

_TRACEBACK = "Traceback (most recent call last)"
_OF_KIND: Mapping[str, Callable[[Any], Value]] = {
    "Real": float,
    "Integer": int,
    "Boolean": bool,
    "String": lambda x: x if isinstance(x, str) else (x or b"").decode(errors="replace"),
}
_OF_THIS_MACHINE = tuple(f"binaries/{name}/" for name in map(this_machine, ("2.0", "3.0")))
_UNUSED = ("documentation/", "sources/", "binaries/")

LOGGER = logging.getLogger(__name__)
"""Gets what goes wrong where an FMU is terminated."""

_never_freed: list[Any] = []
"""Slaves that FMI does not let us free: what they call back must stay, too."""


class LoadedInstance(ABC):
    """One instance of an FMU in this process."""

    SLAVE: ClassVar[type]
    """FMPy's class: one of fmpy_private.py."""

    NEEDS: ClassVar[Sequence[str]]
    """The functions without which an FMU cannot run, by their names without fmi2 or fmi3."""

    def __init__(
        self,
        name: str,
        interface: Interface,
        tolerance: float | None = None,
        logging: Logging = False,
        trace: Path | None = None,
    ) -> None:
        """Extract and instantiate; InputError where the FMU does not load.

        The FMU is told the relative `tolerance`, unless that is None. `logging` is what it is to
        log next to warnings and errors, `trace` the file to which its calls are appended.
        """
        self.name = name
        self.interface = interface
        self.tolerance = tolerance
        self._logging = logging
        self._messages = Messages(name, logging, self._time)
        self._is_log_restrained = False
        self._major = interface.version[0]
        self._worst_status = FATAL  # until it is instantiated
        self._bound_buffers: list[Any] = []
        self._inputs = Inputs()
        self._array_values: dict[int, list[Any]] = {}
        self._clock: npt.NDArray[np.float64] | None = None
        self._folder: ScratchFolder | None = None
        self._is_python = False
        self._slave: Any = None
        self._kept_states: States | None = None
        self._forget()
        self._trace = CallTrace(name, trace, self.SLAVE, self._time) if trace else None
        if obstacle := of_binary(interface):
            raise InputError(f"{name}: {interface.called} {obstacle}")
        try:
            with CURRENT_FOLDER:
                self._load(self._unpacked())
        except BaseException:
            self.close()
            raise

    @abstractmethod
    def _instantiate(self, folder: Path) -> Any:
        """FMPy's slave, instantiated from the folder it was extracted to."""

    def _opened(self, folder: Path) -> Any:
        """FMPy's slave with the library from the folder, not instantiated yet.

        MissingFunctionError where that lacks a function that is needed.
        """
        slave = with_known_signatures(self.SLAVE)(
            guid=self.interface.guid,
            unzipDirectory=str(folder),
            modelIdentifier=self._identifier,
            instanceName=self.name,
        )
        slave.messages, slave.trace = self._messages, self._trace
        names = [f"fmi{self._major}{name}" for name in self.NEEDS]
        missing = [name for name in names if not hasattr(slave.dll, name)]
        if missing:
            raise MissingFunctionError(*missing)
        return slave

    @property
    def _logs_at_once(self) -> bool:
        """True if logging is on from the instantiation.

        It is for pythonfmu, too, which else drops the exceptions that the Python code raises. What
        it logs of a call that goes well is what that code wants logged.
        """
        return self._is_python or self._logging is True

    def _choose_categories(self) -> None:
        """Have the FMU log warnings, errors, and the categories that were asked for.

        Some log no warning without that. InputError where it has to be, and the FMU refuses.
        """
        severe = set(SEVERE.values()).intersection(self.interface.log_categories)
        categories = () if isinstance(self._logging, bool) else self._logging
        if self._logs_at_once or not (severe or categories):
            return
        try:
            with self._messages.ignored():
                self._slave.setDebugLogging(True, sorted({*severe, *categories}))
        except (FMICallException, MissingFunctionError) as error:
            fatal = isinstance(error, FMICallException) and error.status >= FATAL
            if categories or fatal:
                self._worst_status = FATAL if fatal else self._worst_status
                raise InputError(
                    f"{self.name}: {self.interface.called} does not take log categories: "
                    f"{self._reason(error)}"
                ) from error
        else:
            self._is_log_restrained = not categories

    def quieten(self) -> None:
        """Switch logging off again in an FMU that takes no notice of the categories it was told.

        It would format each call, which may take fifty times as long as the call.
        """
        if self._is_log_restrained and self._messages.unrequested:
            self._is_log_restrained = False
            with suppress(FMICallException), self._messages.ignored():
                self._slave.setDebugLogging(False, [])
            LOGGER.info("%s: logs more than its warnings; its log is off", self.name)

    def remarks(self, returned: int = 0, first: float = 0.0) -> list[str]:
        """As Instance.remarks."""
        return self._messages.remarks(returned, first)

    @abstractmethod
    def _start(self, values: Mapping[str, Value], stop: float | None, start: float) -> None:
        """Set the values and enter initialisation mode."""

    @abstractmethod
    def _wants_the_end(self) -> bool:
        """Return True if the FMU asked for the end of the simulation in a step that it rejected."""

    @abstractmethod
    def last_successful_time(self) -> float | None:
        """Return the end of that step in s, None if the FMU does not say."""

    @property
    def _identifier(self) -> str:
        """The name of the binary."""
        return self.interface.identifier

    def _unpacked(self) -> Path:
        """The folder with what an instance here may need of the FMU; InputError if that fails."""
        self._folder = ScratchFolder()
        folder = Path(self._folder.name)
        try:
            fmpy.extract(self.interface.path, folder, _used_here)
        except Exception as error:  # FMPy and zipfile raise whatever they like
            if isinstance(error, OSError) and error.errno in FULL:
                raise InputError(
                    f"{self.name}: {self.interface.called} cannot be extracted to {folder}: "
                    f"{error.strerror}; must have space there, or TMPDIR must be another folder"
                ) from error
            limit = not_its_fault(error)
            problem = f"cannot be read: {limit}" if limit else f"is damaged: {error}"
            raise InputError(f"{self.name}: {self.interface.called} {problem}") from error
        return folder

    def _load(self, folder: Path) -> None:
        self._is_python = (folder / "resources/slavemodule.txt").exists()
        plain = str(folder).replace(" ", "")
        if self._is_python and quote(plain) != plain:
            raise InputError(
                f"{self.name}: temporary folder {folder}: a Python FMU crashes on its characters; "
                "set TMPDIR to a folder of plain ASCII letters"
            )
        current_folder = Path.cwd()
        try:
            self._slave = self._instantiate(folder)
        except SimulationError as error:  # of the trace, whose file cannot be written
            raise InputError(str(error)) from error
        except Exception as error:  # FMPy raises plain Exception
            reason = self._reason(error)
            if reason.startswith(FAILED_TO_INSTANTIATE):  # and the FMU logged nothing
                reason += self._advice(ERROR)
            message = f"{self.name}: {self.interface.called} does not load: {reason}"
            if obstacle := of_loading(self.interface, reason):
                message += f"; it {obstacle}"
            raise InputError(message) from error
        finally:
            os.chdir(current_folder)  # where loading fails, FMPy stays in the library's folder
        if self._is_python:
            _binaries_of_pythonfmu.add(library_file(self._slave))
        self._worst_status = OK
        self._choose_categories()

    def close(self) -> None:
        """Terminate and free the FMU as far as it permits; remove what was extracted."""
        if self._inputs.running and self._worst_status < ERROR:
            self._terminate()
        if self._slave is not None:
            self._release()
        if self._folder:
            resources = str(Path(self._folder.name, "resources"))
            if resources in sys.path:  # pythonfmu puts it there and leaves it
                sys.path.remove(resources)
            self._folder.cleanup()
        if self._trace:
            self._trace.close()

    def _terminate(self) -> None:
        """Terminate the FMU; what it refuses is logged."""
        try:
            self._slave.terminate()
        except FMICallException as error:
            self._worst_status = error.status
            reason = as_reason(self._messages.reasons())
            LOGGER.warning("%s: %s%s", self.name, error, reason)

    def _release(self) -> None:
        """Free the FMU with the states that it keeps, or never if it must not be called."""
        if not self._may_be_called:
            _never_freed.append(self._slave)
            return
        if self._kept_states:
            self._kept_states.close()
        self._free()

    @property
    def _may_be_called(self) -> bool:
        """False after fmi2Fatal, but where pythonfmu makes that of any call refused: our own Python
        FMUs outlive it.
        """
        return self._worst_status < FATAL or (self._is_python and self.interface.ours)

    def _free(self) -> None:
        """Free the instance, and the library with it."""
        self._slave.freeInstance()

    def enter_initialization(
        self, values: Mapping[str, Value], stop: float | None, start: float = 0.0
    ) -> None:
        with self._refusals():
            self._start(values, stop, start)

    def exit_initialization(self) -> None:
        with self._refusals():
            self._slave.exitInitializationMode()
        self._inputs.running = True

    def enter_step_mode(self) -> None:
        """It is in step mode already: without event mode it leaves initialisation for that."""
        return

    def through_events(self, status: int, begin: float, end: float) -> tuple[int, float]:
        """It is not to return for an event."""
        must = "; must handle its events itself, or have event mode and a step that may vary"
        raise self._error("returned for an event", self.last_successful_time() or begin, must)

    def get(self, variables: Sequence[Variable]) -> list[Value]:
        """As Instance.get(), by one call for the scalars of a type and one for each array."""
        scalars: dict[str, list[int]] = {}
        arrays: dict[int, list[Any]] = {}
        with self._failures():
            for v in variables:
                if not v.element:
                    scalars.setdefault(self._suffix(v.type), []).append(v.reference)
                elif v.reference not in arrays:
                    arrays[v.reference] = self._get_array(v)
            values = {
                suffix: iter(getattr(self._slave, f"get{suffix}")(references))
                for suffix, references in scalars.items()
            }
            return [
                _OF_KIND[v.kind](
                    arrays[v.reference][v.element.place]
                    if v.element
                    else next(values[self._suffix(v.type)])
                )
                for v in variables
            ]

    def set(self, variables: Sequence[Variable], values: Sequence[Value]) -> None:
        with self._failures(), self._refused_values():
            self._assign(zip(variables, values, strict=True))

    def transfer(self, action: str, variables: Sequence[Variable], data: npt.NDArray[Any]) -> Call:
        # Of an array its first element stands for all of them.
        scalars = [v.reference for v in variables if not (v.element and v.element.place)]
        count, size, values_at = len(scalars), len(variables), data.ctypes.data
        references = (ctypes.c_uint * count)(*scalars)
        self._bound_buffers += [references, data]
        if action == "set":
            self._inputs.bind(variables, data)
        shape, sizes = TRANSFER_2, []
        if self._major == "3":
            shape, sizes = TRANSFER_3, [ctypes.c_size_t(size)]
        bound, address = self._function(
            action.capitalize() + self._suffix(variables[0].type),
            ctypes.byref(references),
            ctypes.c_size_t(count),
            ctypes.c_void_p(values_at),
            *sizes,
        )
        native = Native(
            shape,
            address,
            self._slave.component,
            ctypes.addressof(references),
            count,
            values_at,
            values=size,
        )
        return self._loop_call(bound, native)

    def _loop_call(self, call: Callable[[], int], native: Native) -> Call:
        """The call for the loop: as Python makes it where it is traced, else also natively."""
        return Call(call) if self._trace else Call(call, native, self._is_python)

    def _suffix(self, fmi_type: str) -> str:
        """The end of the names of the functions that set and get an FMI type."""
        if fmi_type != "Enumeration":
            return fmi_type
        return "Int64" if self._major == "3" else "Integer"

    def _assign(self, values: Iterable[tuple[Variable, Value]], fetch: bool = True) -> None:
        """Set values of variables, those of a type at once, then of arrays, each whole.

        Elements without a value keep what they were set to, at first their start value or, with
        fetch, what the FMU has: before the initialisation it does not tell.
        """
        arrays: dict[int, tuple[Variable, list[Any]]] = {}
        scalars: dict[str, tuple[list[int], list[Any]]] = {}
        for variable, value in values:
            self._inputs.set(variable, value)
            of_kind = _OF_KIND[variable.kind](value)
            if variable.element is None:
                references, data = scalars.setdefault(self._suffix(variable.type), ([], []))
                references.append(variable.reference)
                data.append(of_kind)
                continue
            elements = self._elements(variable, variable.element, fetch)
            elements[variable.element.place] = of_kind
            arrays[variable.reference] = variable, elements
        for suffix, (references, data) in scalars.items():
            getattr(self._slave, f"set{suffix}")(references, data)
        for reference, (variable, elements) in arrays.items():
            getattr(self._slave, f"set{self._suffix(variable.type)}")([reference], elements)

    def _elements(self, variable: Variable, element: Element, fetch: bool) -> list[Any]:
        """The elements of an array that the variable is in, as they were set last."""
        if variable.reference not in self._array_values:
            starts: list[Any] = [None] * element.size
            for v in self.interface.variables:
                if v.element and v.reference == variable.reference and v.start is not None:
                    starts[v.element.place] = _OF_KIND[v.kind](v.start_value)
            if None in starts and fetch:
                starts = self._get_array(variable)
            self._array_values[variable.reference] = [
                0 if start is None else start for start in starts
            ]
        return self._array_values[variable.reference]

    def _get_array(self, variable: Variable) -> list[Any]:
        """The elements of the array that a variable is in."""
        getter = getattr(self._slave, f"get{self._suffix(variable.type)}")
        size = variable.element.size if variable.element else 1
        return list(getter([variable.reference], size))

    def saved(self) -> Any:
        if self._kept_states is None:
            self._kept_states = self._bind_states()
        status, state = self._kept_states.take()
        if state is None:
            raise self.failure(status, self._time())
        arrays = {reference: [*elements] for reference, elements in self._array_values.items()}
        return state, self._worst_status, arrays, self._inputs.saved(), self._messages.saved()

    def restore(self, saved: Any) -> None:
        state, worst, arrays, inputs, messages = saved
        self._check_that_it_may_be_called()
        assert self._kept_states is not None  # noqa: S101 - it has given the state
        status = self._kept_states.put(state)
        if status > WARNING:
            raise self.failure(status, self._time())
        self._worst_status = worst
        self._array_values = {reference: [*elements] for reference, elements in arrays.items()}
        self._inputs.restore(inputs)
        self._messages.restore(messages)

    def reset(self) -> None:
        self._check_that_it_may_be_called()
        with self._failures():
            self._slave.reset()
        self._worst_status = OK
        self._inputs.forget()
        self._messages.forget()
        self._array_values.clear()
        self._forget()
        self._choose_categories()

    def _check_that_it_may_be_called(self) -> None:
        if not self._may_be_called:
            raise self._error("cannot go back after what it returned", self._time())

    def _forget(self) -> None:
        """Be as a new instance, but for what it has loaded and bound."""
        return

    def numbers(self) -> npt.NDArray[np.float64]:
        self._check_numbers()
        with self._failures():
            return state_numbers(self._slave, self.interface)

    def take_numbers(self, numbers: npt.NDArray[np.float64]) -> bool:
        self._check_numbers()
        with self._failures():
            return take_numbers(self._slave, self.interface, numbers)

    def _check_numbers(self) -> None:
        """InputError where the numbers of the state are not known."""
        if not (self.interface.ours and self.interface.has_states):
            raise InputError(
                f"{self.name}: the states of {self.interface.file_name} are not known one by one; "
                "must be an FMU that grasp-cosim build made of a block"
            )

    def _bind_states(self) -> States:
        """The functions for states; InputError where the FMU has none."""
        if not self.interface.has_states:
            raise self._has_no_state("cannot be saved (canGetAndSetFMUstate)")
        form = "FMUstate" if self._major == "2" else "FMUState"
        kind = _PYTHON_FUNCTION if self._is_python else _NATIVE_FUNCTION
        instance = ctypes.c_void_p(self._slave.component)
        get, set_, free = (
            partial(self._symbol(f"{action}{form}", kind), instance)
            for action in ("Get", "Set", "Free")
        )
        return States(get, set_, free, overwrites=not self._is_python)

    def _has_no_state(self, reason: str) -> InputError:
        """The error where the state is asked for."""
        return InputError(
            f"{self.name}: the state of {self.interface.file_name} {reason}; must be a "
            "co-simulation FMU with fmi2GetFMUstate or fmi3GetFMUState"
        )

    def the_end(self) -> float | None:
        if not self._wants_the_end():
            return None
        reached = self.last_successful_time()
        return self._time() if reached is None else reached

    def failure(self, status: int, time: float) -> SimulationError:
        """The error for a call that returned status at time in s. The FMU is not used again."""
        self._worst_status = OK if status == EARLY else status
        if status == EARLY:
            return self._error("ended a step early", time)
        name = STATUS[status] if status < len(STATUS) else status
        return self._error(f"returned {name}", time, advice=self._advice(status))

    def _refusal(self, reason: str, status: int) -> SimulationError:
        """The error for what the FMU did, now, when it returned a status. It is not used again."""
        self._worst_status = max(self._worst_status, status)
        return self._error(reason, self._time())

    def _error(self, reason: str, time: float, must: str = "", advice: str = "") -> SimulationError:
        """The error for what the FMU did, with what it logged of it, and its inputs.

        Where it logged nothing, with the `advice`.
        """
        logged = self._messages.reasons()
        explanation = as_reason(logged) or advice
        error = SimulationError(
            f"{self.name}: {self.interface.file_name} {reason} at t = {time:.9g} s{must}"
            f"{explanation}{self._inputs}"
        )
        for text in logged:
            error.add_note(text)
        return error

    def _function(self, name: str, *arguments: Any) -> tuple[Callable[[], int], int]:
        """The bound function for Python, and its address, 0 where its calls are traced."""
        function = self._symbol(name, _PYTHON_FUNCTION if self._is_python else _NATIVE_FUNCTION)
        bound = partial(function, ctypes.c_void_p(self._slave.component), *arguments)
        address = 0 if self._trace else ctypes.cast(function, ctypes.c_void_p).value
        return bound, address or 0

    def _bound(self, name: str, *kinds: Any) -> Callable[..., int]:
        """A function of the FMU, for its instance, by the types of its arguments."""
        prototype = ctypes.CFUNCTYPE(ctypes.c_int, ctypes.c_void_p, *kinds)
        return partial(self._symbol(name, prototype), self._slave.component)

    def _symbol(self, name: str, prototype: Any) -> Any:
        """A function of the binary, with a prototype of ctypes; InputError where it lacks it."""
        full = f"fmi{self._major}{name}"
        if not hasattr(self._slave.dll, full):
            raise self._incomplete(MissingFunctionError(full))
        function = prototype((full, self._slave.dll))
        return self._trace.traced(full, function) if self._trace else function

    def _stepping(
        self, clock: npt.NDArray[np.float64], step: float, *arguments: Any
    ) -> tuple[Callable[[], int], int]:
        """The function DoStep from the time in clock[0], as of _function()."""
        self._clock = clock if self._clock is None else self._clock
        time = ctypes.c_double.from_buffer(clock)  # type: ignore[arg-type]  # numpy's 3.11 stubs
        return self._function("DoStep", time, ctypes.c_double(step), *arguments)

    @contextmanager
    def _refusals(self) -> Iterator[None]:
        """Turns a failed call of the life cycle into an InputError."""
        try:
            yield
        except FMICallException as error:
            self._worst_status = error.status
            reason = as_reason(self._messages.reasons())
            if not reason:
                reason = f": {error}{self._advice(error.status)}"
            raise InputError(
                f"{self.name}: {self.interface.file_name} refused its initialisation"
                f"{reason}{self._inputs}"
            ) from error
        except MissingFunctionError as error:
            raise self._incomplete(error) from error

    @contextmanager
    def _failures(self) -> Iterator[None]:
        """Turns a failed call in the run into a SimulationError."""
        try:
            yield
        except FMICallException as error:
            raise self.failure(error.status, self._time()) from error
        except MissingFunctionError as error:
            raise self._incomplete(error) from error

    @contextmanager
    def _refused_values(self) -> Iterator[None]:
        """Turns the status discard of a setter into a RefusedValueError: the FMU is still used."""
        try:
            yield
        except FMICallException as error:
            if error.status != DISCARD:
                raise
            reason = as_reason(self._messages.reasons())
            raise RefusedValueError(
                f"{self.name}: {self.interface.file_name} refused a value at t = "
                f"{self._time():.9g} s, and keeps the older one{reason}"
            ) from error

    def _incomplete(self, error: MissingFunctionError) -> InputError:
        """The error for a binary that lacks a function."""
        return InputError(f"{self.name}: {self.interface.called}: {error}")

    def _time(self) -> float:
        """The time in s of the step that was begun last."""
        return 0.0 if self._clock is None else float(self._clock[0])

    def _reason(self, error: Exception) -> str:
        """What the FMU logged, or else the error itself."""
        logged = as_reason(self._messages.reasons()).removeprefix(": ")
        return logged or without_scratch(" ".join(str(error).split()))

    def _advice(self, status: int) -> str:
        """How to get more messages of an FMU that failed without a word; the end of a line."""
        if status < ERROR or self._logs_at_once:
            return ""
        return f"; components.{self.name}.logging = true may have it say why"


_binaries_of_pythonfmu: set[str] = set()
"""By their names, those that were loaded, and may be unloaded again."""


@atexit.register
def _let_go_of_python() -> None:
    """Have the binaries of pythonfmu that are still loaded let go of Python.

    By themselves they do it after the end of Python, in memory that was freed, which may end the
    process by a signal. Our FMUs see to it in any host.
    """
    if hasattr(os, "RTLD_NOLOAD"):  # on Windows there is no need
        for name in _binaries_of_pythonfmu:
            with suppress(OSError, AttributeError):  # it was unloaded, or is of another version
                ctypes.PyDLL(name, mode=os.RTLD_NOLOAD).finalizePythonInterpreter()


def _used_here(member: str) -> bool:
    """Return True if an instance here may need this file of the FMU: no binary for others."""
    return member.startswith(_OF_THIS_MACHINE) or not member.startswith(_UNUSED)


def as_reason(messages: Sequence[str]) -> str:
    """Messages, each once, as the end of a one-line error; of a traceback what it comes to."""
    reasons: list[str] = []
    for message in messages:
        *_, last_line = message.strip().split("\n")
        reasons.append(last_line if _TRACEBACK in message else message)
    text = " ".join(" ".join(dict.fromkeys(reasons)).split())
    return f": {text}" if text else ""
