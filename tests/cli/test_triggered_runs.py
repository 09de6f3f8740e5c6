"""run with a trigger: the folders of its windows, what it prints, and its exit codes."""

import json

import pytest
from grasp_cosim import load_run

SHORT = ("run", "--step", "1e-3", "--stop", "2.5", "--quiet", "--out", "r")
TRIGGER = ("--set", "record.trigger=plant.contact[1] == true", "--set", "record.after=0.05")


def files(folder):
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())


def test_a_run_is_a_few_files(command, tmp_path):
    code, out, _ = command(*SHORT, *TRIGGER, "--set", "record.before=0.1")
    assert code == 0
    assert "recorded              151 rows in 1 window" in out
    assert files(tmp_path / "r") == ["run.json", "window_001/run.json", "window_001/signals.csv"]
    run = json.loads((tmp_path / "r/run.json").read_text("utf-8"))
    assert "t = 1.887 s: recording 1: plant.contact[1] == true" in run["log"]
    code, out, _ = command(*SHORT, *TRIGGER, "--json")
    (window,) = json.loads(out)["windows"]
    assert (window["folder"], window["time"], window["rows"]) == ("window_001", 1.887, 51)
    assert len(load_run(tmp_path / "r/window_001").time) == 51


def test_a_trigger_that_never_came_true_ends_with_1(command, tmp_path):
    code, out, err = command(*SHORT[:5], "--out", "r", *TRIGGER, "--stop", "0.1")
    assert code == 1
    assert "record.trigger: plant.contact[1] == true never came true: nothing is recorded" in err
    assert "recorded              0 rows in 0 windows" in out
    assert files(tmp_path / "r") == ["run.json"]
    assert command("report", "r", "--quiet")[0] == 0


def test_the_other_commands_read_a_window_as_a_run(command, tmp_path):
    """And refuse the whole for its gaps, where they compare."""
    both = ("--set", "record.trigger=plant.gap[1] < 0.02")
    assert command(*SHORT, *TRIGGER[2:], *both)[0] == 0
    assert command("report", "r", "--quiet")[0] == 0
    pages = {"r/report.html", "r/window_001/report.html"}
    assert {f"r/{name}" for name in files(tmp_path / "r")} >= pages
    assert "window_001" in (tmp_path / "r/report.html").read_text("utf-8")
    assert command("compare", "r/window_001", "r/window_001", "--quiet")[0] == 0
    assert command("diff", "r", "r/window_001")[0] == 0
    code, _, err = command("compare", "r", "r/window_001")
    assert code == 2
    assert "r: recorded windows with gaps between; must be one of them: r/window_001" in err


def test_pictures_and_mdf_are_those_of_the_windows(command, tmp_path):
    pytest.importorskip("matplotlib")
    pytest.importorskip("asammdf")
    assert command(*SHORT, *TRIGGER, "--plot", "--mdf")[0] == 0
    assert files(tmp_path / "r/window_001") == [
        "grasp.png",
        "run.json",
        "signals.csv",
        "signals.mf4",
    ]
    assert command("run", "--stop", "0.01", "--quiet", "--out", "r")[0] == 0
    assert files(tmp_path / "r") == ["run.json", "signals.csv"]


def test_a_trigger_stays_where_other_signals_are_recorded(command, tmp_path):
    assert command(*SHORT, *TRIGGER, "--record", "plant.gap[1]")[0] == 0
    assert [*load_run(tmp_path / "r/window_001")] == ["plant.gap[1]"]


def test_what_needs_all_rows_does_without_a_trigger_and_says_so(command):
    options = ("--step", "1e-3", "--stop", "0.1", *TRIGGER)
    code, _, err = command("sweep", "--vary", "plant.object_width=0.06,0.07", *options)
    assert code == 0
    assert "grasp.toml: record.trigger: is left out, as all rows are needed" in err


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["record.trigger=plant.contact[1] > 2", "record.after=1"], "grasp.toml: record.trigger = "
         "'plant.contact[1] > 2.0': plant.contact[1] is Boolean; must be compared with true or "),
        (["record.before=1"], "--set record.before = 1: there is no trigger; must have one, like "),
        (["record.signals=a"], "--set record.signals: is a list; must be given by --record, or "),
        (["record.tigger=a"], "--set record.tigger: no entry 'tigger' of [record]; did you mean "),
    ],
)  # fmt: skip
def test_a_trigger_that_cannot_be_ends_with_2(command, options, message):
    code, _, err = command("run", *(word for option in options for word in ("--set", option)))
    assert code == 2
    assert message in err
    assert len(err.splitlines()) == 1
