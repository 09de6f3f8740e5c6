"""All that is private in FMPy and used here, or written into its classes, with a reason for each.

A new version of FMPy may change any of it without notice. Therefore pyproject.toml names the last
version that was tried, and tests/fmi/test_fmpy_private.py finds the changes.

- _call and _functions: each call of a function of FMI goes through the former, which looks it up in
  the latter. Only there a warning that a call returns is seen, and a call is traced. FMPy has a
  logger of calls, which rounds nothing either, but is told of a call only after it.
- _loadFunctions: FMPy takes the functions to load from dir() of an instance. It finds the version
  of FMI by the name of its class, and raises where a binary lacks a function. So dir()
  leaves out what is lacking, and the names of the classes here begin as theirs.
- __signature__ of its methods: it is worked out at each instance, which takes 3 of the 4 ms that
  one takes; so it is written into the methods once.
- getString of FMI 3.0: FMPy's raises at what is no UTF-8, and at NULL.
- "Failed to instantiate": so begins the plain Exception where an FMU gives no instance.
- dll._name: the file of a library, of ctypes rather than of FMPy.
- fmpy.sundials.libraries: the libraries of CVode that it ships, which cvode.py calls itself.
"""

import ctypes
import inspect
from collections.abc import Iterable, Sequence
from functools import cache, partial
from typing import Any

from fmpy.fmi2 import FMU2Model, FMU2Slave
from fmpy.fmi3 import FMU3Model, FMU3Slave

from .call_trace import CallTrace
from .instance import WARNING
from .messages import Messages

FAILED_TO_INSTANTIATE = "Failed to instantiate"
"""So begins what FMPy says where an FMU gave no instance."""


class MissingFunctionError(Exception):
    """The binary of an FMU lacks functions that are needed."""

    def __init__(self, *functions: str) -> None:
        super().__init__(f"its binary lacks {', '.join(functions)}; must have what is called")


class Lenient:
    """Mixed into FMPy's classes: the binary may lack functions, until one of these is called."""

    messages: Messages
    """Gets a warning that a call returns without having logged why."""

    trace: CallTrace | None = None
    """Gets each call; None where that is not asked for."""

    def __dir__(self) -> Iterable[str]:
        """FMPy loads the functions by these names."""
        names = super().__dir__()
        return [n for n in names if not n.startswith(("fmi2", "fmi3")) or hasattr(self.dll, n)]  # type: ignore[attr-defined]

    def _call(self, function: str, *arguments: Any) -> Any:
        """As FMPy's; MissingFunctionError where the binary has no such function."""
        if function not in self._functions:  # type: ignore[attr-defined]
            raise MissingFunctionError(function)
        messages_before = self.messages.count
        if self.trace:
            call = partial(super()._call, function)  # type: ignore[misc]
            answer = self.trace.call(function, call, arguments)
        else:
            answer = super()._call(function, *arguments)  # type: ignore[misc]
        has_status = self._functions[function].restype is ctypes.c_int  # type: ignore[attr-defined]
        if has_status and answer == WARNING:
            self.messages.returned(function, messages_before)
        return answer


class StringsOfFmi3:
    """Mixed into FMPy's classes of FMI 3.0."""

    def getString(self, references: Sequence[int]) -> list[bytes | None]:
        """The Strings of variables as they are, whatever bytes these are."""
        count = len(references)
        texts = (ctypes.c_char_p * count)()
        self.fmi3GetString(  # type: ignore[attr-defined]
            self.component,  # type: ignore[attr-defined]
            (ctypes.c_uint * count)(*references),
            count,
            texts,
            count,
        )
        return list(texts)


class FMU2CoSimulation(Lenient, FMU2Slave):  # type: ignore[misc]  # FMPy has no types
    """FMPy's class of a co-simulation FMU of FMI 2.0."""


class FMU2ModelExchange(Lenient, FMU2Model):  # type: ignore[misc]  # FMPy has no types
    """FMPy's class of a model exchange FMU of FMI 2.0."""


class FMU3CoSimulation(StringsOfFmi3, Lenient, FMU3Slave):  # type: ignore[misc]
    """FMPy's class of a co-simulation FMU of FMI 3.0."""


class FMU3ModelExchange(StringsOfFmi3, Lenient, FMU3Model):  # type: ignore[misc]
    """FMPy's class of a model exchange FMU of FMI 3.0."""


@cache
def with_known_signatures(fmpy_class: type) -> type:
    """The same class, with the signatures of its methods for functions of FMI written into them."""
    for name, function in inspect.getmembers(fmpy_class, inspect.isfunction):
        if name.startswith("fmi"):
            function.__signature__ = inspect.signature(function)  # type: ignore[attr-defined]
    return fmpy_class


def library_file(fmpy_instance: Any) -> str:
    """The file that the library of an instance was loaded from."""
    file: str = fmpy_instance.dll._name
    return file
