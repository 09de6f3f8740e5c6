"""The Pythons on this machine."""

import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

VERSIONS = ["3.11", "3.12", "3.13", "3.14", "3.15"]

_ASK = "import sys; print('{}.{}'.format(*sys.version_info))"


@cache
def python(version):
    """The program of a Python of that version; skips the test without."""
    programs = [
        sys.executable,
        shutil.which(f"python{version}"),
        *sorted((Path.home() / ".pyenv/versions").glob(f"{version}.*/bin/python")),
    ]
    for program in map(str, filter(None, programs)):  # a shim of pyenv may be of no Python at all
        done = subprocess.run([program, "-c", _ASK], capture_output=True, text=True)
        if (done.returncode, done.stdout.strip()) == (0, version):
            return program
    pytest.skip(f"PYTHON {version} IS NOT ON THIS MACHINE: the FMUs go untested with it")
