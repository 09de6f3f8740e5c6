"""Pacing by a clock that is made up: deadlines, overruns and who is to blame are exact."""

from fractions import Fraction
from itertools import pairwise

import pytest
from grasp_cosim import InputError, Realtime, SimulationError
from grasp_cosim.master.master import CHUNK
from grasp_cosim.master.plan import Planner
from grasp_cosim.realtime.pacer import BREATH_NS, SLICE_NS, SOME, SPIN_NS, Pacer
from realtime.fake import MS, NEAR, US, Fake, Paced
from support.marks import ENGINES
from support.mocks import Mock, make_system


@pytest.fixture(params=ENGINES)
def engine(request):
    return request.param


def culprits(timing):
    return [(overrun.step, overrun.culprit) for overrun in timing.listed]


def make_pacer(folder, fake, realtime, step_ns=100 * MS):
    system = make_system([Mock(folder, "a", lambda u, t: t)], [], 10, step_ns)
    return Pacer(system, realtime, clock=fake.clock)


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
def test_each_step_begins_at_its_time(tmp_path, engine, scheme):
    run = Paced(tmp_path, {"a": {-1: 30 * MS}, "b": {-1: 20 * MS}}, engine=engine, scheme=scheme)
    timing = run.to_the_end()
    first, *others = run.began["a"]
    expected = [k * 100 * MS for k in range(1, 10)]
    assert [t - first for t in others] == pytest.approx(expected, abs=20 * US)
    assert (timing.steps, timing.overruns, timing.listed) == (10, 0, ())
    assert timing.real_time_factor == pytest.approx(1.0, abs=1e-4)
    usual = {"step": 0.05, "a": 0.03, "b": 0.02}
    none = dict.fromkeys(("start", "exchange", "between", "recording"), 0.0)
    medians = {name: part.median for name, part in timing.parts.items()}
    assert medians == pytest.approx({**usual, **none}, rel=1 / 64, abs=NEAR)
    assert timing.parts["step"].worst == pytest.approx(0.05, abs=NEAR)


def test_it_sleeps_in_slices_and_spins_at_the_end(tmp_path):
    fake = Fake()
    pace = make_pacer(tmp_path, fake, Realtime())
    pace(0)
    start = fake.time
    pace(1)
    assert max(fake.sleeps) <= SLICE_NS / 1e9
    assert sum(fake.sleeps) == pytest.approx((100 * MS - SPIN_NS) / 1e9, abs=1e-5)
    assert fake.time - start == pytest.approx(100 * MS, abs=10 * US)
    fake.sleeps.clear()
    fake.time += 100 * MS - SPIN_NS
    pace(2)
    assert fake.sleeps == []


@pytest.mark.parametrize("factor", [3.0, 0.1, 1.7])
def test_the_schedule_does_not_drift(tmp_path, factor):
    """Where the period is no whole number of ns; and 0.1 is a tenth."""
    fake = Fake()
    system = make_system([Mock(tmp_path, "a", lambda u, t: t)], [], 10, 1 * MS)
    pace = Pacer(system, Realtime(factor=factor, overrun="stop"), clock=fake.clock)
    pace(0)
    start = fake.time
    fake.time = start + int(10**6 * MS / Fraction(str(factor))) - 3 * US
    pace(10**6)
    assert fake.time - start == pytest.approx(10**6 * MS / Fraction(str(factor)), abs=1 * US)


def test_catch_up_keeps_to_the_schedule(tmp_path, engine):
    """Step 3 takes 350 ms: 3 to 5 end late, by 250, 160 and 70 ms, and 7 begins in time."""
    run = Paced(tmp_path, {"a": {-1: 10 * MS, 3: 350 * MS}, "b": {}}, engine=engine)
    timing = run.to_the_end()
    assert culprits(timing) == [(3, "a"), (4, "backlog"), (5, "backlog")]
    assert [o.late for o in timing.listed] == pytest.approx([0.25, 0.16, 0.07], abs=NEAR)
    assert [o.took for o in timing.listed] == pytest.approx([0.35, 0.25, 0.16], abs=NEAR)
    assert [o.time for o in timing.listed] == pytest.approx([0.3, 0.4, 0.5])
    assert timing.culprits == {"backlog": 2, "a": 1}
    began = run.began["a"]
    assert began[7] - began[0] == pytest.approx(700 * MS, abs=20 * US)
    assert timing.real_time_factor == pytest.approx(1.0, abs=1e-4)
    assert (timing.parts["a"].worst_at, timing.parts["start"].worst_at) == (0.3, 0.4)


def test_continue_shifts_the_schedule(tmp_path, engine):
    run = Paced(
        tmp_path, {"a": {-1: 10 * MS, 3: 350 * MS}}, Realtime(overrun="continue"), engine
    )  # fmt: skip
    timing = run.to_the_end()
    assert culprits(timing) == [(3, "a")]
    began = run.began["a"]
    assert began[4] - began[3] == pytest.approx(350 * MS, abs=50 * US)
    assert began[9] - began[4] == pytest.approx(500 * MS, abs=50 * US)
    assert timing.real_time_factor == pytest.approx(1.0 / 1.25, abs=1e-3)


