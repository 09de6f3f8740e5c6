"""What SIGINT, SIGTERM, SIGKILL, a crash or an exit of an FMU leave of a command."""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path

import pytest
from grasp_cosim import SimulationError, simulate
from grasp_cosim.base.interruption import AT_ONCE
from grasp_cosim.base.scratch import PREFIX, lock_of
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.recording.read_back import load_run
from support.marks import slow
from support.native_fmus import needs_gcc
from support.native_systems import driven

pytestmark = pytest.mark.usefixtures("ctrl_c")

CODES = {signal.SIGINT: 130, signal.SIGTERM: 143}
LONG = ("--step", 1e-3, "--stop", 1e4, "--out", "out")
SHORT = ("--step", 1e-3, "--stop", 0.01)


@pytest.fixture
def start(tmp_path):
    """The command in the folder of the test, with its temporary folders in `tmp` there."""
    (tmp_path / "tmp").mkdir()
    with ExitStack() as stack:

        def command(*arguments):
            process = subprocess.Popen(
                [sys.executable, "-m", "grasp_cosim", *map(str, arguments)], cwd=tmp_path,
                env={**os.environ, "TMPDIR": str(tmp_path / "tmp")}, start_new_session=True,
                stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
            )  # fmt: skip
            stack.enter_context(process)
            stack.callback(process.kill)
            return process

        yield command


@pytest.fixture
def native(start, tmp_path):
    """Runs a native FMU alone, its component a."""
    system = driven(tmp_path, "time\n0\n")
    return lambda *options: start("run", system, *options)


def recording(process, folder):
    """Wait until some of a run is on disk."""
    end = time.monotonic() + 120.0
    signals = folder / "out/signals.csv"
    while not (folder / "out/run.json").exists() or signals.stat().st_size < 10_000:
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.01)


def left(folder):
    return {path.name for path in (folder / "tmp").iterdir() if path.name.startswith(PREFIX)}


@pytest.mark.parametrize(
    ("number", "times"), [(signal.SIGINT, 1), slow(signal.SIGTERM, 1), slow(signal.SIGTERM, 2)]
)
def test_a_signal_keeps_what_a_run_recorded(start, tmp_path, fmus, number, times):
    """Sent to all processes, as systemd does, and twice at once, as `timeout` does."""
    text = SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/')
    (tmp_path / "grasp.toml").write_text(text, "utf-8")
    process = start("run", "grasp.toml", "--stop", 1000, "--out", "out")
    recording(process, tmp_path)
    for _ in range(times):
        os.killpg(process.pid, number)
    _, err = process.communicate(timeout=60)
    assert process.returncode == CODES[number]
    assert "Traceback" not in err
    assert "interrupted at t = " in err
    assert json.loads((tmp_path / "out/run.json").read_text())["wall_time"] is not None
    assert len(load_run(tmp_path / "out").time) > 1
    assert not left(tmp_path)


@needs_gcc
@pytest.mark.slow
@pytest.mark.parametrize("number", CODES)
def test_a_second_signal_ends_a_run_that_hangs(native, tmp_path, number):
    process = native(*LONG, "--set", "a.hang_at=0.0105")
    assert "native FMU hangs\n" in iter(process.stderr.readline, "")
    process.send_signal(number)
    time.sleep(5 * AT_ONCE)
    assert process.poll() is None
    process.send_signal(number)
    process.communicate(timeout=60)
    assert process.returncode == CODES[number]
    assert not load_run(tmp_path / "out").complete
    assert left(tmp_path)
    assert native(*SHORT).wait(60) == 0
    assert not left(tmp_path)


