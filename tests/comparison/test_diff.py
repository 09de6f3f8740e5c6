"""The changes from one run to another: settings and metrics side by side, without a verdict."""

import json

import pytest
from grasp_cosim import InputError, cli, diff, grasp_system, metric, simulate
from support.marks import needs_compiler

pytestmark = needs_compiler


@pytest.fixture(scope="module")
def runs():
    """A wide and a narrow object, 3 s."""
    return [
        simulate(grasp_system().with_values({"plant.object_width": width}), step=1e-3)
        for width in (0.07, 0.06)
    ]


def test_a_narrower_object_is_held_with_less_force(runs):
    """Layer 1 settles at K_i W/2, Eq. (7): 98 N/m times half of the width."""
    changes = diff(*runs)
    (setting,) = changes.settings
    assert setting == ("plant.object_width", "0.07 m", "0.06 m")
    by_name = {change.name: change for change in changes.metrics}
    force = by_name["steady_contact_force[1]"]
    assert (force.before, force.after) == pytest.approx((98 * 0.035, 98 * 0.03), rel=0.04)
    assert force.change == force.after - force.before
    assert force.unit == "N"


def test_the_table_is_in_the_units_that_people_read(runs):
    lines = [line.split() for line in repr(diff(*runs)).splitlines()]
    assert ["plant.object_width", "0.07", "m", "0.06", "m"] in lines
    (row,) = (line for line in lines if line[:1] == ["impact_velocity[1]"])
    before, after, change = map(float, row[1:4])
    assert (before, after) == pytest.approx(
        [1e3 * run.metrics["impact_velocity"][0] for run in runs], rel=1e-3
    )
    assert change == pytest.approx(after - before, abs=2e-3)
    assert row[4] == "mm/s"


def test_a_value_that_a_run_lacks_is_none_and_has_no_change(runs):
    short = simulate(grasp_system(), step=1e-3, stop=0.5)
    by_name = {change.name: change for change in diff(runs[0], short).metrics}
    assert by_name["time_to_contact[1]"].after is None
    assert by_name["time_to_contact[1]"].change is None
    assert " none " in repr(diff(runs[0], short))


def test_a_metric_that_one_run_has_is_there(runs):
    own = metric("own", unit="s")(lambda run: float(run.time[-1]))
    result = simulate(grasp_system(), step=1e-3, stop=3.0, metrics=[own])
    (change,) = (c for c in diff(runs[0], result).metrics if c.name == "own")
    assert (change.before, change.after, change.unit) == (None, 3.0, "s")


def test_true_and_false_are_words(runs):
    own = metric("own")(lambda run: True)
    result = simulate(grasp_system(), step=1e-3, stop=0.1, metrics=[own])
    (row,) = (line for line in repr(diff(result, result)).splitlines() if line.startswith("own"))
    assert row.split() == ["own", "yes", "yes"]


def test_a_metric_in_two_units_is_refused():
    results = [
        simulate(
            grasp_system(),
            step=1e-3,
            stop=0.1,
            metrics=[metric("own", unit=unit)(lambda run: 1.0)],
        )
        for unit in ("s", "m")
    ]
    with pytest.raises(InputError, match="own: is in 's' before and in 'm' after"):
        diff(*results)


def test_equal_settings_are_named_so(runs):
    assert "The settings of both runs are the same." in repr(diff(runs[0], runs[0]))


def test_the_command_prints_the_table_and_ends_with_0(runs, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for name, run in zip(("before", "after"), runs, strict=True):
        run.save(name)
    assert cli.main(["diff", "before", "after"]) == 0
    out = capsys.readouterr().out
    assert out.startswith("before: before\nafter:  after\n")
    assert cli.main(["diff", "before", "after", "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["settings"] == [
        {"setting": "plant.object_width", "before": "0.07 m", "after": "0.06 m"}
    ]
    assert {m["name"]: m["change"] for m in report["metrics"]}["object_shift"] == 0.0


def test_a_folder_without_a_run_is_refused(tmp_path, capsys):
    assert cli.main(["diff", str(tmp_path), str(tmp_path)]) == 2
    assert "must be a folder that `grasp-cosim run --out` wrote" in capsys.readouterr().err
