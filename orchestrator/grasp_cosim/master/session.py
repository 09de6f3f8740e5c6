"""A run that its user advances step by step: reads, sets, goes back, and takes the result of."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, fields, replace
from functools import partial
from numbers import Integral
from pathlib import Path
from typing import Any, TypeVar

from ..base.errors import InputError, SimulationError, nearest
from ..base.progress import Progress, phase
from ..exchange.listener import Listener
from ..fmi.call_trace import begin_trace
from ..fmi.instance import Instance
from ..fmi.load import load
from ..interface.units import IDENTITY
from ..interface.values import Given
from ..metrics.groups import check_groups
from ..metrics.metric import Function, Metric
from ..realtime.pacer import Pacer, Privileges, long_waits, privileges
from ..recording.result import Result
from ..system.connectors import behind_connectors, read_at
from ..system.declared_steps import check_declared_steps
from ..system.description import System, as_system
from ..system.overrides import as_overrides
from ..system.parts import Component, Port, Realtime, as_signal
from ..system.settings import with_events
from ..system.times import TimeInput, in_seconds
from ..twins.twins import twins_of_run
from .engine import Engine
from .fault_windows import NO_CUTS, Cut
from .master import Master
from .paced import PacedMaster
from .process_guard import guarded_process, leaves_process_alone, same_folder
from .requests import Requests
from .run_log import RunLog
from .run_record import RunRecord

LOGGER = logging.getLogger(__name__)
"""Gets what the operating system does not permit, and at the level INFO what a run does."""

MAX_STEPS = 2**62
"""The highest number of steps, far beyond the longest run."""

Finish = Callable[[Result, SimulationError | None], object]
"""Takes the result of a run that ended, and the error that ended it."""

Returned = TypeVar("Returned")


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The state of a session at a time, from Session.save()."""

    session: Session = field(repr=False)
    """The session that it is of, the only one that can go back to it."""
    time: float
    """The communication point in s."""
    system: System = field(repr=False)
    """The system with the start values of the run."""
    master: Any = field(repr=False)
    """The state of the FMUs and of the loop, which nobody but the master reads."""
    records: Sequence[Any] = field(repr=False)
    """The states of what keeps the rows."""


