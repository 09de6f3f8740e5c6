"""What is kept in memory, and metrics, which are of every step however few rows are recorded."""

import tracemalloc
from dataclasses import replace
from tempfile import gettempdir

import pytest
from grasp_cosim import InputError, compare, load_run, metric, simulate
from grasp_cosim.exchange.listener import Signal
from grasp_cosim.recording.folder import RunFolder
from grasp_cosim.recording.memory import MemoryListener
from grasp_cosim.recording.recorded_run import UNITS
from recording.rows import EXPERIMENT, SIGNALS, full_disk


@metric("samples", unit="1")
def samples(run):
    """How many there were, by one that a group would not name."""
    return len(run["sensor_1.intensity"])


def run(grasp, every, **more):
    return simulate(grasp, step=1e-3, stop=2.5, every=every, metrics=[samples], **more)


def measured(result):
    return {name: m for name, m in result.metrics.items() if name not in UNITS}


@pytest.mark.parametrize("every", [2, 499, 5000])
def test_metrics_do_not_depend_on_what_is_recorded(grasp, tmp_path, every):
    whole, few = run(grasp, 1), run(grasp, every)
    assert len(few.time) == 2 + 2499 // every
    assert few.time[-1] == 2.5
    assert measured(few) == measured(whole)
    assert whole.metrics["samples"] == 2501
    assert few.measured.metrics == whole.measured.metrics
    few.to_csv(tmp_path / "signals.csv")
    few.to_json(tmp_path / "run.json")
    back = load_run(tmp_path)
    assert dict(back.metrics) == dict(few.metrics)
    assert back.measured.missing == few.measured.missing
    assert repr(back).splitlines()[1:] == repr(few).splitlines()[1:]


def test_on_the_way_they_are_of_the_steps_so_far(grasp):
    found = []
    for every in (1, 100):
        with simulate.session(grasp, step=1e-3, every=every, metrics=[samples]) as session:
            for _ in range(3):
                session.step(150)
                session.result()
            found.append(session.result())
    whole, few = found
    assert measured(few) == measured(whole)
    assert few.time.tolist() == [0.0, 0.1, 0.2, 0.3, 0.4, 0.45]


def test_of_a_run_that_did_not_end_they_are_of_its_rows_which_is_said(grasp, tmp_path):
    folder = RunFolder(tmp_path, grasp, ["run"])
    with simulate.session(grasp, step=1e-3, every=100, listeners=[folder]) as session:
        session.step(550)
    back = load_run(tmp_path)
    assert back.log[-1] == "one row in 100 was recorded: the metrics are of these"


def test_a_comparison_says_that_they_are_of_the_rows_it_has(grasp):
    found = compare(run(grasp, 1), run(grasp, 100))
    assert "B recorded one row in 100: its metrics are of these" in found.notes
    assert not any(note.startswith("A recorded") for note in found.notes)


def test_on_a_full_disk_they_are_of_the_rows_which_is_said(grasp):
    with simulate.session(grasp, step=1e-3, every=10) as session:
        with full_disk(20_000):
            session.step(2999)
        session.step()
        result = session.result()
    whole = simulate(grasp, step=1e-3, every=10)
    assert measured(result) == measured(replace(whole, of_every_step=None)) != measured(whole)
    assert result.log[-1] == (
        f"{gettempdir()}: cannot be written: File too large: the metrics are of the rows that were "
        "recorded"
    )


@pytest.mark.parametrize("stop", [10**18, 10**13])
def test_a_run_that_does_not_fit_is_refused_at_the_start(stop):
    long = replace(EXPERIMENT, step_ns=1, stop_ns=stop)
    many = [Signal(f"a.x[{i}]", None, "Real") for i in range(1000)]
    with pytest.raises(InputError, match=rf"^bare: {stop} steps do not fit into memory; must"):
        MemoryListener().begin(long, many)


def test_a_decimated_run_takes_memory_for_what_is_kept_only():
    tracemalloc.start()
    long = replace(EXPERIMENT, step_ns=1, stop_ns=10**13)
    MemoryListener(every=10**9).begin(long, SIGNALS)
    assert tracemalloc.get_traced_memory()[1] < 2e6
    tracemalloc.stop()
