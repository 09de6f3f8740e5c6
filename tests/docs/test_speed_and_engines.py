"""The pages on speed and engines, and that on benchmarks, which has the numbers of the first."""

import re
import shlex
from importlib.util import find_spec
from pathlib import Path

import pytest
from grasp_cosim import cli
from support.marks import needs_compiler
from support.pages import commands_of

ROOT = Path(__file__).parents[2]
SPEED = (ROOT / "docs/results/speed.md").read_text("utf-8")
ENGINES = (ROOT / "docs/explanation/engines.md").read_text("utf-8")
BENCHMARKS = (ROOT / "benchmarks/README.md").read_text("utf-8")
NO_MEASUREMENTS = {"worker", "bare", "mutants"}
"""Modules of benchmarks/: two serve another, one is for contributors."""


def test_each_benchmark_is_listed_and_there():
    modules = {path.stem for path in (ROOT / "benchmarks").glob("*.py")} - NO_MEASUREMENTS
    listed = set(re.findall(r"^\| `python -m benchmarks\.(\w+)`", BENCHMARKS, re.MULTILINE))
    assert listed == modules
    assert all(find_spec(f"benchmarks.{name}") for name in listed)


@pytest.mark.parametrize("master", ["ecospy", "libcosimpy", "cofmupy"])
def test_the_factors_of_other_masters_are_those_measured(master):
    (row,) = re.findall(rf"^\| {master} \| (.*) \|$", BENCHMARKS, re.MULTILINE)
    *python, native = [cell.rpartition(", ")[2] for cell in row.split(" | ")]
    ratios = sorted(python, key=float)
    (shown,) = re.findall(rf"^\| `{master}` .* \| (.*) \| (.*) \|$", SPEED, re.MULTILINE)
    assert shown == (f"{ratios[0]} to {ratios[-1]}", native)


@needs_compiler
def test_verbose_shows_what_runs(checkout, capsys):
    (block,) = re.findall(r"```console\n(.*?)```", ENGINES, re.DOTALL)
    ((command, shown),) = commands_of(block)
    assert cli.main(shlex.split(command)[1:]) == 0
    printed = "".join(capsys.readouterr())
    for line in shown.splitlines():
        begin, end = line.partition(":")[0], line.rpartition("/")[2].rpartition(": ")[2]
        if line != "..." and not begin.startswith(("reading", "native")):
            assert re.search(rf"^{begin}: .*{re.escape(end)}$", printed, re.MULTILINE), line
        elif line != "...":
            assert re.search(rf"^{begin}: ", printed, re.MULTILINE), line
