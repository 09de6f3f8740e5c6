"""Runs a system: to its end with simulate(), or step by step with simulate.session()."""

import logging
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, fields, replace
from functools import partial
from numbers import Integral
from pathlib import Path
from typing import Any, TypeVar

from ..base.errors import InputError, RunInterruptedError, SimulationError, nearest
from ..base.files import CURRENT_FOLDER
from ..base.interruption import interruptible, raised
from ..base.progress import DELAY, Progress, phase
from ..base.text import counted
from ..exchange.dispatch import Dispatcher
from ..exchange.listener import Listener
from ..fmi.instance import Instance
from ..fmi.process import load
from ..interface.interface import Given
from ..interface.units import IDENTITY
from ..metrics.in_si import in_si
from ..metrics.metric import (
    Function,
    Metric,
    Signals,
    check_groups,
    chosen,
    measure,
    metrics_of,
    needed,
)
from ..realtime.pacer import Pacer, Privileges, long_waits, privileges
from ..recording.memory import EveryRow, MemoryListener
from ..recording.proxies import of_proxies, proxy_figures, proxy_lines
from ..recording.result import Known, Result
from ..system.connectors import given_by_connectors, read_at
from ..system.declared_steps import check_declared_steps
from ..system.description import System, as_system
from ..system.native import needed_twins
from ..system.parts import Component, Port, Realtime, as_signal
from ..system.settings import run_settings, start_values
from ..system.times import TimeInput, in_seconds
from ..system.validity import remarks
from .engine import Engine
from .master import Master
from .scenario import NO_CUTS, Cut

LOGGER = logging.getLogger(__name__)
"""Gets what the operating system does not permit, and at the level INFO what a run does."""

MOST = 2**62
"""The highest number of steps, far beyond the longest run."""

Finish = Callable[[Result, SimulationError | None], object]
"""Takes the result of a run that ended, and the error that ended it."""

LOOK = 0.1
"""s of wall time between two looks at the progress bar and at Ctrl-C."""

T = TypeVar("T")

GROWTH = 8
"""Times as many steps as before one look that there are at most before the next."""


@dataclass(frozen=True, slots=True, eq=False)
class State:
    """The state of a session at a time in s, from Session.save()."""

    session: "Session" = field(repr=False)
    time: float
    system: System = field(repr=False)
    master: Any = field(repr=False)
    records: Sequence[Any] = field(repr=False)


