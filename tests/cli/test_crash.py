"""An FMU that crashes: what the command says, and what a process of its own leaves of the run."""

import json
import signal
import subprocess
import sys

import pytest
from grasp_cosim.fmi.process import ProcessInstance
from support.native_fmus import TYPES, build, needs_gcc


def grasp_cosim(*arguments):
    return subprocess.run(
        [sys.executable, "-P", "-m", "grasp_cosim", *map(str, arguments)],
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip


def system_file(folder, crash_at=1e9, isolation="none"):
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
@pytest.mark.parametrize(
    ("options", "said"), [([], ""), (["--debug"], "Fatal Python error: Segmentation fault")]
)
def test_in_the_process_of_the_command(tmp_path, options, said):
    done = grasp_cosim(*options, "run", system_file(tmp_path, 0.55))
    assert done.returncode == -signal.SIGSEGV
    assert said in done.stderr
    assert ("Fatal Python error" in done.stderr) is bool(said)


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
    done = subprocess.run(
        [sys.executable, "-P", "-c", program],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert (done.returncode, done.stderr[: len(said)]) == (code, said)
    assert len(done.stderr.splitlines()) == bool(said)


@needs_gcc
def test_in_a_process_of_its_own(tmp_path):
    path, out = system_file(tmp_path, 0.55), tmp_path / "out"
    done = grasp_cosim("run", path, "--set", "components.motor.isolation=process", "--out", out)
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
def test_the_option_goes_before_the_file(tmp_path, said, started, monkeypatch, command):
    names = []
    start = ProcessInstance.__init__

    def noted(part, name, *rest):
        names.append(name)
        start(part, name, *rest)

    monkeypatch.setattr(ProcessInstance, "__init__", noted)
    given = ["--set", f"components.motor.isolation={said}"] if said else []
    path = system_file(tmp_path, isolation="process")
    assert command("run", path, *given)[0] == 0
    assert names == ["motor"] * started
