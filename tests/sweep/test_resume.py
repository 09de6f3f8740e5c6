"""A sweep that is killed goes on: no finished run is lost, none is done again."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from grasp_cosim.sweep.sweep import sweep
from support.made_studies import GAIN, HEAD, native_study, write_native
from support.native_fmus import needs_gcc
from support.processes import alive

pytestmark = [needs_gcc, pytest.mark.slow]

RUNS = 160
ENDLESS = 2000
"""Runs that nobody waits for."""


def study_of(runs: int) -> str:
    return (
        f'{HEAD}[design]\nkind = "random"\nruns = {runs}\nseed = 1\n'
        f"{GAIN}uniform = {{ low = 1.0, high = 2.0 }}\n"
    )


COMMAND = [sys.executable, "-m", "grasp_cosim", "sweep", "study.toml", "--out", "out", "--json"]

Parts = dict[str, tuple[int, int]]


def parts(folder: Path) -> Parts:
    """Each part's inode and time of writing: another one if it was written again."""
    found = (folder / "out/parts").glob("*.json")
    return {p.name: (p.stat().st_ino, p.stat().st_mtime_ns) for p in found}


def start(folder: Path, workers: int) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [*COMMAND, "--workers", str(workers)], cwd=folder, text=True, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def wait_for(process: subprocess.Popen[str], folder: Path, count: int) -> None:
    """Return once there are so many parts."""
    while sum(1 for _ in (folder / "out/parts").glob("*.json")) < count:
        assert process.poll() is None, process.communicate()
        time.sleep(0.005)


def children(process: subprocess.Popen[str]) -> list[int]:
    listed = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
    return [int(pid) for pid in listed.split()]


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="this system has no /proc")
def test_killed_at_any_moment_it_goes_on(tmp_path: Path) -> None:
    study = native_study(write_native(tmp_path), study_of(RUNS))
    generator, kept = random.Random(20), Parts()
    for workers in (2, 1):
        process = start(tmp_path, workers)
        wait_for(process, tmp_path, len(kept) + generator.randint(1, 40))
        started = children(process)
        process.kill()
        process.communicate()
        assert process.returncode == -signal.SIGKILL
        assert started
        while any(map(alive, started)):
            time.sleep(0.01)
        now = parts(tmp_path)
        assert kept.items() <= now.items()
        assert len(kept) < len(now) < RUNS
        kept = now
    process = start(tmp_path, 2)
    out, err = process.communicate()
    assert process.returncode == 0, err
    summary = json.loads(out)
    assert (summary["runs"], summary["resumed"], summary["failed"]) == (RUNS, len(kept), 0)
    final = parts(tmp_path)
    assert kept.items() <= final.items()
    assert sorted(final) == [f"{k:07d}.json" for k in range(RUNS)]
    sweep(study, tmp_path / "at once", workers=1)
    whole, resumed = (tmp_path / name / "runs.parquet" for name in ("at once", "out"))
    assert whole.read_bytes() == resumed.read_bytes()


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("group", [True, False])
def test_ctrl_c_keeps_what_is_done(tmp_path: Path, group: bool) -> None:
    native_study(write_native(tmp_path), study_of(ENDLESS))
    process = start(tmp_path, 2)
    wait_for(process, tmp_path, 5)
    if group:  # as a terminal does
        os.killpg(process.pid, signal.SIGINT)
    else:
        process.send_signal(signal.SIGINT)
    out, err = process.communicate()
    count = len(parts(tmp_path))
    assert (process.returncode, out) == (130, "")
    # Lines of several workers may come as one, with the ends of all of them after it.
    last = [line for line in err.splitlines() if line and "native FMU" not in line]
    kept = f"{count} of {ENDLESS} runs are kept in out"
    assert last == [f"grasp-cosim: interrupted; {kept}, the same command goes on"]
    assert not list((tmp_path / "out/parts").glob("*.part"))
