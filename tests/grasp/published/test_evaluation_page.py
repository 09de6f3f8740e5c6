"""The command evaluate: the page, the numbers beside it, and how it ends."""

import csv
import json
import re
from pathlib import Path

import pytest
from grasp_cosim.grasp.published import compared, evaluation

WRITTEN = {"evaluation.html", "evaluation.csv", "evaluation.json"}

FIGURES = [
    ((), 36, "10 mm", "Case 1", ["1.64", "2.06", "0.42"]),
    (("--bench",), 78, "brown/white", "Case 2", ["2.38", "2.53", "0.15"]),
]
"""The rows of each source, and the published figures of one of its grasps."""


@pytest.fixture
def coarse(grasp, monkeypatch):
    """Grasps in steps of 2 ms."""
    made = grasp.with_experiment(step=2e-3)
    monkeypatch.setattr("grasp_cosim.grasp.system.as_named", lambda: made)


@pytest.mark.slow
@pytest.mark.usefixtures("coarse")
@pytest.mark.parametrize(("source", "rows", "where", "case", "published"), FIGURES)
def test_the_page_has_the_published_figures_beside_ours(
    command, source, rows, where, case, published
):
    code, out, err = command("evaluate", *source, "--json")
    report = json.loads(out)
    assert (code, err) == (int(not all(c["holds"] for c in report["claims"])), "")
    assert {path.name for path in Path("results").iterdir()} == WRITTEN
    assert json.loads(Path("results/evaluation.json").read_text()) == report
    with Path("results/evaluation.csv").open() as file:
        found = list(csv.DictReader(file))
    assert [float(row["simulated"]) for row in found] == [r["simulated"] for r in report["rows"]]
    assert len(found) == rows

    page = Path("results/evaluation.html").read_text("utf-8")
    assert not re.search(r"""\b(src|href)=["'](?!data:|#)|@import|url\((?!#)""", page)
    assert page.count("<svg ") == 3
    assert page.count("<td>holds</td>") == sum(c["holds"] for c in report["claims"])
    line = re.search(rf"<tr><td>{where}</td><td>{case}</td>(.*?)</tr>", page)
    assert line
    cells = re.findall(r">([^<]+)</td>", line[1])
    assert cells[::3] == published
    for shown, simulated, difference in zip(cells[::3], cells[1::3], cells[2::3], strict=True):
        assert float(simulated) == pytest.approx(float(shown) + float(difference), abs=2e-3)


def test_ctrl_c_is_130_and_nothing_is_written(command, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(compared, "run_all", interrupted)
    code, out, err = command("evaluate")
    assert (code, out, err.split()) == (130, "", ["grasp-cosim:", "interrupted"])
    assert not list(Path().rglob("evaluation*"))


@pytest.mark.parametrize(("holds", "code"), [(True, 0), (False, 1)])
def test_a_claim_that_fails_is_exit_1(command, monkeypatch, holds, code):
    made = {"rows": [], "rms": {"contact_times": 0.28}, "claims": [{"text": "It.", "holds": holds}]}

    def evaluated(system, source, *_):
        assert system.start("sensor_1.noise.enabled") == 1.0
        assert source == "experiment"

    monkeypatch.setattr(evaluation, "compared", evaluated)
    monkeypatch.setattr(evaluation, "as_report", lambda *_: made)
    monkeypatch.setattr(evaluation, "write", lambda *_: None)
    found, out, _ = command("evaluate", "--bench")
    assert found == code
    assert out.startswith("holds  It.\n" if holds else "FAILS  It.\n")
    assert "contact times 0.280" in out
    assert out.splitlines()[-1].endswith("results/evaluation.html")
    found, out, _ = command("evaluate", "--bench", "--json")
    assert (found, json.loads(out)) == (code, made)
