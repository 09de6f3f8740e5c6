"""Reads back what a run left behind."""

import json

import numpy as np
import pytest
from grasp_cosim import InputError, simulate
from grasp_cosim.recording.load import load_log, load_run

CSV = '"time","a.x","a.on"\n0.0,1.5,1\n0.1,2.5e-300,0\n'
RUN = {
    "system": "made.toml", "scheme": "sequential", "step": 0.1, "stop": 0.1,
    "initialisation": {}, "components": {}, "connections": [], "events": [], "faults": [],
    "wall_time": 0.5, "complete": True, "log": [], "rejections": {},
}  # fmt: skip
JSON = {**RUN, "units": {"a.x": "m", "a.on": None}, "types": {"a.on": "bool"}}


def folder(path, csv=CSV, settings=JSON):
    (path / "signals.csv").write_bytes(csv if isinstance(csv, bytes) else csv.encode())
    text = settings if isinstance(settings, str) else json.dumps(settings)
    (path / "run.json").write_text(text, encoding="utf-8")
    return path


def test_a_run_comes_back_as_it_was(grasp, tmp_path):
    result = simulate(grasp, stop=0.01, diverging="continue")
    result.to_csv(tmp_path / "signals.csv")
    result.to_json(tmp_path / "run.json")
    run = load_run(tmp_path)
    assert run.time.tolist() == result.time.tolist()
    assert list(run.signals) == list(result)
    for name, column in result.items():
        assert run.signals[name].dtype == column.dtype
        assert run.signals[name].tobytes() == column.tobytes()
    assert run.units == dict(result.units)
    assert run.settings == result.settings
    assert run.settings["diverging"] == "continue"


def test_columns_have_their_types_and_real_is_the_default(tmp_path):
    run = load_run(folder(tmp_path))
    assert run.signals["a.x"].tolist() == [1.5, 2.5e-300]
    assert run.signals["a.on"].dtype == np.bool_
    assert run.signals["a.on"].tolist() == [True, False]
    assert run.descriptions == {}


def test_values_that_are_not_finite_are_kept(tmp_path):
    """A run that failed ends with them."""
    run = load_run(folder(tmp_path, CSV + "0.2,nan,1\n0.3,-inf,1\n"))
    np.testing.assert_array_equal(run.signals["a.x"][2:], [np.nan, -np.inf])


def test_a_single_row_and_a_run_without_signals_are_runs(tmp_path):
    run = load_run(folder(tmp_path, '"time"\n0.0\n', {**RUN, "units": {}}))
    assert run.time.tolist() == [0.0]
    assert run.signals == {}


@pytest.mark.parametrize("name", ["signals.csv", "run.json"])
def test_a_missing_file_is_named(tmp_path, name):
    (folder(tmp_path) / name).unlink()
    with pytest.raises(InputError, match=rf"^.*{name}: No such file or directory; must be a fold"):
        load_run(tmp_path)


