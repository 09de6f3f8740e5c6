"""report: what it writes and prints, its mistakes in one line."""

import json
import sys

import pytest
from grasp_cosim import cli, simulate
from grasp_cosim.recording.load import load_run
from grasp_cosim.report.page import page_html
from report.runs import grasp_run, write_run


@pytest.fixture
def folder(tmp_path):
    """A recorded grasp."""
    write_run(tmp_path / "results", grasp_run())
    return tmp_path / "results"


@pytest.mark.slow
def test_the_page_and_the_picture_are_beside_the_run(folder, capsys):
    assert cli.main(["report", str(folder)]) == 0
    out, err = capsys.readouterr()
    html = (folder / "report.html").read_text("utf-8")
    for run in (load_run(folder), grasp_run()):
        assert html == page_html(run, scene=run.view.scene(run))
    assert 'id="scene"' in html
    assert (folder / "grasp.png").read_bytes().startswith(b"\x89PNG")
    assert out.splitlines()[0].startswith(f"{folder / 'report.html'}: ")
    assert out.splitlines()[1:] == [str(folder / "grasp.png")]
    assert not err


@pytest.mark.slow
def test_json_and_another_place(folder, tmp_path, capsys):
    page = tmp_path / "new" / "page.html"
    assert cli.main(["report", str(folder), "--out", str(page), "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == {
        "page": str(page),
        "bytes": page.stat().st_size,
        "pictures": [str(page.parent / "grasp.png")],
    }
    assert sorted(p.name for p in folder.iterdir()) == ["run.json", "signals.csv"]


def test_without_matplotlib_there_is_the_page_alone(folder, monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    assert cli.main(["report", str(folder), "--json"]) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)["pictures"] == []
    assert err.startswith("no picture: matplotlib is not installed")
    assert "pip install 'matplotlib>=" in err
    assert len(err.splitlines()) == 1
    assert (folder / "report.html").exists()
    assert not (folder / "grasp.png").exists()


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("run.json", None, "run.json: No such file"),
        ("signals.csv", None, "signals.csv: No such file"),
        ("run.json", '{"units": {}}', "run.json: no entry 'system'; must be as"),
    ],
)
def test_a_folder_that_is_no_run_is_one_line(name, text, message, folder, capsys):
    if text is None:
        (folder / name).unlink()
    else:
        (folder / name).write_text(text, "utf-8")
    assert cli.main(["report", str(folder)]) == 2
    err = capsys.readouterr().err
    assert message in err
    assert len(err.splitlines()) == 1
    assert not (folder / "report.html").exists()


def test_a_run_as_it_is_recorded_makes_a_page(grasp, tmp_path):
    result = simulate(grasp, stop=0.05)
    result.to_csv(tmp_path / "signals.csv")
    result.to_json(tmp_path / "run.json")
    assert cli.main(["report", str(tmp_path)]) == 0
    html = (tmp_path / "report.html").read_text("utf-8")
    assert all(f"{c.name}</text>" in html for c in grasp.components)
    assert all(f"{w.source} → {w.target}" in html for w in grasp.connections)


def test_help_has_an_example(capsys):
    assert cli.main(["report", "--help"]) == 0
    assert "Example: grasp-cosim report" in capsys.readouterr().out
