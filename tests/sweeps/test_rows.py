"""What varies: texts, tables and columns become rows, in SI units."""

import numpy as np
import pandas as pd
import pytest
from grasp_cosim import InputError
from grasp_cosim.sweeps.rows import as_rows, grid, read_rows, settings_of, unit_of, varied


@pytest.mark.parametrize(
    ("text", "place", "values"),
    [
        ("plant.object_width=0.05:0.07:3", "plant.object_width", [0.05, 0.06, 0.07]),
        ("a.b=0.3,0.57", "a.b", [0.3, 0.57]),
        ("a.b=true,false", "a.b", [True, False]),
        ("a.b=1, 2", "a.b", [1, 2]),
        ("experiment.scheme=jacobi,sequential", "experiment.scheme", ["jacobi", "sequential"]),
        ("a.b=-1e-3:1e-3:2", "a.b", [-1e-3, 1e-3]),
    ],
)
def test_a_text_is_a_place_with_values(text, place, values):
    found = varied(text)
    assert found == (place, pytest.approx(values) if "true" not in text else values)
    assert [type(v) for v in found[1]] == [type(v) for v in values]


@pytest.mark.parametrize(
    "text",
    ["a.b", "a=1", ".b=1", "a.b=", "a.b=1,,2", "a.b=1:2", "a.b=1:2:x", "a.b=0:inf:3", "a.b=0:1:1",
     "a.b=0:1:2:3", "a.b=0:1:100001"],
)  # fmt: skip
def test_another_text_is_refused_in_one_line(text):
    with pytest.raises(InputError, match=r"^--vary '.*: ") as error:
        varied(text)
    assert "must be" in str(error.value)
    assert "\n" not in str(error.value)


def test_of_a_grid_the_last_place_varies_fastest():
    assert grid({"a": [1, 2], "b": [3, 4]}) == [
        {"a": 1, "b": 3}, {"a": 1, "b": 4}, {"a": 2, "b": 3}, {"a": 2, "b": 4},
    ]  # fmt: skip


def test_rows_are_the_same_however_they_are_given(tmp_path):
    rows = [{"p.a": 1.5, "p.b": True}, {"p.a": 2.5}, {"p.a": 3, "p.b": False}]
    (tmp_path / "rows.csv").write_text(
        "\ufeffp.a,p.b\n1.5,true\n2.5,\n\n3,false\n", encoding="utf-8"
    )
    columns = {"p.a": np.array([1.5, 2.5, 3.0]), "p.b": [True, None, False]}
    for given in (rows, tmp_path / "rows.csv", columns, pd.DataFrame(columns)):
        assert as_rows(given) == rows


def test_a_unit_in_the_head_is_converted(tmp_path):
    path = tmp_path / "rows.csv"
    path.write_text("plant.width [mm],sensor.angle [deg],t [degC],n\n60,180,20,3\n")
    (row,) = read_rows(path)
    assert row == pytest.approx({"plant.width": 0.06, "sensor.angle": np.pi, "t": 293.15, "n": 3})


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "not enough values"),
        ("a.b\n1,2\n", "line 2 has 2 cells; must be 1"),
        ("a.b [furlong]\n1\n", "'furlong' is no known unit"),
        ("a.b\n", "0 rows; must be 1 to"),
        ([], "0 rows; must be 1 to"),
        ([{}], "nothing varies"),
    ],
)
def test_a_table_that_is_none(tmp_path, content, said):
    path = tmp_path / "rows.csv"
    if isinstance(content, str):
        path.write_text(content)
    with pytest.raises(InputError, match=said):
        as_rows(path if isinstance(content, str) else content)


@pytest.mark.parametrize(
    ("place", "unit"),
    [
        ("plant.object_width", "m"),
        ("components.plant.values.object_width", "m"),
        ("experiment.step", "s"),
        ("experiment.scheme", None),
        ("controller.impact_reduction.enabled", None),
        ("controller.impact_reduction.damping", "N.s/m"),
    ],
)
def test_the_unit_of_a_place(grasp, place, unit):
    assert unit_of(grasp, place) == unit


def test_a_row_that_does_not_fit_is_refused(grasp):
    for row, said in (
        ({"plant.object_widht": 0.05}, "object_width"),
        ({"nobody.x": 1.0}, "nobody"),
        ({"experiment.stepp": 1.0}, "experiment.step"),
    ):
        with pytest.raises(InputError, match=said):
            settings_of(grasp, [row])
