"""run --record: which signals the files of a run have, what pages show of them, and refusals."""

import csv
import json
import re
import shlex
import shutil
from pathlib import Path

import pytest
from grasp_cosim import load_run
from support.native_fmus import inner, needs_gcc


def header(folder):
    with (folder / "signals.csv").open(encoding="utf-8", newline="") as file:
        return next(csv.reader(file))


SHORT = ("run", "--stop", "0.01", "--quiet")


def test_what_is_named_is_recorded_and_the_metrics_stay_the_same(command, tmp_path):
    _, usual, _ = command(*SHORT, "--json")
    names = ["plant.gap[1]", "controller.contact_force.stiffness"]
    code, out, _ = command(*SHORT, "--record", ",".join(reversed(names)), "--out", "r", "--json")
    assert (code, header(tmp_path / "r")) == (0, ["time", *names])
    clock = {"wall_time", "real_time_factor"}
    assert {k: v for k, v in json.loads(out).items() if k not in clock} == {
        k: v for k, v in json.loads(usual).items() if k not in clock
    }
    assert json.loads((tmp_path / "r/run.json").read_text("utf-8"))["record"] == names[::-1]
    assert load_run(tmp_path / "r").metrics["smallest_gap"] == json.loads(out)["smallest_gap"]


def test_the_example_of_the_page_runs(command, tmp_path):
    page = (Path(__file__).parents[2] / "docs/reference/signals.md").read_text("utf-8")
    (example,) = re.findall("\n    grasp-cosim (run --stop 0.1 .*)", page.replace("\\\n", " "))
    assert command(*shlex.split(example))[0] == 0
    assert header(tmp_path / "results")[1:5] == [
        *("plant.position[1]", "plant.position[2]", "plant.velocity[1]", "plant.velocity[2]"),
    ]
    assert "controller.contact_force.stiffness" in header(tmp_path / "results")
    assert not any("force" in name for name in header(tmp_path / "results") if "plant" in name)


def test_what_is_worked_out_of_others_is_recorded_by_its_name(command, tmp_path):
    command(*SHORT, "--record", "plant.exchange*", "--record", "!*[2]", "--out", "r")
    assert header(tmp_path / "r") == ["time", "plant.exchange_energy[1]"]


@pytest.mark.parametrize(
    ("names", "message"),
    [
        ("plant.gpa[1]", "--record 'plant.gpa[1]' matches no signal; did you mean plant.gap[1]?"),
        ("plant.*,sensr_1.*", "--record 'sensr_1.*' matches no signal; valid: plant.*, sensor_1.*"),
        ("plant.*,", "--record '' matches no signal; valid: plant.*, "),
    ],
)
def test_what_matches_nothing_is_refused_before_the_run(command, names, message):
    code, _, err = command(*SHORT, "--record", names)
    assert (code, err.startswith(f"grasp-cosim: {message}")) == (2, True), err


def test_a_list_is_no_single_value(command):
    code, _, err = command(*SHORT, "--set", "record.signals=plant.*")
    said = "--set record.signals: is a list; must be given by --record, or with_record()"
    assert (code, err) == (2, f"grasp-cosim: {said}\n")


@pytest.fixture
def file(tmp_path):
    inner(tmp_path, "2.0")
    text = '[experiment]\nstep = 0.1\nstop = 0.5\n[components.a]\nfmu = "inner.fmu"\n'
    (tmp_path / "s.toml").write_text(text + 'values = { u = 1.0 }\n[record]\nsignals = ["a.k"]\n')
    return tmp_path / "s.toml"


@needs_gcc
def test_an_option_goes_before_the_file(command, file, tmp_path):
    command("run", file, "--out", "file")
    command("run", file, "--record", "a.x", "--out", "option")
    assert header(tmp_path / "file") == ["time", "a.k"]
    assert header(tmp_path / "option") == ["time", "a.x"]


@pytest.mark.slow
@needs_gcc
def test_locals_are_drawn_compared_and_reported_with_what_is_no_number(command, file, tmp_path):
    """a.empty is none from 0.3 s on, in two runs that are alike; in the third it is left out."""
    for folder in "ab":
        assert command("run", file, "--record", "a.*", "--out", folder, "--plot")[0] == 0
    assert (tmp_path / "a/signals.png").is_file()
    assert command("report", "a", "-o", "a.html")[0] == 0
    code, out, _ = command("compare", "a", "b", "--json", "-o", "ab.html")
    report = json.loads(out)
    assert code == 0
    assert {s["name"]: s["deviation"] for s in report["signals"]}["a.empty"] == 0.0


@needs_gcc
def test_a_signal_that_is_a_number_in_one_run_alone_differs(command, file, tmp_path):
    assert command("run", file, "--record", "a.empty", "--out", "a")[0] == 0
    shutil.copytree(tmp_path / "a", tmp_path / "b")
    rows = (tmp_path / "b/signals.csv").read_text("utf-8")
    (tmp_path / "b/signals.csv").write_text(rows.replace("0.4,nan", "0.4,0.0"), "utf-8")
    code, out, _ = command("compare", "a", "b", "-o", "ab.html")
    assert (code, "DIFFERENT: 1 of 1 signals" in out) == (1, True)
    assert "a.empty" in out
