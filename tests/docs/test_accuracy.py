"""The tables of accuracy.md are what `evaluate` finds, to the printed digit."""

import json
import re
from pathlib import Path

import pytest
from grasp_cosim import cli
from support.marks import needs_compiler

PAGE = (Path(__file__).parents[2] / "docs/results/accuracy.md").read_text("utf-8")


def row(heading, quantity):
    """The numbers of a row of the table below a heading."""
    table = re.search(rf"^\| quantity \| {heading} .*?\n\n", PAGE, re.DOTALL | re.MULTILINE)[0]
    return re.search(
        rf"^\| {quantity} \| ([\d.]+) s \| ([\d.]+) s \|$", table, re.MULTILINE
    ).groups()


@pytest.mark.slow
@needs_compiler
def test_the_deviations_from_the_published_simulations(capsys):
    assert cli.main(["evaluate", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    for quantity, is_finger, count in (
        ("contact times", True, 24),
        ("time differences", False, 12),
    ):
        rows = [r for r in found["rows"] if bool(r["finger"]) == is_finger]
        worst = max(abs(r["difference"]) for r in rows)
        key = quantity.replace(" ", "_")
        rms, rms_at_gap = found["rms"][key], found["rms"][f"{key}_at_0.37_mm"]
        assert row("largest deviation", quantity) == (f"{worst:.3f}", f"{rms:.3f}")
        assert row("contact at 0 mm", quantity) == (f"{rms:.3f}", f"{rms_at_gap:.3f}")
        assert f"{count} {quantity}" in PAGE
    claims = " ".join(claim["text"] for claim in found["claims"])
    for number in ("10.0 mm/s", "286 mm/s"):
        assert number in claims
        assert number in PAGE
