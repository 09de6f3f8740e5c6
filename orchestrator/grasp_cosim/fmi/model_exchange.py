"""An instance of an FMU for model exchange: its equations, integrated by CVode between two
communication points.

At a communication point inputs may jump, so what was set is handed over in event mode and the
solver begins again; where nothing changed it goes on. It stops at each event: an indicator leaves
or enters z > 0, the time that the FMU has named comes, or a clock ticks. The FMU may also want an
event after a step of the solver; the discrete states are then iterated until they settle.
"""

import ctypes
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from ..base.calls import Call
from ..base.errors import InputError, SimulationError, choices
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.variables import Variable
from ..system.parts import Logging, Solver
from .clocks import Clocks
from .co_simulation import Fmi3Instance, FmuInstance
from .cvode import Cvode, CvodeError, Function
from .events import DENSE, ConnectedInputs, Events
from .fmpy_private import FMU2ModelExchange, FMU3ModelExchange
from .instance import AT_POINT, DISCARD, EARLY, OK, WARNING
from .loaded import LoadedInstance

MIN_SPAN = 16
"""In units of the last place of a time: over less nothing is integrated."""

MAX_STATES = 20_000
"""The solver has a matrix of their square."""


class ModelInstance(LoadedInstance):
    """One instance of an FMU for model exchange, the parts that FMI 2.0 and 3.0 have in common."""

    SLOPES: ClassVar[str]
    """The function that evaluates the derivatives."""

    UPDATE: ClassVar[str]
    """The method of FMPy's class that updates the discrete states once: Update of events.py."""

    def __init__(
        self,
        name: str,
        interface: Interface,
        options: Solver,
        logging: Logging = False,
        trace: Path | None = None,
    ) -> None:
        """Extract and instantiate; InputError where the FMU does not load."""
        self._solver_options = options
        self._solver: Cvode | None = None
        self._connected_inputs: list[ConnectedInputs] = []
        self._communication_step = 0.0
        super().__init__(name, interface, options.relative_tolerance, logging, trace)

    def _forget(self) -> None:
        """As LoadedInstance."""
        super()._forget()
        self._end_solver()
        self._clocks = Clocks(self.interface, self._bound, self._refusal)
        self._events = Events(self._clocks, self._error)
        self._solver_time = 0.0
        self._next_event = math.inf
        self._get_indicators: Any = None
        self._end_time: float | None = None
        self._failed_status = OK
        self._values_set: dict[Variable, Value] = {}
        self._pending_inputs: dict[Variable, Value] = {}
        self._has_stepped = False
        self._zero_indicators: npt.NDArray[np.bool_] | None = None
        self._warnings_noted = 0
        for inputs in self._connected_inputs:
            inputs.last_passed = b""

    def _end_solver(self) -> None:
        if self._solver:
            self._solver.close()
            self._solver = None

    @property
    def _identifier(self) -> str:
        assert self.interface.exchange is not None  # noqa: S101 - else it is not loaded as this
        return self.interface.exchange.identifier

    def _wants_the_end(self) -> bool:
        return self._end_time is not None

    def last_successful_time(self) -> float | None:
        return self._end_time

    def _time(self) -> float:
        return self._solver_time

    def close(self) -> None:
        """Free the solver, then the FMU as far as it permits."""
        self._end_solver()
        super().close()

    def enter_initialization(
        self, values: Mapping[str, Value], stop: float | None, start: float = 0.0
    ) -> None:
        self._solver_time = start
        super().enter_initialization(values, stop, start)

    def exit_initialization(self) -> None:
        """Leave initialisation mode; settle the discrete states, and prepare the solver."""
        try:
            self._clocks.initialise(self._solver_time)
            super().exit_initialization()
            with self._refusals():
                self._bind()
                self._settle(first=True)
        except (SimulationError, CvodeError) as error:
            raise InputError(str(error)) from error

    def set(self, variables: Sequence[Variable], values: Sequence[Value]) -> None:
        """Set inputs or tunable parameters; in the run they change as the next step begins.

        Between the initialisation and the first step they change at once, by an event.
        """
        value_of = dict(zip(variables, values, strict=True))
        if self._inputs.running:
            self._pending_inputs |= value_of
            if not self._has_stepped and self._end_time is None:
                with self._failures():
                    self._event()
        else:
            super().set(variables, values)
            self._values_set |= value_of

    def saved(self) -> Any:
        """InputError: the solver's own state cannot be saved."""
        raise self._has_no_state("cannot be saved, as it is integrated by CVode")

    def transfer(self, action: str, variables: Sequence[Variable], data: npt.NDArray[Any]) -> Call:
        """As Instance.transfer: inputs arrive as the next step begins."""
        call = super().transfer(action, variables, data)
        if action == "get":
            return call
        self._connected_inputs.append(ConnectedInputs(data, call))
        return Call(lambda: OK)

    def stepper(self, clock: npt.NDArray[np.float64], step: float) -> Call:
        """As Instance.stepper: EARLY where the FMU asks for the end of the simulation."""
        time: Any = memoryview(clock)  # type: ignore[arg-type]  # numpy's 3.11 stubs

        def advance() -> int:
            self._communication_step, self._has_stepped = step, True
            self._advance(time[2])
            return OK if self._end_time is None else EARLY

        return Call(advance)

    def _advance(self, end: float) -> None:
        with self._failures():
            self._pending_inputs = {
                v: x for v, x in self._pending_inputs.items() if self._values_set.get(v) != x
            }
            if self._pending_inputs or any(inputs.changed() for inputs in self._connected_inputs):
                self._event()
            while self._solver_time < end and self._end_time is None:
                stop = self._next_event if self._next_event <= end + AT_POINT else end
                has_event = self._go_on(stop)
                if self._end_time is None and (has_event or self._solver_time >= self._next_event):
                    self._event(DENSE * self._communication_step if has_event else AT_POINT)

    def _go_on(self, stop: float) -> bool:
        """Take one step of the solver, to `stop` at most; True where there is an event."""
        event = False
        if self._solver is None or stop - self._solver_time <= MIN_SPAN * math.ulp(stop):
            self._solver_time = max(self._solver_time, stop)
            self._check(self._set_time(self._solver_time))
        else:
            if self._zero_indicators is not None:
                stop = min(
                    stop,
                    self._solver_time + max(AT_POINT, 4.0 * MIN_SPAN * math.ulp(self._solver_time)),
                )
            try:
                self._solver_time, event = self._solver.step(stop)
            except CvodeError as error:
                raise self._stuck(error) from None
            self._check(self._set_time(self._solver_time))
            if self._states:
                self._check(self._set_states(self._states_address, self._states))
            event = event or self._left_zero()
        if self.interface.exchange and self.interface.exchange.wants_completed_steps:
            wants, ended = self._slave.completedIntegratorStep()
            event = event or wants
            if ended:
                self._end_time = self._solver_time
        return event

    def _left_zero(self) -> bool:
        """True where an indicator was 0 as the solver began and is not now, which CVode leaves
        out; the solver has gone a tiny step then.
        """
        if self._zero_indicators is None:
            return False
        zero, self._zero_indicators = self._zero_indicators, None
        return bool((zero & (self._indicators_now() != 0.0)).any())

    def _event(self, near: float = AT_POINT) -> None:
        """Event mode, now: what was set arrives, and the discrete states settle.

        It counts as close upon another event that was less than `near` s before.
        """
        self._events.count(self._solver_time, near, self._communication_step, self._next_event)
        self._slave.enterEventMode()
        waiting, self._pending_inputs = self._pending_inputs, {}
        self._values_set |= waiting
        self._assign(waiting.items())
        for inputs in self._connected_inputs if self._has_stepped else ():
            if inputs.changed():
                self._check(inputs.pass_on())
        self._settle()

    def _settle(self, first: bool = False) -> None:
        """Iterate an event until nothing changes, and begin the continuous time after it."""
        update = getattr(self._slave, self.UPDATE)
        settled = self._events.settle(self._solver_time, update, arrive=lambda _: None)
        if settled.ended:
            self._end_time = self._solver_time
            return
        self._next_event = min(settled.next, self._clocks.next)
        self._slave.enterContinuousTimeMode()
        if self._solver:
            self._begin(self._solver, first or settled.new_nominals)

    def _begin(self, solver: Cvode, nominals: bool) -> None:
        """Have the solver begin again with the states that the FMU has now."""
        new = None
        if self._states:
            self._check(self._get_states(self._states_address, self._states))
            if nominals:
                new = np.ones(self._states)
                self._check(self._get_nominals(new.ctypes.data, self._states))
                new = np.where(np.isfinite(new) & (new > 0.0), new, 1.0)
        solver.restart(self._solver_time, new)
        zero = self._indicators_now() == 0.0
        self._zero_indicators = zero if zero.any() else None

    def _bind(self) -> None:
        """Bind the functions that are called in the steps of the solver, and make that."""
        number, place, size = ctypes.c_double, ctypes.c_void_p, ctypes.c_size_t
        if self._major == "3":
            self._states = self._slave.getNumberOfContinuousStates()
            self._indicators = self._slave.getNumberOfEventIndicators()
        elif exchange := self.interface.exchange:
            self._states, self._indicators = exchange.states, exchange.indicators
        self._set_time = self._bound("SetTime", number)
        if self._states:
            self._set_states = self._bound("SetContinuousStates", place, size)
            self._get_states = self._bound("GetContinuousStates", place, size)
            self._get_nominals = self._bound("GetNominalsOfContinuousStates", place, size)
            self._get_slopes = self._bound(self.SLOPES, place, size)
        if self._indicators:
            self._get_indicators = self._bound("GetEventIndicators", place, size)
        slopes = self._evaluation(self._get_slopes if self._states else _no_slope, self._states)
        crossings = self._evaluation(self._get_indicators, self._indicators)
        if self._states > MAX_STATES:
            raise InputError(
                f"{self.name}: {self.interface.file_name} has {self._states} continuous states; "
                f"must have {MAX_STATES} at most"
            )
        if self._states or self._indicators:
            sizes = max(self._states, 1), self._indicators  # CVode needs a state; it stays 0
            self._solver = Cvode(*sizes, slopes, crossings, self._solver_options)
            self._states_address = self._solver.x.ctypes.data

    def _evaluation(self, get: Callable[[int, int], int], size: int) -> Function:
        """For the solver: what to get at the time and states that it tries."""

        def evaluate(time: float, states: int, values: int) -> int:
            status: int = self._set_time(time)
            if self._states and status <= WARNING:
                status = self._set_states(states, self._states)
            if status <= WARNING:
                status = get(values, size)
            if status == WARNING:
                self._note_warning()
            if status > DISCARD:
                self._failed_status = status
            return 0 if status <= WARNING else 1 if status == DISCARD else -1

        return evaluate

    def _indicators_now(self) -> npt.NDArray[np.float64]:
        values = np.zeros(self._indicators)
        if self._indicators:
            self._check(self._get_indicators(values.ctypes.data, self._indicators))
        return values

    def _check(self, status: int) -> None:
        if status == WARNING:
            self._note_warning()
        if status > WARNING:
            raise self.failure(status, self._solver_time)

    def _note_warning(self) -> None:
        """Keep a warning that a call returned, unless the FMU has logged one since the last."""
        self._messages.returned("an evaluation", self._warnings_noted)
        self._warnings_noted = self._messages.count

    def _stuck(self, error: CvodeError) -> SimulationError:
        """The error for a step that the solver could not take."""
        if self._failed_status:
            return self.failure(self._failed_status, self._solver_time)
        return self._error(f"cannot be integrated by CVode ({error})", self._solver_time)


