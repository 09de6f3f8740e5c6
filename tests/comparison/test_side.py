"""The two sides of a comparison: run folders, and logs from elsewhere."""

import numpy as np
import pytest
from grasp_cosim import InputError
from grasp_cosim.comparison.compare import compare
from grasp_cosim.comparison.side import read_side
from report.runs import grasp_run, write_run

GAP = "plant.gap[1]"


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
    found = compare(run, log(tmp_path, "\n".join([heads, *lines])))
    assert found.alike
    assert {s.name: s.unit for s in found.signals} == {GAP: "m", "plant.contact[1]": None}
    assert found.signals[0].deviation < 1e-12
    assert "B tells no units of plant.contact[1]: taken as in the other" in found.notes
    assert found.differences == ()


def test_without_a_unit_a_log_is_in_that_of_the_run_and_on_either_side(run, tmp_path):
    result = grasp_run()
    rows = zip(result.time.tolist(), result[GAP].tolist(), strict=True)
    lines = [f"{t!r},{gap!r}" for t, gap in rows]
    path = log(tmp_path, "\n".join([f"time,{GAP}", *lines]))
    for found in (compare(run, path), compare(path, run)):
        assert [(s.name, s.unit, s.deviation) for s in found.signals] == [(GAP, "m", 0.0)]


def test_a_whole_log_has_the_metrics_of_the_run(run, tmp_path):
    path = tmp_path / "copied.csv"
    path.write_bytes((run / "signals.csv").read_bytes())
    found = compare(run, path)
    assert found.alike
    assert {m.name for m in found.metrics} >= {"time_to_contact[1]", "steady_contact_force[2]"}
    assert {m.deviation for m in found.metrics} == {0.0}


def test_the_files_of_a_run_stand_for_it(run):
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
        ("time,plant.gap[1]\n0,1\n1,abc\n", "has texts; must be numbers, as in "),
        ("time,plant.gap[1]\n1,1\n0,1\n", "must not fall"),
        ("time,plant.gap[1]\n0,1\n1,\n", "missing; must be a value"),
        ("time,plant.gap[1] [kg]\n0,1\n1,1\n", "must have a signal of one name and quantity"),
        ("time,plant.nothing\n0,1\n1,1\n", "must have a signal of one name and quantity"),
        ("time,plant.gap[1]\n0,nan\n1,1\n", "must be a finite number"),
        ("t,plant.gap[1]\n0,1\n1,1\n", "must be time"),
        ("", "is empty"),
    ],
)
def test_a_wrong_log_is_one_line(run, tmp_path, text, said):
    with pytest.raises(InputError) as raised:
        compare(run, log(tmp_path, text))
    assert said in str(raised.value)
    assert "\n" not in str(raised.value)


def test_no_run_and_no_log(tmp_path):
    with pytest.raises(InputError, match="no such run; must be a folder"):
        read_side(tmp_path / "nothing")
    other = tmp_path / "page.html"
    other.write_text("")
    with pytest.raises(InputError, match=r"must be a folder .* a .csv or an .mf4 file"):
        read_side(other)


def test_two_rows_of_one_time_are_a_jump(tmp_path):
    jump = log(tmp_path, "time,x.y\n0,0\n1,0\n1,5\n2,5\n")
    side = read_side(jump)
    assert np.array_equal(side.time, [0.0, 1.0, 1.0, 2.0])
    assert compare(jump, jump).alike
