"""Two runs compared, over the time that both have; logs from elsewhere; settings."""

import json
from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import InputError, metric, simulate
from grasp_cosim.comparison.bands import Bands, Given
from grasp_cosim.comparison.compare import compare
from grasp_cosim.comparison.side import differences, read_side
from grasp_cosim.comparison.summary import as_json, as_text, verdict
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.interface.units import Conversion
from report.runs import component, grasp_run, rounded, write_run

GAP = "plant.gap[1]"
ALL = {"*": Given(absolute=1e9)}


def changed(run, **more):
    """The run with other signals, by the last parts of their names."""
    signals = {f"plant.{k}": v for k, v in more.items()}
    return replace(run, signals={**run.signals, **signals})


def cut(run, rows):
    """Some rows of the run."""
    columns = {name: column[rows] for name, column in run.items()}
    return replace(run, time=run.time[rows], signals=columns)


def test_text_and_json_of_runs_that_differ(snapshot):
    """In a signal, in length and step, in settings, in a unit, in what they have."""
    run = grasp_run()
    less = {n: c for n, c in run.items() if n != "controller.target_position"}
    other = replace(
        cut(replace(run, signals={**less, GAP: run[GAP] * 1e3 + 5.0}), slice(200, 1801, 4)),
        units={**run.units, GAP: "mm", "plant.gap[2]": "N"},
        to_si={GAP: Conversion(1e-3, 0.0)},
        settings={**run.settings, "scheme": "jacobi", "faults": []},
    )
    found = compare(run, other)
    assert found.only == (("controller.target_position",), ())
    assert as_text(found) == snapshot
    report = json.loads(json.dumps(rounded(as_json(found)), allow_nan=False))
    assert {
        **report,
        "signals": report["signals"][:1],
        "metrics": report["metrics"][:1],
    } == snapshot


def test_a_shift_in_time_within_the_band_is_allowed_and_a_longer_one_is_not():
    run = grasp_run()
    late = np.concatenate([run[GAP][:1].repeat(5), run[GAP][:-5]])
    moved = changed(run, **{"gap[1]": late})
    wide = Bands(signals={GAP: Given(absolute=1e-9, time=5e-3), **ALL}, metrics=ALL)
    assert compare(run, moved, bands=wide).alike
    found = compare(
        run, moved, bands=replace(wide, signals={GAP: Given(absolute=1e-9, time=4e-3), **ALL})
    )
    assert not found.alike
    assert [s.name for s in found.signals if not s.inside] == [GAP]


def test_a_metric_that_is_off_or_that_only_one_has_makes_the_runs_differ():
    @metric("farthest", unit="m")
    def farthest(run):
        return float(run[GAP].max()) if run[GAP][0] < 0.07 else None

    def compared(a, b):
        found = compare(a, b, bands=bands, metrics=[farthest])
        assert not found.alike
        (off,) = (m for m in found.metrics if m.name == "farthest")
        return off.deviation, off.original, off.candidate

    bands = Bands(signals={"*": Given(absolute=np.inf)}, metrics={"farthest": Given(relative=0)})
    run = grasp_run()
    first = run[GAP][0]
    near, far = (
        changed(run, **{"gap[1]": np.concatenate([[first + by], run[GAP][1:]])})
        for by in (0.001, 0.01)
    )
    assert compared(run, near) == (pytest.approx(0.001), first, first + 0.001)
    assert compared(run, far) == (np.inf, first, None)
    assert compared(far, run) == (np.inf, None, first)


def test_recorded_metrics_of_a_users_file_are_compared_as_they_were(tmp_path):
    def own(value):
        @metric("grip", unit="N")
        def grip(_):
            return value

        return replace(grasp_run(), more_metrics=(grip,))

    whole, other, short = (tmp_path / name for name in ("whole", "other", "short"))
    write_run(whole, own(3.0))
    write_run(other, own(4.0))
    write_run(short, cut(own(4.0), slice(0, 1500)))
    found = compare(whole, other)
    assert [(m.original, m.candidate) for m in found.metrics if m.name == "grip"] == [(3.0, 4.0)]
    assert "grip" not in {m.name for m in compare(whole, short).metrics}


def test_a_run_that_did_not_come_to_its_end_is_not_alike():
    found = compare(grasp_run(), replace(grasp_run(), complete=False))
    assert not found.alike
    assert as_text(found).startswith("DIFFERENT: B did not come to its end; 0 of ")


def test_metrics_without_a_value_on_both_sides_are_not_inside(grasp):
    run = simulate(grasp, step=1e-3, stop=0.3)
    found = compare(run, run)
    assert as_text(found).startswith("ALIKE: 0 of ")
    assert "the settings of the runs are the same" in as_text(found)
    assert {s.deviation for s in found.signals} == {0.0}
    assert "time_to_contact[1]" in found.absent
    assert "time_to_contact[1]" not in {m.name for m in found.metrics}
    assert "nothing was touched until t = 0.3 s: " in as_text(found)


def test_a_system_is_run_as_long_as_the_other_run(grasp, fmus, tmp_path):
    text = SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/')
    (tmp_path / "grasp.toml").write_text(text, "utf-8")
    found = compare(tmp_path / "grasp.toml", simulate(grasp, stop=0.05))
    assert found.alike
    assert (found.begin, found.end) == (0.0, 0.05)
    assert {s.deviation for s in found.signals} == {0.0}


# ------------------------------------------------------------------------- logs from elsewhere


@pytest.fixture
def run(tmp_path):
    write_run(tmp_path / "run", grasp_run())
    return tmp_path / "run"


def log(folder, text):
    path = folder / "log.csv"
    path.write_text(text, "utf-8")
    return path


