"""A sweep says which runs an FMU ended before their stop time; they are no failures."""

import json

import pytest
from grasp_cosim import compare, load_run, metric, simulate, sweep
from grasp_cosim.sweeps.table import as_json, as_text
from support.native_fmus import needs_gcc
from support.native_systems import integrator, write_integrator

pytestmark = needs_gcc

ENDS = [1e9, 0.055, 0.15, 0.015]
"""s at which the FMU asks for the end; the stop time is 0.1 s, the step 10 ms."""


@metric("end", unit="1")
def end(run):
    return float(run["a.x"][-1])


@pytest.fixture
def system(tmp_path):
    return integrator(tmp_path)


def test_the_column_is_there_where_a_run_ended_early(system, tmp_path):
    file = tmp_path / "table.csv"
    table = sweep(system, {"a.terminate_at": ENDS}, metrics=[end], workers=1, out=file)
    assert table.columns["ended at"] == [None, 0.06, None, 0.02]
    assert (table.units["ended at"], table.ended_early) == ("s", {1: 0.06, 3: 0.02})
    assert table.errors == {}
    head, *rows = file.read_text().splitlines()
    assert head == "index,a.terminate_at,end [1],ended at [s],error"
    assert [row.split(",")[3] for row in rows] == ["", "0.06", "", "0.02"]
    assert as_text(table).splitlines()[0] == "4 runs, 0 failed, 2 ended early by an FMU"
    assert as_json(table)["ended_early"] == {"1": 0.06, "3": 0.02}


def test_without_such_a_run_there_is_no_such_column(system):
    table = sweep(system, {"a.terminate_at": [1e9]}, metrics=[end], workers=1)
    assert "ended at" not in table.columns
    assert "ended" not in as_text(table)


def test_a_run_that_ended_early_is_not_complete_but_no_failure(command, tmp_path):
    path = write_integrator(tmp_path) / "system.toml"
    more = ("--set", "a.terminate_at=0.055", "--out", "out", "--json")
    code, out, err = command("run", path, *more)
    told = json.loads(out)
    assert (code, told["complete"], told["ended_at"]) == (0, False, 0.06)
    assert told["units"]["ended_at"] == "s"
    assert "asked for the end of the simulation at t = 0.055 s" in err
    written = json.loads((tmp_path / "out/run.json").read_text())
    assert (written["complete"], written["ended_at"]) == (False, 0.06)
    back = load_run(tmp_path / "out")
    assert (back.complete, back.ended_at, back.came_to_its_end) == (False, 0.06, True)
    assert "ended there" in repr(back)
    assert compare(back, back).alike
    assert command("report", "out")[0] == 0
    assert "ended at 0.06 s, as an FMU asked" in (tmp_path / "out/report.html").read_text()


def test_one_that_goes_to_its_stop_time_has_no_early_end(system):
    result = simulate(system)
    assert (result.complete, result.ended_at) == (True, None)
    assert "ended_at" not in result.metrics
