"""Recording in windows around a trigger: the rows of a run without it, whatever the blocks are."""

import json
from dataclasses import replace
from typing import ClassVar

import numpy as np
import pytest
from grasp_cosim import (
    InputError,
    Realtime,
    RunInterruptedError,
    SimulationError,
    System,
    load_run,
    simulate,
)
from grasp_cosim.exchange.trigger import TriggeredRows
from grasp_cosim.recording.folder import FORMS, RunFolder
from grasp_cosim.recording.memory import WindowRows
from hypothesis import given
from hypothesis import strategies as st

STEP = 0.125


class Pulses:
    """Puts out whether the time is in one of its pulses, and a count of its steps."""

    outputs: ClassVar = {"on": (False, None), "count": (0, None), "wave": (0.0, "m")}
    high = frozenset()

    def __init__(self):
        self.count = 0

    def step(self, t, inputs):
        self.count += 1
        return {"on": self.count in self.high, "count": self.count, "wave": np.sin(self.count)}


def pulses(high, steps, **record):
    """A system whose signal is on in the steps of these numbers, from 1 on."""
    return System(
        components={"a": type("Pulses", (Pulses,), {"high": frozenset(high)})},
        experiment={"step": STEP, "stop": STEP * steps},
        record={"trigger": "a.on == true", **record},
    )


def windows_of(is_on, before, after):
    """The oracle: the first and the last step of each window, from the steps as they stand."""
    windows = []
    for step, now in enumerate(is_on):
        if not now or (step and is_on[step - 1]):
            continue
        if windows and step <= windows[-1][1]:
            windows[-1][1] = step + after
        else:
            begin = windows[-1][1] + 1 if windows else 0
            windows.append([max(begin, step - before), step + after])
    return windows


@given(st.data())
def test_windows_are_the_rows_of_a_run_without_a_trigger(data):
    steps = data.draw(st.integers(1, 60))
    before, after = data.draw(st.integers(0, 12)), data.draw(st.integers(0, 12))
    every = data.draw(st.integers(1, after + 1))
    high = data.draw(st.sets(st.integers(1, steps)))
    system = pulses(high, steps, before=STEP * before, after=STEP * after)
    whole = simulate(system.with_record(trigger=False), every=every)
    is_on = simulate(system.with_record(trigger=False))["a.on"]
    result = simulate(system, every=every)
    expected = windows_of(is_on.tolist(), before, after)
    assert len(result.windows) == len(expected)
    numbers = np.rint(whole.time / STEP)
    for window, (first, last) in zip(result.windows, expected, strict=True):
        chosen = (numbers >= first) & (numbers <= last)
        assert window.time.tolist() == whole.time[chosen].tolist()
        for name, column in whole.items():
            assert window[name].dtype == column.dtype
            assert window[name].tobytes() == column[chosen].tobytes()
    assert len(result.time) == sum(len(window.time) for window in result.windows)
    assert result.last_step == steps
    assert result.complete


@given(st.data())
def test_blocks_of_any_length_come_to_the_same_and_little_is_held(data):
    """No more rows than a window has before its trigger."""
    is_on = np.array(data.draw(st.lists(st.booleans(), min_size=1, max_size=80)), float)
    before, after = data.draw(st.integers(0, 9)), data.draw(st.integers(0, 9))
    system = pulses((), 100, before=STEP * before, after=STEP * after)
    (port,) = (p for p in system.observed if p.variable == "on")
    trigger = system.record.trigger
    rows = TriggeredRows(system, trigger, {port: 0})
    received = []

    class Receiver:
        def begin_window(self, window):
            received.append([])

        def hand_on(self, steps, rows):
            received[-1] += steps.tolist()
            assert rows[:, 0].tolist() == is_on[steps].tolist()

        def end_window(self, window):
            assert received[-1]

    first = 0
    while first < len(is_on):
        last = min(len(is_on), first + data.draw(st.integers(1, 20)))
        steps, values = np.arange(first, last), is_on[first:last, np.newaxis]
        rows(Receiver(), steps, values, steps, values)
        assert sum(len(kept) for kept, _ in rows._kept) <= before
        first = last
    expected = windows_of(is_on.astype(bool).tolist(), before, after)
    assert received == [[*range(a, min(b, len(is_on) - 1) + 1)] for a, b in expected]


def test_the_log_and_the_windows_tell_when_the_trigger_came_true():
    result = simulate(pulses({9, 11, 40}, 60, before=2 * STEP, after=3 * STEP))
    assert [line for line in result.log if "recording" in line] == [
        "t = 1 s: recording 1: a.on == true",
        "t = 4.875 s: recording 2: a.on == true",
    ]
    assert [(w.window.number, w.window.time, w.window.times) for w in result.windows] == [
        (1, 1.0, 2),
        (2, 4.875, 1),
    ]
    assert [(w.time[0] / STEP, w.time[-1] / STEP) for w in result.windows] == [(6, 13), (37, 42)]
    assert result.windows[0].log == ("t = 1 s: recording 1: a.on == true",)
    assert "2 windows" in repr(result)


