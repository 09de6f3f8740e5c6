"""A result as Python users meet it: in a console, in a notebook, as files, as tables of others."""

import json
import pickle
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, load_run, simulate
from grasp_cosim.recording.mdf import read_mdf
from grasp_cosim.recording.recorded_run import UNITS, Rejection
from grasp_cosim.system.settings import run_settings
from report.runs import grasp_run, ring_run, write_run

GAP = "plant.gap[1]"


@pytest.fixture(scope="module")
def result(grasp):
    """A short run."""
    return simulate(grasp, stop=0.1)


def test_a_decimated_result_keeps_its_times_in_every_format(result, tmp_path):
    kept = [0, 300, 600, 900, 1000]
    texts = np.array(list("abbab"), object)
    signals = {GAP: result[GAP][kept], "a.n": np.array(kept), "a.s": texts}
    units = {GAP: "m", "a.n": None, "a.s": None}
    few = replace(result, time=result.time[kept], signals=signals, units=units)
    assert few.metrics["steps"] == result.metrics["steps"] == 1000
    few.to_csv(tmp_path / "signals.csv")
    few.to_json(tmp_path / "run.json")
    few.to_mdf(tmp_path / "s.mf4")
    back, (time, columns, found) = load_run(tmp_path), read_mdf(tmp_path / "s.mf4")
    assert back.time.tolist() == time.tolist() == [0.0, 0.03, 0.06, 0.09, 0.1]
    assert back[GAP].tolist() == columns[GAP].tolist() == few[GAP].tolist()
    assert back["a.n"].tolist() == columns["a.n"].tolist() == kept
    assert back["a.s"].tolist() == list("abbab")
    assert list(back.numbers) == list(found) == [GAP, "a.n"]
    assert found[GAP] == "m"


@pytest.mark.parametrize("start", [0.5, 1.0])
def test_a_run_that_starts_later_keeps_its_times_in_every_format(grasp, tmp_path, start):
    system = grasp.with_settings({"experiment.start": start, "experiment.stop": start + 0.01})
    few = simulate(system, every=30)
    points = [*(round(start + k * 0.003, 9) for k in range(4)), round(start + 0.01, 9)]
    assert few.time.round(9).tolist() == points
    few.save(tmp_path / "csv")
    few.save(tmp_path / "arrow", "arrow")
    few.to_mdf(tmp_path / "s.mf4")
    for time in (*(load_run(tmp_path / form).time for form in ("csv", "arrow")),
                 read_mdf(tmp_path / "s.mf4")[0]):  # fmt: skip
        assert time.tolist() == few.time.tolist()
    assert few.metrics["steps"] == load_run(tmp_path / "csv").metrics["steps"] == 100


def test_json_has_the_metrics_and_what_led_to_them(grasp, result, tmp_path):
    told = replace(
        result,
        descriptions={GAP: "to the object"},
        log=("the plant rejected a step",),
        rejections={"plant": Rejection(3, 0.25)},
    )
    told.to_json(tmp_path / "run.json")
    assert json.loads((tmp_path / "run.json").read_text()) == {
        **{name: result.metrics[name] for name in UNITS},
        "measured": json.loads(json.dumps(dict(result.measured.values))),
        "rows": len(result.time),
        **run_settings(grasp.with_experiment(stop=0.1)),
        "units": dict(result.units),
        "to_si": {},
        "types": {n: {"f": "float64", "b": "bool"}[c.dtype.kind] for n, c in result.items()},
        "descriptions": {GAP: "to the object"},
        "metric_units": result.metric_units,
        "missing_metrics": [],
        "log": ["the plant rejected a step"],
        "rejections": {"plant": {"count": 3, "first": 0.25}},
    }


def test_a_result_without_signals_has_nothing_to_draw(result, tmp_path):
    bare = replace(result, signals={}, units={})
    with pytest.raises(InputError, match=r"s\.png: nothing to draw; must be a result with "):
        bare.plot(tmp_path / "s.png")


