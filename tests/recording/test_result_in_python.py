"""A result as Python users meet it: in a console, in a notebook, as tables of other packages."""

import json
import pickle
import sys
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, load_run
from grasp_cosim.base.checks import extra_module
from report.runs import grasp_run, ring_run, write_run

GAP = "plant.gap[1]"


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
    assert back._repr_html_().replace(", read from run", "") == run._repr_html_()
    assert back.metrics == run.metrics


def test_html_shows_metrics_and_escapes_names():
    html = grasp_run()._repr_html_()
    assert "time to contact" in html
    assert "16 signals" in html
    assert "<b>" not in ring_run(["<b>", "c"])._repr_html_()


@pytest.mark.parametrize(
    ("asked", "near"),
    [
        ("plant.gap1", "plant.gap[1]"),
        ("gap[1]", "plant.gap[1]"),
        ("Plant.Gap[2]", "plant.gap[2]"),
        ("controller.target_postion", "controller.target_position"),
    ],
)
def test_a_wrong_name_is_a_key_error_with_the_nearest_ones(asked, near):
    with pytest.raises(KeyError) as raised:
        grasp_run()[asked]
    said = str(raised.value)
    assert said.startswith(f"{asked!r}: no such signal; did you mean ")
    assert near in said.partition("did you mean ")[2].rstrip("?").split(", ")
    assert str(pickle.loads(pickle.dumps(raised.value))) == said


def test_so_is_a_wrong_name_of_a_metric():
    run = grasp_run()
    said = r"'time_to_contat': no such metric; did you mean time_to_contact"
    with pytest.raises(KeyError, match=said):
        run.metrics["time_to_contat"]
    assert run.metrics.get("time_to_contat") is None
    assert json.loads(json.dumps(run.metrics))["scheme"] == run.metrics["scheme"]


@pytest.mark.slow
def test_plot_returns_a_figure_that_a_notebook_shows_and_writes_it_where_asked(tmp_path):
    figure_module = pytest.importorskip("matplotlib.figure")
    figure = ring_run(["a", "b"]).plot(tmp_path / "own.png")
    assert isinstance(figure, figure_module.Figure)
    assert (tmp_path / "own.png").read_bytes().startswith(b"\x89PNG")
    shown = figure._repr_png_()
    assert shown.startswith(b"\x89PNG")
    figure.axes[0].set_title("mine")
    figure.savefig(tmp_path / "mine.svg")
    assert "mine.svg" in [p.name for p in tmp_path.iterdir()]


@pytest.mark.slow
def test_pandas_has_the_same_numbers_types_and_units():
    pytest.importorskip("pandas")
    run = grasp_run()
    frame = run.to_pandas()
    assert frame.index.name == "time"
    assert np.array_equal(frame.index.to_numpy(), run.time)
    assert list(frame.columns) == list(run)
    assert frame["plant.contact[1]"].dtype == bool
    assert all(np.array_equal(frame[name], run[name]) for name in run)
    assert frame.attrs["units"] == {"time": "s", **run.units}
    assert frame.attrs["system"] == "grasp.toml"


@pytest.mark.slow
def test_xarray_has_the_same_numbers_units_and_descriptions():
    pytest.importorskip("xarray")
    run = grasp_run()
    data = run.to_xarray()
    assert set(data.data_vars) == set(run)
    assert np.array_equal(data["time"], run.time)
    assert data["time"].attrs["units"] == "s"
    assert data[GAP].attrs == {"units": "m", "long_name": "l_1, distance"}
    assert data["plant.contact[1]"].attrs == {}
    assert all(np.array_equal(data[name], run[name]) for name in run)
    assert data.attrs == {"system": "grasp.toml", "scheme": "sequential", "step": 1e-3, "stop": 2.0}


def test_what_is_missing_says_how_this_environment_gets_it():
    with pytest.raises(InputError) as raised:
        extra_module("no_such_package", "it makes the table", "pandas")
    assert str(raised.value) == (
        "no_such_package is not installed, it makes the table; install it with: "
        f"{sys.executable} -m pip install 'pandas>=2.2'"
    )


@pytest.mark.parametrize("method", ["to_pandas", "to_xarray"])
def test_without_the_extra_it_is_one_line(method, monkeypatch):
    monkeypatch.setitem(sys.modules, method.removeprefix("to_"), None)
    with pytest.raises(InputError, match=r"-m pip install ('pandas>=[0-9.]+'|xarray)$"):
        getattr(grasp_run(), method)()
