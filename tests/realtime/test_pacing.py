"""Pacing by a clock that is made up: deadlines, overruns and who is to blame are exact.

And what is asked of the operating system: granted or refused in plain words, and put back.
"""

import ctypes
import errno
import gc
import os
import re
import signal
import sys
from fractions import Fraction
from functools import partial
from itertools import pairwise
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from comparison.made import write_fmu
from grasp_cosim import (
    InputError,
    Realtime,
    RunInterruptedError,
    SimulationError,
    System,
    simulate,
)
from grasp_cosim.exchange.dispatch import Dispatcher
from grasp_cosim.master.master import CHUNK
from grasp_cosim.master.paced import PacedMaster
from grasp_cosim.master.plan import Planner
from grasp_cosim.realtime.pacer import (
    MIN_ROWS,
    SPIN_NS,
    Pacer,
    StallError,
    permitted_share,
    privileges,
)
from grasp_cosim.recording.memory import MemoryListener
from grasp_cosim.system.parts import Component
from hypothesis import assume, given
from hypothesis import strategies as st
from support.marks import ENGINES, engines, examples
from support.mocks import Mock, make_system

US, MS = 1_000, 1_000_000
"""ns."""

PERIOD = 100 * MS

TICK = US
"""What a look at the clock takes: so a spin comes to its end."""

NEAR = 1e-4
"""s: what the looks at the clock in a step may come to."""


class Fake:
    """Time in ns; the next sleep takes longer by `oversleep`."""

    def __init__(self):
        self.time, self.sleeps, self.oversleep = 123_456_789, [], 0
        self.on_sleep = lambda: None
        self.clock = self.now, self.sleep

    def now(self):
        self.time += TICK
        return self.time

    def sleep(self, seconds):
        self.sleeps.append(seconds)
        self.time += round(seconds * 1e9) + self.oversleep
        self.oversleep = 0
        self.on_sleep()


class Paced:
    """A paced run of components with a step of 100 ms, each of which takes its own times.

    costs are the wall times in ns of the components, by name and then by the number of the step;
    under -1 is what all the other steps take. began are the wall times at which steps were called.
    """

    def __init__(self, folder, costs, realtime=None, engine="python", steps=10, **system):
        self.fake, self.halted, self.recording = Fake(), False, 0
        self.began = {name: [] for name in costs}
        mocks = [Mock(folder, name, self._output(name, own)) for name, own in costs.items()]
        self.system = make_system(mocks, [], steps, PERIOD, **system)
        pace = realtime or Realtime()
        self.pacer = Pacer(self.system, pace, lambda: self.halted, self.fake.clock)
        self.memory = MemoryListener()
        self.master = PacedMaster(self.system, mocks, self._receive, self.pacer, engine)
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

    def records_in(self, ns):
        """Have the recording take so long from now on; handed_on are the rows before each."""
        self.recording, self.handed_on = ns, []

    def _receive(self, steps, rows):
        if self.recording:
            self.handed_on.append(len(self.memory.columns()[0]))
            self.fake.time += self.recording
        self.dispatch(steps, rows)

    def to_the_end(self):
        self.master.advance(self.master.total_steps)
        return self.timing()

    def timing(self):
        return self.pacer.meter.timing((), ())


@pytest.fixture(params=ENGINES)
def engine(request):
    return request.param


def culprits(timing):
    return [(overrun.step, overrun.culprit) for overrun in timing.listed]


