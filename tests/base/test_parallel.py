"""Runs spread over processes."""

import ctypes
import os
import signal
import subprocess
import sys
import threading
import time
from multiprocessing.context import SpawnProcess

import pytest
from grasp_cosim.base.errors import InputError, SimulationError
from grasp_cosim.base.parallel import Crew
from grasp_cosim.base.progress import Progress
from grasp_cosim.base.system_calls import held_back
from support.processes import ends


def run_all(run, jobs, workers):
    with Crew(workers) as crew, Progress("runs", shown=False) as bar:
        return crew.map(run, jobs, bar)


def _process(job):
    return job, os.getpid()


def _refuse(job):
    if job.name == "wrong":
        raise InputError(f"{job}: must be something else")
    job.touch()


def test_results_come_in_the_order_of_the_jobs_from_other_processes():
    results = run_all(_process, range(6), 2)
    assert [job for job, _ in results] == list(range(6))
    assert os.getpid() not in {process for _, process in results}


def test_the_error_of_a_job_is_that_of_all(tmp_path):
    jobs = [tmp_path / "right", tmp_path / "wrong"]
    with pytest.raises(InputError, match="wrong: must be something else"):
        run_all(_refuse, jobs, 1)
    assert (tmp_path / "right").exists()


def _end(job):
    if job == 1:
        os.kill(os.getpid(), signal.SIGKILL)
    return job


def test_a_process_that_dies_is_an_error():
    with pytest.raises(SimulationError, match="a process for the runs ended with signal SIGKILL"):
        run_all(_end, range(3), 1)


def test_batches_share_their_processes():
    with Crew(1) as crew, Progress("runs", shown=False) as bar:
        first, second = (crew.map(_process, range(2), bar) for _ in range(2))
    assert first == second


def test_ctrl_c_while_a_process_starts_is_not_lost(monkeypatch):
    start = SpawnProcess.start

    def interrupted(self):
        start(self)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(SpawnProcess, "start", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_all(_process, range(6), 2)
    assert signal.pthread_sigmask(signal.SIG_BLOCK, ()) == set()


def _endless(folder):
    """As an FMU that hangs in C code, and keeps the lock of the interpreter."""
    (folder / "pid").write_text(str(os.getpid()))
    ctypes.PyDLL(None).sleep(1000)


@pytest.mark.usefixtures("ctrl_c")
def test_a_signal_that_another_thread_takes_comes_at_the_end_as_well():
    """The mask is that of one thread; what was started there would lack what it waits for."""
    over, done = threading.Event(), []

    def interrupted():
        with held_back([signal.SIGINT, signal.SIGTERM]):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(0.02)
            done.append("all of it")

    thread = threading.Thread(target=over.wait)
    thread.start()
    try:
        with pytest.raises(KeyboardInterrupt):
            interrupted()
    finally:
        over.set()
        thread.join()
    assert done == ["all of it"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


MASKS = """
import signal
from functools import partial
from grasp_cosim.base.parallel import Crew
from grasp_cosim.base.progress import Progress

with Crew(1) as crew, Progress("runs", shown=False) as bar:
    blocked = crew.map(partial(signal.pthread_sigmask, signal.SIG_BLOCK), [()], bar)
print(*(sorted(s.name for s in mask) for mask in blocked), __name__)
"""


def test_also_the_first_process_starts_with_signals_held_back(tmp_path):
    """Ctrl-C would end its start with a traceback; that multiprocessing is new takes a new one.

    A script without a guard, which none of them runs anew."""
    (tmp_path / "masks.py").write_text(MASKS)
    done = subprocess.run([sys.executable, tmp_path / "masks.py"], capture_output=True, text=True)
    assert (done.stdout, done.stderr) == ("['SIGINT', 'SIGTERM'] __main__\n", "")


def test_a_kill_ends_its_processes_whatever_they_are_at(tmp_path):
    code = (
        "from pathlib import Path; from test_parallel import _endless, run_all; "
        f"run_all(_endless, [Path({str(tmp_path)!r})], 1)"
    )
    path = os.pathsep.join(filter(None, sys.path))
    killed = subprocess.Popen(
        [sys.executable, "-c", f"if __name__ == '__main__': {code}"],
        env={**os.environ, "PYTHONPATH": path},
    )
    file = tmp_path / "pid"
    while not file.exists() or not file.read_text():
        assert killed.poll() is None
        time.sleep(0.01)
    killed.kill()
    killed.wait()
    assert ends(int(file.read_text()))
