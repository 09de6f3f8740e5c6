"""Metrics belong to a system: its file names groups of ours, and runs and archives keep these."""

import pytest
from grasp_cosim import InputError, System, load_run, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.ssp.to_archive import write_ssp


def without(fmus, tmp_path, entry):
    """The built-in grasp with another entry in the place of its metrics."""
    text = SYSTEM.read_text("utf-8")
    (line,) = (line for line in text.splitlines() if line.startswith("metrics = "))
    path = tmp_path / "system.toml"
    path.write_text(text.replace(line, entry), "utf-8")
    return System.load(path, fmus)


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        ('metrics = ["grasps"]', "system.toml: metrics: no group 'grasps'; did you mean grasp?"),
        ('metrics = ["foot"]', "system.toml: metrics: no group 'foot'; valid: grasp, hand"),
        ('metrics = "grasp"', "system.toml: metrics = 'grasp': must be a list of groups, like [\""),
        ("metrics = [1]", "system.toml: metrics = 1: must be the name of a group of metrics"),
    ],
)
def test_what_is_no_group_is_one_line(fmus, tmp_path, entry, said):
    with pytest.raises(InputError) as caught:
        without(fmus, tmp_path, entry)
    assert str(caught.value).startswith(said)


def test_a_system_that_names_none_has_none(fmus, grasp, tmp_path):
    for system, some in ((grasp, True), (without(fmus, tmp_path, ""), False)):
        result = simulate(system, step=1e-3, stop=0.01)
        assert bool(result.measured.values) is some
        assert result.measured.missing == ()


def test_a_recorded_run_and_an_archive_keep_the_groups(grasp, tmp_path):
    result = simulate(grasp, step=1e-3, stop=0.2)
    result.to_csv(tmp_path / "signals.csv")
    result.to_json(tmp_path / "run.json")
    back = load_run(tmp_path)
    assert (back.groups, back.more_metrics) == (["grasp"], ())
    assert back.measured.metrics == result.measured.metrics
    write_ssp(grasp, tmp_path / "grasp.ssp")
    assert System.load(tmp_path / "grasp.ssp").metrics == ("grasp",)