def test_stop_ends_the_run_and_keeps_what_was_recorded(tmp_path, engine):
    costs = {"a": {-1: 10 * MS}, "b": {-1: 20 * MS, 3: 140 * MS}}
    run = Paced(tmp_path, costs, Realtime(overrun="stop"), engine)
    error = r"^mock.toml: the step at t = 0\.3 s ended 50 ms late: b took 140 ms; must end within 1"
    with pytest.raises(SimulationError, match=error):
        run.to_the_end()
    assert run.memory.columns()[0].tolist() == pytest.approx([0.0, 0.1, 0.2, 0.3, 0.4])
    assert len(run.began["a"]) == 4
    assert culprits(run.timing()) == [(3, "b")]


def test_the_last_step_can_stop_the_run(tmp_path, engine):
    run = Paced(tmp_path, {"a": {9: 150 * MS}}, Realtime(overrun="stop"), engine)
    with pytest.raises(SimulationError, match=r"the step at t = 0\.9 s ended 50 ms late: a took"):
        run.to_the_end()
    assert len(run.memory.columns()[0]) == 11


def test_a_machine_that_wakes_us_late_is_to_blame(tmp_path):
    fake = Fake()
    run = Paced(tmp_path, {"a": {-1: 50 * MS}}, fake=fake)
    run.master.advance(3)
    fake.oversleeps = [120 * MS]
    timing = run.to_the_end()
    assert culprits(timing) == [(3, "start"), (4, "backlog")]
    start = timing.parts["start"]
    assert start.worst == pytest.approx(0.1198, abs=NEAR)
    assert start.worst_at == 0.3
    assert timing.parts["step"].worst == pytest.approx(0.05, abs=NEAR)


def test_recording_is_to_blame_where_it_takes_too_long(tmp_path):
    run = Paced(tmp_path, {"a": {-1: 50 * MS}})
    run.master.advance(3)

    def slow():
        run.fake.time += 80 * MS

    run.recording = slow
    run.master.hand_on()
    run.recording = lambda: None
    timing = run.to_the_end()
    assert culprits(timing) == [(2, "recording")]
    assert timing.listed[0].took == pytest.approx(0.08, abs=NEAR)
    assert timing.parts["recording"].worst_at == 0.2


def test_rows_are_handed_on_while_there_is_time_to_wait(tmp_path, engine):
    """And what is recorded is all of them, in order."""
    run = Paced(tmp_path, {"a": {-1: 10 * MS}}, engine=engine, steps=1500)
    took = []

    def slow():
        took.append(len(run.memory.columns()[0]))
        run.fake.time += 50 * MS

    run.recording = slow
    timing = run.to_the_end()
    assert timing.overruns == 0
    assert max(b - a for a, b in pairwise([*took, 1501])) <= SOME + 2
    assert run.memory.columns()[0].tolist() == [k * 100 * MS / 1e9 for k in range(1501)]
    assert run.memory.columns()[1]["a.y"] == pytest.approx(run.memory.columns()[0])


def test_rows_wait_where_there_is_no_time_for_them(tmp_path, engine):
    run = Paced(tmp_path, {"a": {-1: 60 * MS}}, engine=engine, steps=CHUNK + 500)
    took = []

    def slow():
        took.append(len(run.memory.columns()[0]))
        run.fake.time += 50 * MS

    run.recording = slow
    timing = run.to_the_end()
    assert took == [1, SOME + 1, CHUNK + 1]
    assert (
        culprits(timing)
        == [(SOME - 1, "recording"), (CHUNK - 1, "recording"), (CHUNK + 499, "a")][:2]
    )
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


def test_where_the_machine_is_too_slow_the_longest_part_is_to_blame(tmp_path):
    costs = {"a": {-1: 40 * MS, 5: 50 * MS}, "b": {-1: 90 * MS}}
    timing = Paced(tmp_path, costs).to_the_end()
    assert timing.culprits == {"b": 10}
    assert timing.real_time_factor == pytest.approx(100 / 131, abs=0.01)


def test_the_time_between_two_beginnings_is_divided_without_a_gap(tmp_path):
    """In overload, where there is no waiting, the parts are the whole of the wall time."""
    run = Paced(tmp_path, {"a": {-1: 110 * MS}, "b": {-1: 7 * MS}}, steps=600)
    before = run.fake.time
    timing = run.to_the_end()
    names = ("a", "b", "exchange", "recording", "between")
    total = sum(
        count * (low + high) / 2
        for name in names
        for h in [timing.histograms[name]]
        for low, high, count in zip(h.edges, h.edges[1:], h.counts, strict=False)
    )
    assert total == pytest.approx((run.fake.time - before) / 1e9, rel=1 / 16)


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
    assert SOME <= done <= 150
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


def test_at_a_priority_others_get_to_run_in_overload(tmp_path):
    run = Paced(tmp_path, {"a": {-1: 101 * MS}}, steps=20)
    run.pacer.breathes = True
    run.to_the_end()
    assert len(run.fake.sleeps) == 20 * 101 * MS // (BREATH_NS + 101 * MS)
    without = Paced(tmp_path, {"a": {-1: 101 * MS}}, steps=20)
    without.to_the_end()
    assert without.fake.sleeps == []


@pytest.mark.parametrize("name", ["step", "recording", "backlog"])
def test_a_component_must_not_be_called_like_another_part(tmp_path, name):
    with pytest.raises(InputError, match=rf"^mock.toml: component '{name}': in real time must not"):
        Paced(tmp_path, {name: {}})


def test_a_run_without_steps_has_a_timing(tmp_path):
    timing = Paced(tmp_path, {"a": {}}).timing()
    assert (timing.steps, timing.real_time_factor, timing.parts) == (0, 0.0, {})
