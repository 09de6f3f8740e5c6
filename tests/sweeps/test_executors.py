"""Where runs are done: in threads as in processes, from any script, and ended by Ctrl-C."""

import signal
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor

import pytest
from grasp_cosim import grasp_system, sweep
from grasp_cosim.metrics.metric import metric
from grasp_cosim.sweeps import executors
from grasp_cosim.sweeps.executors import (
    MAX_RUNS_IN_THREADS,
    in_processes,
    in_threads,
    may_be_threads,
    one_by_one,
)
from grasp_cosim.sweeps.run import Task
from support.marks import needs_compiler
from support.native_systems import integrator

pytestmark = needs_compiler

POSITION = "plant.initial_object_position"
JOBS = [(i, {POSITION: 0.005 * i}) for i in range(8)]


@pytest.fixture(scope="module")
def native():
    return grasp_system().with_experiment(step=1e-3, stop=0.3).natively(True)


def closed(run):
    """By how much the first finger closed, in m."""
    return float(run["plant.gap[1]"][0] - run["plant.gap[1]"].min())


@pytest.mark.slow
def test_threads_and_processes_find_the_same_bits(native):
    task = Task(native, (metric("closed")(closed),))
    threads, processes = (
        sorted(of(task, JOBS, 2), key=lambda o: o.index) for of in (in_threads, in_processes)
    )
    assert threads == processes
    assert len({o.metrics["closed"] for o in threads}) > 1
    assert all(o.error is None for o in threads)


def test_only_native_fmus_made_here_run_in_threads(native, tmp_path):
    assert may_be_threads(Task(native), JOBS)
    assert not may_be_threads(Task(native), [(0, {"components.plant.fmu": "x.fmu"})])
    assert not may_be_threads(Task(native.natively(False)), JOBS)
    assert not may_be_threads(Task(integrator(tmp_path)), JOBS)


@pytest.mark.parametrize(
    ("runs", "workers", "threads"),
    [(MAX_RUNS_IN_THREADS, 8, True), (MAX_RUNS_IN_THREADS + 1, 8, False), (1000, 4, True)],
)
def test_many_threads_would_wait_for_one_another(native, monkeypatch, runs, workers, threads):
    for of in (in_threads, in_processes):
        monkeypatch.setattr(executors, of.__name__, lambda *a, of=of: of)
    jobs = [(i, {}) for i in range(runs)]
    chosen = executors.on_this_machine(Task(native), jobs, workers)
    assert chosen is (in_threads if threads else in_processes)


def test_functions_of_the_user_are_called_one_at_a_time():
    """Until Python 3.12 a lock of cached properties sees to it, too."""
    inside, second = threading.Event(), threading.Event()

    def joined(run):
        """True if another call begins before this one, the first, ends."""
        if inside.is_set():
            second.set()
        inside.set()
        return second.wait(0.1)

    function = one_by_one(joined, threading.Lock())
    with ThreadPoolExecutor(2) as pool:
        first = pool.submit(function, None)
        assert inside.wait(10.0)
        pool.submit(function, None)
        assert not first.result()


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_the_runs_of_threads(native):
    ended = []

    def interrupting(run):
        ended.append(run.time[-1])
        signal.raise_signal(signal.SIGINT)
        return 1.0

    rows = [{"experiment.stop": stop} for stop in (0.01, 300.0, 300.0)]
    with pytest.raises(KeyboardInterrupt):
        sweep(native, rows, metrics=[interrupting], workers=2)
    assert ended == [0.01]
    for thread in threading.enumerate():  # one that had just been started ends by itself
        if thread.name.startswith("sweep"):
            thread.join(5.0)
    assert not [t for t in threading.enumerate() if t.name.startswith("sweep")]


SCRIPT = """
from grasp_cosim import grasp_system, sweep

SCALE = 1e3

def closed(run):
    return SCALE * float(run["plant.gap[1]"].min())

print("once")
system = grasp_system().with_experiment(step=1e-2, stop=0.1)
rows = {"plant.initial_object_position": [0.0, 0.01]}
for native in (True, False):
    table = sweep(system, rows, metrics=[closed], native=native)
    print(table["closed"].tolist(), table.errors)
"""


@pytest.mark.slow
def test_a_script_needs_no_guard_and_its_functions_are_metrics(tmp_path):
    """Neither in threads nor in processes."""
    (tmp_path / "script.py").write_text(SCRIPT)
    program = [sys.executable, "script.py"]
    done = subprocess.run(program, cwd=tmp_path, capture_output=True, text=True, check=False)
    once, threads, processes = done.stdout.splitlines()
    assert (done.stderr, once) == ("", "once")
    assert threads == processes
    assert threads.endswith("] {}")