@pytest.mark.parametrize(
    ("csv", "reason"),
    [
        ("", "the first column is 'nothing'; must be \"time\""),
        ('"t","a.x","a.on"\n0.0,1.5,1\n', "the first column is 't'; must be \"time\""),
        ('"time","a.x","a.on"\n', "the last row is cut off, or there is none"),
        ('"time","a.x","a.on"', "the last row is cut off, or there is none"),
        (CSV[:-2], "the last row is cut off"),
        (CSV + "0.2,", "the last row is cut off"),
        (CSV + "0.2,1\n", "damaged: the number of columns changed from 3 to 2"),
        (CSV + "0.2,1,0,1\n", "damaged: the number of columns changed from 3 to 4"),
        (CSV + "0.2,1,x\n", "damaged: could not convert string 'x' to float64"),
        (CSV + "0.1,1,1\n", "the time must grow from row to row"),
        (CSV + "nan,1,1\n", "the time must grow from row to row"),
        (CSV.replace("a.on", "a.x"), "two columns have the same name"),
        ('"time","a.x\n0.0,1\n', "the first line names no columns"),
        ('"time","a.x","a.on","b"\n0.0,1,1\n', "3 values in a row, 4 names"),
        (CSV.encode("utf-16"), "the first line names no columns"),
        (CSV.encode() + b"0.2,\xff,1\n", "damaged: "),
    ],
)
def test_damaged_signals_are_refused_in_one_line(tmp_path, csv, reason):
    with pytest.raises(InputError) as caught:
        load_run(folder(tmp_path, csv))
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'signals.csv'}: ")
    assert reason in message
    assert "\n" not in message


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        ("{", "is damaged, not JSON in UTF-8: "),
        ([], "is list; must be a JSON object"),
        ({}, "no entry 'system'; must be as `grasp-cosim run --out` writes it"),
        (JSON | {"units": 1}, "units = 1; must be a JSON object"),
        ({k: v for k, v in JSON.items() if k != "log"}, "no entry 'log'; must be as `grasp-cosim"),
        ({**JSON, "types": []}, "types = []; must be a JSON object"),
        ({**JSON, "step": True}, "step = True; must be a number"),
        ({**JSON, "stop": "3"}, "stop = '3'; must be a number"),
        ({**JSON, "complete": 1}, "complete = 1; must be true or false"),
        ({**JSON, "log": {}}, "log = {}; must be a list"),
        ({**JSON, "system": None}, "system = None; must be a string"),
        ({**JSON, "roles": ["plant"]}, "roles = ['plant']; must be a JSON object"),
        ({**JSON, "rejections": {"a": {"count": 1}}}, "rejections: is damaged (KeyError: 'first'"),
        ({**JSON, "types": {"a.on": "x"}}, "type of a.on = 'x': must be one of float64, int32, "),
        ({**JSON, "types": {"a.on": []}}, "type of a.on = []: must be one of float64, int32, "),
        ({**JSON, "types": {"a.x": "int64"}}, "type of a.x = int64: must be a type of its values"),
        ({**RUN, "units": {"a.x": "m"}}, "must be those of the recorded columns: a.x, a.on"),
    ],
)
def test_damaged_settings_are_refused_in_one_line(tmp_path, settings, reason):
    with pytest.raises(InputError) as caught:
        load_run(folder(tmp_path, settings=settings))
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / 'run.json'}: ")
    assert reason in message
    assert "\n" not in message


# ------------------------------------------------------------------------- units


def in_unit(path, unit, **more):
    return folder(path, settings={**JSON, "units": {"a.x": unit, "a.on": None}, **more})


def test_metrics_get_si_as_run_json_says_and_signals_stay_as_recorded(tmp_path):
    entry = {"a.x": {"factor": 0.5, "offset": 1.0}}
    run = load_run(in_unit(tmp_path, "mm", to_si=entry))
    assert run.by_role["a.x"][0] == 0.5 * 1.5 + 1.0
    assert run["a.x"][0] == 1.5
    assert run.units["a.x"] == "mm"
    assert load_run(in_unit(tmp_path, "mm", to_si={})).by_role["a.x"][0] == 1.5


@pytest.mark.parametrize("entry", [1.0, {}, {"factor": 1.0}, {"factor": "1", "offset": 0.0}])
def test_a_damaged_conversion_is_one_line(tmp_path, entry):
    with pytest.raises(InputError, match=r"run\.json: to_si: a\.x = .*; must be factor a"):
        load_run(in_unit(tmp_path, "mm", to_si={"a.x": entry}))


def test_a_log_comes_in_si_where_the_run_beside_it_tells(tmp_path):
    in_unit(tmp_path, "mm", to_si={"a.x": {"factor": 1e-3, "offset": 0.0}})
    said = []
    assert load_log(tmp_path / "signals.csv", said.append)["a.x"][0] == 1.5e-3
    assert not said
    other = tmp_path / "measured.csv"
    other.write_text(CSV, "utf-8")
    assert load_log(other, said.append)["a.x"][0] == 1.5
    assert said == [
        f"{other}: there is no run.json beside it; its values are taken to be in SI units"
    ]


def test_a_run_without_a_signal_says_so(tmp_path):
    in_unit(tmp_path, "mm")
    (tmp_path / "signals.csv").unlink()
    path = tmp_path / "run.json"
    path.write_text(json.dumps({**json.loads(path.read_text("utf-8")), "units": {}}), "utf-8")
    with pytest.raises(InputError, match=r"run\.json: this run recorded no signal; must"):
        load_run(tmp_path)
