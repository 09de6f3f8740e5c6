"""The fixed-step master: initialise, then run the loop in chunks and hand its rows on.

A step that an FMU rejects, since it discards it or ends it early, is finished in parts, as is one
with events that the FMU handles with its master.

The schemes, components with a longer step and time are in docs/system_files.md.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.checks import exact
from ..base.errors import InputError, SimulationError, choices
from ..base.system_calls import cpus
from ..exchange.listener import Texts
from ..fmi.instance import DISCARD, DUE, EARLY, EVENT, WARNING, Instance, clock_of, length_until
from ..interface.fmi_types import Value
from ..realtime.pacer import HaltError, OverrunError, Pacer, StallError
from ..recording.recorded_run import Rejection
from ..system.description import System
from ..system.faults import INITIAL
from ..system.parts import Component, Port
from ..system.times import NANOSECONDS, in_seconds, seconds
from . import loop
from .engine import Aside, CompiledLoop, Engine, make_loop
from .exchanged import exchanged, used
from .initialisation import Propagation
from .plan import Planner
from .scenario import NO_CUTS, Cut, Scenario, driven_at, drives_of, stored
from .watches import Watches

CHUNK = 4096
"""The most steps between two times that rows are handed on."""

ROOM = 1 << 15
"""The same where another thread hands them on."""

MOST_BYTES = 1 << 26
"""Of memory for these rows; of a wide row there are fewer."""

ENOUGH = 512
"""The rows that advance() collects before it hands them on: one alone costs 100 steps."""

FEW = 64
"""So many that wait are saved with a state; of more it is quicker to hand them on before."""

LONG = 0.1
"""s of wall time after which it hands on any."""

SPARE = 5e7
"""ns that this thread may take at a time for what listeners have put off."""

NEVER = 2**62
"""A step that no run reaches."""

SMALLEST = 1024
"""A step that is rejected is divided down to this part of it, then the run fails."""

RowReceiver = Callable[[npt.NDArray[np.int64], npt.NDArray[np.float64]], None]
"""Takes step numbers and rows of all values; the rows are reused afterwards."""


class Master:
    """Runs a system's instances, which are in the order of its components."""

    def __init__(
        self,
        system: System,
        instances: Sequence[Instance],
        receive: RowReceiver,
        engine: Engine = "auto",
        pacer: Pacer | None = None,
        renew: Callable[[], Sequence[Instance]] | None = None,
        cuts: Mapping[Port, Cut] = NO_CUTS,
    ) -> None:
        """Renew closes the instances and loads others, for a loop that is initialised anew; cuts
        are by the input at which each is.
        """
        self.system = system
        self._engine, self._renew_instances = engine, renew
        self.instances = tuple(instances)
        self.total_steps = system.total_steps
        self.steps_done = 0
        self.rejections: dict[str, Rejection] = {}
        self.log: list[str] = []
        self.ends: list[str] = []
        """The requests to end the simulation before the stop time, a line each."""
        moved = system.once(exchanged)
        self.slots = moved.slots()
        self.texts = {port: Texts() for port in moved.texts}
        self._used = system.once(used)
        self.values = np.zeros(len(self.slots) + (pacer.width if pacer else 0))
        if pacer:
            pacer.bind(self.values[len(self.slots) :], self._hand_on_until)
        self.scenario = Scenario(system, instances, self.slots, self.values, cuts)
        interfaces = {instance.name: instance.interface for instance in instances}
        self.watches = Watches(system, interfaces, self.slots)
        self._receive = receive
        self.meanwhile: Callable[[], None] = lambda: None
        """Called while the loop of a run in real time goes on without Python's lock."""
        self._pacer = pacer
        self.renewed: list[float] = []
        """The times in s at which the loop was initialised anew."""
        self.peers: dict[str, dict[str, str]] = {}
        """The name and the build of the peer of each proxy."""
        self._pause = NEVER
        self._aborted = ""
        self._warned_before: list[str] = []
        self._make_loop()
        affordable = max(ENOUGH, MOST_BYTES // (self.values.nbytes or 1))
        room = min(ROOM if self._alone else CHUNK, affordable)
        self._rows = np.empty((room, len(self.values)))
        self._rows.fill(0.0)  # its memory is there from now on
        self._cpus = cpus() if self._alone else []
        self._grid = system.time_grid
        self._base = self._handed_on = 0
        self._handed_on_at = time.monotonic()
        self._blank = self._own_state()

    def _make_loop(self) -> None:
        """The loop over the instances of now."""
        system, pacer = self.system, self._pacer
        self._drives = drives_of(system, self.slots)
        planner = Planner(
            system,
            {instance.name: instance for instance in self.instances},
            self.slots,
            self.values,
            self.scenario,
            self.texts,
            self._drives,
            self.watches.table,
            pacer,
        )
        self.plan = planner.plan()
        self._loop = made = make_loop(self.plan, self._engine, None if pacer else self.total_steps)
        self._alone = made if pacer and isinstance(made, CompiledLoop) and made.alone else None

    def read(self, port: Port) -> Value:
        """The value now of any variable, from its FMU."""
        instance = next(i for i in self.instances if i.name == port.component)
        (value,) = instance.get([instance.interface.by_name[port.variable]])
        return value

    def initialise(self) -> None:
        """Start values in, then outputs at the start that agree with its inputs.

        The row of the start has what the first step uses: outputs as they are out of initialisation
        mode, and inputs that agree with them. SimulationError where a limit is exceeded there.
        """
        self._initialise_at(0)
        self._receive(np.zeros(1, np.int64), self.values[np.newaxis])
        self._handed_on_at = time.monotonic()
        if reason := self.watches.at_start(self.values):
            raise SimulationError(reason)

    def _initialise_at(self, step: int) -> None:
        """Initialise all instances at a communication point."""
        start = in_seconds(self.system.time_ns(step))
        self.plan.clock[0] = start
        for component, instance in zip(self.system.components, self.instances, strict=True):
            driven = {
                **driven_at(self.system, self._drives, component.name, step),
                **self.scenario.tuned_at_start(component.name),
            }
            stop = told_stop(self.system, component)
            instance.enter_initialization({**component.values, **driven}, stop, start)
        faults, at = self.scenario.fault_functions, step or INITIAL
        propagation = Propagation(self.system, self.instances, faults, at)
        pairs = list(zip(self.system.components, self.instances, strict=True))
        in_event_mode = [i for c, i in pairs if c.loaded.event_mode and not c.integrated]
        try:
            self.log += propagation.run()
            for instance in self.instances:
                instance.exit_initialization()
            self.log += propagation.after_exit()
            for instance in in_event_mode:
                instance.enter_step_mode()
            if in_event_mode:
                self.log += propagation.after_exit()
        except SimulationError as error:
            raise InputError(str(error)) from error
        values = propagation.values
        values |= self._held_at_start()
        self._fetch_others(values)
        for component, instance in pairs:
            has_had_event = instance in in_event_mode or component.integrated
            if has_had_event and (ended := instance.the_end()) is not None:
                self._end(instance, ended, step)
        for port, slot in self.slots.items():
            drive = self._drives.get(port)
            now = self._grid.start + step * self._grid.step
            value = drive.at(now) if drive else values[port]
            if port in self.texts:
                value = self.texts[port].number(str(value))
            if port in self._used:
                exact(str(port), value, f"{value} at step {step}")
            self.values[slot] = float(value)
        for instance in self.instances:
            instance.quieten()
        self.peers = {c.name: _peer_of(c, i) for c, i in pairs if c.is_proxy}

    def _held_at_start(self) -> dict[Port, Value]:
        """What inputs without a source start with, where that is given or declared."""
        found: dict[Port, Value] = {}
        for port in self.system.once(exchanged).held:
            component = self.system.component(port.component, port)
            interface = component.loaded
            start = interface.by_name[port.variable].start_value
            value = component.values.get(port.variable, start)
            if isinstance(value, float | int):
                found[port] = stored(interface, port.variable, value)
        return found

    def _fetch_others(self, values: dict[Port, Value]) -> None:
        """What was not passed on: locals, say, or elements of connected arrays without a source."""
        missing: dict[str, list[Port]] = {}
        for port in self.slots:
            if port not in self._drives and port not in values:
                missing.setdefault(port.component, []).append(port)
        for instance in self.instances:
            ports = missing.get(instance.name, [])
            if ports:
                by_name = instance.interface.by_name
                others = instance.get([by_name[port.variable] for port in ports])
                values |= zip(ports, others, strict=True)

    def _end(self, instance: Instance, time: float, step: int) -> None:
        """Have the run end with the row of a step, as an FMU asked for at a time in s.

        What is still to be done in this step is done: all components are then at its end.
        """
        self.total_steps = step
        line = f"{instance.name} asked for the end of the simulation at t = {time:.9g} s"
        row = self.system.time_ns(step)
        if abs(in_seconds(row) - time) * NANOSECONDS > 1.0:
            line += f"; its values there are in the last row, that of t = {seconds(row)}"
        self.ends.append(line)

    def warnings(self) -> list[str]:
        """Lines for the log on what the FMUs warned of, in the order of the components."""
        lines = [*self._warned_before]
        for instance in self.instances:
            returned = [
                (count, first)
                for owner, (count, first) in zip(
                    self.plan.owners, self.plan.warned.reshape(-1, 2).tolist(), strict=True
                )
                if owner is instance and count
            ]
            total = sum(int(count) for count, _ in returned)
            lines += instance.remarks(total, min((first for _, first in returned), default=0.0))
        return lines

    @property
    def runs_alone(self) -> bool:
        """True if the loop of a run in real time needs nothing of Python's until it ends."""
        return self._alone is not None

    def advance(self, steps: int) -> int:
        """Do the given number of steps, or fewer where the stop time is nearer; how many it were.

        Fewer, too, where the pacer is halted. Rows may wait to be handed on, unless a value is not
        finite. SimulationError where an FMU fails, or where the run stops at an overrun; the rows
        until then have been handed on.
        """
        first = self.steps_done
        try:
            while self.steps_done < (end := min(first + steps, self.total_steps)):
                try:
                    self._chunk(end if self._alone else min(self._base + len(self._rows), end))
                except StallError as stall:
                    self._after_stall(stall)
                if self.steps_done == self._pause:
                    self._at_pause()
        except HaltError:
            pass
        except OverrunError:
            assert self._pacer is not None  # noqa: S101 - who else has raised it
            raise SimulationError(self._pacer.meter.verdict()) from None
        for instance in self.instances:
            instance.quieten()
        waiting = self._waiting()
        wraps = len(waiting) < self.steps_done - self._handed_on
        fresh = waiting[max(first - self._handed_on, 0) :]
        if wraps or self._enough(len(waiting)) or not all_finite(fresh):
            self.hand_on()
        return self.steps_done - first

    def saved(self) -> Any:
        """All that decides what comes, and the rows that wait, for restore().

        InputError where an FMU does not give its state; SimulationError where it fails.
        """
        if len(self._waiting()) > FEW:
            self.hand_on()
        return self._own_state(), [instance.saved() for instance in self.instances]

    def _own_state(self) -> tuple[Any, ...]:
        """All but the states of the FMUs."""
        plan, made = self.plan, self._loop
        acted = self.watches.saved(), self.scenario.saved()
        told = [*self.log], [*self.ends], dict(self.rejections), *acted
        arrays = [array.copy() for array in (plan.values, plan.clock, plan.warned, *plan.buffers)]
        drives = [drive.row for drive in plan.drives]
        compiled = made.saved() if isinstance(made, CompiledLoop) else None
        at = self.steps_done, self.total_steps, self._base, self._pause
        return at, told, arrays, drives, compiled, self._waiting().copy()

    def restore(self, saved: Any) -> None:
        """Go back to what was saved; SimulationError where an FMU fails."""
        own, instances = saved
        for instance, state in zip(self.instances, instances, strict=True):
            instance.restore(state)
        self._restore_own(own)

    def reset(self, system: System) -> None:
        """Go back to before the initialisation, with the start values of a system of the same FMUs.

        InputError, SimulationError as of Instance.reset().
        """
        self.system = system
        for instance in self.instances:
            instance.reset()
        self._restore_own(self._blank)

    def _restore_own(self, saved: tuple[Any, ...]) -> None:
        at, told, arrays, drives, compiled, waiting = saved
        plan, made = self.plan, self._loop
        self.steps_done, self.total_steps, self._base, self._pause = at
        self._handed_on, self._aborted = self._base, ""
        self._rows[: len(waiting)] = waiting
        log, ends, rejections, watches, scenario = told
        self.log, self.ends = [*log], [*ends]
        plan.raised.clear()
        self.rejections = dict(rejections)
        self.watches.restore(watches)
        self.scenario.restore(scenario)
        own = plan.values, plan.clock, plan.warned, *plan.buffers
        for array, before in zip(own, arrays, strict=True):
            array[:] = before
        for drive, row in zip(plan.drives, drives, strict=True):
            drive.row = row
        if isinstance(made, CompiledLoop):
            made.restore(compiled)

    def end_here(self, why: str) -> None:
        """Have the run end at the communication point reached; `why` is for the log."""
        self.total_steps = self.steps_done
        self.ends.append(f"t = {seconds(self.system.time_ns(self.steps_done))}: {why}")
        self._finish_pacing()

    def _finish_pacing(self) -> None:
        if self._pacer is not None and self.steps_done == self.total_steps:
            ended = self._alone.shared.ended if self._alone else None
            self._pacer.finish(self.total_steps, ended)

    def hand_on(self) -> None:
        """Hand on the rows that wait; SimulationError where a value is not finite."""
        self._hand_on_until(self.steps_done)
        self._base = self._handed_on

    def _hand_on_until(self, step: int) -> None:
        """Hand on the rows up to a step that is done; the pacer does while it waits in the loop."""
        self.steps_done = step
        while len(rows := self._waiting()):
            steps = self._handed_on + np.arange(1, len(rows) + 1)
            self._handed_on, self._handed_on_at = int(steps[-1]), time.monotonic()
            times = rows[:, len(self.slots) :]
            if self._pacer is None:
                self._receive(steps, rows)
            elif self._alone:
                self._pacer.meter.add(steps - 1, times)
                self._receive(steps, rows)
            else:
                self._pacer.record(steps, times, partial(self._receive, steps, rows))

    def _waiting(self) -> npt.NDArray[np.float64]:
        """Rows that wait to be handed on, as far as they are in one piece."""
        first = (self._handed_on - self._base) % len(self._rows)
        return self._rows[first : first + self.steps_done - self._handed_on]

    def _enough(self, rows: int) -> bool:
        """True if so many rows that wait are many, have waited long or include the last one."""
        return (
            self.steps_done == self.total_steps
            or (self._pacer is None and rows >= ENOUGH)  # a pacer has its occasions
            or time.monotonic() - self._handed_on_at > LONG
        )

    def _chunk(self, stop: int) -> None:
        """Run the loop until stop; hand the rows on where there is no room left, or it fails."""
        try:
            if self._alone and self._pacer:
                self._run_alone(stop, self._alone, self._pacer)
            else:
                self._run(stop)
            self._finish_pacing()
        except BaseException:
            self.hand_on()
            raise
        if self.steps_done == self._base + len(self._rows) and not self._alone:
            self.hand_on()

    def _run(self, stop: int) -> None:
        step, operation = self.steps_done, 0
        try:
            while step < (until := min(stop, self.total_steps, self._pause)):
                step, operation, status = self._loop(
                    self._rows, operation, step, until, *self._grid, row=step - self._base
                )
                if status:
                    self.steps_done = step
                    self._resolve(step, operation, status)
                    operation += 1
        finally:  # an interruption of the loop does not say how far it came; the pacer knows more
            self.steps_done = max(step, self._handed_on)

    def _run_alone(self, stop: int, compiled: CompiledLoop, pacer: Pacer) -> None:
        """The same in real time without any call of Python; another thread hands the rows on."""
        step, operation, status, shared = self.steps_done, 0, 0, compiled.shared
        shared.done, shared.taken, shared.halt = step, self._handed_on, int(pacer.halted())

        def halt() -> None:
            shared.halt = 1

        def hand_on() -> None:
            self._hand_on_until(shared.done)
            shared.taken = self._handed_on
            if pacer.spare is not None:
                pacer.spare(SPARE)
            self.meanwhile()
            if pacer.halted():
                halt()

        try:
            with Aside(hand_on, halt, self._cpus) as aside:
                while step < (until := min(stop, self.total_steps, self._pause)):
                    row = (step - self._base) % len(self._rows)
                    step, operation, status = compiled(
                        self._rows, operation, step, until, *self._grid, row=row, ring=True
                    )
                    if status == loop.OVERRUN:
                        raise pacer.overrun()
                    if status == loop.STALLED:
                        raise pacer.stall()
                    if status == loop.HALTED:
                        if pacer.halted() or aside.error:
                            raise HaltError
                        shared.halt = 0
                    elif status == loop.FULL:
                        time.sleep(LONG)
                    elif status:
                        self._resolve(step, operation, status)
                        operation += 1
        finally:
            self.steps_done = shared.done

    def _note_watch(self, step: int, number: int) -> None:
        """A condition holds at the end of a step: the run ends there, or the loop begins anew."""
        if self.watches.entries[number].limit is None:
            every = math.lcm(*(self.system.period(c.name) for c in self.system.components))
            self._pause = min(self._pause, -(-(step + 1) // every) * every)
        elif reason := self.watches.note(number, step + 1, self.values):
            self._aborted, self._pause = reason, step + 1

    def _at_pause(self) -> None:
        """Where a condition asked for: abort the run, or initialise the loop anew."""
        self._pause = NEVER
        if self._aborted:
            self.hand_on()
            raise SimulationError(self._aborted)
        self._begin_anew("a lost peer is back")

    def _after_stall(self, stall: StallError) -> None:
        """A step would begin too late: where each peer may come back all begin anew, else it ends.

        So no command is worked out from what was measured before a stall.
        """
        self.hand_on()
        proxies = [c for c in self.system.components if c.is_proxy]
        every = math.lcm(*(self.system.period(c.name) for c in self.system.components))
        resumes = all(c.of_proxy("resume") for c in proxies)
        if not resumes or self.steps_done % every:
            raise SimulationError(
                f"{self.system.name}: the run stalled at t = "
                f"{seconds(self.system.time_ns(self.steps_done))}: a step would begin "
                f"{stall.late:.3g} s late, and {choices(c.name for c in proxies)} would get "
                "commands from what was measured before; must be at most realtime.stall, or "
                "proxy.resume = true"
            ) from None
        self._begin_anew(f"the run stalled for {stall.late:.3g} s")

    def _begin_anew(self, reason: str) -> None:
        """Load all FMUs again, and initialise them at the communication point reached.

        SimulationError where that fails.
        """
        assert self._renew_instances is not None  # noqa: S101 - who has proxies has given it
        self.hand_on()
        step, now = self.steps_done, self.system.time_ns(self.steps_done)
        self._warned_before = self.warnings()
        self.plan.warned[:] = 0.0
        try:
            self.instances = tuple(self._renew_instances())
            self.scenario.renew(self.instances)
            self._make_loop()
            self._initialise_at(step)
        except InputError as error:
            raise SimulationError(f"{error}; the loop was to be initialised anew") from error
        self.scenario.apply_again(step)
        self.watches.arm()
        if self._pacer:
            self._pacer.begin_anew()
        self.renewed.append(in_seconds(now))
        self.watches.log.append(f"t = {seconds(now)}: {reason}: the loop was initialised anew")

    def _resolve(self, step: int, operation: int, status: int) -> None:
        """Finish a step that was rejected, or has events; any other bad status ends the run."""
        kind, call, _, period, _ = self.plan.operations[operation]
        if status == loop.WATCHED:
            self._note_watch(step, call)
            return
        if status == loop.TOO_LONG:
            self._too_long(step, operation)
        if status == loop.RAISED:
            raise self.plan.raised.pop()
        instance = self.plan.owners[call]
        assert instance is not None  # noqa: S101 - the master's own calls return no bad status
        begin = in_seconds(self.system.time_ns(step + 1 - period))
        if kind != loop.STEP or status not in (DISCARD, EARLY, EVENT, DUE):
            raise instance.failure(status, begin)
        end = in_seconds(self.system.time_ns(step + 1))
        ended = finish_step(instance, status, begin, end)
        if ended is not None:
            self._end(instance, ended, step + 1)
            return
        if status in (EVENT, DUE):
            return
        known = self.rejections.get(instance.name, Rejection(0, begin))
        self.rejections[instance.name] = Rejection(known.count + 1, known.first)

    def _too_long(self, step: int, operation: int) -> None:
        """SimulationError for the value that the operation refused."""
        _, first, last, _, _ = self.plan.operations[operation]
        for buffer, index, slot in self.plan.casts[first:last]:
            port = next(p for p, s in self.slots.items() if s == slot)
            value = int(self.plan.buffers[buffer][index])
            exact(str(port), value, f"{value} at step {step + 1}", SimulationError)
        raise AssertionError("no value is too long")  # pragma: no cover


def all_finite(rows: npt.NDArray[np.float64]) -> bool:
    """True if all values are finite; a sum of squares tells it sooner, but for very large ones."""
    flat = rows.reshape(-1)
    with np.errstate(over="ignore", invalid="ignore"):
        squares = flat.dot(flat)
    return bool(squares < np.inf or np.isfinite(flat).all())


def told_stop(system: System, component: Component) -> float:
    """The stop time in s that a component is told: no step that is asked of it ends later.

    An FMU finds the end of a step as the sum of its begin and its length, two floats, which may
    round to more than the stop time: 0.2 + 0.1 > 0.3. Then it is told that sum, a few units in the
    last place later, so that its last step has the length of all others.
    """
    length = system.step_of(component)
    last = in_seconds(system.stop_ns - length) + in_seconds(length)
    return max(in_seconds(system.stop_ns), last)


def finish_step(instance: Instance, status: int, begin: float, end: float) -> float | None:
    """Bring an instance to end, in s, that rejected the step from begin to there, or has events.

    Goes on from where the step got to. Where it got nowhere, the rest is halved, at most down to
    1/1024 of the step; a rest below half of that is none. The time in s where the FMU asked for the
    end of the simulation, else None. SimulationError where that does not help, and where an FMU of
    ours refuses a step.
    """
    clock, length = clock_of(begin, end), end - begin
    smallest = length / SMALLEST
    for _ in range(4 * SMALLEST):
        if status in (EVENT, DUE):
            stop = float(clock[0]) + length
            stop = end if stop >= end - smallest / 2 else stop
            status, clock[0] = instance.through_events(status, float(clock[0]), stop)
        if status == DISCARD and instance.interface.ours:
            break  # in Python it could not go on: pythonfmu has no word for it but fatal
        if status in (DISCARD, EARLY):
            if (ended := instance.the_end()) is not None:
                return ended
            varies = instance.interface.can_vary_step
            if not varies or (reached := instance.last_successful_time()) is None:
                break
            if reached > clock[0]:
                clock[0], length = reached, end - reached
            elif (length := length / 2) < smallest or clock[0] + length == clock[0]:
                break
        elif status > WARNING:
            break
        if clock[0] >= end:
            return None
        length = min(length, length_until(float(clock[0]), end))
        clock[2] = clock[0] + length
        status = instance.stepper(clock, length).python()
        if status <= WARNING:
            clock[0] = end if clock[0] + length >= end - smallest / 2 else clock[0] + length
    raise instance.failure(status, float(clock[0]))


def _peer_of(component: Component, instance: Instance) -> dict[str, str]:
    """The name and the build of a proxy's peer, which it knows once it is initialised."""
    by_name = instance.interface.by_name
    own = {theirs: name for name, theirs in component.rename.items()}
    names = {key: own.get(f"proxy.{key}", f"proxy.{key}") for key in ("name", "build")}
    known = {key: name for key, name in names.items() if name in by_name}
    values = instance.get([by_name[name] for name in known.values()])
    return {key: str(value) for key, value in zip(known, values, strict=True)}
