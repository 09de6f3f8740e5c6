"""Two runs compared: what is in both, over the time that both have, each in its band."""

from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import InputError, metric, simulate
from grasp_cosim.comparison.bands import Bands, Given
from grasp_cosim.comparison.compare import compare
from grasp_cosim.comparison.words import as_json, as_text
from grasp_cosim.grasp.presets import SYSTEM
from report.runs import grasp_run, write_run

GAP = "plant.gap[1]"


def changed(run, **signals):
    """The run with other signals, by the last parts of their names."""
    return replace(run, signals={**run.signals, **{f"plant.{k}": v for k, v in signals.items()}})


def cut(run, rows):
    """Some rows of the run."""
    columns = {name: column[rows] for name, column in run.items()}
    return replace(run, time=run.time[rows], signals=columns)


@pytest.fixture
def folders(tmp_path):
    def compared(a, b, **more):
        for name, run in (("a", a), ("b", b)):
            write_run(tmp_path / name, run)
        return compare(tmp_path / "a", tmp_path / "b", **more)

    return compared


def test_a_run_is_like_itself(folders):
    found = folders(grasp_run(), grasp_run())
    assert found.alike
    assert {s.name for s in found.signals} == set(grasp_run())
    assert {s.deviation for s in found.signals} == {0.0}
    assert len(found.metrics) > 8
    assert as_text(found).startswith("ALIKE: 0 of 16 signals and 0 of ")
    assert "the settings of the runs are the same" in as_text(found)


def test_results_are_compared_as_they_are():
    found = compare(grasp_run(), cut(grasp_run(), slice(0, 1001)))
    assert found.alike
    assert (found.a.name, found.b.name, found.end) == ("A", "B", 1.0)


def test_a_shift_in_time_within_the_band_is_allowed_and_a_longer_one_is_not():
    run = grasp_run()
    late = np.concatenate([run[GAP][:1].repeat(5), run[GAP][:-5]])
    moved = replace(run, signals={**run.signals, GAP: late})
    given = {GAP: Given(absolute=1e-9, time=5e-3)}
    others = {"*": Given(absolute=1e9)}
    wide = Bands(signals={**given, **others}, metrics=others)
    assert compare(run, moved, bands=wide).alike
    tight = replace(wide, signals={GAP: Given(absolute=1e-9, time=4e-3), **others})
    found = compare(run, moved, bands=tight)
    assert not found.alike
    assert [s.name for s in found.signals if not s.inside] == [GAP]


def test_runs_of_unlike_length_and_step_are_compared_where_both_are(folders):
    run = grasp_run()
    found = folders(run, cut(run, slice(200, 1801, 4)))
    assert (found.begin, found.end) == (0.2, 1.8)
    by_name = {s.name: s for s in found.signals}
    assert by_name[GAP].inside
    assert by_name["controller.target_position"].deviation < 1e-6
    same = {m.name: (m.original, m.candidate) for m in found.metrics}
    assert same["object_shift"][0] == same["object_shift"][1]
    assert same["target_position"][0] == pytest.approx(run["controller.target_position"][1800])
    note = "compared from 0.2 to 1.8 s, where both are: A is 0 to 2 s, B is 0.2 to 1.8 s"
    assert note in found.notes


def test_runs_at_other_times_are_refused_in_one_line(folders):
    run = grasp_run()
    later = replace(run, time=run.time + 5.0)
    with pytest.raises(InputError, match=r"a: 0 to 2 s; .*b: 5 to 7 s: must have some time in"):
        folders(run, later)


def test_a_metric_that_one_run_only_has_a_value_of_is_out(folders):
    run = grasp_run()
    less = {name: c for name, c in run.items() if name != "controller.target_position"}
    found = folders(run, replace(run, signals=less, units={n: run.units[n] for n in less}))
    assert not found.alike
    assert found.only == (("controller.target_position",), ())
    assert "time_to_contact[1]" in found.only_metrics[0]
    outside = {m.name for m in found.metrics if not m.inside}
    assert "time_to_contact[1]" in outside
    assert {m.candidate for m in found.metrics} == {None}
    assert "signals only in A: controller.target_position" in as_text(found)


def test_signals_in_another_unit_are_converted_and_of_another_quantity_left_out(folders):
    run = grasp_run()
    names = (GAP, "plant.gap[2]")
    other = replace(
        run,
        signals={**run.signals, GAP: 1e3 * run[GAP]},
        units={**run.units, GAP: "mm", "plant.gap[2]": "N"},
    )
    found = folders(run, other)
    signals = {s.name: s for s in found.signals}
    assert signals[GAP].inside
    assert signals[GAP].unit == "m"
    assert names[1] not in signals
    assert "not compared, as the units do not convert: plant.gap[2] (m, N)" in found.notes


def test_a_metric_that_is_off_makes_the_runs_differ(folders):
    @metric("farthest", unit="m")
    def farthest(run):
        return float(run[GAP].max())

    run = grasp_run()
    spike = run[GAP].copy()
    spike[0] += 0.01
    found = folders(
        run,
        changed(run, **{"gap[1]": spike}),
        bands=Bands(signals={"*": Given(absolute=np.inf)}, metrics={"farthest": Given(relative=0)}),
        metrics=[farthest],
    )
    off = {m.name: m for m in found.metrics}["farthest"]
    assert off.deviation == pytest.approx(0.01)
    assert not found.alike
    report = as_json(found)
    entry = next(m for m in report["metrics"] if m["name"] == "farthest")
    assert (entry["a"], entry["b"], entry["inside"]) == (run[GAP][0], spike[0], False)


def test_recorded_metrics_of_a_users_file_are_compared_as_they_were(folders, tmp_path):
    def own(value):
        @metric("grip", unit="N")
        def grip(_):
            return value

        return replace(grasp_run(), more_metrics=(grip,))

    found = folders(own(3.0), own(4.0))
    assert [(m.original, m.candidate) for m in found.metrics if m.name == "grip"] == [(3.0, 4.0)]
    short = tmp_path / "short"
    write_run(short, cut(own(4.0), slice(0, 1500)))
    assert "grip" not in {m.name for m in compare(tmp_path / "a", short).metrics}


def test_a_band_for_nothing_is_refused(folders):
    bands = Bands("own.toml", signals={"plant.gp*": Given(absolute=1.0)})
    with pytest.raises(InputError, match=r"own.toml: \[signals\]: nothing is called 'plant.gp\*'"):
        folders(grasp_run(), grasp_run(), bands=bands)


def test_a_run_that_did_not_come_to_its_end_is_not_alike(folders):
    run = grasp_run()
    found = folders(run, replace(run, complete=False))
    assert not found.alike
    assert as_text(found).startswith("DIFFERENT: B did not come to its end; 0 of ")


def test_metrics_without_a_value_on_both_sides_are_not_inside(grasp):
    run = simulate(grasp, step=1e-3, stop=0.3)
    found = compare(run, run)
    assert found.alike
    assert "time_to_contact[1]" in found.absent
    assert "time_to_contact[1]" not in {m.name for m in found.metrics}
    assert "nothing was touched until t = 0.3 s: " in as_text(found)


def test_a_system_is_run_as_long_as_the_other_run(grasp, fmus, tmp_path):
    text = SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/')
    (tmp_path / "grasp.toml").write_text(text, "utf-8")
    run = simulate(grasp, stop=0.05)
    found = compare(tmp_path / "grasp.toml", run)
    assert found.alike
    assert (found.begin, found.end) == (0.0, 0.05)
    assert {s.deviation for s in found.signals} == {0.0}
