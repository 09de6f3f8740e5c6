"""An FMU that crashes: what the command says, and what a process of its own leaves of the run."""

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from conftest import Run
from grasp_cosim import System, simulate
from grasp_cosim.fmi.process import ProcessInstance
from support.native_fmus import TYPES, build, needs_gcc

ADVICE = "run has --isolation process"


def grasp_cosim(*arguments: object) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-P", "-m", "grasp_cosim", *map(str, arguments)],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


def system_file(folder: Path, crash_at: float = 1e9, isolation: str = "none") -> Path:
    build(folder, version="2.0")
    starts = {"Boolean": "false", "String": "''", "Enumeration": "1"}
    values = "".join(f"u_{t} = {starts.get(t, '2')}, " for t in TYPES["2.0"])
    (folder / "one.toml").write_text(
        "[experiment]\nstep = 0.1\nstop = 1.0\n"
        f"[components.motor]\nfmu = 'native.fmu'\nisolation = '{isolation}'\n"
        f"values = {{ {values}crash_at = {crash_at} }}\n"
    )
    return folder / "one.toml"


@needs_gcc
@pytest.mark.parametrize("engine", ["python", "compiled"])
def test_in_the_process_of_the_command(tmp_path: Path, engine: str) -> None:
    done = grasp_cosim("run", system_file(tmp_path, 0.55), "--engine", engine)
    assert done.returncode == 3
    *_, line = done.stderr.splitlines()
    assert line.startswith("grasp-cosim: native.so, the binary of an FMU, crashed with SIGSEGV; ")
    assert ADVICE in line


@needs_gcc
def test_with_debug_it_is_seen_where_python_was(tmp_path: Path) -> None:
    done = grasp_cosim("--debug", "run", system_file(tmp_path, 0.55))
    assert done.returncode == -11
    assert "Segmentation fault" in done.stderr
    assert ADVICE not in done.stderr


@pytest.mark.parametrize(
    ("does", "how"),
    [
        ("os.abort()", "crashed with SIGABRT"),
        ("os.kill(os.getpid(), signal.SIGBUS)", "crashed with SIGBUS"),
        ("ctypes.string_at(0)", "crashed with SIGSEGV"),
        # after which a run in its midst would look like one that is done
        ("ctypes.CDLL(None).exit(0)", "ended the process with exit code 0"),
        ("os.fork() or ctypes.CDLL(None).exit(0); os.wait(); os.abort()", "crashed with SIGABRT"),
        # no lock of Python's keeps the words back: another thread, while this one waits for it
        (
            "t = threading.Thread(target=ctypes.CDLL(None).abort); t.start(); t.join()",
            "crashed with SIGABRT",
        ),
    ],
)
def test_another_end(does: str, how: str) -> None:
    code = f"""
import ctypes, os, signal, threading
from grasp_cosim.cli.crash import explain_crashes
explain_crashes(debug=False)
{does}
"""
    done = subprocess.run(
        [sys.executable, "-P", "-c", code], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 3
    assert done.stderr.startswith(f"grasp-cosim: the process {how}; ")
    assert len(done.stderr.splitlines()) == 1


@needs_gcc
def test_in_a_process_of_its_own(tmp_path: Path) -> None:
    path, out = system_file(tmp_path, 0.55), tmp_path / "out"
    done = grasp_cosim("run", path, "--isolation", "process", "--out", out)
    assert done.returncode == 3
    *_, line = done.stderr.splitlines()
    assert (
        line
        == "grasp-cosim: motor: the process of native.fmu ended with signal SIGSEGV at t = 0.5 s "
        "(inputs: u_Real = 2, u_Integer = 2, u_Boolean = false, u_Enumeration = 1, u_String = '')"
    )
    assert json.loads((out / "run.json").read_text())["complete"] is False
    assert len((out / "signals.csv").read_text().splitlines()) == 1 + 6


@needs_gcc
@pytest.mark.parametrize(("said", "started"), [("none", 0), ("process", 1), (None, 1)])
def test_the_option_goes_before_the_file(
    tmp_path: Path, said: str | None, started: int, monkeypatch: pytest.MonkeyPatch, command: Run
) -> None:
    names = []
    start = ProcessInstance.__init__

    def noted(part: ProcessInstance, name: str, *rest: Any) -> None:
        names.append(name)
        start(part, name, *rest)

    monkeypatch.setattr(ProcessInstance, "__init__", noted)
    given = ["--isolation", said] if said else []
    path = system_file(tmp_path, isolation="process")
    assert command("run", path, *given)[0] == 0
    assert names == ["motor"] * started


@needs_gcc
def test_the_numbers_are_the_same(tmp_path: Path) -> None:
    system = System.load(system_file(tmp_path))
    here, there = (simulate(system.with_isolation(i)) for i in ("none", "process"))
    assert all((here[name] == there[name]).all() for name in here)