def test_its_repr_is_five_short_lines():
    lines = repr(grasp_run()).splitlines()
    assert len(lines) == 5
    assert max(map(len, lines)) <= 100
    assert lines[0] == "Result of grasp.toml"
    assert "2 s in steps of 1 ms, sequential, took 1.5 s" in lines[1]
    assert "16, of 2001 rows: plant.position[1], " in lines[2]
    assert "time_to_contact 1, 1.2 s" in lines[3]
    assert "t = 0.5 s: sensor_1.reflectance = 0.6" in lines[4]


def test_what_was_read_back_looks_and_works_like_what_was_run(tmp_path, monkeypatch):
    run = grasp_run()
    monkeypatch.chdir(tmp_path)
    write_run(Path("run"), run)
    back = load_run("run")
    first, *rest = repr(back).splitlines()
    fresh, *same = repr(run).splitlines()
    assert first == f"{fresh}, read from run"
    assert rest == same
    assert back.metrics == run.metrics
    html = run._repr_html_()
    assert back._repr_html_().replace(", read from run", "") == html
    assert "time to contact" in html
    assert "16 signals" in html
    assert "<b>" not in ring_run(["<b>", "c"])._repr_html_()


def test_a_wrong_name_is_a_key_error_with_the_nearest_ones():
    run = grasp_run()
    with pytest.raises(KeyError) as raised:
        run["plant.gap1"]
    said = str(raised.value)
    assert said.startswith(f"'plant.gap1': no such signal; did you mean {GAP}")
    assert str(pickle.loads(pickle.dumps(raised.value))) == said
    with pytest.raises(KeyError, match=r"'time_to_contat': no such metric; did you mean time_to_c"):
        run.metrics["time_to_contat"]
    assert run.metrics.get("time_to_contat") is None
    assert json.loads(json.dumps(run.metrics))["scheme"] == run.metrics["scheme"]


@pytest.mark.slow
def test_plot_returns_a_figure_that_a_notebook_shows_and_writes_it_where_asked(tmp_path):
    figure_module = pytest.importorskip("matplotlib.figure")
    figure = ring_run(["a", "b"]).plot(tmp_path / "own.png")
    assert isinstance(figure, figure_module.Figure)
    assert (tmp_path / "own.png").read_bytes().startswith(b"\x89PNG")
    assert figure._repr_png_().startswith(b"\x89PNG")


@pytest.mark.slow
def test_tables_have_the_same_numbers_types_units_and_descriptions():
    pytest.importorskip("pandas")
    pytest.importorskip("xarray")
    run = grasp_run()
    frame, data = run.to_pandas(), run.to_xarray()
    assert frame.index.name == "time"
    assert list(frame.columns) == list(data.data_vars) == list(run)
    assert frame["plant.contact[1]"].dtype == data["plant.contact[1]"].dtype == bool
    assert frame.attrs["units"] == {"time": "s", **run.units}
    assert frame.attrs["system"] == "grasp.toml"
    for table, time in ((frame, frame.index.to_numpy()), (data, data["time"])):
        assert np.array_equal(time, run.time)
        assert all(np.array_equal(table[name], run[name]) for name in run)
    assert data["time"].attrs["units"] == "s"
    assert data[GAP].attrs == {"units": "m", "long_name": "l_1, distance"}
    assert data["plant.contact[1]"].attrs == {}
    assert data.attrs == {"system": "grasp.toml", "scheme": "sequential", "step": 1e-3, "stop": 2.0}


def test_without_the_extra_it_is_one_line_that_says_how_to_get_it(monkeypatch):
    for method in ("to_pandas", "to_xarray"):
        monkeypatch.setitem(sys.modules, method.removeprefix("to_"), None)
        with pytest.raises(InputError, match=r"-m pip install '(pandas|xarray)>=[0-9.]+'$"):
            getattr(grasp_run(), method)()