def _no_slope(slopes: int, _: int) -> int:
    ctypes.c_double.from_address(slopes).value = 0.0
    return OK


class Fmi2Model(ModelInstance, FmuInstance):
    """One instance of an FMI 2.0 FMU for model exchange."""

    SLAVE = FMU2ModelExchange
    SLOPES = "GetDerivatives"
    UPDATE = "newDiscreteStates"
    NEEDS: ClassVar[Sequence[str]] = (
        *("Instantiate", "FreeInstance", "SetupExperiment", "EnterInitializationMode"),
        *("ExitInitializationMode", "EnterEventMode", "NewDiscreteStates"),
        *("EnterContinuousTimeMode", "SetTime", "Terminate"),
    )


class Fmi3Model(ModelInstance, Fmi3Instance):
    """One instance of an FMI 3.0 FMU for model exchange."""

    SLAVE = FMU3ModelExchange
    SLOPES = "GetContinuousStateDerivatives"
    UPDATE = "updateDiscreteStates"
    NEEDS: ClassVar[Sequence[str]] = (
        *("InstantiateModelExchange", "FreeInstance", "EnterInitializationMode"),
        *("ExitInitializationMode", "EnterEventMode", "UpdateDiscreteStates"),
        *("EnterContinuousTimeMode", "SetTime", "Terminate"),
        *("GetNumberOfContinuousStates", "GetNumberOfEventIndicators"),
    )

    def __init__(
        self,
        name: str,
        interface: Interface,
        options: Solver,
        logging: Logging = False,
        trace: Path | None = None,
    ) -> None:
        """Extract and instantiate; InputError where the FMU does not load."""
        if clocked := [v.name for v in interface.of("input") if v.clocks]:
            raise InputError(
                f"{name}: {interface.called}: {choices(clocked, 1)} is an input of a clock; must "
                "run by co-simulation, as model exchange has no such inputs here"
            )
        super().__init__(name, interface, options, logging, trace)

    def _instantiate(self, folder: Path) -> Any:
        model = self._opened(folder)
        model.instantiate(loggingOn=self._logs_at_once, logMessage=self._log)
        return model
