"""The clocks of an FMU that tick by time (FMI 3.0): when each does, and the calls that tick them.

Times are fractions, in s, so a clock of 0.1 s ticks at k/10 s exactly. The master ticks them in
event mode: those that are due, then, after each update of the discrete states, those that the FMU
wants at once.
"""

from collections.abc import Callable, Collection, Iterator
from ctypes import byref, c_bool, c_double, c_int, c_size_t, c_uint, c_uint64, c_void_p
from fractions import Fraction
from math import inf, isfinite

from ..base.errors import SimulationError
from ..interface.interface import Interface
from ..interface.variables import Clock, Variable
from .instance import AT_POINT, OK, WARNING

NOT_YET_KNOWN, UNCHANGED, CHANGED = range(3)
"""The interval that an FMU gives of a clock."""

ARGUMENTS = {
    "SetClock": (c_void_p,),
    "GetIntervalDecimal": (c_void_p, c_void_p),
    "GetIntervalFraction": (c_void_p, c_void_p, c_void_p),
    "GetShiftDecimal": (c_void_p,),
    "GetShiftFraction": (c_void_p, c_void_p),
}
"""The functions for clocks, and their arguments behind references and their number."""

Bind = Callable[..., Callable[..., int]]
"""Gives a function of the FMU, for its instance, by its name and the types of its arguments."""

Refuse = Callable[[str, int], SimulationError]
"""Gives the error for a reason, what the FMU did in words, and the status that it returned."""


