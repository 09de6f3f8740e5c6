"""Python hosts in trouble: at the end of the stack, interrupted, with no import path, in threads.

Each is a process of its own:  python tests/fmus/test_hard_times.py HOST FOLDER FMU...
"""

import os
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from support.fmi2 import ERROR, OK, Fmu, Instance
from support.packages import runnable
from support.slow import slow

ROUNDS = 10
MANY = 200


def at_the_end_of_the_stack(fmus: list[Fmu]) -> None:
    """Python may raise between pythonfmu's call and the slave's first line, and at any repr."""

    def deep(levels: int) -> None:
        if levels:
            deep(levels - 1)
        else:
            statuses.append(instance.step(0.0, -1.0))

    statuses: list[int] = []
    with Instance(fmus[0], logger=False) as instance:
        instance.initialise()
        for levels in range(sys.getrecursionlimit()):
            try:
                deep(levels)
            except RecursionError:
                break
        assert set(statuses) == {ERROR}
        assert instance.step(0.0, 1e-3) == OK


def interrupted(fmus: list[Fmu]) -> None:
    """A signal handler that raises does so anywhere, also on the way into the slave."""
    refused, inside = 0, False

    def interrupt(*_: object) -> None:
        nonlocal inside
        if inside:
            inside = False
            raise KeyboardInterrupt

    signal.signal(signal.SIGALRM, interrupt)
    with Instance(fmus[0], logger=False) as instance:
        instance.initialise()
        signal.setitimer(signal.ITIMER_REAL, 1e-3, 1.7e-4)
        while refused < MANY:
            try:  # not with suppress(), which is Python, and so can be interrupted itself
                inside = True
                refused += instance.get_real([0])[0] != OK
                inside = False
            except KeyboardInterrupt:
                pass
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        assert instance.step(0.0, 1e-3) == OK


def without_an_import_path(fmus: list[Fmu]) -> None:
    """The host may do as it likes with sys.path."""
    with Instance(fmus[0]) as instance:
        instance.initialise()
        path = sys.path.copy()
        sys.path.clear()
        assert instance.call("Reset") == OK
        sys.path[:] = path
        instance.initialise()
        assert instance.step(0.0, 1e-3) == OK


def in_threads(fmus: list[Fmu]) -> None:
    """Instances of different FMUs made at the same time."""

    def live(fmu: Fmu) -> None:
        for _ in range(ROUNDS):
            with Instance(fmu) as instance:
                instance.initialise()
                assert instance.step(0.0, 1e-3) == OK
                finished.append(fmu.name)

    finished: list[str] = []
    before = sys.path.copy()
    threads = [Thread(target=live, args=(fmu,)) for fmu in fmus]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(finished) == ROUNDS * len(fmus)
    assert sys.path == before


HOSTS: dict[str, Any] = {
    host.__name__: host
    for host in (at_the_end_of_the_stack, interrupted, without_an_import_path, in_threads)
}


@pytest.mark.parametrize("host", [slow(h) if h == "in_threads" else h for h in HOSTS])
def test_the_host_lives(fmus: Path, tmp_path: Path, host: str) -> None:
    """With every other FMU, one of each room; the threads with all."""
    hosted(host, tmp_path, runnable(fmus)[:: 1 if host == "in_threads" else 2])


def test_threads_live_with_native_fmus_too(natives: Path, tmp_path: Path) -> None:
    hosted("in_threads", tmp_path, sorted(natives.glob("*.fmu")))


def hosted(host: str, folder: Path, fmus: Sequence[Path]) -> None:
    """It ends in peace."""
    done = subprocess.run(
        [sys.executable, __file__, host, folder, *fmus],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


if __name__ == "__main__":
    name, folder, *paths = sys.argv[1:]
    HOSTS[name]([Fmu(Path(path), Path(folder, Path(path).stem)) for path in paths])