def test_a_trigger_that_never_came_true_is_said():
    result = simulate(pulses((), 20, after=STEP))
    assert (result.windows, len(result.time)) == ((), 0)
    assert result.log[-1] == "record.trigger: a.on == true never came true: nothing is recorded"
    assert result.metrics["steps"] == 20


def test_an_edge_between_two_states_of_a_session_is_taken_back(grasp):
    system = grasp.with_experiment(step=1e-3, stop=2.5).with_record(
        trigger="plant.contact[1] == true", before=0.01, after=0.02
    )
    whole = simulate(system)
    with simulate.session(system) as session:
        session.step(1850)
        state = session.save()
        session.step(45)
        assert len(session.result().windows) == 1
        session.restore(state)
        assert session.result().windows == ()
        session.step(10**4)
        again = session.result()
        session.reset()
        assert session.result().windows == ()
    (window,), (second,) = whole.windows, again.windows
    assert all(window[name].tobytes() == second[name].tobytes() for name in window)


@pytest.mark.parametrize("engine", ["python", "compiled"])
@pytest.mark.parametrize("realtime", [False, Realtime(factor=1e3)])
def test_the_windows_are_those_rows_in_real_time_and_in_each_engine(grasp, engine, realtime):
    system = grasp.with_experiment(step=1e-2, stop=2.5)
    whole = simulate(system)
    triggered = system.with_record(trigger="plant.gap[1] < 0.001", before=0.1, after=0.2)
    result = simulate(triggered, engine=engine, realtime=realtime)
    (window,) = result.windows
    first = int(np.flatnonzero(whole["plant.gap[1]"] < 0.001)[0])
    rows = slice(first - 10, first + 21)
    assert window.time.tolist() == whole.time[rows].tolist()
    assert all(window[name].tobytes() == column[rows].tobytes() for name, column in whole.items())
    assert result.metrics["time_to_contact"] == whole.metrics["time_to_contact"]
    assert (result.timing is not None) is bool(realtime)
    assert window.timing is None


def contact(grasp, **times):
    """The grasp in 250 steps, of which those around the first contact are recorded."""
    system = grasp.with_experiment(step=1e-2, stop=2.5)
    return system.with_record(trigger="plant.contact[1] == true", **times)


@pytest.mark.parametrize("condition", ["> 0", "== 1", ">= 1", "!= 0", "!= false"])
def test_a_boolean_is_compared_with_its_number_too(grasp, condition):
    by_word, by_number = (
        simulate(contact(grasp, before=0.05, after=0.1).with_record(trigger=f"plant.contact[1] {c}",
                                                                    before=0.05, after=0.1))
        for c in ("== true", condition)
    )  # fmt: skip
    [expected], [found] = by_word.windows, by_number.windows
    assert found.time.tolist() == expected.time.tolist()


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("realtime", [False, Realtime(factor=1e3)])
def test_each_window_is_the_folder_of_a_run(grasp, tmp_path, form, realtime):
    if form == "arrow":
        pytest.importorskip("pyarrow")
    system = contact(grasp, before=0.05, after=0.1)
    with RunFolder(tmp_path, system, ["run"], paced=bool(realtime), form=form) as folder:
        result = simulate(system, realtime=realtime, listeners=[folder])
        folder.finish(result)
    (window,) = result.windows
    files = sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*") if p.is_file())
    assert files == ["run.json", "window_001/run.json", f"window_001/signals.{form}"]
    for back in (load_run(tmp_path).windows[0], load_run(tmp_path / "window_001")):
        assert back.complete
        assert back.window == window.window
        assert back.time.tobytes() == window.time.tobytes()
        assert all(back[n].tobytes() == window[n].tobytes() for n in window)
        assert back.metrics == window.metrics
        assert (back.log, back.verdict) == (window.log, ())
        assert back.origin["command"] == ["run"]
    back = load_run(tmp_path)
    assert (back.metrics, back.log, back.settings) == (result.metrics, result.log, result.settings)
    assert [*back] == [*result]
    assert back.settings["trigger"] == {
        "when": "plant.contact[1] == true", "before": 0.05, "after": 0.1
    }  # fmt: skip
    listed = json.loads((tmp_path / "run.json").read_text())["windows"]
    assert listed == [result.windows[0].summary]
    assert (listed[0]["folder"], listed[0]["rows"]) == ("window_001", 16)
    result.save(tmp_path / "saved", form)
    again = load_run(tmp_path / "saved")
    assert again.windows[0].time.tobytes() == window.time.tobytes()
    window.save(tmp_path / "one", form)
    assert load_run(tmp_path / "one").time.tobytes() == window.time.tobytes()


