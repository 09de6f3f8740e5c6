"""The fixed-step master: initialise, then run the loop in chunks and hand its rows on.

Stepping is here; a run by the clock is in paced.py, the start in start.py, the end in end.py; a
step that an FMU rejects or has events in is in step_completion.py.

The schemes, components with a longer step and time: docs/explanation/co_simulation.md.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.checks import exact
from ..base.errors import InputError, SimulationError
from ..exchange.bounds import Bounds
from ..exchange.listener import Texts
from ..fmi.instance import DUE, EVENT, FATAL, Instance
from ..interface.fmi_types import Value
from ..realtime.pacer import Pacer
from ..recording.recorded_run import Rejection
from ..system.description import System
from ..system.parts import Port
from ..system.times import NANOSECONDS, in_seconds, seconds
from . import loop
from .drives import drives_of
from .end import RunEnd
from .engine import CompiledLoop, Engine, make_loop
from .exchanged import exchanged
from .exchanges import begin, exchanges_of
from .fault_windows import NO_CUTS, Cut
from .plan import Planner
from .requests import Requests
from .rows import RowBuffer
from .scenario import Scenario
from .start import Starter
from .step_completion import TO_BE_FINISHED, finish_step, with_failures_beside
from .watches import Watches

CHUNK = 1024
"""The most steps between two times that rows are handed on."""

MAX_BYTES = 1 << 26
"""Of memory for these rows; of a wide row there are fewer."""

ENOUGH = 512
"""The rows that advance() collects before it hands them on: a single one costs 100 steps."""

MAX_SAVED_ROWS = 64
"""So many that wait are saved with a state; of more it is quicker to hand them on before."""

LONG = 0.1
"""s of wall time after which it hands on any."""

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
        renew: Callable[[], Sequence[Instance]] | None = None,
        cuts: Mapping[Port, Cut] = NO_CUTS,
        requests: Requests | None = None,
    ) -> None:
        """Bind the instances of a system, before their initialisation.

        Args:
            system: The system that runs.
            instances: Its loaded FMUs.
            receive: Gets the rows.
            engine: "python", "compiled" or "auto".
            renew: Closes the instances and loads others, for a loop that is initialised again.
            cuts: Functions by the input at which each opens a loop.
            requests: What other threads ask for.
        """
        self.system = system
        self.instances = tuple(instances)
        self.steps_done = 0
        self.end = RunEnd(system.total_steps)
        self.rejections: dict[str, Rejection] = {}
        self.log: list[str] = []
        self.renewed: list[float] = []
        """The times in s at which the loop was initialised again."""
        self.peers: dict[str, dict[str, str]] = {}
        """The name and the build of the peer of each proxy."""
        self._receive, self.engine, self._renew_instances = receive, engine, renew
        self._requests = requests
        self._grid = system.time_grid
        self._earlier_warnings: list[str] = []
        """Those of instances that were closed as the loop was initialised again."""
        moved = system.once(exchanged)
        self.slots = moved.slots()
        self.texts = {port: Texts() for port in moved.texts}
        self.exchanges = exchanges_of(system, self.slots)
        last_output = max((self.slots[port] for port in system.watched), default=-1)
        self.bounds = Bounds(last_output + 1)
        """The magnitudes from which on a value of a row must be looked at."""
        self.values = np.zeros(self._first_extra_value + self._extra_values)
        self.scenario = Scenario(system, instances, self.slots, self.values, cuts)
        interfaces = {instance.name: instance.interface for instance in instances}
        self.watches = Watches(system, interfaces, self.slots)
        self._make_loop()
        affordable = max(ENOUGH, MAX_BYTES // (self.values.nbytes or 1))
        self._rows = RowBuffer(len(self.values), min(self._max_rows, affordable))
        self._blank = self._own_state()

    # What a run by the clock has otherwise: see paced.PacedMaster.

    _pacer: Pacer | None = None
    _extra_values = 0
    """Values in a row in addition to those of the slots and the energies."""

    @property
    def _first_extra_value(self) -> int:
        return len(self.slots) + len(self.exchanges)

    @property
    def _max_rows(self) -> int:
        """The rows for which there is a place, if memory allows."""
        return CHUNK

    @property
    def total_steps(self) -> int:
        """The number of steps after which the run ends."""
        return self.end.total_steps

    def _make_loop(self) -> None:
        """The loop over the present instances."""
        self._drives = drives_of(self.system, self.slots)
        planner = Planner(
            self.system,
            {instance.name: instance for instance in self.instances},
            self.slots,
            self.values,
            self.scenario,
            self.texts,
            self._drives,
            self.watches.table,
            self.exchanges,
            self.bounds,
            self._pacer,
        )
        self.plan = planner.plan()
        # In real time the loop is compiled where it can be, however short the run is.
        steps = None if self._pacer else self.total_steps
        self._loop = make_loop(self.plan, self.engine, steps)
        # By the clock rows may be handed on while the loop goes on, and finds more.
        self.bounds.compared = isinstance(self._loop, CompiledLoop) and not self._pacer

    def read(self, port: Port) -> Value:
        """The present value of any variable, from its FMU."""
        instance = next(i for i in self.instances if i.name == port.component)
        (value,) = instance.get([instance.interface.by_name[port.variable]])
        return value

    def initialise(self) -> None:
        """Start values in, then outputs at the start that agree with its inputs.

        The row of the start has what the first step uses: outputs as they are out of initialisation
        mode, and inputs that agree with them. SimulationError where a limit is exceeded there.
        """
        self._initialise_at(0)
        begin(self.exchanges, self.values)
        self._receive(np.zeros(1, np.int64), self.values[np.newaxis])
        self._rows.note_time()
        if reason := self.watches.at_start(self.values):
            raise SimulationError(reason)

    def _initialise_at(self, step: int) -> None:
        """Initialise all instances at a communication point."""
        self.plan.clock[0] = in_seconds(self.system.time_ns(step))
        starter = Starter(
            self.system, self.instances, self.scenario, self._drives, self.slots, self.texts
        )
        start = starter.initialise_at(step, self.values)
        self.log += start.log
        self.peers = start.peers
        for instance, asked_end in start.asked_ends:
            self._end_as_asked(instance, asked_end, step)

    def _end_as_asked(self, instance: Instance, time: float, step: int) -> None:
        """Have the run end with the row of a step, as an FMU asked for at a time in s.

        What is still to be done in this step is done: all components are then at its end.
        """
        line = f"{instance.name} asked for the end of the simulation at t = {time:.9g} s"
        row = self.system.time_ns(step)
        if abs(in_seconds(row) - time) * NANOSECONDS > 1.0:
            line += f"; its values there are in the last row, that of t = {seconds(row)}"
        self.end.ask(step, line)

    def warnings(self) -> list[str]:
        """Lines for the log on what the FMUs warned of, in the order of the components."""
        lines, returned = [*self._earlier_warnings], self._warned_calls()
        for instance in self.instances:
            calls = returned.get(instance.name, [])
            total = sum(int(count) for count, _ in calls)
            first = min((time for _, time in calls), default=0.0)
            lines += instance.remarks(total, first)
        return lines

    def _warned_calls(self) -> dict[str, list[tuple[float, float]]]:
        """The warnings that calls returned, by instance: how many, and the time of the first."""
        calls: dict[str, list[tuple[float, float]]] = {}
        warned = self.plan.warned.reshape(-1, 2).tolist()
        for owner, (count, first) in zip(self.plan.owners, warned, strict=True):
            if owner is not None and count:
                calls.setdefault(owner.name, []).append((count, first))
        return calls

    def advance(self, steps: int) -> int:
        """Do the given number of steps, or fewer where the stop time is nearer; how many it were.

        Fewer, too, where the pacer is halted. Rows may wait to be handed on, unless a value is not
        finite. SimulationError where an FMU fails, or where the run stops at an overrun; the rows
        until then have been handed on.
        """
        first = self.steps_done
        self._advance_until(first + steps)
        for instance in self.instances:
            instance.quieten()
        rows, steps_done = self._rows, self.steps_done
        waiting = rows.waiting(steps_done)
        fresh = waiting[max(first - rows.handed_on, 0) :]
        is_wrapped = len(waiting) < steps_done - rows.handed_on  # some are at the beginning again
        is_finite = not self.bounds.may_be_exceeded or all_finite(fresh)
        if is_wrapped or self._are_enough(len(waiting)) or not is_finite:
            self.hand_on()
        return steps_done - first

    def _advance_until(self, steps: int) -> None:
        """Run the loop until so many steps are done, or the end of the run."""
        end = self.end
        while self.steps_done < (stop := min(steps, end.total_steps)):
            self._run_chunk(stop)
            if self.steps_done == end.pause:
                self.hand_on()
                self.end.go_on()
                self._begin_anew("a lost peer is back")

    def _run_chunk(self, stop: int) -> None:
        """Run the loop until stop; hand the rows on where there is no space left, or it fails."""
        try:
            self._run_loop(min(self._rows.last_step, stop))
        except BaseException:
            self.hand_on()
            raise
        if self.steps_done == self._rows.last_step:
            self.hand_on()

    def _run_loop(self, stop: int) -> None:
        """Run the loop until stop, or a pause; finish the steps that it leaves unfinished."""
        step, operation = self.steps_done, 0
        rows = self._rows
        try:
            while step < (until := self._until(stop, step, operation)):
                step, operation, status = self._loop(
                    rows.rows, operation, step, until, *self._grid, row=rows.place(step)
                )
                if status:
                    self.steps_done = step
                    self._resolve(step, operation, status)
                    operation += 1
        finally:  # an interruption of the loop does not say how far it came; the pacer knows more
            self.steps_done = max(step, rows.handed_on)

    def _until(self, stop: int, step: int, operation: int) -> int:
        """The step at which the loop is to stop, at the latest at stop; before, requests are done.

        That is at the beginning of a step only, before its first operation.
        """
        until = min(stop, self.end.total_steps, self.end.pause)
        if self._requests is None or step >= until:
            return until
        if operation == 0:
            if self._requests.are_waiting:
                self.scenario.take(self._requests, step)
            if self.scenario.request_due == step:
                self.scenario.before_step(step)
        return int(min(until, self.scenario.request_due))

    def saved(self) -> Any:
        """All that decides what comes, and the rows that wait, for restore().

        InputError where an FMU does not give its state; SimulationError where it fails.
        """
        if len(self._rows.waiting(self.steps_done)) > MAX_SAVED_ROWS:
            self.hand_on()
        return self._own_state(), [instance.saved() for instance in self.instances]

    def _own_state(self) -> tuple[Any, ...]:
        """All but the states of the FMUs."""
        plan, rejections = self.plan, dict(self.rejections)
        parts = self.end.saved(), self.watches.saved(), self.scenario.saved()
        arrays = [array.copy() for array in self._state_arrays()]
        drives = [drive.row for drive in plan.drives]
        compiled = self._loop.saved() if isinstance(self._loop, CompiledLoop) else None
        rows = self._rows.saved(self.steps_done)
        return self.steps_done, [*self.log], rejections, parts, arrays, drives, compiled, rows

    def _state_arrays(self) -> Sequence[npt.NDArray[Any]]:
        """The arrays of the plan that change from step to step."""
        plan = self.plan
        return plan.values, plan.clock, plan.warned, self.exchanges, *plan.buffers

    def restore(self, saved: Any) -> None:
        """Go back to what was saved; SimulationError where an FMU fails."""
        own_state, states = saved
        for instance, state in zip(self.instances, states, strict=True):
            instance.restore(state)
        self._restore_own(own_state)

    def reset(self, system: System) -> None:
        """Go back to before the initialisation, with the start values of a system of the same FMUs.

        InputError, SimulationError as of Instance.reset().
        """
        self.system = system
        for instance in self.instances:
            instance.reset()
        self._restore_own(self._blank)

    def _restore_own(self, saved: tuple[Any, ...]) -> None:
        self.steps_done, log, rejections, parts, arrays, drives, compiled, rows = saved
        self.log, self.rejections = [*log], dict(rejections)
        for part, state in zip((self.end, self.watches, self.scenario), parts, strict=True):
            part.restore(state)  # type: ignore[attr-defined]  # each has it, of its state
        for array, old in zip(self._state_arrays(), arrays, strict=True):
            array[:] = old
        for drive, row in zip(self.plan.drives, drives, strict=True):
            drive.row = row
        self.plan.raised.clear()
        self._rows.restore(rows)
        if isinstance(self._loop, CompiledLoop):
            self._loop.restore(compiled)

    def end_here(self, reason: str) -> None:
        """Have the run end at the communication point reached; the reason is for the log."""
        time = seconds(self.system.time_ns(self.steps_done))
        self.end.ask(self.steps_done, f"t = {time}: {reason}")

    def hand_on(self) -> None:
        """Hand on the rows that wait; SimulationError where a value is not finite."""
        self._hand_on_until(self.steps_done)
        self._rows.start_over()

    def _hand_on_until(self, steps: int) -> None:
        """Hand on the rows up to a step that is done."""
        self.steps_done = steps
        for numbers, rows in self._rows.take(steps):
            self._deliver(numbers, rows)

    def _deliver(self, numbers: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Give rows, by the numbers of their steps, to who receives them."""
        self._receive(numbers, rows)

    def _are_enough(self, rows: int) -> bool:
        """True if so many rows that wait are many, have waited long or include the last one."""
        return (
            self.steps_done == self.total_steps
            or rows >= ENOUGH
            or self._rows.seconds_since() > LONG
        )

    @property
    def _common_period(self) -> int:
        """Every how many steps all components are at their own communication point."""
        return math.lcm(*(self.system.period(c.name) for c in self.system.components))

    def _note_watch(self, step: int, number: int) -> None:
        """A condition holds at the end of a step: the run ends there, or the loop begins again."""
        if self.watches.entries[number].limit is None:
            period = self._common_period
            self.end.pause_after(-(-(step + 1) // period) * period)
        elif reason := self.watches.note(number, step + 1, self.values):
            self.end.abort_after(step + 1, reason)

    def _begin_anew(self, reason: str) -> None:
        """Load all FMUs again, and initialise them at the communication point reached.

        SimulationError where that fails.
        """
        assert self._renew_instances is not None  # noqa: S101 - who has proxies has given it
        self.hand_on()
        step, time = self.steps_done, self.system.time_ns(self.steps_done)
        self._earlier_warnings = self.warnings()
        self.plan.warned[:] = 0.0
        try:
            self.instances = tuple(self._renew_instances())
            self.scenario.renew(self.instances)
            self._make_loop()
            self._initialise_at(step)
        except InputError as error:
            raise SimulationError(f"{error}; the loop was to be initialised again") from error
        self.scenario.apply_again(step)
        self.watches.arm()
        self.renewed.append(in_seconds(time))
        self.watches.log.append(f"t = {seconds(time)}: {reason}: the loop was initialised again")

    def _resolve(self, step: int, operation: int, status: int) -> None:
        """Finish a step that was rejected, or has events; any other bad status ends the run."""
        call = self.plan.operations[operation][1]
        if status == loop.WATCHED:
            self._note_watch(step, call)
            return
        if status == loop.TOO_LONG:
            self._refuse_inexact(step, operation)
        try:
            if status == loop.RAISED:
                raise self.plan.raised.pop()
            self._finish_step(step, operation, status)
        except SimulationError as error:
            fatal = status == FATAL
            raise with_failures_beside(
                error, fatal, self.plan, self.system, step, operation
            ) from error.__cause__

    def _finish_step(self, step: int, operation: int, status: int) -> None:
        """Bring a step to its end; SimulationError where its status allows none."""
        kind, call, _, period, _ = self.plan.operations[operation]
        instance = self.plan.owners[call]
        assert instance is not None  # noqa: S101 - the master's own calls return no bad status
        begin = in_seconds(self.system.time_ns(step + 1 - period))
        if kind != loop.STEP or status not in TO_BE_FINISHED:
            raise instance.failure(status, begin)
        end = in_seconds(self.system.time_ns(step + 1))
        asked_end = finish_step(instance, status, begin, end)
        if asked_end is not None:
            self._end_as_asked(instance, asked_end, step + 1)
        elif status not in (EVENT, DUE):
            earlier = self.rejections.get(instance.name, Rejection(0, begin))
            self.rejections[instance.name] = Rejection(earlier.count + 1, earlier.first)

    def _refuse_inexact(self, step: int, operation: int) -> None:
        """SimulationError for the integer that the operation refused: no float64 holds it."""
        _, first, last, _, _ = self.plan.operations[operation]
        for buffer, index, slot in self.plan.casts[first:last]:
            port = next(p for p, s in self.slots.items() if s == slot)
            value = int(self.plan.buffers[buffer][index])
            exact(str(port), value, f"{value} at step {step + 1}", SimulationError)
        raise AssertionError("no value is too long")  # pragma: no cover


def all_finite(rows: npt.NDArray[np.float64]) -> bool:
    """Return True if all values are finite.

    A sum of squares would tell it sooner. But the threads of BLAS, which would add it up, then keep
    all processors busy for 30 ms.
    """
    return bool(np.isfinite(rows).all())