def schedule(costs, realtime):
    """By hand: when each step begins, by how much it ends late, and what is to blame, in s.

    None where a step is on the edge of being late, or two are as much to blame.
    """
    period = PERIOD / 1e9 / realtime.factor
    usual, slow = np.median(costs, axis=0), np.median(costs.sum(axis=1)) > period
    begins, overruns, base, base_step, arrived, lateness = [], [], 0.0, 0, 0.0, 0.0
    for step, (a, b) in enumerate(costs):
        due = base + (step - base_step) * period
        begins.append(max(due, arrived))
        backlog, arrived = begins[-1] - due, begins[-1] + a + b
        lateness = max(lateness, backlog)
        late = arrived - due - period
        if abs(late) < 2 * NEAR:
            return None
        if late > 0.0:
            excuse = (0.0, 0.0) if slow else usual
            suspects = {"backlog": 0.0 if slow else backlog, "a": a - excuse[0], "b": b - excuse[1]}
            second, most = sorted(suspects.values())[1:]
            if most - second < 4 * NEAR:
                return None
            culprit = max(suspects, key=suspects.get)
            took = {"backlog": backlog, "a": a, "b": b}[culprit]
            overruns.append((step, culprit, late, took))
            if realtime.overrun == "stop":
                break
            if realtime.overrun == "continue":
                base, base_step = arrived, step + 1
    return begins, overruns, arrived, base + (len(costs) - base_step) * period, lateness


milliseconds = st.integers(0, 60) | st.sampled_from((140, 250, 350))
tables = st.lists(st.tuples(milliseconds, milliseconds), min_size=10, max_size=10)
paces = st.builds(
    Realtime, st.sampled_from((1.0, 2.0, 0.7)), st.sampled_from(("catch-up", "continue", "stop"))
)


