"""What an FMU does at its end, or with the process it is in, costs nothing that was recorded."""

import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from grasp_cosim.recording.read_back import load_run
from support.marks import slow
from support.native_fmus import needs_gcc, talker

pytestmark = needs_gcc

CRASH = "abort()"
FILE = '[experiment]\nstep = 0.1\nstop = 1.0\n[components.a]\nfmu = "talker.fmu"\n'


def run(folder, *arguments, isolation="none", other=""):
    """The command in that folder; what it prints, and its exit code. other is more of the file."""
    (folder / "talk.toml").write_text(f'{FILE}isolation = "{isolation}"\n{other}', "utf-8")
    command = [sys.executable, "-m", "grasp_cosim", "run", "talk.toml", *arguments]
    return subprocess.run(
        command, cwd=folder, env=os.environ, capture_output=True, text=True, timeout=120
    )


def check_whole(folder):
    """A run of 10 steps is in that folder, from the first row to the last, and finished."""
    result = load_run(folder)
    assert result.complete
    assert result.wall_time is not None
    assert len(result.time) == 11
    assert result["a.y"][-1] == 1.0


@pytest.mark.slow
@pytest.mark.parametrize("where", ["AT_TERMINATE", slow("AT_FREE")])
@pytest.mark.parametrize("form", ["csv", slow("arrow")])
def test_a_crash_at_the_end_leaves_a_finished_result(tmp_path, where, form):
    talker(tmp_path, f"-D{where}={CRASH}")
    done = run(tmp_path, "--out", "out", "--format", form, "--json")
    assert done.returncode == -signal.SIGABRT
    assert json.loads(done.stdout)["complete"] is True
    check_whole(tmp_path / "out")


@pytest.mark.slow
@pytest.mark.parametrize("where", ["AT_TERMINATE", slow("AT_FREE")])
def test_a_crash_of_an_isolated_fmu_at_its_end_is_one_line(tmp_path, where):
    talker(tmp_path, f"-D{where}={CRASH}")
    done = run(tmp_path, "--out", "out", isolation="process")
    assert done.returncode == 0
    assert done.stderr == (
        "a: the process of talker.fmu ended with signal SIGABRT at t = 0.9 s, while it was closed\n"
    )
    check_whole(tmp_path / "out")


@pytest.mark.slow
def test_a_failure_is_recorded_before_a_crash_that_follows_on_it(tmp_path):
    talker(tmp_path, f"-DAT_FREE={CRASH}", '-DAT_STEP=if (time > 0.45) return fail(m, 3, "stuck")')
    done = run(tmp_path, "--out", "out")
    assert done.returncode == -signal.SIGABRT
    assert done.stderr == "kept what was recorded, in out\n"
    result = load_run(tmp_path / "out")
    assert (result.complete, len(result.time)) == (False, 6)
    assert result.wall_time is not None


@pytest.mark.slow
@pytest.mark.parametrize("where", ["AT_INITIALISATION", slow("AT_STEP")])
@pytest.mark.parametrize("form", ["csv", slow("arrow")])
def test_an_fmu_that_goes_to_another_folder_takes_nothing_along(tmp_path, where, form):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.mkdir()
    talker(tmp_path, f'-D{where}=(void)!chdir("{elsewhere}")')
    done = run(tmp_path, "--out", "out", "--format", form)
    assert (done.returncode, done.stderr) == (0, "")
    check_whole(tmp_path / "out")
    assert not list(elsewhere.iterdir())


@pytest.mark.parametrize("where", ["AT_INITIALISATION", slow("AT_STEP")])
@pytest.mark.parametrize("isolation", ["none", slow("process")])
def test_a_fork_that_comes_back_does_nothing(tmp_path, where, isolation):
    """The FMU forgets to end the child: it would go on as a second run into the same files."""
    talker(tmp_path, f"-D{where}=(void)!fork()")
    done = run(tmp_path, "--out", "out", "--json", isolation=isolation)
    assert (done.returncode, done.stderr) == (0, "")
    assert json.loads(done.stdout)["complete"] is True
    check_whole(tmp_path / "out")
    assert len(Path(tmp_path, "out/signals.csv").read_text().splitlines()) == 12


@pytest.mark.slow
@pytest.mark.parametrize("isolation", ["none", "process"])
def test_a_fork_that_comes_back_late_writes_no_values(tmp_path, isolation):
    """Both ends of the memory that is shared with the process of an FMU: neither is the fork's."""
    talker(tmp_path, "-DAT_STEP=if (!fork()) usleep(300)")
    talker(tmp_path, name="other")
    other = '[components.b]\nfmu = "other.fmu"\nisolation = "process"\n'
    more = ("--step", "0.01", "--stop", "2", "--out", "out")
    done = run(tmp_path, *more, isolation=isolation, other=other)
    assert (done.returncode, done.stderr) == (0, "")
    result = load_run(tmp_path / "out")
    assert result["a.y"] == pytest.approx(result.time)
    assert result["b.y"] == pytest.approx(result.time)
