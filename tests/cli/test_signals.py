"""Commands as processes: what SIGINT, SIGTERM and SIGKILL leave behind."""

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
from grasp_cosim.recording.load import load_run
from support.marks import slow
from support.native_fmus import build, needs_gcc

pytestmark = pytest.mark.usefixtures("ctrl_c")

CODES = {signal.SIGINT: 130, signal.SIGTERM: 143}


@pytest.fixture
def start(tmp_path):
    """The command in the folder of the test, with its temporary folders in `tmp` there."""
    (tmp_path / "tmp").mkdir()
    with ExitStack() as stack:

        def command(*arguments):
            process = subprocess.Popen(
                [sys.executable, "-m", "grasp_cosim", *map(str, arguments)],
                cwd=tmp_path,
                env={**os.environ, "TMPDIR": str(tmp_path / "tmp")},
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                start_new_session=True,
            )
            stack.enter_context(process)
            stack.callback(process.kill)
            return process

        yield command


def wait_for(process, there):
    end = time.monotonic() + 120.0
    while not there():
        assert process.poll() is None, process.communicate()
        assert time.monotonic() < end
        time.sleep(0.01)


def left(folder):
    return [path.name for path in (folder / "tmp").iterdir() if path.name.startswith(PREFIX)]


def grasp_file(folder, fmus):
    path = folder / "grasp.toml"
    path.write_text(SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/'), "utf-8")
    return path


def native_system(folder, **values):
    """A native FMU alone, for 1e4 s."""
    fmu = build(folder, "native", "2.0")
    given = {"u_Real": 0.0, "u_Integer": 0, "u_Enumeration": 1, **values}
    text = ", ".join(f"{name} = {value!r}" for name, value in given.items())
    (folder / "system.toml").write_text(
        "[experiment]\nstep = 0.001\nstop = 1e4\n"
        f'[components.a]\nfmu = "{fmu.name}"\n'
        f'values = {{ {text}, u_Boolean = false, u_String = "" }}\n'
    )
    return folder / "system.toml"


@pytest.mark.parametrize(
    ("number", "times"),
    [(signal.SIGINT, 1), slow(signal.SIGTERM, 1), slow(signal.SIGTERM, 2)],
)
def test_a_signal_keeps_what_a_run_recorded(start, tmp_path, fmus, number, times):
    """Sent to all processes, as systemd does, and twice at once, as `timeout` does."""
    process = start("run", grasp_file(tmp_path, fmus), "--stop", 1000, "--out", "out")
    wait_for(process, lambda: (tmp_path / "out/run.json").exists() and size(tmp_path) > 10_000)
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
def test_a_second_signal_ends_a_run_that_hangs(start, tmp_path, number):
    system = native_system(tmp_path, hang_at=0.0105)
    process = start("run", system, "--out", "out")
    assert process.stderr
    assert "native FMU hangs\n" in iter(process.stderr.readline, "")
    process.send_signal(number)
    time.sleep(5 * AT_ONCE)
    assert process.poll() is None
    process.send_signal(number)
    process.communicate(timeout=60)
    assert process.returncode == CODES[number]
    assert not load_run(tmp_path / "out").complete
    assert left(tmp_path)
    other = start("run", native_system(tmp_path), "--stop", "0.01")
    _, err = other.communicate(timeout=60)
    assert other.returncode == 0, err
    assert not left(tmp_path)


@pytest.mark.slow
@needs_gcc
def test_a_killed_run_is_on_disk_and_its_folders_are_swept(start, tmp_path):
    alive = tempfile.mkdtemp(prefix=PREFIX, dir=tmp_path / "tmp")
    lock = lock_of(Path(alive))
    assert lock.taken()
    process = start("run", native_system(tmp_path), "--out", "out")
    wait_for(process, lambda: (tmp_path / "out/run.json").exists() and size(tmp_path) > 10_000)
    process.kill()
    process.communicate()
    run = load_run(tmp_path / "out")
    assert not run.complete
    assert run.wall_time is None
    assert run.origin["command"][:2] == ["grasp-cosim", "run"]
    assert len(run.time) > 100
    assert len(left(tmp_path)) == 2
    report = start("report", "out", "--json")
    out, err = report.communicate(timeout=120)
    assert report.returncode == 0, err
    assert f"out: unfinished, to t = {run.time[-1]:.6g} s" in err
    assert "unfinished: to t = " in Path(tmp_path, json.loads(out)["page"]).read_text("utf-8")
    assert left(tmp_path) == [Path(alive).name]
    lock.release()


def size(folder):
    return (folder / "out/signals.csv").stat().st_size


@needs_gcc
@pytest.mark.slow
def test_folders_of_running_processes_are_not_swept(start, tmp_path):
    process = start("run", native_system(tmp_path), "--out", "out")
    wait_for(process, (tmp_path / "out/run.json").exists)
    there = left(tmp_path)
    assert there
    other = start("run", native_system(tmp_path), "--stop", "0.01", "--out", "out")
    _, err = other.communicate(timeout=60)
    assert other.returncode == 2
    assert err == (
        "native FMU 2.0 instantiated\n"
        "grasp-cosim: out: another process records a run in it; must end first, or --out be "
        "another folder\n"
    )
    assert set(there) <= set(left(tmp_path))
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

        monkeypatch.setattr(session._master, "advance", advance)
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
