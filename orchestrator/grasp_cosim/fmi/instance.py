"""The interface of a component to the master, for every FMI version and process.

And the inputs that an FMU was given last, as its failure names them.
"""

from collections.abc import Mapping, Sequence
from math import isfinite, nextafter
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from ..base.calls import Call
from ..base.errors import SimulationError, choices
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.variables import Variable
from ..system.parts import literal

STATUS = ("ok", "warning", "discard", "error", "fatal", "pending")
OK, WARNING, DISCARD, ERROR, FATAL = 0, 1, 2, 3, 4
"""FMI statuses. Up to WARNING a simulation goes on; after FATAL no call is allowed."""

EARLY, EVENT, DUE = 6, 7, 8
"""No FMI statuses, of steps of FMI 3.0: one that returned OK, but before its end; one that did so
at an event which has to be handled with the master; one that was not taken, since an event within
it, or at its end, is known already.
"""

AT_POINT = 1e-10
"""s, a tenth of the unit of time: an event so near to a communication point is at that."""


class RefusedValueError(SimulationError):
    """An FMU refused a value with the status discard: it keeps the older one, and may go on."""


CLOCK = ("begin", "number", "end")
"""What a stepper is told of a step: the time at which it begins in s, its number, the time at which
it ends.
"""


def clock_of(begin: float, end: float) -> npt.NDArray[np.float64]:
    """Only the clock of a step, from begin to end in s."""
    return np.array([begin, 0.0, end])


def length_until(begin: float, end: float) -> float:
    """The longest step in s from begin that is not beyond end where both are added as floats."""
    length = end - begin
    while begin + length > end:
        length = nextafter(length, 0.0)
    return length


class Instance(Protocol):
    """One instance of a component, in the order of its life."""

    name: str
    """The component's name in the system."""

    interface: Interface
    """Its declared interface, under the system's names."""

    def enter_initialization(
        self, values: Mapping[str, Value], stop: float | None, start: float = 0.0
    ) -> None:
        """Set start values and enter initialisation mode; the experiment is from start to stop, s.

        stop is None where the end is not known.

        InputError where the FMU refuses.
        """

    def exit_initialization(self) -> None:
        """Leave initialisation mode; one with interface.event_mode is then in event mode."""

    def enter_step_mode(self) -> None:
        """Handle the event of the start; of an instance with interface.event_mode only.

        SimulationError where the FMU fails.
        """

    def get(self, variables: Sequence[Variable]) -> list[Value]:
        """The values of the variables now, one by one. For use outside the loop.

        SimulationError where the FMU fails.
        """

    def set(self, variables: Sequence[Variable], values: Sequence[Value]) -> None:
        """Set inputs or tunable parameters. For use outside the loop.

        Of an array that is set in part, the other elements keep what they were set to last. A
        SimulationError where the FMU fails, a RefusedValueError where it keeps the older values.
        """

    def transfer(self, action: str, variables: Sequence[Variable], data: npt.NDArray[Any]) -> Call:
        """The call that passes data to inputs ("set") or fetches outputs into it ("get").

        The variables are all of one FMI type; data has that of dtype() and their order. Of an array
        they are all elements, row by row.
        """

    def stepper(self, clock: npt.NDArray[np.float64], step: float) -> Call:
        """The call that advances by step seconds from the time in clock; EARLY is a status.

        clock has the parts of CLOCK.
        """

    def through_events(self, status: int, begin: float, end: float) -> tuple[int, float]:
        """Go on to the end, in s, with a step from begin that returned EVENT or DUE.

        Handles the events on the way; the status, and how far it came. SimulationError where there
        is an event that cannot be handled.
        """

    def saved(self) -> Any:
        """Its state between two steps, for restore(), kept until nothing refers to it any more.

        InputError where the FMU does not give it; SimulationError where it fails.
        """

    def restore(self, saved: Any) -> None:
        """Go back to a state that was saved, also after a failure, any number of times.

        SimulationError where the FMU fails, or did so in a way that nothing may follow.
        """

    def reset(self) -> None:
        """Be as it was when it was loaded, with what was bound since; enter_initialization() next.

        InputError where the FMU has no such function; SimulationError where it fails.
        """

    def numbers(self) -> npt.NDArray[np.float64]:
        """The numbers that make up its state; InputError where they are not known one by one."""

    def take_numbers(self, numbers: npt.NDArray[np.float64]) -> bool:
        """Go on from a state of other numbers; False where the FMU refuses these.

        Errors as of numbers().
        """

    def last_successful_time(self) -> float | None:
        """Return the end of a discarded or shortened step in s, None if the FMU does not say."""

    def the_end(self) -> float | None:
        """Return the time in s at which the FMU asked for the end of the simulation.

        In a step that it rejected, or in its initialisation; None if it did not.
        """

    def failure(self, status: int, time: float) -> SimulationError:
        """The error for a call that returned a bad status at time in s."""

    def remarks(self, returned: int = 0, first: float = 0.0) -> list[str]:
        """Lines for the log of the run: the first of the FMU's warnings, and how many followed.

        So many calls of the loop have returned a warning, the first in the step from that time in
        s on.
        """

    def quieten(self) -> None:
        """Stop a log that nobody asked for; called between steps."""

    def close(self) -> None:
        """End and free the instance as far as FMI permits after what it returned."""


