"""Components in a process of their own: what happens there stays there."""

import gc
import os
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from fmi.test_instances import Bound, real, running
from grasp_cosim import InputError, SimulationError, System, simulate
from grasp_cosim.fmi import process
from grasp_cosim.fmi.instance import OK
from support.native_fmus import build, needs_gcc, starts_text
from support.processes import alive, ends

pytestmark = needs_gcc
versions = pytest.mark.parametrize("version", ["2.0", "3.0"])


def workers():
    """The processes of components that this process has."""
    found = set()
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                line = (entry / "cmdline").read_bytes().split(b"\0")
                parent = int((entry / "stat").read_text().rpartition(")")[2].split()[1])
            except OSError:  # it ended meanwhile
                continue
            if b"grasp_cosim.fmi.worker" in line and parent == os.getpid():
                found.add(int(entry.name))
    return found


def open_files():
    """How many this process has, but for what it merely has not collected."""
    gc.collect()
    return len(list(Path("/proc/self/fd").iterdir()))


def system_file(folder, version, values, isolation="process"):
    """A native part that drives a second one, which fails as its values say."""
    build(folder, version=version)
    u, y = f"u_{real(version)}", f"y_{real(version)}"
    others = f", {starts_text(version, u)}"
    path = folder / "two.toml"
    path.write_text(
        f"""connections = ["first.{y} -> second.{u}"]
[experiment]
step = 0.1
stop = 2.0
[components.first]
fmu = "native.fmu"
values = {{ {u} = 1.5{others} }}
[components.second]
fmu = "native.fmu"
isolation = "{isolation}"
values = {{ gain = 1.0{others}{values} }}
""",
        encoding="utf-8",
    )
    return path


@versions
def test_a_run_has_the_bits_of_one_in_this_process(tmp_path, version):
    runs = [
        simulate(System.load(system_file(tmp_path, version, "", isolation)))
        for isolation in ("none", "process")
    ]
    assert set(runs[0]) == set(runs[1])
    assert all((runs[0][name] == runs[1][name]).all() for name in runs[0])
    assert runs[1]["second.x"][-1] == pytest.approx(3.0, rel=1e-13)


@versions
@pytest.mark.parametrize(
    ("parameter", "how"), [("crash_at", "signal SIGSEGV"), ("exit_at", "exit code 7")]
)
def test_a_crash_ends_the_run_with_the_recording_kept(tmp_path, version, parameter, how):
    system = System.load(system_file(tmp_path, version, f", {parameter} = 1.05"))
    driven = f"u_{real(version)}"
    message = f"second: the process of native.fmu ended with {how} at t = 1 s (inputs: {driven} = "
    with pytest.raises(SimulationError) as caught:
        simulate(system)
    assert str(caught.value).startswith(f"{message}1.5, u_")
    result = caught.value.result
    assert result is not None
    assert not result.complete
    assert result.time.tolist() == [k * 100_000_000 / 1e9 for k in range(11)]
    assert result["second.x"][-1] == pytest.approx(1.5, rel=1e-13)
    assert not workers()
    assert any("Segmentation fault" in note for note in caught.value.__notes__) is (
        parameter == "crash_at"
    )


@versions
def test_a_hang_is_bounded(tmp_path, version, monkeypatch):
    with running(tmp_path, version, "process", {"hang_at": 0.25}) as part:
        bound = Bound(part, 0.2)
        assert bound.step() == OK
        monkeypatch.setattr(process, "TIMEOUT", 0.5)
        bound.clock[0] = 0.2
        message = (
            r"^part: the process of native.fmu did not answer within 0.5 s and was ended "
            r"at t = 0.2 s"
        )
        for _ in range(2):  # it stays lost
            with pytest.raises(SimulationError, match=message):
                bound.step()
        assert str(part.failure(3, 0.2)).startswith("part: the process of native.fmu did not")
        assert not workers()


def test_a_crash_in_the_initialisation_is_a_wrong_input(tmp_path):
    with running(tmp_path, "3.0", "process") as part:
        (pid,) = workers()
        os.kill(pid, signal.SIGKILL)
        with pytest.raises(InputError, match=r"^part: the process of .* signal SIGKILL at t = 0 s"):
            part.enter_initialization({}, 1.0)


@pytest.mark.slow
def test_nothing_stays_behind(tmp_path, monkeypatch, capfd):
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(folder))
    files = open_files()
    for values in ({}, {"crash_at": 0.1}):
        with running(tmp_path, "3.0", "process", values) as part:
            assert len(workers()) == 1
            if values:
                with pytest.raises(SimulationError):
                    Bound(part, 0.2).step()
        del part
        assert not workers()
        assert list(folder.iterdir()) == []
    assert open_files() == files
    assert capfd.readouterr() == ("", "")  # of what the FMU prints


@pytest.mark.slow
def test_what_an_fmu_started_ends_with_it(tmp_path, monkeypatch):
    """Such as a fork, which would keep open what the FMU printed to."""
    python, child = tmp_path / "python", tmp_path / "child"
    python.write_text(f'#!/bin/sh\nsleep 600 &\necho $! > {child}\nexec {sys.executable} "$@"\n')
    python.chmod(0o700)
    monkeypatch.setattr(sys, "executable", str(python))
    monkeypatch.setattr(process, "OUTPUT_TIMEOUT", 600.0)
    simulate(System.load(system_file(tmp_path, "2.0", "")))
    assert ends(int(child.read_text()))


def test_without_posix_it_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(process, "POSIX", False)
    with (
        pytest.raises(InputError, match=r"^part: isolation = 'process' needs Linux or macOS"),
        running(tmp_path, "3.0", "process"),
    ):
        pass


def test_the_process_ends_when_the_masters_is_killed(tmp_path):
    """Even while its FMU hangs."""
    fmu = build(tmp_path)
    code = f"""
import numpy as np
from pathlib import Path
from grasp_cosim.fmi.load import load
from grasp_cosim.system.parts import Component
part = load(Component("part", Path({str(fmu)!r}), {{}}, isolation="process"))
part.enter_initialization({{"hang_at": 0.1}}, 1.0)
part.exit_initialization()
print(part._process.pid, flush=True)
part.stepper(np.zeros(3), 0.2).python()
"""
    with subprocess.Popen(
        [sys.executable, "-c", code],
        stdout=subprocess.PIPE,
        env={**os.environ, "TMPDIR": str(tmp_path)},  # it has no chance to tidy up
    ) as master:
        assert master.stdout is not None
        worker = int(master.stdout.readline())
        assert alive(worker)
        master.kill()
    assert ends(worker)
