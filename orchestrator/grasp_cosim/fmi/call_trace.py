"""The trace of the calls that are made to an FMU: a line for each, as it is made.

    t=0.5 fmi2SetReal(vr=[0, 1], nvr=2, value=[0.1, -0.0]) -> OK

t is the simulated time in s at which the step began. Names and order of the arguments are those of
the standard; the instance, callbacks and other addresses are left out, but for those of states.
Numbers are written such that they read back as they were, to the last bit.

What the FMU gets is written before the call, what it returns after it: a call in which it crashes
or hangs is the last line of the file, and has no status.
"""

import ctypes
import inspect
import json
import os
from collections.abc import Callable, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple, get_args

from fmpy.fmi1 import FMICallException

from ..base.errors import InputError, SimulationError
from .instance import STATUS

REFERENCES = ("vr", "valueReferences")
"""The arguments that say of which variables a call is, in FMI 2.0 and 3.0."""

BYTES_OF_STATE = "serializedState"
"""The argument with the content of a state."""

WITHOUT_STATUS = ("Instantiate", "FreeInstance")
"""So begin the functions that return no status, behind fmi2 or fmi3."""

READING = ("Set", "Instantiate", "Free")
"""So begin the functions whose arrays the FMU reads; all others write some."""

ADDRESSES = (
    *("c", "instance", "callbacks", "instanceEnvironment", "logMessage", "intermediateUpdate"),
)
"""Arguments that are left out: they say nothing, and are others in each run."""


class Argument(NamedTuple):
    """An argument of a function of FMI; `position` is its place among all."""

    position: int
    name: str
    kind: Any
    """The type of ctypes: of a number its own, of an array that of its elements."""
    is_array: bool
    size_at: int | None
    """The position of the argument with the number of elements; None for one element."""
    is_result: bool
    """True for what the FMU writes."""