NUMPY_TYPES_OF_FMI_2: Mapping[str, str] = {
    "Real": "float64",
    "Integer": "int32",
    "Boolean": "int32",
    "Enumeration": "int32",
}
"""The element type by the type of FMI 1.0 and 2.0, for those of numbers."""


def dtype(version: str, fmi_type: str) -> np.dtype[Any]:
    """The element type of an FMI type in a version; KeyError or TypeError for one not of numbers.

    An Enumeration is an Integer in FMI 2.0, an Int64 in 3.0.
    """
    if version.startswith("3"):
        exceptions = {"Boolean": "bool", "Enumeration": "int64"}
        return np.dtype(exceptions.get(fmi_type, fmi_type.lower()))
    return np.dtype(NUMPY_TYPES_OF_FMI_2[fmi_type])


MAX_INPUTS_NAMED = 6
"""Of an instance in an error; those that are not finite or out of their range come first."""


class Inputs:
    """What an instance was given: values set one by one, and in the run those of its buffers."""

    def __init__(self) -> None:
        self.running = False
        """True once the buffers hold what the FMU gets."""
        self._set_singly: dict[Variable, Value] = {}
        self._bound: list[tuple[Sequence[Variable], npt.NDArray[Any]]] = []

    def forget(self) -> None:
        """It has none of the values any more."""
        self.running = False
        self._set_singly.clear()

    def saved(self) -> dict[Variable, Value]:
        """What was set one by one, for restore(); the buffers are their owner's."""
        return dict(self._set_singly)

    def restore(self, saved: Mapping[Variable, Value]) -> None:
        """Go back to what was saved."""
        self._set_singly = dict(saved)

    def set(self, variable: Variable, value: Value) -> None:
        """Note a value that is about to be set; one of a parameter is not kept."""
        if variable.causality == "input":
            self._set_singly[variable] = value

    def last(self, variable: Variable) -> Value | None:
        """The value that was set last, one by one; None where there is none."""
        return self._set_singly.get(variable)

    def bind(self, variables: Sequence[Variable], data: npt.NDArray[Any]) -> None:
        """Note the buffer from which the variables are set in the run."""
        self._bound.append((variables, data))

    def __str__(self) -> str:
        """The end of a one-line error, like " (inputs: gap = 45 m)"; empty without inputs."""
        connected: dict[Variable, Value] = {}
        for variables, data in self._bound if self.running else ():
            connected |= zip(variables, data.tolist(), strict=True)
        # Connected inputs come before those that were set one by one and stay as they are.
        values = {**connected, **self._set_singly, **connected}
        if not values:
            return ""
        by_suspicion = sorted(values, key=lambda v: _is_usual(v, values[v]))
        words = (_in_words(v, values[v]) for v in by_suspicion)
        return f" (inputs: {choices(words, MAX_INPUTS_NAMED)})"


def _is_usual(variable: Variable, value: Value) -> bool:
    """False for a number that is not finite, or out of its declared range."""
    if isinstance(value, str):
        return True
    return isfinite(value) and variable.low <= value <= variable.high


def _in_words(variable: Variable, value: Value) -> str:
    if variable.kind == "Boolean":
        value = bool(value)
    text = f"{value:.6g}" if isinstance(value, float) else literal(value)
    return f"{variable.name} = {text} {variable.unit or ''}".rstrip()
