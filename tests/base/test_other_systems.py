"""What Windows lacks is not needed: hidden, all modules load, and systems run, sweep and fail."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from support.native_fmus import needs_gcc
from support.native_systems import write_integrator

HIDDEN = Path(__file__).parents[1] / "support" / "no_posix"


def run(*arguments, cwd):
    path = os.pathsep.join([str(HIDDEN), *filter(None, [os.environ.get("PYTHONPATH")])])
    return subprocess.run(
        [sys.executable, *arguments], cwd=cwd, env={**os.environ, "PYTHONPATH": path},
        capture_output=True, text=True, timeout=600,
    )  # fmt: skip


def test_there_is_nothing_of_it_in_these_processes(tmp_path):
    """Or the others would show nothing."""
    program = "import os, signal; assert not hasattr(os, 'killpg'); import fcntl"
    done = run("-c", program, cwd=tmp_path)
    assert "ModuleNotFoundError: No module named 'fcntl'" in done.stderr


def test_every_module_can_be_imported(tmp_path):
    program = (
        "import pkgutil, grasp_cosim\n"
        "for m in pkgutil.walk_packages(grasp_cosim.__path__, 'grasp_cosim.'):\n"
        "    if not m.name.endswith('__main__'): __import__(m.name)\n"
    )
    done = run("-c", program, cwd=tmp_path)
    assert done.returncode == 0, done.stderr


@needs_gcc
@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "system.toml", "--out", "out"),
        ("run", "system.toml", "--realtime", "--set", "realtime.cpu=0",
         "--set", "verdict.refused=1"),
        ("run", "system.toml", "--set", "components.a.isolation=process"),
        ("sweep", "system.toml", "--vary", "a.gain=1,2", "--workers", "2", "--metrics", "mine.py"),
    ],
    ids=" ".join,
)  # fmt: skip
def test_the_command_works(arguments, tmp_path):
    write_integrator(tmp_path)
    done = run("-m", "grasp_cosim", *arguments, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
