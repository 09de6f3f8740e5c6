"""Python hosts in trouble: with no import path, in threads.

Each is a process of its own:  python tests/fmus/test_hard_times.py HOST FOLDER FMU...
"""

import os
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path
from threading import Thread
from typing import Any

import pytest
from support.fmi2 import OK, Fmu, Instance
from support.packages import runnable
from support.slow import slow

ROUNDS = 10


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


HOSTS: dict[str, Any] = {host.__name__: host for host in (without_an_import_path, in_threads)}


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
