"""Damaged input ends in a verdict: an exit code from 0 to 3, one line, in time, in its place."""

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

TESTS = Path(__file__).parents[1]


def tried(kind: str, first: int, count: int, fmus: Path, folder: Path) -> list[dict[str, Any]]:
    """What came of so many seeds, see support/mutants.py."""
    done = subprocess.run(
        [sys.executable, "-P", "-m", "support.mutants", kind, *map(str, (first, count, fmus)),
         str(folder / "mutants")],
        env={**os.environ, "PYTHONPATH": str(TESTS), "PYTHONWARNINGS": "ignore:Duplicate name"},
        stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    return [json.loads(line) for line in done.stdout.splitlines()]


def check(found: list[dict[str, Any]]) -> None:
    assert [entry for entry in found if entry["wrong"]] == []
    assert {0, 2} <= {entry["code"] for entry in found}  # neither all well nor all refused


@pytest.mark.parametrize(("kind", "count"), [("toml", 30), ("fmu", 4), ("ssp", 8)])
def test_a_few(kind: str, count: int, fmus: Path, tmp_path: Path) -> None:
    check(tried(kind, 0, count, fmus, tmp_path))


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "count"), [("toml", 120), ("fmu", 20), ("ssp", 30)])
def test_more(kind: str, count: int, fmus: Path, tmp_path: Path) -> None:
    check(tried(kind, 5000, count, fmus, tmp_path))
