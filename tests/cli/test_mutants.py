"""Damaged input ends in a verdict: an exit code from 0 to 3, one line, in time, in its place."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from support import campaign
from support.mutants import complaints, make

TESTS = Path(__file__).parents[1]


def tried(kind, first, count, fmus, folder):
    """What came of so many seeds, see support/mutants.py."""
    done = subprocess.run(
        [sys.executable, "-P", "-m", "support.mutants", kind, *map(str, (first, count, fmus)),
         str(folder / "mutants")],
        env={**os.environ, "PYTHONPATH": str(TESTS), "PYTHONWARNINGS": "ignore:Duplicate name"},
        stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.parametrize(("kind", "count"), [("toml", 4), ("ssp", 2)])
def test_a_few(kind, count, fmus, tmp_path):
    assert [e for e in tried(kind, 0, count, fmus, tmp_path) if e["wrong"]] == []


@pytest.mark.slow
@pytest.mark.campaign
@pytest.mark.parametrize(("kind", "count"), [("toml", 800), ("fmu", 100), ("ssp", 200)])
def test_more(kind, count, fmus, tmp_path):
    found = tried(kind, campaign.first_seed, campaign.part(count), fmus, tmp_path)
    assert [e for e in found if e["wrong"]] == []
    assert {0, 2} <= {e["code"] for e in found}  # neither all well nor all refused


def test_the_seed_is_the_mutant(fmus, tmp_path):
    made = []
    for name in ("one", "other"):
        (tmp_path / name).mkdir()
        list(make("fmu", 7, fmus, tmp_path / name, b""))
        made.append((tmp_path / name / "mutant.fmu").read_bytes())
    assert made[0] == made[1]


def test_what_is_wrong_is_seen():
    """The campaign itself: it can fail."""
    assert complaints(0, "a note\n", []) == []
    assert complaints(2, "a note\ngrasp-cosim: no such\n", []) == []
    assert complaints(None, "", []) == ["exit code None"]
    assert complaints(-11, "", []) == ["exit code -11"]
    assert complaints(2, "", []) == ["0 lines of error"]
    assert complaints(3, "grasp-cosim: KeyError: 'a' (--debug shows where)", []) != []
    assert complaints(2, "Traceback (most recent call last)\ngrasp-cosim: a", []) == ["Traceback"]
    assert complaints(0, "", ["home/.x"]) == ["wrote home/.x"]