@engines
@examples(40)
@given(table=tables, realtime=paces)
def test_steps_begin_and_are_blamed_as_by_hand(table, realtime, engine):
    costs = np.array(table) / 1e3 + [0.0003, 0.0]
    assume(expected := schedule(costs, realtime))
    begins, overruns, arrived, deadline, lateness = expected
    by_step = {
        name: dict(enumerate((1e9 * costs[:, i]).round().astype(int).tolist()))
        for i, name in enumerate("ab")
    }
    with TemporaryDirectory() as folder:
        run = Paced(Path(folder), by_step, realtime, engine)
        if overruns and realtime.overrun == "stop":
            step, culprit, *figures = overruns[0]
            with pytest.raises(SimulationError) as caught:
                run.to_the_end()
            said = re.fullmatch(
                rf"mock\.toml: the step at t = {step / 10:.9g} s ended (\S+) ms late: {culprit} "
                r"took (\S+) ms; must end within (\S+) ms",
                str(caught.value),
            )
            figures = [*figures, 0.1 / realtime.factor]
            assert [float(f) / 1e3 for f in said.groups()] == pytest.approx(figures, rel=0.01)
            assert len(run.memory.columns()[0]) == len(begins) + 1
            begins = begins[: step + 1]
        else:
            run.to_the_end()
    timing, began = run.timing(), np.array(run.began["a"])
    assert (began - began[0]) / 1e9 == pytest.approx(np.array(begins), abs=5 * NEAR)
    assert [(o.step, o.culprit) for o in timing.listed] == [o[:2] for o in overruns]
    assert [o.late for o in timing.listed] == pytest.approx([o[2] for o in overruns], abs=5 * NEAR)
    assert [o.took for o in timing.listed] == pytest.approx([o[3] for o in overruns], abs=5 * NEAR)
    assert [o.time for o in timing.listed] == pytest.approx([o.step / 10 for o in timing.listed])
    assert sum(timing.culprits.values()) == timing.overruns == len(overruns)
    assert timing.steps == len(begins)
    done = costs[: len(begins)]
    for name, part in (("a", done[:, 0]), ("b", done[:, 1]), ("step", done.sum(axis=1))):
        spread = timing.parts[name]
        assert spread.worst == pytest.approx(part.max(), abs=2 * NEAR)
        assert spread.median == pytest.approx(np.sort(part)[(len(part) - 1) // 2], abs=2 * NEAR)
        assert part[round(10 * spread.worst_at)] == pytest.approx(part.max(), abs=2 * NEAR)
        assert sum(timing.histograms[name].counts) == len(part)
    for name in ("exchange", "between", "recording"):
        assert timing.parts[name].worst < NEAR
    assert timing.parts["start"].worst == pytest.approx(lateness, abs=5 * NEAR)
    if len(begins) == 10:
        simulated, wall = 1.0, max(arrived, deadline)
        assert timing.real_time_factor == pytest.approx(simulated / wall, rel=2e-3)


def make_pacer(folder, fake, realtime, step_ns=100 * MS):
    system = make_system([Mock(folder, "a", lambda u, t: t)], [], 10, step_ns)
    return Pacer(system, realtime, clock=fake.clock)


def test_it_sleeps_in_slices_and_spins_at_the_end(tmp_path):
    fake = Fake()
    pace = make_pacer(tmp_path, fake, Realtime())
    pace(0)
    start = fake.time
    pace(1)
    assert max(fake.sleeps) <= 0.05
    assert sum(fake.sleeps) == pytest.approx((100 * MS - SPIN_NS) / 1e9, abs=1e-5)
    assert fake.time - start == pytest.approx(100 * MS, abs=10 * US)
    fake.sleeps.clear()
    fake.time += 100 * MS - SPIN_NS
    pace(2)
    assert fake.sleeps == []


THIRTIETH = Fraction(1000 * MS, 30)


@pytest.mark.parametrize(
    ("factor", "step"), [(3.0, 1 * MS), (0.1, 1 * MS), (1.7, 1 * MS), (1.0, THIRTIETH)]
)
def test_the_schedule_does_not_drift(tmp_path, factor, step):
    """Where the period is no whole number of ns; and 0.1 is a tenth."""
    fake = Fake()
    pace = make_pacer(tmp_path, fake, Realtime(factor=factor, overrun="stop"), step)
    pace(0)
    start, end = fake.time, float(10**6 * step / Fraction(str(factor)))
    fake.time = start + int(end) - 3 * US
    pace(10**6)
    assert fake.time - start == pytest.approx(end, abs=1 * US)


def test_a_machine_that_wakes_us_late_is_to_blame(tmp_path):
    run = Paced(tmp_path, {"a": {-1: 50 * MS}})
    run.master.advance(3)
    run.fake.oversleep = 120 * MS
    timing = run.to_the_end()
    assert culprits(timing) == [(3, "start"), (4, "backlog")]
    assert [o.took for o in timing.listed] == pytest.approx([0.1198, 0.0698], abs=3 * NEAR)
    assert [o.late for o in timing.listed] == pytest.approx([0.0698, 0.0198], abs=3 * NEAR)
    start = timing.parts["start"]
    assert start.worst == pytest.approx(0.1198, abs=NEAR)
    assert start.worst_at == 0.3
    assert timing.parts["step"].worst == pytest.approx(0.05, abs=NEAR)


def test_the_last_of_several_overruns_ends_a_run_that_tolerates_some(tmp_path, engine):
    """The step at 0.2 s ends 40 ms late, which is tolerated; that at 0.6 s ends 250 ms late."""
    costs = {"a": {-1: 10 * MS, 2: 140 * MS, 6: 350 * MS}}
    run = Paced(tmp_path, costs, Realtime(overrun="stop", tolerance=0.05), engine)
    line = (
        r"^mock\.toml: the step at t = 0\.6 s ended 250 ms late: a took 350 ms; must end within "
        "100 ms$"
    )
    with pytest.raises(SimulationError, match=line):
        run.to_the_end()
    assert run.pacer.meter.live() == "0.737x, worst step 350 ms, 2 overruns"
    assert [o.step for o in run.timing().listed] == [2, 6]


def test_a_delay_that_is_tolerated_to_the_last_ends_no_run(tmp_path, engine):
    costs = {"a": {-1: 10 * MS, 2: 140 * MS}}
    for tolerance, ends in ((0.039, True), (0.042, False)):
        run = Paced(tmp_path, costs, Realtime(overrun="stop", tolerance=tolerance), engine)
        if ends:
            with pytest.raises(SimulationError, match=r"at t = 0\.2 s ended 40 ms late"):
                run.to_the_end()
        else:
            assert run.to_the_end().overruns == 1


def test_each_duration_is_counted_in_a_bar_of_a_sixteenth_of_an_octave(tmp_path):
    costs = {"a": {-1: 10 * MS, 3: 20 * MS, 5: 20 * MS, 7: 80 * MS}}
    histogram = Paced(tmp_path, costs).to_the_end().histograms["a"]
    edges, counts = np.array(histogram.edges), np.array(histogram.counts)
    assert counts[counts > 0].tolist() == [7, 2, 1]
    for seconds, count in ((0.01, 7), (0.02, 2), (0.08, 1)):
        (bar,) = np.flatnonzero((edges[:-1] <= seconds + 2e-6) & (seconds + 2e-6 < edges[1:]))
        assert counts[bar] == count
        assert edges[bar + 1] / edges[bar] == pytest.approx(2.0 ** (1 / 16))
    assert edges[0] <= 0.01
    assert 0.08 < edges[-1] < 0.084


@pytest.mark.parametrize(
    ("stall", "late", "stalled"),
    [(0.1, 90, False), (0.1, 110, True), (0.5, 490, False), (0.5, 510, True)],
)
def test_a_delay_from_which_on_a_bench_counts_as_lost(tmp_path, stall, late, stalled):
    """Of a component that has a peer; of others there is none."""
    variables = {"proxy.state": 'causality="output" variability="discrete" | Integer'}
    bench = write_fmu(tmp_path / "bench.fmu", variables, {})
    peers = System("bench", (Component("bench", bench, {}),), (), PERIOD, 10 * PERIOD, "sequential")
    plain = make_system([Mock(tmp_path, "a", lambda u, t: t)], [], 10, PERIOD)
    for system, counts in ((peers, stalled), (plain, False)):
        fake = Fake()
        pace = Pacer(system, Realtime(stall=stall), clock=fake.clock)
        pace(0)
        fake.time += PERIOD + late * MS
        if counts:
            with pytest.raises(StallError):
                pace(1)
        else:
            pace(1)


def test_recording_is_to_blame_where_it_takes_too_long(tmp_path):
    run = Paced(tmp_path, {"a": {-1: 50 * MS}})
    run.master.advance(3)
    run.records_in(80 * MS)
    run.master.hand_on()
    run.records_in(0)
    timing = run.to_the_end()
    assert culprits(timing) == [(2, "recording")]
    assert timing.listed[0].took == pytest.approx(0.08, abs=NEAR)
    assert timing.parts["recording"].worst_at == 0.2
    assert timing.parts["between"].worst < NEAR


def test_what_may_wait_is_done_in_spare_time_which_counts_as_recording(tmp_path):
    run, offered = Paced(tmp_path, {"a": {-1: 10 * MS}}, steps=5), []

    def spare(ns):
        offered.append(ns / 1e9)
        run.fake.time += 20 * MS
        return len(offered) > 1  # there was nothing to do at first

    run.pacer.spare = spare
    timing = run.to_the_end()
    assert offered == pytest.approx([2 / 3 * 0.09] * 4, abs=NEAR)
    assert timing.parts["recording"].worst == pytest.approx(0.02, abs=NEAR)
    assert sum(timing.histograms["recording"].counts[-1:]) == 3


def test_rows_are_handed_on_while_there_is_time_to_wait(tmp_path, engine):
    """And what is recorded is all of them, in order."""
    run = Paced(tmp_path, {"a": {-1: 10 * MS}}, engine=engine, steps=1500)
    run.records_in(50 * MS)
    assert run.to_the_end().overruns == 0
    assert max(b - a for a, b in pairwise([*run.handed_on, 1501])) <= MIN_ROWS + 2
    assert run.memory.columns()[0].tolist() == [k * 100 * MS / 1e9 for k in range(1501)]
    assert run.memory.columns()[1]["a.y"] == pytest.approx(run.memory.columns()[0])


def test_rows_wait_where_there_is_no_time_for_them(tmp_path, engine):
    run = Paced(tmp_path, {"a": {-1: 60 * MS}}, engine=engine, steps=CHUNK + 500)
    run.records_in(50 * MS)
    timing = run.to_the_end()
    assert run.handed_on == [1, MIN_ROWS + 1, CHUNK + 1]
    assert culprits(timing) == [(MIN_ROWS - 1, "recording"), (CHUNK - 1, "recording")]
    assert len(run.memory.columns()[0]) == CHUNK + 501


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_a_slow_component_is_counted_where_it_steps(tmp_path, scheme):
    """It takes its time at every fifth step, and is then to blame although that is usual."""
    run = Paced(
        tmp_path, {"a": {-1: 10 * MS}, "slow": {-1: 95 * MS}}, steps=10, scheme=scheme,
        own={"slow": 500 * MS},
    )  # fmt: skip
    timing = run.to_the_end()
    assert culprits(timing) == [(4, "slow"), (9, "slow")]
    counts = {name: sum(h.counts) for name, h in timing.histograms.items()}
    assert counts["slow"] == {"sequential": 2, "jacobi": 4}[scheme]
    assert counts["a"] == counts["step"] == counts["start"] == counts["between"] == 10


def test_interrupted_in_a_binary_it_keeps_what_was_handed_on(tmp_path, monkeypatch):
    monkeypatch.setattr(Planner, "_guarded", lambda _, call: call)  # as of calls of binaries
    run = Paced(tmp_path, {"a": {-1: 10 * MS}}, steps=200)

    def interrupt():
        if len(run.began["a"]) == 150:
            raise KeyboardInterrupt

    run.fake.on_sleep = interrupt
    with pytest.raises(KeyboardInterrupt):
        run.master.advance(200)
    done = run.master.steps_done
    assert MIN_ROWS <= done <= 150
    run.master.hand_on()
    assert len(run.memory.columns()[0]) == done + 1
    assert run.timing().steps <= done


def test_halted_it_stops_at_a_communication_point_and_can_go_on(tmp_path, engine):
    run = Paced(tmp_path, {"a": {}}, engine=engine)
    run.master.advance(3)
    run.fake.on_sleep = lambda: setattr(run, "halted", True)
    assert run.master.advance(5) == 0
    assert (len(run.began["a"]), run.master.steps_done) == (3, 3)
    run.halted, run.fake.on_sleep = False, lambda: None
    assert run.master.advance(100) == 7
    assert run.timing().steps == 10
    assert run.memory.columns()[1]["a.y"].tolist() == pytest.approx([k / 10 for k in range(11)])


@pytest.mark.parametrize("priority", [20, None])
def test_at_a_priority_others_get_to_run_in_overload(tmp_path, priority):
    run = Paced(tmp_path, {"a": {-1: 101 * MS}}, Realtime(priority=priority), steps=20)
    run.to_the_end()
    breaths = 20 * 101 // (500 + 101)
    assert len(run.fake.sleeps) == (breaths if priority else 0)


def test_a_component_must_not_be_called_like_another_part(tmp_path):
    with pytest.raises(InputError, match=r"^mock.toml: component 'step': in real time must not"):
        Paced(tmp_path, {"step": {}})


def test_a_run_without_steps_has_a_timing(tmp_path):
    timing = Paced(tmp_path, {"a": {}}).timing()
    assert (timing.steps, timing.real_time_factor, timing.parts) == (0, 0.0, {})


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("engine", ["python", "auto"])
def test_ctrl_c_does_not_wait_for_the_next_step(tmp_path, monkeypatch, engine):
    """Which would begin only after 1000 s."""
    mock, fake = Mock(tmp_path, "a", lambda u, t: t), Fake()
    fake.on_sleep = lambda: os.kill(os.getpid(), signal.SIGINT)
    monkeypatch.setattr("grasp_cosim.master.session.load", lambda component: mock)
    monkeypatch.setattr("grasp_cosim.realtime.pacer.CLOCK_OF_THE_SYSTEM", fake.clock)
    with pytest.raises(RunInterruptedError) as interrupted:
        simulate(make_system([mock], [], 10), engine=engine, realtime=Realtime(factor=1e-4))
    result = interrupted.value.result
    assert len(fake.sleeps) == 1
    assert not result.complete
    assert result.time.tolist() == [0.0, 0.1]


# ----------------------------------------------------------------- the operating system

linux = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has these")
ALL = Realtime(priority=20, cpu=0, lock_memory=True)


class Kernel:
    """What the operating system was asked to do, which it refuses with an error code, if any."""

    def __init__(self, monkeypatch, code=0):
        self.asked, self.code = [], code
        known = {"getscheduler": 0, "getparam": "parameter", "getaffinity": {0, 1}}
        for name in (*known, "setscheduler", "setaffinity"):
            answer = partial(self._answer, name, known.get(name))
            monkeypatch.setattr(os, f"sched_{name}", answer, raising=False)
        monkeypatch.setattr(ctypes, "CDLL", lambda *_, **__: self)

    def _answer(self, name, known, _, *arguments):
        if known is None and self.code:
            raise OSError(self.code, os.strerror(self.code))
        if known is None:
            self.asked.append((name, *arguments))
        return known

    def mlockall(self, flags):
        self.asked.append(("mlockall", flags))
        ctypes.set_errno(self.code)
        return -1 if self.code else 0

    def munlockall(self):
        self.asked.append(("munlockall",))


@linux
def test_what_was_granted_is_put_back(monkeypatch):
    kernel = Kernel(monkeypatch)
    with privileges(ALL) as found:
        assert found.granted == [
            "CPU 0",
            "memory locked",
            f"SCHED_FIFO, priority 20{permitted_share()}",
        ]
        assert found.refused == []
        names = [name for name, *_ in kernel.asked]
        assert names == ["setaffinity", "mlockall", "setscheduler"]
        kernel.asked.clear()
    back = [("setscheduler", 0, "parameter"), ("munlockall",), ("setaffinity", {0, 1})]
    assert kernel.asked == back


@linux
def test_what_is_not_permitted_is_said_with_the_remedy(monkeypatch):
    kernel = Kernel(monkeypatch, errno.EPERM)
    with privileges(ALL) as found:
        assert found.granted == []
    cpu, memory, priority = found.refused
    assert cpu == "CPU 0: Operation not permitted; must be one of 0, 1"
    assert memory.startswith("memory locked: Operation not permitted; needs CAP_IPC_LOCK, or a")
    assert priority.startswith(
        "SCHED_FIFO, priority 20: Operation not permitted; needs CAP_SYS_NICE, or a limit"
    )
    assert kernel.asked == [("mlockall", 7)]


def test_a_system_that_has_none_of_it(monkeypatch):
    for name in ("sched_setscheduler", "sched_getscheduler", "sched_getaffinity"):
        monkeypatch.delattr(os, name, raising=False)
    monkeypatch.setattr(sys, "platform", "darwin")
    with privileges(ALL) as found:
        assert found.granted == []
    why = "not possible on this operating system"
    names = ("CPU 0", "memory locked", "SCHED_FIFO, priority 20")
    assert found.refused == [f"{name}: {why}" for name in names]


def test_no_garbage_is_collected_on_the_way():
    with privileges(Realtime()) as found:
        assert not gc.isenabled()
        assert gc.get_freeze_count() > 0
    assert (gc.isenabled(), gc.get_freeze_count()) == (True, 0)
    assert (found.granted, found.refused) == ([], [])


@pytest.mark.parametrize(
    ("runtime", "said"),
    [
        ("950000", " (the kernel permits it 95 % of each 1 s)"),
        ("1000000", ""),
        ("-1", ""),
        ("", ""),
    ],
)
def test_what_the_kernel_permits_of_a_priority_is_said(monkeypatch, tmp_path, runtime, said):
    monkeypatch.setattr("grasp_cosim.realtime.pacer.KERNEL", tmp_path)
    (tmp_path / "sched_rt_runtime_us").write_text(runtime)
    (tmp_path / "sched_rt_period_us").write_text("1000000")
    Kernel(monkeypatch)
    with privileges(Realtime(priority=20)) as found:
        assert found.granted == [f"SCHED_FIFO, priority 20{said}"]
