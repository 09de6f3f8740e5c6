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


@pytest.mark.slow
@needs_compiler
def test_the_deviations_from_the_published_experiments(capsys):
    """And the claim that does not hold."""
    assert cli.main(["evaluate", "--bench", "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    rms = ", ".join(f"{name.replace('_', ' ')} {value:.3f}" for name, value in found["rms"].items())
    assert f"root mean square of the differences in s: {rms}" in PAGE
    assert [f"FAILS  {c['text']}" in PAGE for c in found["claims"] if not c["holds"]] == [True]
    apart = {
        row["condition"]: row for row in found["rows"] if (row["case"], row["finger"]) == (2, None)
    }
    first, second = (apart[colours]["simulated"] for colours in ("brown/white", "white/brown"))
    assert f"they touch {first:.3f} s and {second:.3f} s apart" in PAGE
    assert (
        f"| contact times of mixed colours | 0.336 s | {found['rms']['mixed_colours']:.3f} s |"
        in PAGE
    )


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize(("inner", "column"), [((), 0), (("--fit", "inner[2]"), 1)])
def test_the_cross_validation_of_the_friction(capsys, inner, column):
    groups = ("--fit", "coulomb", "--fit", "viscous", *inner)
    assert cli.main(["identify", *groups, "--cross-validate", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    for quantity, key in (
        ("contact times of the fit", "rms"),
        ("contact times of the row that was left out", "left_out_rms"),
    ):
        table = re.search(rf"^\| {quantity} \| ([\d.]+) s \| ([\d.]+) s \|$", PAGE, re.MULTILINE)
        assert table[column + 1] == f"{found[key]:.3f}"
