"""Reads back what a run left behind."""

import json

import numpy as np
import pytest
from grasp_cosim import InputError
from grasp_cosim.recording.load import load_log, load_run

CSV = '"time","a.x","a.on"\n0.0,1.5,1\n0.1,2.5e-300,0\n'
RUN = {
    "system": "made.toml", "scheme": "sequential", "step": 0.1, "stop": 0.1,
    "initialisation": {}, "components": {}, "connections": [], "events": [], "faults": [],
    "wall_time": 0.5, "complete": True, "log": [], "rejections": {},
}  # fmt: skip
JSON = {**RUN, "units": {"a.x": "m", "a.on": None}, "types": {"a.on": "bool"}}


def folder(path, csv=CSV, settings=JSON):
    (path / "signals.csv").write_text(csv)
    (path / "run.json").write_text(json.dumps(settings))
    return path


def test_columns_have_their_types_and_real_is_the_default(tmp_path):
    """Values that are not finite are kept: a run that failed ends with them."""
    run = load_run(folder(tmp_path, CSV + "0.2,nan,1\n0.3,-inf,1\n"))
    np.testing.assert_array_equal(run.signals["a.x"], [1.5, 2.5e-300, np.nan, -np.inf])
    assert run.signals["a.on"].dtype == np.bool_
    assert run.signals["a.on"].tolist() == [True, False, True, True]
    assert run.descriptions == {}
    run = load_run(folder(tmp_path, '"time"\n0.0\n', {**RUN, "units": {}}))
    assert (run.time.tolist(), run.signals) == ([0.0], {})


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        (
            "run.json",
            None,
            "No such file or directory; must be a folder that `grasp-c",
        ),
        (
            "signals.csv",
            None,
            "No such file or directory; must be a folder that `grasp-c",
        ),
        ("signals.csv", "", "the first column is 'nothing'; must be \"time\""),
        (
            "signals.csv",
            '"t","a.x","a.on"\n0.0,1.5,1\n',
            "the first column is 't'; must be \"time\"",
        ),
        ("signals.csv", '"time","a.x","a.on"\n', "the last row is cut off, or there is none"),
        ("signals.csv", '"time","a.x","a.on"', "the last row is cut off, or there is none"),
        ("signals.csv", CSV + "0.2,", "the last row is cut off"),
        ("signals.csv", CSV + "0.2,1\n", "damaged: the number of columns changed from 3 to 2"),
        ("signals.csv", CSV + "0.2,1,x\n", "damaged: could not convert string 'x' to float64"),
        ("signals.csv", CSV + "0.1,1,1\n", "the time must grow from row to row"),
        ("signals.csv", CSV + "nan,1,1\n", "the time must grow from row to row"),
        ("signals.csv", CSV.replace("a.on", "a.x"), "two columns have the same name"),
        ("signals.csv", '"time","a.x\n0.0,1\n', "the first line names no columns"),
        ("signals.csv", '"time","a.x","a.on","b"\n0.0,1,1\n', "3 values in a row, 4 names"),
        ("signals.csv", CSV.encode("utf-16"), "the first line names no columns"),
        ("signals.csv", CSV.encode() + b"0.2,\xff,1\n", "damaged: "),
        ("run.json", "{", "is damaged, not JSON in UTF-8: "),
        ("run.json", b"\xff", "is damaged, not JSON in UTF-8: "),
        ("run.json", [], "is list; must be a JSON object"),
        ("run.json", {}, "no entry 'system'; must be a string, as `grasp-cosim run --out` writes"),
        ("run.json", {**JSON, "units": 1}, "units = 1; must be a JSON object"),
        ("run.json", {**JSON, "step": True}, "step = True; must be a number"),
        ("run.json", {**JSON, "wall_time": "3"}, "wall_time = '3'; must be a number or null"),
        ("run.json", {**JSON, "complete": 1}, "complete = 1; must be true or false"),
        ("run.json", {**JSON, "log": {}}, "log = {}; must be a list"),
        ("run.json", {**JSON, "system": None}, "system = None; must be a string"),
        ("run.json", {**JSON, "roles": ["plant"]}, "roles = ['plant']; must be a JSON object"),
        ("run.json", {**JSON, "rejections": {"a": {"count": 1}}}, "is damaged (KeyError: 'first'"),
        ("run.json", {**JSON, "types": {"a.on": []}}, "type of a.on = []: must be one of float64,"),
        (
            "run.json",
            {**JSON, "types": {"a.x": "int64"}},
            "a.x = int64: must be a type of its va",
        ),
        ("run.json", {**RUN, "units": {"a.x": "m"}}, "those of the recorded columns: a.x, a.on"),
        (
            "run.json",
            {**JSON, "to_si": {"a.x": 1.0}},
            "to_si: a.x = 1.0; must be factor and off",
        ),
        ("run.json", {**JSON, "to_si": {"a.x": {"factor": 1.0}}}, "; must be factor and offset"),
    ],
)
def test_what_is_missing_or_damaged_is_refused_in_one_line(tmp_path, name, content, reason):
    folder(tmp_path)
    content = json.dumps(content) if isinstance(content, dict | list) else content
    if content is None:
        (tmp_path / name).unlink()
    else:
        (tmp_path / name).write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(InputError) as caught:
        load_run(tmp_path)
    message = str(caught.value)
    assert message.startswith(f"{tmp_path / name}: ")
    assert reason in message
    assert "\n" not in message


def in_unit(path, unit, **more):
    return folder(path, settings={**JSON, "units": {"a.x": unit, "a.on": None}, **more})


def test_metrics_get_si_as_run_json_says_and_signals_stay_as_recorded(tmp_path):
    entry = {"a.x": {"factor": 0.5, "offset": 1.0}}
    run = load_run(in_unit(tmp_path, "mm", to_si=entry))
    assert run.by_role["a.x"][0] == 0.5 * 1.5 + 1.0
    assert run["a.x"][0] == 1.5
    assert run.units["a.x"] == "mm"
    assert load_run(in_unit(tmp_path, "mm", to_si={})).by_role["a.x"][0] == 1.5


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