def test_no_window_of_an_older_run_is_left(grasp, tmp_path):
    """Nor in a run without a trigger; what else is in their folders stays."""
    both = contact(grasp, after=0.0).with_settings({"record.trigger": "plant.contact[2] == true"})
    result = simulate(both)
    result.save(tmp_path)
    (tmp_path / "report.html").write_text("older")
    (tmp_path / "window_001/signals.mf4").write_text("older")
    (tmp_path / "window_002").mkdir()
    (tmp_path / "window_002/signals.csv").write_text("older")
    (tmp_path / "window_002/mine.txt").write_text("mine")
    simulate(grasp, step=1e-2, stop=0.1).save(tmp_path / "window_007")  # another run
    simulate(grasp, step=1e-2, stop=0.1).save(tmp_path)
    files = sorted(str(p.relative_to(tmp_path)) for p in tmp_path.rglob("*"))
    others = ["window_007", "window_007/run.json", "window_007/signals.csv"]
    assert files == ["run.json", "signals.csv", "window_002", "window_002/mine.txt", *others]
    simulate(contact(grasp, after=0.0), stop=0.1).save(tmp_path)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.json", "window_002", "window_007"]
    assert load_run(tmp_path).windows == ()


def test_an_interrupted_run_keeps_its_windows(grasp, tmp_path):
    """The open one, too, which is not complete."""
    system = contact(grasp, before=0.05, after=0.5)

    class Interrupts:
        rows = 0

        def begin(self, experiment, signals):
            pass

        def block(self, steps, rows):
            self.rows += len(steps)
            if self.rows > 20:
                raise KeyboardInterrupt

        def end(self, complete):
            pass

    with RunFolder(tmp_path, system) as folder:
        with pytest.raises(RunInterruptedError) as interrupted:
            simulate(
                system,
                listeners=[folder, Interrupts()],
                until=lambda session: session.result() is None,
            )
        folder.finish(interrupted.value.result)
    back = load_run(tmp_path)
    (window,) = back.windows
    assert not back.complete
    assert not window.complete
    assert window.window.time == pytest.approx(1.89)
    assert len(window.time) > 20


def test_the_folder_can_be_read_while_the_run_goes_on(grasp, tmp_path):
    """As a kill would leave it."""
    system = contact(grasp, before=0.05, after=0.1)
    seen = []

    def look(session):
        if session.time == 1.9:
            session.result()  # hands the rows on
            seen.append(load_run(tmp_path))
        return False

    with RunFolder(tmp_path, system) as folder:
        simulate(system, listeners=[folder], until=look)
    (back,) = seen
    (window,) = back.windows
    assert not back.complete
    assert not window.complete
    assert window.time[-1] == 1.9
    assert back.measured.values == {}
    assert back.measured.missing == (
        "metrics of the run: none, as only the rows of windows are there",
    )


def test_a_window_that_is_gone_is_named(grasp, tmp_path):
    simulate(contact(grasp, after=0.1)).save(tmp_path)
    (tmp_path / "window_001/run.json").unlink()
    with pytest.raises(InputError, match="is damaged: has 0 windows; must have 1"):
        load_run(tmp_path)


def test_a_window_whose_file_cannot_be_made_breaks_the_run(grasp, tmp_path):
    (tmp_path / "window_001").write_text("in the way")
    system = contact(grasp, after=0.1)
    refusal = pytest.raises(SimulationError, match="window_001: cannot be written")
    with RunFolder(tmp_path, system) as folder, refusal:
        simulate(system, listeners=[folder])
    assert not json.loads((tmp_path / "run.json").read_text())["complete"]


def test_more_rows_than_a_window_has_are_not_left_out():
    with pytest.raises(InputError, match=r"every = 5: a window .* must be at most 4, the points"):
        simulate(pulses({1}, 20, after=3 * STEP), every=5)


def test_without_space_the_run_goes_on_and_says_so(monkeypatch):
    class Full:
        def write(self, _):
            raise OSError(28, "No space left on device")

        def truncate(self, _):
            pass

    opened = WindowRows._open

    def open_full(self, rows=0):
        opened(self, rows)
        self._storage = replace(self._storage, medium=Full())

    monkeypatch.setattr(WindowRows, "_open", open_full)
    result = simulate(pulses({3}, 20, after=STEP))
    assert (len(result.time), result.windows, result.complete) == (0, (), True)
    assert result.log[-1].endswith(
        "No space left on device: the result has no rows; those of --out are whole"
    )


class Steps:
    """A listener that keeps the numbers of the steps that it gets."""

    def __init__(self):
        self.steps = []

    def begin(self, experiment, signals):
        pass

    def block(self, steps, rows):
        self.steps += steps.tolist()

    def end(self, complete):
        pass


class AllSteps(Steps):
    is_of_all_rows = True


@pytest.mark.parametrize("every", [1, 5])
def test_a_listener_may_get_the_rows_between_the_windows_too(grasp, every):
    of_windows, of_all = Steps(), AllSteps()
    system = contact(grasp, before=0.05, after=0.1)
    result = simulate(system, every=every, listeners=[of_windows, of_all])
    [window] = result.windows
    assert of_windows.steps == np.rint(window.time / 1e-2).astype(int).tolist()
    assert of_all.steps == [*range(0, 251, every)]
