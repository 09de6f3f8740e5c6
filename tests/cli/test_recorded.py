"""report and compare: what they write and print of recorded runs, and their exit codes."""

import json
import sys

import pytest
from grasp_cosim.recording.read_back import load_run
from grasp_cosim.report.run_report import page_html
from report.runs import grasp_run, write_run


@pytest.fixture
def runs(command, tmp_path):
    """The command where a and b are recorded grasps, whose gaps are 1 mm apart."""
    run = grasp_run()
    write_run(tmp_path / "a", run)
    run.signals["plant.gap[1]"][:] += 1e-3
    write_run(tmp_path / "b", run)
    return command


@pytest.mark.slow
def test_the_page_and_the_picture_are_beside_the_run(runs, tmp_path):
    code, out, err = runs("report", "a")
    assert (code, err) == (0, "")
    html = (tmp_path / "a/report.html").read_text("utf-8")
    for run in (load_run(tmp_path / "a"), grasp_run()):
        assert html == page_html(run, scene=run.view.scene(run))
    assert 'id="scene"' in html
    assert (tmp_path / "a/grasp.png").read_bytes().startswith(b"\x89PNG")
    page, picture = out.splitlines()
    assert page.startswith("a/report.html: ")
    assert picture == "a/grasp.png"


def test_json_another_place_and_no_matplotlib(runs, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, out, err = runs("report", "a", "--out", "new/page.html", "--json", "--title", "Mine")
    page = tmp_path / "new/page.html"
    expected = {"page": "new/page.html", "bytes": page.stat().st_size, "pictures": []}
    assert (code, json.loads(out)) == (0, expected)
    assert "<title>Mine" in page.read_text("utf-8")
    assert err.startswith("no picture: matplotlib is not installed")
    assert "pip install 'matplotlib>=" in err
    assert err.count("\n") == 1
    assert sorted(path.name for path in (tmp_path / "a").iterdir()) == ["run.json", "signals.csv"]


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("run.json", None, "run.json: No such file"),
        ("signals.csv", None, "signals.csv: No such file"),
        ("run.json", '{"units": {}}', "run.json: no entry 'system'; must have one, as"),
    ],
)
def test_a_folder_that_is_no_run_is_one_line(name, text, message, runs, tmp_path):
    (tmp_path / "a" / name).unlink()
    if text:
        (tmp_path / "a" / name).write_text(text, "utf-8")
    code, out, err = runs("report", "a")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err
    assert not (tmp_path / "a/report.html").exists()


def test_what_differs_is_exit_code_1(runs, tmp_path):
    assert runs("compare", "a", "a")[0] == 0
    code, out, err = runs("compare", "a", "b", "--json", "-o", "page.html")
    assert code == 1
    worst = json.loads(out)["signals"][0]
    assert (worst["name"], worst["unit"], worst["inside"]) == ("plant.gap[1]", "m", False)
    assert worst["deviation"] == pytest.approx(1e-3)
    assert (tmp_path / "page.html").read_text("utf-8").startswith("<!DOCTYPE html>")
    assert err.startswith("wrote page.html: ")
    assert runs("compare", "a", "b", "-o", "page.html", "-q")[2] == ""


def test_bands_from_a_file_decide(runs, tmp_path):
    (tmp_path / "bands.toml").write_text(
        '[signals]\n"plant.gap[*]" = { absolute = 2e-3 }\n[metrics]\n"*" = { absolute = inf }\n'
    )
    code, out, _ = runs("compare", "a", "b", "--bands", "bands.toml")
    assert (code, out.partition(":")[0]) == (0, "ALIKE")
