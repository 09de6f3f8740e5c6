"""An instance of an FMI 3.0 co-simulation FMU that handles its events with the master.

A step ends at an event: where the FMU returns for one, at the time that it has named for the next
one, and where a clock ticks. The FMU is then in event mode: clocks tick, discrete inputs arrive,
the discrete states are updated until they settle, and the step goes on. What comes at the end of a
step is handled before its outputs are read.

A discrete input that a connection changed arrives by an event as the next step begins; one that is
bound to a clock arrives with its ticks.
"""

import math
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from ..base.calls import Call
from ..base.errors import InputError, SimulationError
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.variables import Variable
from ..system.parts import Logging
from .clocks import Clocks
from .co_simulation import NEEDED, SHORT, TERMINATE, Fmi3Instance
from .events import DENSE, ConnectedInputs, Events
from .instance import AT_POINT, EARLY, EVENT, OK, WARNING, length_until


class EventInstance(Fmi3Instance):
    """One instance of an FMI 3.0 co-simulation FMU with event mode."""

    NEEDS: ClassVar[Sequence[str]] = (
        *Fmi3Instance.NEEDS,
        *("EnterEventMode", "UpdateDiscreteStates", "EnterStepMode"),
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
        self._inputs_at_events: list[_PartOfInputs] = []
        self._communication_step = 0.0
        """The communication step in s."""
        super().__init__(name, interface, tolerance, logging, trace)

    def _forget(self) -> None:
        """As Fmi3Instance."""
        super()._forget()
        self._clocks = Clocks(self.interface, self._bound, self._refusal)
        self._events = Events(self._clocks, self._error)
        self._event_time = 0.0
        """The time that the FMU has come to, in s, at its events."""
        self._next_event = math.inf
        """The time in s that it has named for the next event."""
        self._in_step_mode = False
        self._has_stepped = False
        self._pending_inputs: dict[Variable, Value] = {}
        """What was set one by one, and has not arrived."""
        for inputs in self._inputs_at_events:
            inputs.last_passed = b""

    def enter_initialization(
        self, values: Mapping[str, Value], stop: float | None, start: float = 0.0
    ) -> None:
        """As Instance.enter_initialization()."""
        self._event_time = start
        super().enter_initialization(values, stop, start)

    def exit_initialization(self) -> None:
        """Leave initialisation mode for event mode, which ends with enter_step_mode()."""
        try:
            self._clocks.initialise(self._event_time)
        except SimulationError as error:
            raise InputError(str(error)) from error
        super().exit_initialization()

    def enter_step_mode(self) -> None:
        """Handle the event of the start, in which clocks may tick."""
        with self._failures():
            self._settle()

    def set(self, variables: Sequence[Variable], values: Sequence[Value]) -> None:
        """As Instance.set; but in step mode only continuous inputs change at once.

        The others do by an event, as the next step begins, or now if there was none yet; those of
        clocks with a tick.
        """
        if not self._inputs.running:
            super().set(variables, values)
            return
        at_once: dict[Variable, Value] = {}
        by_event: dict[Variable, Value] = {}
        for variable, value in zip(variables, values, strict=True):
            waits = not _is_continuous(variable) and (self._in_step_mode or variable.clocks)
            (by_event if waits else at_once)[variable] = value
        self._pending_inputs |= by_event
        with self._failures():
            self._assign(at_once.items())
            if self._in_step_mode and not all(v.clocks for v in by_event):
                if self._has_stepped:
                    self._event_limit[0] = -math.inf
                else:
                    self._event()

    def saved(self) -> Any:
        """As Fmi3Instance, with the events and clocks."""
        events = self._events.saved(), self._clocks.saved(), self._event_time, self._next_event
        passed = [inputs.last_passed for inputs in self._inputs_at_events]
        return super().saved(), events, self._has_stepped, dict(self._pending_inputs), passed

    def restore(self, saved: Any) -> None:
        """As Fmi3Instance."""
        (
            state,
            (events, clocks, self._event_time, self._next_event),
            self._has_stepped,
            pending,
            passed,
        ) = saved
        self._events.restore(events)
        self._clocks.restore(clocks)
        self._pending_inputs = dict(pending)
        for inputs, last in zip(self._inputs_at_events, passed, strict=True):
            inputs.last_passed = last
        super().restore(state)

    def transfer(self, action: str, variables: Sequence[Variable], data: npt.NDArray[Any]) -> Call:
        """As Instance.transfer: inputs that are not continuous arrive by an event."""
        if action == "get" or all(_is_continuous(v) for v in variables):
            return super().transfer(action, variables, data)
        by_clocks: dict[tuple[int, ...], list[int]] = {}
        continuous: list[int] = []
        for place, v in enumerate(variables):
            places = continuous if _is_continuous(v) else by_clocks.setdefault(v.clocks, [])
            places.append(place)

        def bind(places: list[int], clocks: tuple[int, ...]) -> _PartOfInputs:
            part, bound = np.zeros(len(places), data.dtype), [variables[p] for p in places]
            call = super(EventInstance, self).transfer("set", bound, part)
            return _PartOfInputs(data, np.array(places), part, call, clocks)

        at_events = [bind(places, clocks) for clocks, places in by_clocks.items()]
        at_once = [bind(continuous, ())] if continuous else []
        self._inputs_at_events += at_events

        def put() -> int:
            if not self._has_stepped:
                for inputs, places in zip(at_events, by_clocks.values(), strict=True):
                    inputs.expect([self._inputs.last(variables[p]) for p in places])
            if any(inputs.changed() for inputs in at_events if not inputs.clocks):
                self._event_limit[0] = -math.inf
            return max((inputs.pass_on() for inputs in at_once), default=OK)

        return Call(put)

    def stepper(self, clock: npt.NDArray[np.float64], step: float) -> Call:
        """As Instance.stepper; InputError where its clocks tick within a step that cannot vary."""
        if not self.interface.can_vary_step:
            for v in self.interface.input_clocks:
                self._check_ticks(v, step)
        if not self._communication_step:
            self._communication_step = step  # the first is that of the run; others are parts of it
        return super().stepper(clock, step)

    def _check_ticks(self, v: Variable, step: float) -> None:
        """InputError where a clock whose ticks are declared has one within a step."""
        if v.clock is None or v.clock.interval is None:
            return
        for time in (v.clock.interval, v.clock.shift):
            steps = float(time) / step
            if abs(steps - round(steps)) * step > AT_POINT:
                raise InputError(
                    f"{self.name}: {self.interface.file_name}: clock {v.name!r} ticks within steps "
                    f"of {step:g} s, which cannot vary; must have a step that divides "
                    f"{float(time):g} s"
                )

    def through_events(self, status: int, begin: float, end: float) -> tuple[int, float]:
        """As Instance.through_events()."""
        self._has_stepped, self._event_time = True, begin
        near = DENSE * (end - begin)
        with self._failures():
            if status == EVENT:
                self._event_time = self._reached(end)
                self._event(near)
            while not self._step_flags[TERMINATE]:
                if self._event_limit[0] <= self._event_time:
                    self._event()
                    continue
                if self._event_time >= end:
                    return OK, end
                due = min(self._next_event, self._clocks.next)
                stop = due if due < end - AT_POINT else end
                if stop < end and not self.interface.can_vary_step:
                    raise self._error("has an event within a step, which cannot vary,", due)
                begin_of_part = self._event_time
                status = self._do_step(begin_of_part, length_until(begin_of_part, stop))
                if status > WARNING:
                    return status, begin_of_part
                if self._step_flags[TERMINATE]:
                    break
                self._event_time = self._reached(stop)
                if self._step_flags[NEEDED]:
                    self._event(near)
                elif self._event_time <= begin_of_part:
                    return EARLY, begin_of_part
        return EARLY, self._event_time

    def _reached(self, stop: float) -> float:
        """The time in s that a step came to which was to go to `stop`."""
        last = float(self._last_successful[0])
        return last if self._step_flags[SHORT] and last < stop - AT_POINT else stop

    def _event(self, near: float = AT_POINT) -> None:
        """Event mode, now; it counts as close upon another that was less than `near` s before."""
        self._events.count(self._event_time, near, self._communication_step)
        self._slave.fmi3EnterEventMode(self._slave.component)
        self._settle()

    def _settle(self) -> None:
        """Have clocks tick and inputs arrive, update the discrete states until they settle."""
        update = self._slave.updateDiscreteStates
        settled = self._events.settle(self._event_time, update, self._take_inputs)
        if settled.ended:
            self._step_flags[TERMINATE], self._last_successful[0] = True, self._event_time
            return
        handles_it_itself = settled.next == self._next_event <= self._event_time + AT_POINT
        # its inner steps are behind then: it will return for that event by itself
        self._next_event = math.inf if handles_it_itself else settled.next
        self._slave.enterStepMode()
        self._in_step_mode = True
        self._event_limit[0] = min(self._next_event, self._clocks.next) - AT_POINT

    def _take_inputs(self, ticked: Collection[int]) -> None:
        """Have the inputs arrive that wait for an event, and those of the clocks that tick."""
        arriving = {v: x for v, x in self._pending_inputs.items() if _arrives(v.clocks, ticked)}
        for variable in arriving:
            del self._pending_inputs[variable]
        self._assign(arriving.items())
        for inputs in self._inputs_at_events if self._has_stepped else ():
            if _arrives(inputs.clocks, ticked) and inputs.changed():
                status = inputs.pass_on()
                if status > WARNING:
                    raise self.failure(status, self._event_time)

    def _time(self) -> float:
        return max(self._event_time, super()._time())


class _PartOfInputs(ConnectedInputs):
    """Connected inputs that arrive together: a part of the values that come over connections."""

    def __init__(
        self,
        data: npt.NDArray[Any],
        places: npt.NDArray[np.int64],
        part: npt.NDArray[Any],
        call: Call,
        clocks: tuple[int, ...],
    ) -> None:
        """Places are those of the values in data that the call passes on, which takes them from
        part; clocks are the references of those with whose ticks they arrive, if any.
        """
        super().__init__(data, call)
        self.clocks = clocks
        self._places, self._part = places, part

    def expect(self, values: Sequence[Value | None]) -> None:
        """The FMU has these values now, as far as they are known."""
        if None not in values:
            self.last_passed = np.array(values, self._part.dtype).tobytes()

    def values_to_come(self) -> npt.NDArray[Any]:
        """As ConnectedInputs.values_to_come()."""
        values: npt.NDArray[Any] = self._data[self._places]
        return values

    def pass_on(self) -> int:
        """As ConnectedInputs.pass_on()."""
        self._part[:] = self.values_to_come()
        return super().pass_on()


def _is_continuous(variable: Variable) -> bool:
    """True if it may be set in step mode."""
    return variable.causality == "input" and variable.variability == "continuous"


def _arrives(clocks: Collection[int], ticked: Collection[int]) -> bool:
    """True if an input of these clocks, or of none, may be set while those have ticked."""
    return not clocks or any(clock in ticked for clock in clocks)
