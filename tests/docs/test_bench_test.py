"""The bench test of docs/how_to/hardware.md: it passes, and says in a line what failed."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest
from grasp_cosim import cli, load_run
from support.marks import needs_compiler

PAGE = (Path(__file__).parents[2] / "docs/how_to/hardware.md").read_text("utf-8")


def ran(folder):
    """What pytest prints of the test of the page, and its exit code."""
    (folder / "pytest.ini").write_text("[pytest]\n")
    test = [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", "test_bench.py"]
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "COLUMNS": "400"}
    done = subprocess.run(test, cwd=folder, env=environment, capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


@pytest.mark.slow
@needs_compiler
def test_the_bench_test_of_the_page(checkout):
    section = PAGE.partition("## A bench test in pytest")[2].partition("\n## ")[0]
    (tables,) = re.findall(r"^```\n(\[record.*?)^```", section, re.DOTALL | re.MULTILINE)
    (test,) = re.findall(r"^```python\n(.*?)^```", section, re.DOTALL | re.MULTILINE)
    (shown,) = re.findall(r"^```text\n(.*?)^```", section, re.DOTALL | re.MULTILINE)
    assert cli.main(["init", "my_system.toml"]) == 0
    system = checkout / "my_system.toml"
    plain = system.read_text("utf-8")
    system.write_text(f"{plain}\n{tables}", "utf-8")
    (checkout / "test_bench.py").write_text(test, "utf-8")
    code, text = ran(checkout)
    assert code == 0, text
    (window,) = load_run(checkout / "results").windows
    assert window.time[0] == pytest.approx(1.387)
    stricter = tables.replace("time_difference = 0.05", "time_difference = 0.001")
    system.write_text(f"{plain}\n{stricter}", "utf-8")
    code, text = ran(checkout)
    assert code == 1
    assert " ".join(shown.split()) in " ".join(text.split())
