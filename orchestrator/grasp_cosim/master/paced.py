"""The master of a run by the clock: its pacer, overruns, stalls, and a loop that runs on its own.

A loop that makes no call of Python runs without Python's lock, while another thread hands its rows
on; any other calls the pacer at the beginning of each step, which hands rows on while it waits.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial

import numpy as np
import numpy.typing as npt

from ..base.errors import SimulationError, choices
from ..base.system_calls import cpus
from ..fmi.instance import Instance
from ..realtime.pacer import HaltError, OverrunError, Pacer, StallError
from ..system.description import System
from ..system.parts import Port
from ..system.times import seconds
from . import loop
from .engine import Aside, CompiledLoop, Engine
from .fault_windows import NO_CUTS, Cut
from .master import CHUNK, LONG, Master, RowReceiver
from .requests import Requests

MAX_ROWS_ASIDE = 1 << 15
"""The most steps between two times that rows are handed on, where another thread does it."""

SPARE = 5e7
"""ns that this thread may take at a time for what listeners have put off."""


class PacedMaster(Master):
    """Runs a system's instances by the clock."""

    _pacer: Pacer

    def __init__(
        self,
        system: System,
        instances: Sequence[Instance],
        receive: RowReceiver,
        pacer: Pacer,
        engine: Engine = "auto",
        renew: Callable[[], Sequence[Instance]] | None = None,
        cuts: Mapping[Port, Cut] = NO_CUTS,
        requests: Requests | None = None,
    ) -> None:
        """As of a Master; the pacer says when each step begins."""
        self._pacer, self._extra_values = pacer, pacer.width
        self.meanwhile: Callable[[], None] = lambda: None
        """Called while the loop goes on without Python's lock."""
        super().__init__(system, instances, receive, engine, renew, cuts, requests)
        self._cpus = cpus() if self.runs_alone else []

    def _make_loop(self) -> None:
        self._pacer.bind(self.values[self._first_extra_value :], self._hand_on_until)
        super()._make_loop()

    @property
    def _alone(self) -> CompiledLoop | None:
        """The loop, if it needs nothing of Python's until it ends."""
        compiled = self._loop
        return compiled if isinstance(compiled, CompiledLoop) and compiled.alone else None

    @property
    def runs_alone(self) -> bool:
        """True if the loop needs nothing of Python's until it ends."""
        return self._alone is not None

    @property
    def _max_rows(self) -> int:
        return MAX_ROWS_ASIDE if self.runs_alone else CHUNK

    def _advance_until(self, steps: int) -> None:
        """Run the loop until so many steps are done, or it is halted, or stops at an overrun."""
        try:
            while self.steps_done < min(steps, self.total_steps):
                try:
                    super()._advance_until(steps)
                except StallError as stall:
                    self._after_stall(stall)
        except HaltError:
            pass
        except OverrunError:
            raise SimulationError(self._pacer.meter.verdict()) from None

    def _run_chunk(self, stop: int) -> None:
        if (compiled := self._alone) is None:
            super()._run_chunk(stop)
            return
        try:
            self._run_alone(stop, compiled)
            self._finish_pacing()
        except BaseException:
            self.hand_on()
            raise

    def _run_loop(self, stop: int) -> None:
        super()._run_loop(stop)
        self._finish_pacing()

    def _run_alone(self, stop: int, compiled: CompiledLoop) -> None:
        """Run the loop without any call of Python; another thread hands the rows on."""
        pacer, shared = self._pacer, compiled.shared
        step, operation, status = self.steps_done, 0, 0
        shared.done, shared.taken = step, self._rows.handed_on
        shared.halt = int(pacer.halted())

        def halt() -> None:
            shared.halt = 1

        def hand_on() -> None:
            self._hand_on_until(shared.done)
            shared.taken = self._rows.handed_on
            if pacer.spare is not None:
                pacer.spare(SPARE)
            self.meanwhile()
            if pacer.halted() or (requests is not None and requests.are_waiting):
                halt()

        rows, grid, requests = self._rows, self._grid, self._requests
        try:
            with Aside(hand_on, halt, self._cpus) as aside:
                while step < (until := self._until(stop, step, operation)):
                    step, operation, status = compiled(
                        rows.rows, operation, step, until, *grid, row=rows.place(step), ring=True
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

    def end_here(self, reason: str) -> None:
        """Have the run end at the communication point reached; the reason is for the log."""
        super().end_here(reason)
        self._finish_pacing()

    def _finish_pacing(self) -> None:
        """Tell the pacer where the last step has ended, if it was that."""
        if self.steps_done == self.total_steps:
            compiled = self._alone
            self._pacer.finish(self.total_steps, compiled.shared.ended if compiled else None)

    def _deliver(self, numbers: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Give the wall times in the rows to the meter, and the rows to who receives them."""
        times = rows[:, self._first_extra_value :]
        if self.runs_alone:
            self._pacer.meter.add(numbers - 1, times)
            self._receive(numbers, rows)
        else:
            self._pacer.record(numbers, times, partial(self._receive, numbers, rows))

    def _are_enough(self, rows: int) -> bool:
        """True if rows have waited long, or include the last one; the pacer has its occasions."""
        return self.steps_done == self.total_steps or self._rows.seconds_since() > LONG

    def _after_stall(self, stall: StallError) -> None:
        """A step would begin too late: where each peer may come back all begin again, else it ends.

        So no command is worked out from what was measured before a stall.
        """
        self.hand_on()
        proxies = [c for c in self.system.components if c.is_proxy]
        all_resume = all(c.of_proxy("resume") for c in proxies)
        if not all_resume or self.steps_done % self._common_period:
            raise SimulationError(
                f"{self.system.name}: the run stalled at t = "
                f"{seconds(self.system.time_ns(self.steps_done))}: a step would begin "
                f"{stall.late:.3g} s late, and {choices(c.name for c in proxies)} would get "
                "commands from old measurements; must be at most realtime.stall, or "
                "proxy.resume = true"
            ) from None
        self._begin_anew(f"the run stalled for {stall.late:.3g} s")

    def _begin_anew(self, reason: str) -> None:
        super()._begin_anew(reason)
        self._pacer.begin_anew()