class Clocks:
    """The input clocks of one instance, none in most."""

    def __init__(self, interface: Interface, bind: Bind, refuse: Refuse) -> None:
        self._clocks = interface.input_clocks
        self._bind, self._refuse = bind, refuse
        self._functions: dict[str, Callable[..., int]] = {}
        self._event_time, self._exact_event_time = 0.0, Fraction(0)
        """The time of the event, in s, and the same exactly."""
        self._intervals: dict[int, Fraction] = {}
        """In s, by reference, of those that are periodic."""
        self._last_ticks: dict[int, Fraction] = {}
        """The last tick in s of those that have ticked."""
        self._next_ticks: dict[int, Fraction] = {}
        """The next tick in s of those of which it is known."""

    def initialise(self, start: float) -> None:
        """Find the first ticks, in initialisation mode, which ends at start, in s.

        SimulationError where the FMU does not say.
        """
        self._exact_event_time = begin = _exact(start)
        for reference, v, clock in self._declared():
            match clock.variability:
                case "countdown":
                    self._restart(v, clock)
                case "changing":
                    self._next_ticks[reference] = begin + self._required_interval(v, clock)
                case "calculated":
                    self._intervals[reference] = self._required_interval(v, clock)
                    self._next_ticks[reference] = begin + self._shift(v, clock)
                case "tunable":
                    interval = clock.interval
                    self._intervals[reference] = interval or self._required_interval(v, clock)
                    self._next_ticks[reference] = begin + self._shift(v, clock)
                case _:
                    assert clock.interval is not None  # noqa: S101 - see interface/obstacles.py
                    self._intervals[reference] = clock.interval
                    self._next_ticks[reference] = begin + clock.shift

    def saved(self) -> tuple[dict[int, Fraction], ...]:
        """The ticks that were and are to come, for restore()."""
        return dict(self._intervals), dict(self._last_ticks), dict(self._next_ticks)

    def restore(self, saved: tuple[dict[int, Fraction], ...]) -> None:
        """Go back to what was saved."""
        self._intervals, self._last_ticks, self._next_ticks = map(dict, saved)

    @property
    def next(self) -> float:
        """The time of the next tick in s; inf where none is known."""
        return float(min(self._next_ticks.values())) if self._next_ticks else inf

    def begin(self, time: float) -> None:
        """Begin an event at a time in s."""
        self._event_time = time
        self._exact_event_time = max(self._due_now().values(), default=_exact(time))

    def tick(self) -> Collection[int]:
        """Tick what is due, in event mode; the references of these clocks."""
        due = self._due_now()
        for reference, v, clock in self._declared():
            if clock.variability == "countdown" and reference not in due:
                self._restart(v, clock)
        due = self._due_now()
        if due:
            references, active = (c_uint * len(due))(*due), (c_bool * len(due))(*[True] * len(due))
            self._call("SetClock", "does not let its clocks tick", references, len(due), active)
        self._last_ticks |= due
        for reference in due:
            del self._next_ticks[reference]
        return due

    def schedule(self, ticked: Collection[int]) -> None:
        """Find the next ticks, in event mode, after an update of the discrete states."""
        for reference, v, clock in self._declared():
            if clock.variability == "tunable":
                self._tune(v, clock)
            if reference in ticked and clock.variability != "countdown":
                interval = self._intervals.get(reference)
                if interval is None:  # it is another each time
                    interval = self._required_interval(v, clock)
                self._next_ticks[reference] = self._last_ticks[reference] + interval

    def _due_now(self) -> dict[int, Fraction]:
        """The ticks in s that are due in this event, by reference."""
        return {
            r: tick
            for r, tick in self._next_ticks.items()
            if float(tick) <= self._event_time + AT_POINT
        }

    def _declared(self) -> Iterator[tuple[int, Variable, Clock]]:
        for v in self._clocks:
            if v.clock:
                yield v.reference, v, v.clock

    def _restart(self, v: Variable, clock: Clock) -> None:
        """Have a countdown begin now if the FMU wants that."""
        qualifier, interval = self._present_interval(v, clock)
        if qualifier == CHANGED:
            self._next_ticks[v.reference] = self._exact_event_time + interval

    def _tune(self, v: Variable, clock: Clock) -> None:
        """Take the interval that the FMU has now; it counts from the last tick on."""
        qualifier, interval = self._present_interval(v, clock)
        if qualifier != NOT_YET_KNOWN and interval > 0 and interval != self._intervals[v.reference]:
            self._intervals[v.reference] = interval
            if v.reference in self._last_ticks:
                self._next_ticks[v.reference] = max(
                    self._last_ticks[v.reference] + interval, self._exact_event_time
                )

    def _required_interval(self, v: Variable, clock: Clock) -> Fraction:
        """The interval in s, which has to be known now."""
        qualifier, interval = self._present_interval(v, clock)
        if qualifier == NOT_YET_KNOWN or interval <= 0:
            reason = f"does not say the interval of its clock {v.name!r} ({clock.variability})"
            raise self._refuse(reason, OK)
        return interval

    def _present_interval(self, v: Variable, clock: Clock) -> tuple[int, Fraction]:
        """The interval that the FMU gives of a clock now, and the interval in s."""
        failure, qualifier = f"does not say the interval of its clock {v.name!r}", c_int()
        counter, resolution, interval = c_uint64(), c_uint64(), c_double()
        reference = byref(c_uint(v.reference))
        if clock.fractions:
            fraction = byref(counter), byref(resolution), byref(qualifier)
            self._call("GetIntervalFraction", failure, reference, 1, *fraction)
        else:
            decimal = byref(interval), byref(qualifier)
            self._call("GetIntervalDecimal", failure, reference, 1, *decimal)
        if qualifier.value == NOT_YET_KNOWN:
            return NOT_YET_KNOWN, Fraction(0)
        if clock.fractions:
            return qualifier.value, self._fraction(v, counter.value, resolution.value)
        return qualifier.value, self._decimal(v, interval.value)

    def _shift(self, v: Variable, clock: Clock) -> Fraction:
        """The time from the start to the first tick, in s."""
        failure = f"does not say the shift of its clock {v.name!r}"
        counter, resolution, shift = c_uint64(), c_uint64(), c_double()
        reference = byref(c_uint(v.reference))
        if clock.fractions:
            self._call("GetShiftFraction", failure, reference, 1, byref(counter), byref(resolution))
            return self._fraction(v, counter.value, resolution.value)
        self._call("GetShiftDecimal", failure, reference, 1, byref(shift))
        return self._decimal(v, shift.value)

    def _decimal(self, v: Variable, value: float) -> Fraction:
        if not isfinite(value) or value < 0.0:
            raise self._refuse(f"says {value:g} s for its clock {v.name!r}", OK)
        return _exact(value)

    def _fraction(self, v: Variable, counter: int, resolution: int) -> Fraction:
        if not resolution:
            raise self._refuse(f"says {counter}/0 s for its clock {v.name!r}", OK)
        return Fraction(counter, resolution)

    def _call(self, name: str, failure: str, *arguments: object) -> None:
        """Call a function for clocks; SimulationError, with these words, where it fails."""
        if name not in self._functions:
            self._functions[name] = self._bind(name, c_void_p, c_size_t, *ARGUMENTS[name])
        status = self._functions[name](*arguments)
        if status > WARNING:
            raise self._refuse(failure, status)


def _exact(value: float) -> Fraction:
    """The shortest decimal number that is that float: of 0.1 it is 1/10."""
    return Fraction(repr(float(value)))
