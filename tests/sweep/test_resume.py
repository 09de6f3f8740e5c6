"""A sweep that is killed goes on: no finished run is lost, none is done again."""

import json
import random
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from grasp_cosim.sweep.sweep import sweep
from support.made_studies import GAIN, HEAD, native_study, write_native
from support.native_fmus import needs_gcc
from support.processes import ends

pytestmark = [needs_gcc, pytest.mark.slow]

RUNS = 160
STUDY = (
    f'{HEAD}[design]\nkind = "random"\nruns = {RUNS}\nseed = 1\n'
    f"{GAIN}uniform = {{ low = 1.0, high = 2.0 }}\n"
)
ARGUMENTS = ["sweep", "study.toml", "--out", "out", "--json", "--workers"]

PROGRAM = """
import os, signal, sys
from grasp_cosim.cli import entry
from grasp_cosim.sweep.store import Store

keep, parts = Store.keep, []

def keep_and_act(store, outcome):
    keep(store, outcome)
    parts.append(outcome)
    if len(parts) == COUNT:
        ACT

Store.keep = keep_and_act
entry()
"""
KILL = (
    "print(open(f'/proc/self/task/{os.getpid()}/children').read(), flush=True); "
    "os.kill(os.getpid(), signal.SIGKILL)"
)

Parts = dict[str, tuple[int, int]]


def parts(folder: Path) -> Parts:
    """Each part's inode and time of writing: another one if it was written again."""
    found = (folder / "out/parts").glob("*.json")
    return {p.name: (p.stat().st_ino, p.stat().st_mtime_ns) for p in found}


def sweeping(folder: Path, workers: int, count: int = 0, act: str = "") -> tuple[int, str, str]:
    """Exit code and output of a command that acts right after it has kept so many runs."""
    program = PROGRAM.replace("COUNT", str(count)).replace("ACT", act or "pass")
    done = subprocess.run(
        [sys.executable, "-c", program, *ARGUMENTS, str(workers)], cwd=folder, text=True,
        start_new_session=True, capture_output=True, check=False,
    )  # fmt: skip
    return done.returncode, done.stdout, done.stderr


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="this system has no /proc")
def test_killed_at_any_moment_it_goes_on(tmp_path: Path) -> None:
    study = native_study(write_native(tmp_path), STUDY)
    generator, kept = random.Random(20), Parts()
    for workers in (2, 1):
        more = generator.randint(1, 40)
        code, started, _ = sweeping(tmp_path, workers, more, KILL)
        assert code == -signal.SIGKILL
        assert len(started.split()) >= workers
        assert all(ends(int(pid)) for pid in started.split())
        now = parts(tmp_path)
        assert kept.items() <= now.items()
        assert len(now) == len(kept) + more
        kept = now
    code, out, err = sweeping(tmp_path, 2)
    assert code == 0, err
    summary = json.loads(out)
    assert (summary["runs"], summary["resumed"], summary["failed"]) == (RUNS, len(kept), 0)
    final = parts(tmp_path)
    assert kept.items() <= final.items()
    assert sorted(final) == [f"{k:07d}.json" for k in range(RUNS)]
    sweep(study, tmp_path / "at once", workers=1)
    whole, resumed = (tmp_path / name / "runs.parquet" for name in ("at once", "out"))
    assert whole.read_bytes() == resumed.read_bytes()


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("whom", ["0", "os.getpid()"])
def test_ctrl_c_keeps_what_is_done(tmp_path: Path, whom: str) -> None:
    """It is for all processes, as from a terminal, or for the command alone."""
    native_study(write_native(tmp_path), STUDY)
    code, out, err = sweeping(tmp_path, 2, 5, f"os.kill({whom}, signal.SIGINT)")
    count = len(parts(tmp_path))
    assert (code, out) == (130, "")
    # Lines of several workers may come as one, with the ends of all of them after it.
    last = [line for line in err.splitlines() if line and "native FMU" not in line]
    kept = f"{count} of {RUNS} runs are kept in out"
    assert last == [f"grasp-cosim: interrupted; {kept}, the same command goes on"]
    assert not list((tmp_path / "out/parts").glob("*.part"))