@pytest.mark.slow
@needs_gcc
def test_a_killed_run_is_on_disk_and_its_folders_are_swept(native, start, tmp_path):
    alive = tempfile.mkdtemp(prefix=PREFIX, dir=tmp_path / "tmp")
    lock = lock_of(Path(alive))
    assert lock.taken()
    process = native(*LONG)
    recording(process, tmp_path)
    process.kill()
    process.communicate()
    run = load_run(tmp_path / "out")
    assert (run.complete, run.wall_time) == (False, None)
    assert run.origin["command"][:2] == ["grasp-cosim", "run"]
    assert len(run.time) > 100
    assert len(left(tmp_path)) == 2
    report = start("report", "out", "--json")
    out, err = report.communicate(timeout=120)
    assert report.returncode == 0, err
    assert f"out: unfinished, to t = {run.time[-1]:.6g} s" in err
    assert "unfinished: to t = " in Path(tmp_path, json.loads(out)["page"]).read_text("utf-8")
    assert left(tmp_path) == {Path(alive).name}
    lock.release()


@needs_gcc
@pytest.mark.slow
def test_folders_of_running_processes_are_not_swept(native, tmp_path):
    process = native(*LONG)
    recording(process, tmp_path)
    there = left(tmp_path)
    other = native(*SHORT, "--out", "out")
    _, err = other.communicate(timeout=60)
    assert other.returncode == 2
    assert err.splitlines()[-1] == (
        "grasp-cosim: out: another process records a run in it; must end first, or --out be "
        "another folder"
    )
    assert there
    assert there <= left(tmp_path)
    process.terminate()
    process.communicate(timeout=60)
    assert process.returncode == 143
    assert not left(tmp_path)


def test_an_interruption_inside_an_fmu_is_one(grasp, monkeypatch):
    """Of which the FMU makes an error of its own, as a Python FMU does."""
    with simulate.session(grasp, stop=0.1) as session:
        session.step(3)

        def advance(_):
            try:
                signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt:
                raise SimulationError("plant: returned fatal: KeyboardInterrupt") from None
            return 1

        monkeypatch.setattr(session.master, "advance", advance)
        with pytest.raises(KeyboardInterrupt):
            session.step()
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


def test_a_session_leaves_ctrl_c_as_it_was(grasp):
    with simulate.session(grasp, stop=0.1) as one, simulate.session(grasp, stop=0.1) as other:
        one.close()
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)
        assert other.step(3)  # it came outside of an FMU
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler


# ------------------------------------------------------------------ what an FMU does


@needs_gcc
@pytest.mark.parametrize("debug", [[], ["--debug"]])
def test_a_crash_in_the_process_of_the_command(native, debug):
    process = native("--set", "a.crash_at=0.55", *debug)
    _, err = process.communicate(timeout=60)
    assert process.returncode == -signal.SIGSEGV
    assert ("Fatal Python error: Segmentation fault" in err) is bool(debug)


@needs_gcc
def test_a_crash_in_a_process_of_its_own(native, tmp_path):
    more = ("--set", "a.crash_at=0.55", "--set", "components.a.isolation=process", "--out", "out")
    process = native(*more)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 3
    assert err.splitlines()[-1] == (
        "grasp-cosim: a: the process of native.fmu ended with signal SIGSEGV at t = 0.5 s "
        "(inputs: u_Real = 0 N, u_Integer = 0, u_Boolean = false, u_Enumeration = 1, u_String = '')"
    )
    assert json.loads((tmp_path / "out/run.json").read_text())["complete"] is False
    assert len((tmp_path / "out/signals.csv").read_text().splitlines()) == 1 + 6


@pytest.mark.parametrize(
    ("does", "code", "said"),
    [
        ("libc.exit(0)", 3, "grasp-cosim: the binary of an FMU called exit(); with isolation"),
        ("os.fork() or libc.exit(0); os.wait()", 0, ""),
    ],
)
def test_an_exit_is_not_taken_for_the_end(does, code, said):
    """The result of a run in its midst would look like one that is done."""
    program = f"""
import ctypes, os, warnings
from grasp_cosim.cli import entry
from grasp_cosim.cli.group import cli

def main(*arguments, **options):
    warnings.simplefilter("ignore")  # that a process with two threads is forked
    libc = ctypes.CDLL(None)
    {does}

cli.main = main
entry()
"""
    done = subprocess.run([sys.executable, "-P", "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stderr[: len(said)]) == (code, said)
    assert len(done.stderr.splitlines()) == bool(said)