class Session:
    """A run that its user advances. A context manager: leaving it ends and frees the FMUs.

    In real time its schedule begins with the first step.
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
        steered: bool = True,
    ) -> None:
        """Load and initialise; see simulate() for the arguments and errors.

        A cut of a connection, by its input, gets each value that is passed there, and says what is
        passed in its place. steered says that set() may be called, so inputs without a source are
        recorded by default.
        """
        system = as_system(system, "simulate").with_experiment(step, stop, scheme, diverging)
        system = system.as_steered() if steered else system
        if not all(c.is_current for c in system.components):
            system = replace(system, components=tuple(replace(c) for c in system.components))
        system = system.with_natives(needed_twins(system))
        _check_count("every", every)
        observed = system.shown
        self._metrics = chosen(metrics, system.metrics, observed, system.roles)
        self._asked = metrics_of(system.metrics, self._metrics)
        self._notes = check_groups(system)
        self._in_si = in_si(system, self._asked)  # refuses before, not after
        self.system = system
        self._memory = MemoryListener(every, bool(realtime))
        self._has_listeners = bool(listeners)
        self._whole: EveryRow | None = None
        needs = needed(self._asked, observed, system.roles) | of_proxies(observed)
        if every > 1 or not needs <= system.kept:
            self._whole = EveryRow(needs)
        self._wall_time = 0.0
        self._failed = False
        self._failure: SimulationError | None = None
        self._initialised = False
        self._closed = False
        self._note, self._finish = note, finish
        self._noted = len(system.notes)  # known to who has read it
        self.halt = threading.Event()
        """Set, it ends the waiting of a run in real time, at a communication point."""
        paced = system.realtime if realtime is True else realtime
        self.pacer = Pacer(system, paced, self.halt.is_set) if paced else None
        self._privileges = Privileges()
        self._fmus_behave = False
        self._places: dict[str, int] = {}
        """Where in the values the numbers are that were read before, as they are."""
        self._start: tuple[Any, Sequence[Any]] | None = None
        """What save() would give at the start, once it was reset to these start values."""
        self._stack = ExitStack()
        check_declared_steps(system)
        waits = long_waits(system, self.pacer.realtime) if self.pacer else []
        self._remarks = (*system.notes, *self._notes, *system.once(remarks), *waits)
        self._tell(self._remarks)
        try:
            with _guarded():
                self._begin(listeners, every, engine, cuts)
            self._tell(self._early())
            if paced:
                self._ask_for_privileges(paced)
        except BaseException:
            self._stack.close()
            raise

    def _begin(
        self,
        listeners: Sequence[Listener],
        every: int,
        engine: Engine,
        cuts: Mapping[Port, Cut],
    ) -> None:
        """Load the FMUs, initialise them and hand on the row of t = 0; the stack undoes it all."""
        self._instances: list[Instance] = []
        self._stack.callback(self._close_instances)
        with phase(f"loading {len(self.system.components)} FMUs"):
            self._load_instances()
        self.master = Master(
            self.system,
            self._instances,
            lambda *rows: self._dispatch(*rows),
            engine,
            self.pacer,
            self._renew_instances,
            cuts,
        )
        slots, texts = self.master.slots, self.master.texts
        receivers = (self._memory, *listeners)
        self._dispatch = Dispatcher(self.system, slots, receivers, every, texts, self._whole)
        self._records: list[Dispatcher | MemoryListener | EveryRow] = [
            self._dispatch,
            self._memory,
            *([self._whole] if self._whole else []),
        ]
        if self.pacer:
            self.pacer.spare = self._dispatch.spare
        self._blank = [record.saved() for record in self._records]
        self._stack.callback(self._hand_over)  # before the FMUs are ended, and after:
        self._stack.callback(self._end)
        with phase("initialising"), self._failures():  # where the row of t = 0 is not finite
            self.master.initialise()
        self._initialised = True
        self._fmus_behave = all(map(_leaves_the_process_alone, self.system.components))

    def _load_instances(self) -> None:
        for component in self.system.components:
            LOGGER.info("%s", _loaded(component))
            self._instances.append(load(component))

    def _close_instances(self) -> None:
        """Close them in the opposite order, all of them even where one fails."""
        with ExitStack() as stack:
            for instance in self._instances:
                stack.callback(instance.close)
        self._instances.clear()

    def _renew_instances(self) -> Sequence[Instance]:
        """Other instances of the same FMUs, for a loop that is initialised anew."""
        self._close_instances()
        self._load_instances()
        return self._instances

    def _ask_for_privileges(self, realtime: Realtime) -> None:
        """What a run in real time asks of the system; what that refuses is a warning."""
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
        """Hand on what is left, and end the listeners, even where that fails."""
        with self._failures():
            try:
                self.master.hand_on()
            except BaseException:
                self._failed = True
                raise
            finally:
                self._dispatch.end(self.complete)

    def _hand_over(self) -> None:
        """Tell the log and hand the result on: an FMU may take the process along as it ends."""
        if not self._initialised and self._failure is None:
            return
        if self._note is not None:
            self._tell(self._log())
        if self._finish is None:
            return
        if self._failure is not None and self._failure.result is not None:
            self._finish(self._failure.result, self._failure)
        elif not self._failed:
            self._finish(self.result(), None)

    def __enter__(self) -> "Session":
        return self

    def __exit__(self, *_: object) -> None:
        """Close the session."""
        self.close()

    def close(self) -> None:
        """End the listeners, then terminate and free the FMUs. A closed session cannot step.

        SimulationError, with the result, where a listener fails at its end.
        """
        self._closed = True
        with _folder_kept(), self._failures():
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
        """The time in s of the end that an FMU asked for before the stop time, if that is reached.

        None also after a failure.
        """
        end = self.master.total_steps
        early = self.master.steps_done == end < self.system.total_steps
        return self.time if early and not self._failed else None

    def step(self, steps: int = 1) -> bool:
        """Do a number of communication steps, fewer at the end; False if none was done.

        None is where the end was reached before, be it the stop time or one that an FMU asked for,
        or where halt ended the wait for the first.

        SimulationError, with what was recorded as its result, where an FMU fails. After that, and
        after an interruption such as Ctrl-C, the FMUs are not at one time: InputError.
        """
        _check_count("steps", steps)
        start, took = time.perf_counter(), self._dispatch.took
        try:
            return self._called(partial(self.master.advance, int(steps))) > 0
        finally:
            self._wall_time += time.perf_counter() - start
            if not self.pacer:  # which has time for the listeners
                self._wall_time -= self._dispatch.took - took

    def _called(self, act: Callable[[], T]) -> T:
        """What `act` returns, which calls FMUs; whatever is raised in it breaks the session.

        Refuses a session whose FMUs must not be called.
        """
        if self._closed or self._failed:
            state = "closed" if self._closed else "broken off by a failure or an interruption"
            raise InputError(f"{self.system.name}: the session is {state}; must be a new one")
        try:
            if self._fmus_behave:
                return act()
            with _guarded(), self._failures():
                return act()
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
        """Have `show` called while a long step goes on; returns the steps that are best at first.

        These are all of them where a run in real time needs no look in between.
        """
        self.master.meanwhile = show
        return self.master.total_steps if self.master.runs_alone else 1

    def __getitem__(self, name: str) -> float:
        """The value now of any variable, by a name like 'plant.gap[1]' or 'plant.force[1]'.

        A connected input has what was passed to its FMU last, behind its faults; what is neither
        recorded nor connected is asked of the FMU. Of a Boolean it is 0.0 or 1.0; the text of a
        String is that of text(). InputError where there is no such variable.
        """
        place = self._places.get(name)
        if place is not None:  # as loops ask for the same again and again
            return float(self.master.values[place])
        value = self._now(name)
        if isinstance(value, str):
            raise InputError(f"{name!r}: is a String; must be read by session.text({name!r})")
        return value

    def text(self, name: str) -> str:
        """The text now of a String, by its name; InputError where there is no such variable."""
        value = self._now(name)
        if not isinstance(value, str):
            raise InputError(f"{name!r}: is a number; must be read by session[{name!r}]")
        return value

    def _now(self, name: str) -> float | str:
        """The value now of a variable, from the last row, or else from its FMU."""
        master = self.master
        port, change = read_at(self.system, as_signal(f"signal {name!r}", name))
        if port not in master.slots:
            component = self.system.by_name.get(port.component)
            variable = component and component.interface.by_name.get(port.variable)
            if not variable or not variable.supported:
                valid = nearest(name, self._ipython_key_completions_())
                raise InputError(f"{name!r}: no such signal; {valid}")
            asked = self._called(lambda: master.read(port))
            return asked if isinstance(asked, str) else float(asked)
        value = float(master.values[master.slots[port]])
        if port in master.texts:
            return master.texts[port].listed[int(value)]
        if change != IDENTITY:
            return change(value)
        self._places[name] = master.slots[port]
        return value

    def _ipython_key_completions_(self) -> list[str]:
        """The names of what can be read, for Tab behind a bracket in a notebook."""
        readable = [
            f"{component.name}.{v.name}"
            for component in self.system.components
            for v in component.interface.variables
            if v.supported
        ]
        return list(dict.fromkeys([*self.system.outputs, *map(str, self.master.slots), *readable]))

    def __repr__(self) -> str:
        """How far it is."""
        state = ", closed" if self._closed else ", broken off" if self._failed else ""
        stop = in_seconds(self.system.stop_ns)
        return f"Session of {self.system.name} at {self.time:.6g} of {stop:.6g} s{state}"

    def set(self, name: str, value: Given) -> None:
        """Set a tunable parameter or an input without a connection, or a whole array of such.

        It has the value from now on.
        InputError where there is none of that name, or where the value does not fit; errors of
        FMUs as of step().
        """
        values, _ = given_by_connectors(self.system, {name: value}, "set: ".__add__)

        def set_all() -> None:
            for variable, own in values.items():
                self.master.scenario.set(variable, own, self.master.steps_done)

        self._called(set_all)

    def save(self) -> "State":
        """The state of now, to which restore() goes back: what is recorded, and all that decides
        how the run goes on.

        It is kept until nothing refers to it, at most until the session is closed. InputError where
        an FMU does not give its state, in real time, and where listeners record elsewhere; errors
        of FMUs as of step().
        """
        self._check_that_it_can_go_back()
        master = self._called(self.master.saved)
        records = [record.saved() for record in self._records]
        return State(self, self.time, self.system, master, records)

    def _check_that_it_can_go_back(self) -> None:
        if self.pacer:
            raise InputError(f"{self.system.name}: a run in real time cannot go back")
        if self._has_listeners:
            raise InputError(
                f"{self.system.name}: what listeners have got cannot be taken back; must be a "
                "session without"
            )

    def restore(self, state: "State") -> None:
        """Go back to a state of this session that save() gave, as often as you like.

        The run goes on from there with the same bits, as if what came after had not been. So it
        does after a failure or an interruption, unless an FMU refuses any further call.
        InputError for a state of another session; SimulationError where an FMU fails.
        """
        if not isinstance(state, State) or state.session is not self:
            raise InputError(f"{self.system.name}: {state!r}: must be a state of this session")
        self._go_back(state.master, state.records)
        if state.system is not self.system:
            self._take_values_of(state.system)

    def _go_back(self, master: Any, records: Sequence[Any]) -> None:
        if not self._closed:
            self._failed, self._failure = False, None
        self._called(partial(self.master.restore, master))
        self._restore_records(records)

    def reset(self, values: Mapping[str, Given] | None = None) -> None:
        """Go back to the start of the run, as a new session would begin, without loading anew.

        With other start values, where some are given, which stay for the resets after it. So it
        does after a failure or an interruption, unless an FMU refuses any further call. InputError
        where save() refuses for other reasons than the FMUs, for values that do not fit, or where
        an FMU refuses its initialisation, which breaks the session until it is reset.
        """
        self._check_that_it_can_go_back()
        if values or self._start is None:
            system = self._with_values(values or {})
            if not self._closed:
                self._failed, self._failure = False, None
            self._called(partial(self._begin_anew, system))
        else:
            self._go_back(*self._start)
        self._wall_time = 0.0

    def _with_values(self, values: Mapping[str, Given]) -> System:
        """The system with other start values; InputError for what is none, or changes its signals.

        Then the FMUs that are loaded would not do.
        """
        system = self.system.with_values(values) if values else self.system
        check_groups(system)  # refuses before any FMU is called
        names = [f.name for f in fields(system) if f.name != "components"]
        both = [(getattr(system, name), getattr(self.system, name)) for name in names]
        same = all(new is old or new == old for new, old in both)
        pairs = zip(system.components, self.system.components, strict=True)
        if not same or any(new.loaded is not old.loaded for new, old in pairs):
            raise InputError(
                f"reset: {', '.join(values)}: must be start values that change no size of an array"
            )
        return system

    def _begin_anew(self, system: System) -> None:
        self._failed = True
        self.master.reset(system)
        self._restore_records(self._blank)
        self._take_values_of(system)
        self.master.initialise()
        self._failed = False
        with suppress(InputError):  # an FMU that does not give its state is reset each time
            self._start = self.master.saved(), [record.saved() for record in self._records]

    def _take_values_of(self, system: System) -> None:
        """Be a session of the system with these start values, as far as these are told."""
        if system is not self.system:
            self._noted = len(system.notes)  # what is known of other values is told at the end
        self.system, self._start = system, None
        self._dispatch.settings = run_settings(system)
        self._notes = check_groups(system)
        self._remarks = (*system.notes, *self._notes, *system.once(remarks))

    def _restore_records(self, records: Sequence[Any]) -> None:
        for record, saved in zip(self._records, records, strict=True):
            record.restore(saved)

    def end_here(self, why: str) -> None:
        """End the run at the communication point reached, before its stop time.

        It has come to its end then; `why` is for the log.
        """
        self.master.end_here(why)

    def result(self) -> Result:
        """Return the result recorded until now.

        SimulationError, with the result, where a listener does not take it.
        """
        with self._failures():
            self.master.hand_on()
        master, signals, asked = self.master, self._dispatch.signals, self._privileges
        pacer = self.pacer
        time, columns = self._memory.columns(self._dispatch.pending)
        return Result(
            self._dispatch.settings,
            time,
            columns,
            {s.name: s.unit for s in signals},
            self._wall_time,
            self.complete,
            descriptions={s.name: s.description for s in signals},
            rejections=dict(master.rejections),
            log=self._log(),
            timing=pacer.meter.timing(asked.granted, asked.refused) if pacer else None,
            more_metrics=self._metrics,
            to_si={n: c for n, c in self._in_si.conversions.items() if n in columns},
            known=self._known(),
            ended_at=self.ended_at,
            limits=master.watches.trips(),
            initialised_anew=tuple(master.renewed),
            peers=master.peers,
            components=self.system.components,
        )

    def _of_proxies(self, step: float) -> list[str]:
        """Remarks on the proxies, a line each."""
        if not of_proxies(self.system.observed):
            return []
        kept = self._whole if self._whole and not self._whole.lost else self._memory
        time, columns = kept.columns()
        return proxy_lines(time, columns, step)

    def _known(self) -> Known | None:
        """What is worked out of every step, where fewer rows are recorded."""
        if self._whole is None or self._whole.lost:
            return None
        time, columns = self._whole.columns()
        system, to_si = self.system, self._in_si.conversions
        signals = Signals(time, columns, system.roles, to_si, start_values(system))
        return Known(measure(signals, self._asked), proxy_figures(time, columns))

    def _tell(self, log: Sequence[str]) -> None:
        """Hand on the lines of the log that are new; `log` is all of it so far."""
        if self._note is not None:
            for line in log[self._noted :]:
                self._note(line)
        self._noted = len(log)

    def _early(self) -> tuple[str, ...]:
        """The lines of the log that are known before the first step."""
        return (*self._remarks, *self._in_si.notes, *self.master.log)

    def _log(self) -> tuple[str, ...]:
        master = self.master
        rejected = (
            f"{name}: {counted(r.count, 'step')} discarded or ended early, taken in parts, "
            f"the first at t = {r.first:.9g} s"
            for name, r in master.rejections.items()
        )
        whole = self.complete or self.ended_at is not None
        pending = master.scenario.pending() if whole else ()
        step, lost = in_seconds(self.system.step_ns), self._whole and self._whole.lost
        return (
            *self._early(),
            *self._dispatch.log,
            *master.scenario.log,
            *master.watches.log,
            *master.warnings(),
            *rejected,
            *master.ends,
            *pending,
            *self._of_proxies(step),
            *([f"{lost}: the metrics are of the rows that were recorded"] if lost else []),
        )


class Simulate:
    """simulate(): a whole run; simulate.session(): the same, step by step."""

    def __call__(
        self,
        system: System | str | Path,
        *,
        step: TimeInput | None = None,
        stop: TimeInput | None = None,
        scheme: str | None = None,
        progress: bool | str = False,
        every: int = 1,
        listeners: Sequence[Listener] = (),
        engine: Engine = "auto",
        realtime: Realtime | bool = False,
        metrics: Sequence[Metric | Function | str] = (),
        diverging: str | None = None,
        note: Callable[[str], None] | None = None,
        finish: Finish | None = None,
        until: Callable[[Session], bool] | None = None,
    ) -> Result:
        """Run a system, or that of a system file, to its stop time; return what it records at every
        communication point.

        These are its outputs, or what System.with_record() names.

        step and stop in s and the scheme replace those of the system. progress shows on standard
        error how far it is, by the name of the system or the one given. every keeps only each n-th
        communication point, and the last. listeners get what is kept while it is recorded. engine
        is "python", "compiled" (needs a C compiler) or "auto", compiled where that pays; the
        results have the same bits. realtime paces the run by the clock, as the system says, or as
        it says itself: the result has a timing, and the same bits.

        metrics are worked out beside those of the system: from @metric, or functions of their own
        name; a name among them says that the result must have that metric. diverging, "stop" or
        "continue", replaces that of the system. note gets the lines of the log but for
        system.notes: what is known of the system and of t = 0 before the first step, the others at
        the end, also after a failure. finish gets the result, and the error that ended the run if
        there is one, before the FMUs are terminated and freed, in which they may crash.

        until is asked at each communication point, of the session, and ends the run there where it
        is true: ended_at of the result is that time, and the log has a line. A limit does the same
        for a condition that is known before, in the loop itself.

        Ctrl-C ends the run in good order, then is a KeyboardInterrupt: once FMUs are loaded a
        RunInterruptedError, with what was recorded as its result.
        InputError where an FMU does not load or refuses its parameters; SimulationError, with what
        was recorded as its result, where one fails on the way, or a signal runs away.
        """
        if until is not None and not callable(until):
            raise InputError(f"until = {until!r}: must be a function of the session")
        results: list[Result] = []

        def keep(result: Result, error: SimulationError | None) -> None:
            results.append(result)
            if finish is not None:
                finish(result, error)

        try:
            with (
                Session(
                    system,
                    step=step,
                    stop=stop,
                    scheme=scheme,
                    every=every,
                    listeners=listeners,
                    engine=engine,
                    realtime=realtime,
                    metrics=metrics,
                    diverging=diverging,
                    note=note,
                    finish=keep,
                    steered=False,
                ) as session,
                phase(f"{session.system.name} to {in_seconds(session.system.stop_ns):g} s"),
            ):
                _drive(session, progress, until)
        except KeyboardInterrupt as interrupt:
            if not results:
                raise
            raise RunInterruptedError(results[0]) from interrupt
        return results[0]

    session = Session


simulate = Simulate()


def _loaded(component: Component) -> str:
    """Which FMU runs as a component, and how, in words."""
    fmu = component.loaded
    kind = "Python" if fmu.python else "a binary"
    place = ", in a process of its own" if component.isolation == "process" else ""
    return f"{component.name}: {fmu.path}, FMI {fmu.version}, {kind}{place}"


def _check_count(name: str, count: object) -> None:
    if type(count) is int and 1 <= count <= MOST:  # as a rule, and fast
        return
    if isinstance(count, bool) or not isinstance(count, Integral) or not 1 <= int(count) <= MOST:
        raise InputError(f"{name} = {count!r}: must be a whole number from 1 to {MOST}")


def _leaves_the_process_alone(component: Component) -> bool:
    """True for an FMU elsewhere, or of our own C: it takes no Ctrl-C, and goes to no folder."""
    fmu = component.loaded
    return component.isolation == "process" or (fmu.ours and not fmu.python)


@contextmanager
def _guarded() -> Iterator[None]:
    """Ctrl-C is one, and the current folder the same, whatever FMUs in this process do."""
    with interruptible(), _folder_kept():
        yield


@contextmanager
def _folder_kept() -> Iterator[None]:
    """Go back to the current folder from wherever an FMU went."""
    with CURRENT_FOLDER:
        here = os.getcwd()  # noqa: PTH109 - twice in a step, so as fast as can be
    try:
        yield
    finally:
        with CURRENT_FOLDER:
            if os.getcwd() != here:  # noqa: PTH109
                os.chdir(here)


def _drive(session: Session, progress: bool | str, until: Callable[[Session], bool] | None) -> None:
    """Have it step to its end; KeyboardInterrupt, between two steps, at Ctrl-C."""
    begin, end = map(in_seconds, (session.system.start_ns, session.system.stop_ns))
    with (
        raised(session.halt.set),
        Progress(
            progress if isinstance(progress, str) else session.system.name,
            end - begin,
            unit="s",
            shown=bool(progress),
            delay=0.0 if session.pacer else DELAY,
            ticking=False,  # a thread more would be felt in real time
        ) as bar,
    ):

        def show() -> None:
            if session.pacer and not bar.disable:
                bar.set_postfix_str(session.pacer.meter.live(), refresh=False)
            bar.update(session.time - begin - bar.n)

        if until is None:
            _drive_on(session, show)
        else:
            _drive_until(session, until, show)
        if session.pacer:
            bar.set_postfix_str(session.pacer.meter.live(), refresh=False)


def _drive_on(session: Session, show: Callable[[], None]) -> None:
    """Have it step to its end, with a look now and then."""
    steps, start = session.shown_by(show), time.perf_counter()
    while not session.halt.is_set() and session.step(steps):
        show()
        now = time.perf_counter()
        steps = max(1, min(GROWTH * steps, int(steps * LOOK / (now - start))))
        start = now


def _drive_until(
    session: Session, until: Callable[[Session], bool], show: Callable[[], None]
) -> None:
    """Have it step, one at a time, to where `until` is true, or to its end."""
    shown = time.perf_counter()
    while not session.halt.is_set():
        at = session.master.steps_done
        wanted = until(session)
        if session.master.steps_done != at:
            raise InputError(
                "until: has stepped or reset the session; must only look at it, and set values"
            )
        if wanted:
            session.end_here(f"until {getattr(until, '__name__', 'it')} was true: the run ended")
            return
        if not session.step():
            return
        if (now := time.perf_counter()) - shown > LOOK:
            show()
            shown = now
