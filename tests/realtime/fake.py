"""A clock that moves only as it is told, and runs of mocks by it."""

from grasp_cosim.exchange.dispatch import Dispatcher
from grasp_cosim.master.master import Master
from grasp_cosim.realtime.pacer import Clock, Pacer
from grasp_cosim.recording.memory import MemoryListener
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

    def __init__(self, oversleeps=()):
        self.time = 123_456_789
        self.sleeps = []
        self.oversleeps = list(oversleeps)
        self.on_sleep = lambda: None

    def now(self):
        self.time += TICK
        return self.time

    def sleep(self, seconds):
        self.sleeps.append(seconds)
        self.time += round(seconds * 1e9) + (self.oversleeps.pop(0) if self.oversleeps else 0)
        self.on_sleep()

    @property
    def clock(self):
        return Clock(self.now, self.sleep)


class Paced:
    """A paced run of components with a step of 100 ms, each of which takes its own times.

    costs are the wall times in ns of the components, by name and then by the number of the step;
    under -1 is what all the other steps take. began are the wall times at which steps were called.
    """

    def __init__(
        self, folder, costs, realtime=None, engine="python", steps=10, fake=None, **system
    ):
        self.fake = fake or Fake()
        self.began = {name: [] for name in costs}
        mocks = [Mock(folder, name, self._output(name, own)) for name, own in costs.items()]
        self.system = make_system(mocks, [], steps, 100 * MS, **system)
        self.halted = False
        self.pacer = Pacer(
            self.system, realtime or Realtime(), lambda: self.halted, self.fake.clock
        )
        self.memory = MemoryListener()
        self.recording = lambda: None
        self.master = Master(self.system, mocks, self._receive, engine, self.pacer)
        self.dispatch = Dispatcher(self.system, self.master.slots, [self.memory])
        self.master.initialise()

    def _output(self, name, costs):
        def output(u, t):
            step = round(t / 0.1) - 1
            if step >= 0:
                self.began[name].append(self.fake.time)
                self.fake.time += costs.get(step, costs.get(-1, 0))
            return t

        return output

    def _receive(self, steps, rows):
        self.recording()
        self.dispatch(steps, rows)

    def to_the_end(self):
        self.master.advance(self.master.total_steps)
        return self.timing()

    def timing(self):
        return self.pacer.timing((), ())
