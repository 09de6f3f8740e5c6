"""The command as a process of its own: what reaches standard output, and what a full disk does."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.interface.read import read_interface
from support.native_fmus import build, needs_gcc

FULL = Path("/dev/full")


def run(*arguments, output=subprocess.PIPE):
    command = [sys.executable, "-m", "grasp_cosim", *arguments]
    return subprocess.run(
        command, stdout=output, stderr=subprocess.PIPE, text=True, timeout=120, check=False
    )


@needs_gcc
def test_what_an_fmu_prints_does_not_get_into_the_json(tmp_path):
    fmu = build(tmp_path, "printing", "2.0")
    inputs = [v.name for v in read_interface(fmu).of("input")]
    values = {"u_Boolean": "true", "u_String": "'text'", "u_Enumeration": "1"}
    given = ", ".join(f"{name} = {values.get(name, '0')}" for name in inputs)
    (tmp_path / "system.toml").write_text(
        "[experiment]\nstep = 0.01\nstop = 0.02\n"
        f'[components.a]\nfmu = "{fmu.name}"\nvalues = {{ {given} }}\n'
    )
    done = run("run", str(tmp_path / "system.toml"), "--json")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["steps"] == 2
    assert "native FMU 2.0 instantiated" in done.stderr


@pytest.mark.slow
@pytest.mark.skipif(not FULL.exists(), reason="this system has no /dev/full")
def test_a_full_disk_is_no_wrong_input(fmus, tmp_path):
    text = SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/')
    (tmp_path / "grasp.toml").write_text(text)
    with FULL.open("w") as full:
        done = run("run", str(tmp_path / "grasp.toml"), "--stop", "0.001", output=full.fileno())
    assert done.returncode == 3
    assert "No space left on device" in done.stderr
    assert "Traceback" not in done.stderr