class CallTrace:
    """Writes the calls of one instance to a file, to which it appends."""

    def __init__(
        self, component: str, path: Path, functions: type, clock: Callable[[], float]
    ) -> None:
        """Open the file; InputError where that cannot be written.

        Args:
            component: The name of the component, for errors.
            path: The file.
            functions: FMPy's class of the instance, whose methods declare the functions of FMI.
            clock: Returns the simulated time in s.
        """
        self._component, self._path = component, path
        self._functions, self._clock = functions, clock
        try:
            self._file = os.open(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT, 0o666)
        except OSError as error:
            raise InputError(_cannot_write(component, path, error)) from error

    def call(self, name: str, function: Callable[..., Any], arguments: Sequence[Any]) -> Any:
        """Call a function of FMI by its full name, and write the call.

        SimulationError where the file cannot be written to any more.
        """
        passed, returned = _signature(self._functions, name)
        inputs = [_in_words(argument, arguments) for argument in passed]
        self._write(f"t={self._clock()!r} {name}({', '.join(inputs)}")
        try:
            answer = function(*arguments)
        except FMICallException as error:
            self._write(f") -> {_status(error.status)}\n")
            raise
        separator = ", " if inputs and returned else ""
        results = [_in_words(argument, arguments) for argument in returned]
        self._write(f"{separator}{', '.join(results)}){_outcome(name, answer)}\n")
        return answer

    def traced(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The same function, whose calls are written."""

        def call(*arguments: Any) -> Any:
            return self.call(name, function, arguments)

        return call

    def close(self) -> None:
        """Close the file."""
        os.close(self._file)

    def _write(self, text: str) -> None:
        """Write at once: the process may end in the call that follows."""
        try:
            os.write(self._file, text.encode())
        except OSError as error:
            raise SimulationError(_cannot_write(self._component, self._path, error)) from error


def begin_trace(component: str, path: Path) -> None:
    """Empty the file of a trace, or make it; InputError where that is not possible."""
    try:
        path.write_bytes(b"")
    except OSError as error:
        raise InputError(_cannot_write(component, path, error)) from error


def _cannot_write(component: str, path: Path, error: OSError) -> str:
    return f"{component}: trace: {path}: cannot be written: {error.strerror}"


@cache
def _signature(functions: type, name: str) -> tuple[Sequence[Argument], Sequence[Argument]]:
    """The arguments of a function up to the first that the FMU writes, and those from there on."""
    _, *parameters = inspect.signature(getattr(functions, name)).parameters.values()  # without self
    kinds = [_declared_kind(parameter.annotation) for parameter in parameters]
    size_positions = [place for place, kind in enumerate(kinds) if kind is ctypes.c_size_t]
    action = name[len("fmi2") :]
    reads_all = action.startswith(READING)
    arguments: list[Argument] = []
    for position, (parameter, kind) in enumerate(zip(parameters, kinds, strict=True)):
        if parameter.name in ADDRESSES:
            continue
        is_array = hasattr(kind, "contents")  # as all pointers of ctypes
        element = kind._type_ if is_array else kind
        is_read = reads_all or parameter.name in REFERENCES
        if parameter.name == BYTES_OF_STATE:
            is_read = action.startswith("De")
        size_at = None
        if is_array and element is not ctypes.c_void_p:  # there is one state at a time
            size_at = _size_position(position, size_positions)
        is_result = is_array and not is_read
        arguments.append(Argument(position, parameter.name, element, is_array, size_at, is_result))
    results = [place for place, argument in enumerate(arguments) if argument.is_result]
    first_result = results[0] if results else len(arguments)
    return arguments[:first_result], arguments[first_result:]


def _declared_kind(annotation: Any) -> Any:
    """The type of ctypes of an argument, which FMPy declares, or the first type of its union."""
    alternatives = get_args(annotation)
    return alternatives[0] if alternatives else annotation


def _size_position(position: int, size_positions: Sequence[int]) -> int | None:
    """The position of the size of an array: it follows, or is the last one before."""
    if position + 1 in size_positions:
        return position + 1
    return max((place for place in size_positions if place < position), default=None)


def _in_words(argument: Argument, arguments: Sequence[Any]) -> str:
    """An argument with its name and the value that it has in a call."""
    value = arguments[argument.position]
    if not argument.is_array:
        return f"{argument.name}={_literal(argument.kind, _plain(argument.kind, value))}"
    if argument.size_at is None:
        (element,) = _elements(argument.kind, value, 1)
        return f"{argument.name}={_literal(argument.kind, element)}"
    size = _plain(ctypes.c_size_t, arguments[argument.size_at])
    elements = _elements(argument.kind, value, size)
    if argument.name == BYTES_OF_STATE:
        return f"{argument.name}={bytes(elements).hex()}"
    literals = [_literal(argument.kind, element) for element in elements]
    return f"{argument.name}=[{', '.join(literals)}]"


def _plain(kind: Any, value: Any) -> Any:
    """The value of a number, text or address, be it of ctypes or of Python."""
    typed = value if isinstance(value, kind) else kind(value)
    return typed.value


def _elements(kind: Any, array: Any, size: int) -> Any:
    """The elements of an array, which is one of ctypes, or the address of one."""
    address = array if isinstance(array, int) else ctypes.cast(array, ctypes.c_void_p).value
    return (kind * size).from_address(address) if address else ()


def _literal(kind: Any, value: Any) -> str:
    """A value of a type of ctypes as the trace has it."""
    if value is None:
        return "NULL"
    if issubclass(kind, ctypes.Structure):
        fields = [f"{name}={_literal(of, getattr(value, name))}" for name, of in kind._fields_]
        return f"{{{', '.join(fields)}}}"
    if kind is ctypes.c_char_p:
        return json.dumps(value.decode(errors="replace"), ensure_ascii=False)
    if kind is ctypes.c_void_p:
        return hex(value)
    return repr(int(value) if kind is ctypes.c_bool else value)


def _outcome(name: str, answer: Any) -> str:
    """What a function returned, as the end of a line."""
    if not name[len("fmi2") :].startswith(WITHOUT_STATUS):
        return f" -> {_status(answer)}"
    return " -> NULL" if "Instantiate" in name and not answer else ""


def _status(status: int) -> str:
    return STATUS[status].upper() if 0 <= status < len(STATUS) else str(status)
