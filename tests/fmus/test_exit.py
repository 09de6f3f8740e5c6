"""A host that has used an FMU ends without touching freed memory."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

HOST = """
import sys
from fmpy import simulate_fmu
for fmu in sys.argv[1:]:
    simulate_fmu(fmu, stop_time=1e-3)
"""


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("valgrind"), reason="valgrind is not installed")
def test_the_process_ends_in_peace(fmus: Path) -> None:
    """pythonfmu 0.7.0 alone: an invalid read in finalizePythonInterpreter."""
    done = subprocess.run(
        ["valgrind", "--num-callers=6", sys.executable, "-c", HOST,
         str(fmus / "ProximitySensor.fmu"), str(fmus / "GripperPlant.fmu")],
        env={**os.environ, "PYTHONMALLOC": "malloc"}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0
    assert "ERROR SUMMARY" in done.stderr
    assert "finalizePythonInterpreter" not in done.stderr
