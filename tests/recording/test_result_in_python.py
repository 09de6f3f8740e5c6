"""A result as Python users meet it: in a console, in a notebook, as tables of other packages."""

import json
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, Result, load_run
from grasp_cosim.base.checks import extra_module
from hypothesis import given
from hypothesis import strategies as st
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


@pytest.mark.parametrize(
    "changes",
    [
        {"signals": {}, "units": {}},
        {"complete": False, "wall_time": None},
        {"log": ("\x1b[31mred\nlines" * 30,)},
    ],
)
def test_an_odd_result_has_a_repr_too(changes):
    text = repr(replace(grasp_run(), **changes))  # type: ignore[arg-type]
    assert len(text.splitlines()) == 5
    assert "\x1b" not in text


@pytest.mark.slow
@given(names=st.lists(st.text(min_size=1), min_size=1, max_size=30, unique=True))
def test_names_of_any_length_stay_in_their_line(names):
    lines = repr(ring_run(names, rows=3)).split("\n")
    assert len(lines) == 5
    assert max(map(len, lines)) <= 100


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


def test_a_name_like_none_lists_all_and_looking_for_one_is_no_error():
    run = ring_run(["a", "b"])
    with pytest.raises(KeyError, match=r"'zzzzzz': no such signal; valid: a.y, b.y"):
        run["zzzzzz"]
    assert "zzzzzz" not in run
    assert run.get("zzzzzz") is None
    assert "a.y" in run


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
def test_a_csv_of_pandas_is_a_side_of_a_comparison(tmp_path):
    pytest.importorskip("pandas")
    from grasp_cosim.comparison.compare import compare

    write_run(tmp_path / "run", grasp_run())
    grasp_run().to_pandas().to_csv(tmp_path / "pandas.csv")
    found = compare(tmp_path / "run", tmp_path / "pandas.csv")
    assert found.alike
    assert len(found.signals) == len(grasp_run())


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


@pytest.mark.slow
def test_tables_and_pictures_are_not_imported_before_they_are_asked_for():
    """Start-up stays short."""
    code = (
        "import sys, json; from grasp_cosim import Result, load_run, simulate; "
        "print(json.dumps([m for m in ('pandas', 'xarray', 'matplotlib', 'difflib') "
        "if m in sys.modules]))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == []
    assert Result.__name__ == "Result"
