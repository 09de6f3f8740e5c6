"""A host that has used an FMU ends without touching freed memory."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

BARE = Path(__file__).with_name("bare_host.py")

HOST = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from bare_host import Host, run
for fmu in sys.argv[2:]:
    host = Host(fmu, Path(fmu + " extracted"))
    run(host, {"set": {}, "steps": 1, "step_size": 1e-3})
    host.end()
"""
"""A plain host: under valgrind to import FMPy takes longer than all the rest."""


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which("valgrind"), reason="valgrind is not installed")
def test_the_process_ends_in_peace(fmus: Path, tmp_path: Path) -> None:
    """pythonfmu 0.7.0 alone: an invalid read in finalizePythonInterpreter."""
    names = ["ProximitySensor.fmu", "GripperPlant.fmu"]
    copies = [str(shutil.copy(fmus / name, tmp_path)) for name in names]
    done = subprocess.run(
        ["valgrind", "--undef-value-errors=no", "--num-callers=6", sys.executable, "-c", HOST,
         str(BARE.parent), *copies],
        env={**os.environ, "PYTHONMALLOC": "malloc"}, capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0
    assert "ERROR SUMMARY" in done.stderr
    assert "finalizePythonInterpreter" not in done.stderr
