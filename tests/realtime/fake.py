"""A clock that moves only as it is told, and runs of mocks by it."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from grasp_cosim.exchange.dispatch import Dispatcher
from grasp_cosim.master.engine import Engine
from grasp_cosim.master.master import Master
from grasp_cosim.realtime.pacer import Clock, Pacer
from grasp_cosim.realtime.timing import Timing
from grasp_cosim.recording.memory import MemoryListener
from grasp_cosim.system.description import System
from grasp_cosim.system.realtime import Realtime
from support.mocks import Mock, make_system

US, MS = 1_000, 1_000_000
"""ns."""

TICK = US
"""What a look at the clock takes: so a spin comes to its end."""

NEAR = 1e-4
"""s: what the looks at the clock in a step may come to."""


class Fake:
    """Time in ns. oversleeps are added to the sleeps, one by one."""

    def __init__(self, oversleeps: Sequence[int] = ()) -> None:
        self.time = 123_456_789
        self.sleeps: list[float] = []
        self.oversleeps = list(oversleeps)
        self.on_sleep: Callable[[], None] = lambda: None

    def now(self) -> int:
        self.time += TICK
        return self.time

    def sleep(self, seconds: float) -> None:
        self.sleeps.append(seconds)
        self.time += round(seconds * 1e9) + (self.oversleeps.pop(0) if self.oversleeps else 0)
        self.on_sleep()

    @property
    def clock(self) -> Clock:
        return Clock(self.now, self.sleep)


class Paced:
    """A paced run of components with a step of 100 ms, each of which takes its own times.

    costs are the wall times in ns of the components, by name and then by the number of the step;
    under -1 is what all the other steps take. began are the wall times at which steps were called.
    """

    def __init__(
        self,
        folder: Path,
        costs: Mapping[str, Mapping[int, int]],
        realtime: Realtime | None = None,
        engine: Engine = "python",
        steps: int = 10,
        fake: Fake | None = None,
        **system: Any,
    ) -> None:
        self.fake = fake or Fake()
        self.began: dict[str, list[int]] = {name: [] for name in costs}
        mocks = [Mock(folder, name, self._output(name, own)) for name, own in costs.items()]
        self.system: System = make_system(mocks, [], steps, 100 * MS, **system)
        self.halted = False
        self.pacer = Pacer(
            self.system, realtime or Realtime(), lambda: self.halted, self.fake.clock
        )
        self.memory = MemoryListener()
        self.recording: Callable[[], None] = lambda: None
        self.master = Master(self.system, mocks, self._receive, engine, self.pacer)
        self.dispatch = Dispatcher(self.system, self.master.slots, [self.memory])
        self.master.initialise()

    def _output(self, name: str, costs: Mapping[int, int]) -> Callable[[float, float], float]:
        def output(u: float, t: float) -> float:
            step = round(t / 0.1) - 1
            if step >= 0:
                self.began[name].append(self.fake.time)
                self.fake.time += costs.get(step, costs.get(-1, 0))
            return t

        return output

    def _receive(self, steps: Any, rows: Any) -> None:
        self.recording()
        self.dispatch(steps, rows)

    def to_the_end(self) -> Timing:
        self.master.advance(self.master.total_steps)
        return self.timing()

    def timing(self) -> Timing:
        return self.pacer.timing((), ())