class Session:
    """A run that its user advances step by step.

    It is a context manager: leaving it ends the listeners and frees the FMUs. In real time its
    schedule begins with the first step.

        with simulate.session(system, stop=2.0) as session:
            while session.step(100):
                print(session.time, session["plant.gap[1]"])

    Example:
        >>> from grasp_cosim import grasp_system, simulate
        >>> with simulate.session(grasp_system(), step=1e-3, stop=0.1) as session:
        ...     more = session.step(50)
        ...     session.set("sensor_2.reflectance", 0.6)
        ...     time = session.time
        >>> more, time
        (True, 0.05)
    """

    def __init__(
        self,
        system: System | str | Path,
        *,
        step: TimeInput | None = None,
        stop: TimeInput | None = None,
        scheme: str | None = None,
        every: int = 1,
        listeners: Sequence[Listener] = (),
        engine: Engine = "auto",
        realtime: Realtime | bool = False,
        metrics: Sequence[Metric | Function | str] = (),
        diverging: str | None = None,
        note: Callable[[str], None] | None = None,
        finish: Finish | None = None,
        cuts: Mapping[Port, Cut] = NO_CUTS,
        halt: threading.Event | None = None,
        steered: bool = True,
        requests: Requests | None = None,
    ) -> None:
        """Load the FMUs of a system and initialise them.

        Args:
            system: The system, or the path of a system file, .toml or .ssp.
            step: The communication step in s, in place of that of the system. It may also be a
                text, a pair or a Quantity with its unit: "0.5 ms", (0.5, "ms").
            stop: The stop time in s, in place of that of the system.
            scheme: "sequential" or "jacobi", in place of that of the system.
            every: Every how many communication points are recorded; the last point always is.
            listeners: Get the recorded rows while the run goes on: see exchange.listener.
            engine: "python", "compiled", which needs a C compiler, or "auto", which is compiled
                where that pays. The results have the same bits.
            realtime: True paces the run by the clock as the system says, a Realtime as it says
                itself.
            metrics: Metrics to be worked out in addition to those of the system: see simulate().
            diverging: "stop" or "continue": what follows on a signal that runs away, in place of
                what the system says.
            note: Gets the lines of the log: see simulate().
            finish: Gets the result and the error that ended the run, or None, before the FMUs are
                terminated and freed.
            cuts: Functions by the connected input at which each opens a loop. A cut gets each value
                that the connection brings, and returns the one that is passed on in its place.
            halt: The event that is then the attribute of this name.
            steered: Says that set() may be called, so that inputs without a source are recorded by
                default.
            requests: What other threads ask to be set: see requests.Requests.

        Raises:
            InputError: An argument is wrong, or an FMU does not load or refuses its parameters.
            SimulationError: An FMU fails as it is initialised, or a limit is exceeded at the start.
        """
        system = as_system(system, "simulate").with_experiment(step, stop, scheme, diverging)
        system = with_twins(system.as_steered() if steered else system)
        _check_count("every", every)
        self.system = system
        self._record = RunRecord(system, metrics, every, bool(realtime))
        self._has_listeners = bool(listeners)
        self._finish = finish
        self._requests = requests
        self._wall_time = 0.0
        self._failed = False
        self._failure: SimulationError | None = None
        self._initialised = False
        self._closed = False
        self._fmus_leave_process_alone = False
        self.halt = halt or threading.Event()
        """Set, it ends a run of simulate(), or the wait of one in real time, at a communication
        point.
        """
        pacing = system.realtime if realtime is True else realtime
        self.pacer = Pacer(system, pacing, self.halt.is_set) if pacing else None
        self._privileges = Privileges()
        self._slots_read: dict[str, int] = {}
        """The slots of the values that were read before, by name, where they need no conversion."""
        self._start: tuple[Any, Sequence[Any]] | None = None
        """The saved states of the master and the record at the start, after a reset."""
        self._stack = ExitStack()
        if requests is not None:
            self._stack.callback(requests.close)
            requests.meter = self.pacer.meter if self.pacer else None
        check_declared_steps(system)
        waits = long_waits(system, self.pacer.realtime) if self.pacer else []
        self._log = RunLog(system, self._record, waits, note)
        self._log.tell_remarks()
        try:
            with guarded_process():
                self._begin(listeners, engine, cuts)
            self._log.tell_start(self.master)
            if pacing:
                self._ask_for_privileges(pacing)
        except BaseException:
            self._stack.close()
            raise

    def _begin(
        self, listeners: Sequence[Listener], engine: Engine, cuts: Mapping[Port, Cut]
    ) -> None:
        """Load the FMUs, initialise them and hand on the row of t = 0; the stack undoes it all."""
        self._instances: list[Instance] = []
        self._stack.callback(self._close_instances)
        for component in self.system.components:
            if component.trace:
                begin_trace(component.name, component.trace)
        with phase(f"loading {len(self.system.components)} FMUs"):
            self._load_instances()
        rows_to, renew, requests = self._record.receive, self._renew_instances, self._requests
        instances = self._instances
        self.master = (
            PacedMaster(self.system, instances, rows_to, self.pacer, engine, renew, cuts, requests)
            if self.pacer
            else Master(self.system, instances, rows_to, engine, renew, cuts, requests)
        )
        master = self.master
        self._record.begin(master.slots, master.texts, master.bounds, listeners)
        if requests is not None:
            requests.happened = partial(self._log.happened, master)
        if self.pacer:
            self.pacer.spare = self._record.dispatcher.spare
        self._stack.callback(self._hand_over)  # before the FMUs are ended, and after:
        self._stack.callback(self._end)
        with phase("initialising"), self._failures():  # where the row of t = 0 is not finite
            self.master.initialise()
        self._initialised = True
        self._fmus_leave_process_alone = all(map(leaves_process_alone, self.system.components))

    def _load_instances(self) -> None:
        """Load the FMUs in the order of the components."""
        for component in self.system.components:
            LOGGER.info("%s", _description(component))
            self._instances.append(load(component))

    def _close_instances(self) -> None:
        """Close them in the opposite order, all of them even where one fails."""
        with ExitStack() as stack:
            for instance in self._instances:
                stack.callback(instance.close)
        self._instances.clear()

    def _renew_instances(self) -> Sequence[Instance]:
        """Load new instances of the same FMUs, for a loop that is initialised again."""
        self._close_instances()
        self._load_instances()
        return self._instances

    def _ask_for_privileges(self, realtime: Realtime) -> None:
        """Ask the operating system for what a run in real time needs; a refusal is a warning."""
        self._privileges = self._stack.enter_context(privileges(realtime))
        for line in self._privileges.refused:
            LOGGER.warning("%s", line)

    @contextmanager
    def _failures(self) -> Iterator[None]:
        """A SimulationError breaks the session, and gets what was recorded as its result."""
        try:
            yield
        except SimulationError as error:
            self._break(error)
            raise

    def _end(self) -> None:
        """Hand on the rows that wait, and end the listeners, even where that fails."""
        with self._failures():
            try:
                self.master.hand_on()
            except BaseException:
                self._failed = True
                raise
            finally:
                self._record.dispatcher.end(self.complete)

    def _hand_over(self) -> None:
        """Tell the log and hand the result on: an FMU may take the process along as it ends."""
        if not self._initialised and self._failure is None:
            return
        self._log.tell_end(self.master, self._is_over)
        if self._finish is None:
            return
        if self._failure is not None and self._failure.result is not None:
            self._finish(self._failure.result, self._failure)
        elif not self._failed:
            self._finish(self.result(), None)

    def __enter__(self) -> Session:
        return self

    def __exit__(self, *_: object) -> None:
        """Close the session."""
        self.close()

    def close(self) -> None:
        """End the listeners, then terminate and free the FMUs. A closed session cannot step.

        Raises:
            SimulationError: A listener fails at its end; with the result.
        """
        self._closed = True
        with same_folder(), self._failures():
            self._stack.close()

    @property
    def time(self) -> float:
        """The communication point reached, in s."""
        return in_seconds(self.system.time_ns(self.master.steps_done))

    @property
    def complete(self) -> bool:
        """True if the stop time is reached without a failure."""
        return self.master.steps_done == self.system.total_steps and not self._failed

    @property
    def ended_at(self) -> float | None:
        """The time in s at which the run ended before its stop time, as an FMU or `until` had it.

        None where it is not there yet, goes to its stop time, or failed.
        """
        end = self.master.total_steps
        ended_early = self.master.steps_done == end < self.system.total_steps
        return self.time if ended_early and not self._failed else None

    @property
    def _is_over(self) -> bool:
        """True if the run came to its end, at the stop time or before, without a failure."""
        return self.complete or self.ended_at is not None

    def step(self, steps: int = 1) -> bool:
        """Do a number of communication steps, or fewer where the run ends before.

        Args:
            steps: How many, at least 1.

        Returns:
            False if the run had already ended. That is the stop time or one that
            an FMU asked for, or `halt` ended the wait for the first step in real time.

        Raises:
            InputError: The session is closed or broken: after a failure or an interruption such as
                Ctrl-C the FMUs are not at one time.
            SimulationError: An FMU fails, or a signal runs away; with what was recorded as its
                result.
        """
        _check_count("steps", steps)
        dispatcher = self._record.dispatcher
        start, listeners_took = time.perf_counter(), dispatcher.listener_seconds
        try:
            return self._call_fmus(partial(self.master.advance, int(steps))) > 0
        finally:
            self._wall_time += time.perf_counter() - start
            if not self.pacer:  # which has time for the listeners
                self._wall_time -= dispatcher.listener_seconds - listeners_took

    def _call_fmus(self, action: Callable[[], Returned]) -> Returned:
        """Return what an action returns that calls FMUs; whatever it raises breaks the session.

        Refuses a session whose FMUs must not be called.
        """
        if self._closed or self._failed:
            state = "closed" if self._closed else "broken off by a failure or an interruption"
            raise InputError(f"{self.system.name}: the session is {state}; must be a new one")
        try:
            if self._fmus_leave_process_alone:
                return action()
            with guarded_process(), self._failures():
                return action()
        except InputError:  # which was found before any FMU was called
            raise
        except BaseException as error:
            self._break(error)
            raise

    def _break(self, error: BaseException) -> None:
        """An error broke the session; a SimulationError gets what was recorded as its result."""
        self._failed = True
        if isinstance(error, SimulationError):
            self._failure = error
            error.result = error.result or self.result()

    def shown_by(self, show: Callable[[], None]) -> int:
        """Have a function called from time to time while a long step goes on.

        Args:
            show: Called without arguments, to show how far the run is.

        Returns:
            How many steps are best done at first: one, or all where a run in real time needs no
            look in between.
        """
        if not isinstance(self.master, PacedMaster):
            return 1
        self.master.meanwhile = show
        return self.master.total_steps if self.master.runs_alone else 1

    def __getitem__(self, name: str) -> float:
        """The present value of any variable, in the unit of its FMU.

        A connected input has what was passed to its FMU last, behind its faults. What is neither
        recorded nor connected is asked of the FMU.

        Args:
            name: A name like "plant.gap[1]" or "plant.force[1]".

        Returns:
            The number; 0.0 or 1.0 of a Boolean. The text of a String is that of text().

        Raises:
            InputError: There is no such variable, or it is a String.
        """
        slot = self._slots_read.get(name)
        if slot is not None:  # as loops ask for the same again and again
            return float(self.master.values[slot])
        value = self._value(name)
        if isinstance(value, str):
            raise InputError(f"{name!r}: is a String; must be read by session.text({name!r})")
        return value

    def text(self, name: str) -> str:
        """The present text of a String.

        Args:
            name: A name like "plant.state".

        Returns:
            The text.

        Raises:
            InputError: There is no such variable, or it is a number.
        """
        value = self._value(name)
        if not isinstance(value, str):
            raise InputError(f"{name!r}: is a number; must be read by session[{name!r}]")
        return value

    def _value(self, name: str) -> float | str:
        """The value now of a variable, from the last row, or else from its FMU."""
        master = self.master
        port, conversion = read_at(self.system, as_signal(f"signal {name!r}", name))
        if port not in master.slots:
            return self._value_of_fmu(port, name)
        slot = master.slots[port]
        value = float(master.values[slot])
        if port in master.texts:
            return master.texts[port].listed[int(value)]
        if conversion != IDENTITY:
            return conversion(value)
        self._slots_read[name] = slot
        return value

    def _value_of_fmu(self, port: Port, name: str) -> float | str:
        """The value now of a variable that is in no row; InputError where there is none."""
        component = self.system.by_name.get(port.component)
        variable = component and component.interface.by_name.get(port.variable)
        if not variable or not variable.supported:
            valid = nearest(name, self._ipython_key_completions_())
            raise InputError(f"{name!r}: no such signal; {valid}")
        value = self._call_fmus(lambda: self.master.read(port))
        return value if isinstance(value, str) else float(value)

    def _ipython_key_completions_(self) -> list[str]:
        """The names of what can be read, for Tab behind a bracket in a notebook."""
        readable = [
            f"{component.name}.{variable.name}"
            for component in self.system.components
            for variable in component.interface.variables
            if variable.supported
        ]
        return list(dict.fromkeys([*self.system.outputs, *map(str, self.master.slots), *readable]))

    def __repr__(self) -> str:
        """How far it is."""
        state = ""
        if self._closed:
            state = ", closed"
        elif self._failed:
            state = ", broken off"
        stop = in_seconds(self.system.stop_ns)
        return f"Session of {self.system.name} at {self.time:.6g} of {stop:.6g} s{state}"

    def set(self, name: str, value: Given) -> None:
        """Set a tunable parameter, or an input without a connection, from now on.

        Args:
            name: A name like "sensor_2.reflectance"; that of an array sets all its elements.
            value: A value in the unit of its variable, of an array a list; or one with its unit, as
                "50 mm", (50, "mm") or a Quantity.

        Raises:
            InputError: There is no such variable that may be set now, or the value does not fit it.
            SimulationError: Its FMU fails.
        """
        self.set_all({name: value})

    def set_all(self, values: Mapping[str, Given]) -> None:
        """Set several variables as set() does; faster, as each FMU gets its numbers at once.

        Args:
            values: Values by names like "plant.force[1]".

        Raises:
            InputError: There is no such variable that may be set now, or a value does not fit; what
                came before it may be set.
            SimulationError: An FMU fails.
        """
        overrides = behind_connectors(self.system, as_overrides(values, "set: {place}"))
        by_place = {override.place: override.value for override in overrides}
        scenario, master = self.master.scenario, self.master
        self._call_fmus(lambda: scenario.set(by_place, master.steps_done))

    def save(self) -> State:
        """Keep the present state, to which restore() goes back.

        It is what was recorded, and all that decides how the run goes on. It is kept until nothing
        refers to it, at most until the session is closed.

        Returns:
            The state, for restore().

        Raises:
            InputError: An FMU does not give its state, the run is in real time, or listeners record
                it elsewhere.
            SimulationError: An FMU fails.
        """
        self._check_that_it_can_go_back()
        master = self._call_fmus(self.master.saved)
        return State(self, self.time, self.system, master, self._record.saved())

    def _check_that_it_can_go_back(self) -> None:
        if self.pacer:
            raise InputError(f"{self.system.name}: a run in real time cannot go back")
        if self._requests is not None:
            raise InputError(f"{self.system.name}: a run that takes requests cannot go back")
        if self._has_listeners:
            raise InputError(
                f"{self.system.name}: listeners cannot give rows back; must be a session without"
            )

    def restore(self, state: State) -> None:
        """Go back to a state of this session, as often as you like, also after a failure.

        The run goes on from there with the same bits, as if what came after had not been.

        Args:
            state: What save() of this session returned.

        Raises:
            InputError: The state is of another session.
            SimulationError: An FMU fails, or has failed in such a way that it refuses any further
                call.
        """
        if not isinstance(state, State) or state.session is not self:
            raise InputError(f"{self.system.name}: {state!r}: must be a state of this session")
        self._go_back(state.master, state.records)
        if state.system is not self.system:
            self._take_start_values(state.system)

    def _go_back(self, master: Any, records: Sequence[Any]) -> None:
        """Go back to these saved states of the master and the record."""
        self._mend()
        self._call_fmus(partial(self.master.restore, master))
        self._record.restore(records)

    def _mend(self) -> None:
        """Forget the failure that broke the session, as it goes back to before that."""
        if not self._closed:
            self._failed, self._failure = False, None

    def reset(self, values: Mapping[str, Given] | None = None) -> None:
        """Go back to the start of the run, as a new session would begin, without loading again.

        It does so after a failure or an interruption, too, unless an FMU refuses any further call.

        Args:
            values: Other start values by names like "plant.object_width", as System.with_values()
                takes them. They stay for the resets after this one. None changes nothing.

        Raises:
            InputError: The run is in real time, or listeners record it; a value does not fit; or an
                FMU refuses its initialisation, which breaks the session until the next reset.
            SimulationError: An FMU fails.
        """
        self._check_that_it_can_go_back()
        if values or self._start is None:
            system = self._with_values(values or {})
            self._mend()
            self._call_fmus(partial(self._initialise_anew, system))
        else:
            self._go_back(*self._start)
        self._wall_time = 0.0

    def _with_values(self, values: Mapping[str, Given]) -> System:
        """The system with other start values; InputError for what is none, or changes its signals.

        Then the FMUs that are loaded would not do.
        """
        system = self.system.with_values(values) if values else self.system
        check_groups(system)  # refuses before any FMU is called
        if not differs_in_values_alone(system, self.system):
            raise InputError(
                f"reset: {', '.join(values)}: must be start values that change no size of an array"
            )
        return system

    def _initialise_anew(self, system: System) -> None:
        """Reset all FMUs and initialise them with the start values of the system."""
        self._record.restart()
        self._initialise_with(system)
        with suppress(InputError):  # an FMU that does not give its state is reset each time
            self._start = self.master.saved(), self._record.saved()

    def _initialise_with(self, system: System) -> None:
        """As _initialise_anew(), but for the rows, and without a state to go back to."""
        self._failed = True
        self.master.reset(system)
        self._take_start_values(system)
        self.master.initialise()
        self._failed = False

    def _take_start_values(self, system: System) -> None:
        """Be a session of the system with these start values from now on."""
        self._start = None
        self._record.take_start_values(system)
        if system is not self.system:
            self._log.describe(system)
        self.system = system

    def end_here(self, reason: str) -> None:
        """End the run at the communication point reached, before its stop time.

        Args:
            reason: Why, a line for the log.
        """
        self.master.end_here(reason)

    def result(self) -> Result:
        """Return what was recorded until now; the session can go on.

        Returns:
            The result, as that of simulate(). What is recorded later does not change it.

        Raises:
            SimulationError: A listener does not take its rows; with the result.
        """
        with self._failures():
            self.master.hand_on()
        master, record = self.master, self._record
        time, columns = record.columns()
        windows = record.windows(len(time))
        units = {signal.name: signal.unit for signal in record.signals}
        descriptions = {signal.name: signal.description for signal in record.signals}
        timing = None
        if self.pacer:
            privileges = self._privileges
            timing = self.pacer.meter.timing(privileges.granted, privileges.refused)
        result = Result(
            with_events(record.settings, master.scenario.done_requests),
            time,
            columns,
            units,
            self._wall_time,
            self.complete,
            descriptions=descriptions,
            rejections=dict(master.rejections),
            log=self._log.lines(master, self._is_over),
            timing=timing,
            more_metrics=record.metrics,
            to_si=record.conversions(),
            of_every_step=record.figures_of_every_row(),
            ended_at=self.ended_at,
            limits=master.watches.trips(),
            initialised_anew=tuple(master.renewed),
            peers=master.peers,
            components=self.system.components,
            steps_done=master.steps_done if record.is_triggered else None,
        )
        return replace(result, windows=tuple(result.part(*window) for window in windows))


