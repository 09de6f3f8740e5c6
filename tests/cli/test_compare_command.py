"""The command compare: its exit codes, its page and its JSON."""

import json

import pytest
from report.runs import grasp_run, write_run


@pytest.fixture
def runs(tmp_path):
    run = grasp_run()
    write_run(tmp_path / "a", run)
    run.signals["plant.gap[1]"][:] += 1e-3
    write_run(tmp_path / "b", run)
    return tmp_path / "a", tmp_path / "b"


def test_exit_codes_and_json(command, runs, tmp_path):
    a, b = runs
    assert command("compare", a, a)[0] == 0
    code, out, err = command("compare", a, b, "--json", "-o", "page.html")
    assert code == 1
    report = json.loads(out)
    worst = report["signals"][0]
    assert (worst["name"], worst["unit"], worst["inside"]) == ("plant.gap[1]", "m", False)
    assert worst["deviation"] == pytest.approx(1e-3)
    assert (tmp_path / "page.html").read_text("utf-8").startswith("<!DOCTYPE html>")
    assert err.startswith("wrote page.html: ")


def test_bands_from_a_file_decide(command, runs, tmp_path):
    (tmp_path / "bands.toml").write_text(
        '[signals]\n"plant.gap[*]" = { absolute = 2e-3 }\n[metrics]\n"*" = { absolute = inf }\n'
    )
    code, out, _ = command("compare", *runs, "--bands", "bands.toml")
    assert (code, out.partition(":")[0]) == (0, "ALIKE")
    (tmp_path / "bands.toml").write_text('[signals]\n"plant.gap[*]" = { width = 2e-3 }\n')
    code, _, err = command("compare", *runs, "--bands", "bands.toml")
    assert code == 2
    assert "unknown entry 'width'" in err


def test_a_page_that_cannot_be_written_is_refused_before_the_work(command, runs):
    code, _, err = command("compare", *runs, "-o", runs[0] / "run.json" / "page.html")
    assert code == 2
    assert err.count("\n") == 1
    code, _, err = command("compare", *runs, "-o", runs[0])
    assert code == 2
    assert err.count("\n") == 1


def test_wrong_input_is_one_line(command, runs):
    code, out, err = command("compare", runs[0], "nothing")
    assert (code, out) == (2, "")
    assert err.startswith("grasp-cosim: nothing: no such run; must be a folder")
    assert err.count("\n") == 1