def test_a_csv_with_other_units_and_without_a_last_line_break_is_the_run(run, tmp_path):
    result = grasp_run()
    columns = (result.time, result[GAP], result["plant.contact[1]"])
    rows = zip(*(column.tolist() for column in columns), strict=True)
    lines = [f"{1e3 * t!r},{1e3 * gap!r},{touches}" for t, gap, touches in rows]
    heads = f"\ufefftime [ms],{GAP} [mm],plant.contact[1]"
    path = log(tmp_path, "\n".join([heads, *lines]))
    found = compare(run, path)
    assert found.alike
    assert {s.name: s.unit for s in found.signals} == {GAP: "m", "plant.contact[1]": None}
    assert found.signals[0].deviation < 1e-12
    assert "B tells no units of plant.contact[1]: taken as in the other" in found.notes
    assert found.differences == ()
    assert compare(path, run).alike


def test_a_whole_log_has_the_units_and_metrics_of_the_run(run, tmp_path):
    path = tmp_path / "copied.csv"
    path.write_bytes((run / "signals.csv").read_bytes())
    for found in (compare(run, path), compare(path, run)):
        assert found.alike
        assert {m.name for m in found.metrics} >= {"time_to_contact[1]", "steady_contact_force[2]"}
        assert {c.deviation for c in (*found.signals, *found.metrics)} == {0.0}
    for name in ("signals.csv", "run.json"):
        assert read_side(run / name).result


@pytest.mark.slow
def test_an_mdf_file_is_read_with_its_units(run, tmp_path):
    pytest.importorskip("asammdf")
    path = tmp_path / "signals.mf4"
    grasp_run().to_mdf(path)
    assert read_side(path).units[GAP] == "m"
    assert compare(run, path).alike


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time,plant.gap[1]\n0,1\n1,abc\n", "line 3, column 2, plant.gap[1] = 'abc': must be a"),
        ("time,plant.gap[1]\n1,1\n0,1\n", "the time falls; must grow from row to row"),
        ("time,plant.gap[1] [kg]\n0,1\n1,1\n", "must have a signal of one name and quantity"),
        ("time,plant.gap[1]\n0,nan\n1,1\n", "must be a finite number"),
        ("time,plant.gap[1]\n5,1\n7,1\n", "run: 0 to 2 s; {}: 5 to 7 s: must have some time in"),
        ("time,plant.gap[1]\n-1,1\n7,1\n", "{}: has no row from 0 to 2 s; must have one"),
    ],
)
def test_a_wrong_log_is_one_line(run, tmp_path, text, said):
    path = log(tmp_path, text)
    with pytest.raises(InputError) as raised:
        compare(run, path)
    assert said.format(path) in str(raised.value)
    assert "\n" not in str(raised.value)


def test_no_run_and_no_log(tmp_path):
    with pytest.raises(InputError, match="no such run; must be a folder"):
        read_side(tmp_path / "nothing")
    (tmp_path / "page.html").write_text("")
    with pytest.raises(InputError, match=r"must be a folder .*, or a .csv, .tsv, .mf4, .*file"):
        read_side(tmp_path / "page.html")


def test_two_rows_of_one_time_are_a_jump(tmp_path):
    jump = log(tmp_path, "time,x.y\n0,0\n1,0\n1,5\n2,5\n")
    assert np.array_equal(read_side(jump).time, [0.0, 1.0, 1.0, 2.0])
    assert compare(jump, jump).alike


# ------------------------------------------------------------------------- settings

OFF = {"simultaneous_contact.enabled": False, "impact_reduction.enabled": False}


def with_settings(**settings):
    run = grasp_run()
    fmus = {"plant": {"guid": "aa"}} if settings else {}
    return replace(run, settings={**run.settings, **settings}, origin={"fmus": fmus})


def with_controller(**values):
    parts = grasp_run().settings["components"]
    return {**parts, "controller": component("GraspController.fmu", **values)}


def test_settings_that_differ(snapshot):
    run = with_settings(metrics=["grasp"])
    assert differences(run, replace(run, wall_time=9.0)) == ()
    parts = run.settings["components"]
    others = {
        "numbers": with_settings(step=2e-3, scheme="jacobi", system="own.toml"),
        "lists": with_settings(faults=[], connections=[], roles={"plant": "gripper"}),
        "start": with_settings(initialisation={"loops": "refuse"}),
        "case": with_settings(components=with_controller(**OFF)),
        "mixture": with_settings(components=with_controller(**{"impact_reduction.enabled": False})),
        "order": with_settings(components=dict(reversed(parts.items()))),
        "parts": with_settings(
            components={**parts, "plant": {**parts["plant"], "step": 0.5, "rename": {"a": "b"}}}
        ),
        "versions": replace(
            run,
            origin={
                "fmus": {"plant": {"guid": "bb", "native_twin_of": "aa"}},
                "versions": {"numpy": "2.2"},
            },
        ),
    }
    assert {n: [" | ".join(d) for d in differences(run, b)] for n, b in others.items()} == snapshot


def test_a_comparison_is_true_where_the_runs_are_alike():
    run = grasp_run()
    same, other = compare(run, run), compare(run, changed(run, **{"gap[1]": run[GAP] + 1.0}))
    assert same
    assert not other
    assert {same: 1}[same] == 1
    assert same != other


def test_a_comparison_shows_its_verdict_and_the_worst(tmp_path):
    run = grasp_run()
    write_run(tmp_path / "<b>", run)
    found = compare(tmp_path / "<b>", changed(run, **{"gap[1]": run[GAP] + 1.0}))
    first, *lines = repr(found).splitlines()
    assert first == verdict(found)
    assert len(lines) < 24
    assert any(GAP in line for line in lines)
    page = found._repr_html_()
    assert verdict(found) in page
    assert "&lt;b&gt;" in page
    assert "<b>/" not in page