def with_twins(system: System, progress: bool = False) -> System:
    """The system with its FMUs as their files are now, and the native twins that run.

    With progress standard error shows that they are compiled.
    """
    if not all(component.is_current for component in system.components):
        components = tuple(replace(component) for component in system.components)
        system = replace(system, components=components)
    if all(component.is_chosen for component in system.components):
        return system
    with Progress("compiling native FMUs, once for these sources", unit="", shown=progress):
        return system.with_natives(twins_of_run(system))


def differs_in_values_alone(system: System, running: System) -> bool:
    """True if two systems differ at most in values, so that the FMUs that are loaded fit both."""
    if not _are_alike(system, running, but="components"):
        return False
    new_ones, old_ones = system.components, running.components
    return len(new_ones) == len(old_ones) and all(
        new is old or (new.loaded is old.loaded and _are_alike(new, old, but="values"))
        for new, old in zip(new_ones, old_ones, strict=True)
    )


def _are_alike(new: System | Component, old: System | Component, but: str) -> bool:
    """True if all attributes are equal but one."""
    pairs = ((getattr(new, f.name), getattr(old, f.name)) for f in fields(new) if f.name != but)
    return all(a is b or a == b for a, b in pairs)


def _description(component: Component) -> str:
    """Which FMU runs as a component, and how, in words."""
    fmu = component.loaded
    kind = "Python" if fmu.python else "a binary"
    process = ", in its own process" if component.isolation == "process" else ""
    return f"{component.name}: {fmu.path}, FMI {fmu.version}, {kind}{process}"


def _check_count(name: str, count: object) -> None:
    """InputError for what is no number of steps."""
    if type(count) is int and 1 <= count <= MAX_STEPS:  # as a rule, and fast
        return
    is_whole = isinstance(count, Integral) and not isinstance(count, bool)
    if not is_whole or not 1 <= int(count) <= MAX_STEPS:  # type: ignore[call-overload]
        raise InputError(f"{name} = {count!r}: must be a whole number from 1 to {MAX_STEPS}")
