"""What varies becomes rows; the table of runs: types, units in files, text, orders."""

import csv
from fractions import Fraction

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import xarray as xr
from comparison.made import PLANT, write_fmu, write_system
from grasp_cosim import InputError, Quantity
from grasp_cosim.metrics.metric import metric
from grasp_cosim.sweeps.convergence import observed_order
from grasp_cosim.sweeps.rows import as_rows, grid, in_own_units, overrides_of, unit_of, varied
from grasp_cosim.sweeps.table import (
    Outcome,
    Table,
    as_json,
    as_text,
    convergence,
    is_study,
    table_of,
)
from hypothesis import given
from hypothesis import strategies as st


@metric("reach", unit="m", entries=("left", "right"), factor=1e3, shown_unit="mm")
def reach(_):
    return []


def small():
    outcomes = [
        Outcome(0, {"reach[1]": 0.5, "reach[2]": None, "late": True}),
        Outcome(1, {}, "a: failed, badly"),
    ]
    return table_of([{"a.p": 1.5}, {"a.p": 2}], outcomes, {"a.p": "N"}, [reach])


def test_a_file_has_units_and_values_in_full(tmp_path):
    small().write(tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_text().splitlines() == [
        "index,a.p [N],reach[1] [m],reach[2] [m],late,error",
        "0,1.5,0.5,,true,",
        '1,2,,,,"a: failed, badly"',
    ]
    small().write(tmp_path / "t.parquet")
    found = pq.read_table(tmp_path / "t.parquet")
    units = {f.name: f.metadata[b"unit"].decode() for f in found.schema}
    assert units == {"index": "", "a.p": "N", "reach[1]": "m", "reach[2]": "m", "late": "",
                     "error": ""}  # fmt: skip
    assert found.to_pylist()[0] == {"index": 0, "a.p": 1.5, "reach[1]": 0.5, "reach[2]": None,
                                    "late": True, "error": None}  # fmt: skip
    before = (tmp_path / "t.parquet").read_bytes()
    small().write(tmp_path / "t.parquet")
    assert (tmp_path / "t.parquet").read_bytes() == before


def test_columns_are_numbers_and_pandas_has_them(tmp_path):
    table = small()
    np.testing.assert_array_equal(table["reach[1]"], [0.5, np.nan])
    np.testing.assert_array_equal(table["late"], [1.0, np.nan])
    frame = table.to_pandas()
    assert list(frame.columns) == ["a.p", "reach[1]", "reach[2]", "late", "error"]
    assert frame.attrs["units"]["reach[1]"] == "m"
    assert table.shown("reach[1]") == ("reach, left", 1e3, "mm")
    assert table.errors == {1: "a: failed, badly"}
    with pytest.raises(InputError, match=r"'reach': no such column of the sweep.*reach\[1\]"):
        table["reach"]
    with pytest.raises(InputError, match=r"must end in .csv or .parquet"):
        table.write(tmp_path / "t.xlsx")


@pytest.mark.parametrize(
    ("column", "kind"),
    [
        ([2**60, 0.5, None], "double"),
        ([2**63 - 1, -(2**63), None], "int64"),
        ([True, None, False], "bool"),
        (["a", None, "b"], "string"),
        ([None, None, None], "double"),
        ([float("inf"), float("-inf"), 1.0], "double"),
        (["jacobi", 1, None], "string"),
    ],
)
def test_every_column_has_a_type_that_holds_it(tmp_path, column, kind):
    columns = {"index": [0, 1, 2], "c": column, "error": [None] * 3}
    Table(columns, ("c",), (), {}).write(tmp_path / "t.parquet")
    found = pq.read_table(tmp_path / "t.parquet")
    assert str(found.schema.field("c").type) == kind
    assert found["c"].to_pylist() == [None if v is None else v if kind != "string" else str(v)
                                      for v in column]  # fmt: skip
    Table(columns, ("c",), (), {}).write(tmp_path / "t.csv")
    with (tmp_path / "t.csv").open() as file:
        assert [row["index"] for row in csv.DictReader(file)] == ["0", "1", "2"]


def test_a_summary_is_of_what_is_finite():
    values = [*range(101), None, float("nan"), float("inf")]
    table = Table({"index": list(range(104)), "a": values, "b": [None]}, (), ("a", "b"), {})
    found = table.summary()
    assert found["a"] == pytest.approx(
        {"runs": 101, "least": 0, "p5": 5, "median": 50, "p95": 95, "greatest": 100, "mean": 50}
    )
    assert found["b"] == {"runs": 0, **dict.fromkeys(list(found["a"])[1:])}


def test_text_and_json(snapshot):
    assert as_text(small()) == snapshot
    assert as_json(small()) == snapshot


# ------------------------------------------------------------------------- studies of the step

STEPS = st.tuples(*[st.floats(1.1, 10.0)] * 2).map(lambda r: (1.0, r[0], r[0] * r[1]))


@given(steps=STEPS, order=st.floats(0.5, 3.5), c=st.sampled_from([-2.0, 0.3, 7.0]))
def test_an_error_that_is_a_power_of_the_step_has_that_order(steps, order, c):
    results = [5.0 + c * h**order for h in steps]
    assert observed_order(steps, results) == pytest.approx(order, abs=1e-6)


@pytest.mark.parametrize(
    "results", [(1.0, 1.0, 2.0), (1.0, 2.0, 1.0), (None, 1.0, 2.0), (1.0, 2.0, 2.0), (0, 1, 1e3)]
)
def test_results_that_show_no_order(results):
    assert observed_order((1.0, 2.0, 4.0), results) is None


def table(steps, **metrics):
    columns = {"index": list(range(len(steps))), "experiment.step": steps, **metrics}
    columns["error"] = [None] * len(steps)
    return Table(columns, ("experiment.step",), tuple(metrics), {"experiment.step": "s"})


def test_a_study_in_any_order_of_the_steps():
    made = table([4e-4, 1e-4, 2e-4], t=[1.4, 1.1, 1.2], never=[1.0, None, None])
    assert is_study(made)
    found = convergence(made)
    assert found["t"].finest == 1.1
    assert found["t"].steps == (2e-4, 4e-4)
    assert found["t"].errors == pytest.approx((0.1, 0.3))
    assert found["t"].order == pytest.approx(1.0)
    assert (found["never"].finest, found["never"].errors) == (None, (None, None))
    assert as_text(made).splitlines() == [
        "3 runs, 0 failed",
        "error against 0.1 ms    value  0.2 ms  0.4 ms  order",
        "t                         1.1     0.1     0.3      1",
        "never                       -       -       -      -",
    ]


def test_what_is_no_study():
    assert not is_study(table([1e-4]))
    assert not is_study(table([1e-4, 1e-4]))
    assert convergence(table([1e-4, 2e-4], t=[1.0, 2.0]))["t"].order is None


# What varies: texts, tables and columns become rows.


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
    ["a.b", "=1", ".b=1", "a.b=", "a.b=1,,2", "a.b=1:2", "a.b=1:2:x", "a.b=0:inf:3", "a.b=0:1:1",
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
    for table in (rows, tmp_path / "rows.csv", columns, pd.DataFrame(columns)):
        assert as_rows(table) == rows


def test_times_may_be_fractions():
    place = "experiment.step"
    _, values = varied(f"{place}=1/30,1/60,1e-3")
    rows = as_rows(grid({place: values, "p.note": ["1/2"]}))
    assert [row[place] for row in rows] == [1 / 30, 1 / 60, 1e-3]
    assert rows[0]["p.note"] == "1/2"
    assert as_rows([{place: Fraction(1, 30)}]) == [{place: 1 / 30}]
    with pytest.raises(InputError, match=r"sweep: experiment.step = '1/x' s: must be a number"):
        as_rows([{place: "1/x"}])


@pytest.fixture
def milli(tmp_path):
    """A system whose plant has its width in mm."""
    width = 'causality="parameter" variability="fixed" | Real start="50" unit="mm"'
    plant = write_fmu(tmp_path / "milli.fmu", {**PLANT, "width": width})
    return write_system(tmp_path).swap("plant", plant)


def test_a_number_is_in_the_unit_of_its_variable_as_in_the_file(milli, tmp_path):
    """However the rows are given; the head of a column, or the value, may name another unit."""
    (tmp_path / "rows.csv").write_text("plant.width [cm],experiment.step [ms]\n6,1\n", "utf-8")
    step = {"experiment.step": 1e-3}
    for each in (
        [{"plant.width": 60.0, **step}],
        [{"plant.width": "6 cm", "experiment.step": "1 ms"}],
        {"plant.width": (0.06, "m"), "experiment.step [ms]": [1.0]},
        pd.DataFrame({"plant.width [m]": [0.06], **step}),
        tmp_path / "rows.csv",
        grid(dict([varied("plant.width [cm]=6"), varied("experiment.step=1 ms")])),
    ):
        rows = in_own_units(milli, as_rows(each))
        assert rows == [{"plant.width": 60.0, "experiment.step": 1e-3}]
        (settings,) = overrides_of(milli, rows)
        assert milli.with_settings(settings).start("plant.width") == 60.0
    assert unit_of(milli, "plant.width") == "mm"
    found = [v for _, values in [varied("plant.width [cm]=4:6:3")] for v in values]
    assert found == [Quantity(v, "cm") for v in (4.0, 5.0, 6.0)]
    assert as_rows({"a.b": Quantity([4, 5], "cm")})[1] == {"a.b": Quantity(5, "cm")}


def test_a_row_with_another_fmu_means_the_same_by_its_numbers(milli, tmp_path):
    """They are in the unit that the table says, whatever the other FMU has."""
    plant = str(write_fmu(tmp_path / "metre.fmu", PLANT))
    row = {"plant.width": 60.0, "components.plant.fmu": plant}
    (settings,) = overrides_of(milli, [row])
    assert milli.with_settings(settings).start("plant.width") == 0.06


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ({"plant.width [kg]": 60}, "sweep: plant.width = 60 kg: cannot be converted into mm"),
        ({"plant.width [furlong]": 60}, "unit 'furlong' is not known"),
        ({"plant.mass": "60 g"}, "plant.mass = 60 g: .*declares no unit of it; must have none"),
        ({"experiment.scheme [mm]": 60}, "experiment.scheme = 60 mm: must have no unit"),
        ({"experiment.step [mm]": 60}, "experiment.step = 60 mm: must be in a unit of time"),
        ({"plant.width [mm]": "wide"}, r"row 0, plant.width \[mm\]: 'wide': must be a number"),
        ({"plant.width [mm]": "6 mm"}, r"row 0, plant.width \[mm\]: '6 mm': must be a number"),
        (
            {"plant.width [mm]": Quantity("6 mm")},
            r"\[mm\]: '6 mm': must be a number, as the column",
        ),
        ({"plant.width [mm]": 6, "plant.width": 6}, "row 0: plant.width has two values"),
    ],
)
def test_a_row_in_a_unit_of_something_else_is_refused(milli, row, said):
    with pytest.raises(InputError, match=said) as caught:
        in_own_units(milli, as_rows([row]))
    assert "\n" not in str(caught.value)


def test_a_head_with_empty_brackets_says_no_unit(tmp_path):
    path = tmp_path / "rows.csv"
    path.write_text("plant.width []\n60\n")
    assert as_rows(path) == [{"plant.width": 60}]
    assert as_rows({"plant.width []": [60]}) == [{"plant.width": 60}]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "is empty; must have names in its first line"),
        ("a.b\n1,2\n", "line 2 has 2 cells; must have 1, as line 1"),
        ("a.b,a.b\n1,2\n", "line 1, column 2 = 'a.b': appears twice; must appear once"),
        ("a.b [mm]\n1\none\n", "line 3, column 1, a.b = 'one': must be a number"),
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
            overrides_of(grasp, [row])


FRAME = pd.DataFrame({"a.p": [1.5, 2.5], "experiment.scheme": ["jacobi", None]})


class Polars:
    """What polars has of a frame."""

    def to_dicts(self):
        return pa.Table.from_pandas(FRAME).to_pylist()


@pytest.mark.parametrize(
    "given",
    [
        FRAME,
        Polars(),
        pa.Table.from_pandas(FRAME, preserve_index=False),
        np.array([(1.5, "jacobi"), (2.5, "")], [("a.p", "f8"), ("experiment.scheme", "U8")]),
        {"a.p": (v for v in (1.5, 2.5)), "experiment.scheme": np.array(["jacobi", ""])},
    ],
    ids=["pandas", "polars", "pyarrow", "structured", "columns"],
)
def test_rows_are_those_of_any_table(given):
    rows = as_rows(given)
    assert rows == [{"a.p": 1.5, "experiment.scheme": "jacobi"}, {"a.p": 2.5}]
    assert [type(row["a.p"]) for row in rows] == [float, float]


def test_the_coordinates_of_a_dataset_vary_too():
    data = xr.Dataset({"b.q": ("a.p", [1.0, 2.0])}, {"a.p": [3.0, 4.0]})
    assert as_rows(data) == [{"a.p": 3.0, "b.q": 1.0}, {"a.p": 4.0, "b.q": 2.0}]


@pytest.mark.parametrize("one", [0.5, "jacobi", np.float64(0.5), np.array(0.5), True])
def test_a_value_beside_lists_is_that_of_each_row(one):
    plain = one.tolist() if isinstance(one, np.ndarray | np.generic) else one
    assert as_rows({"a": one, "b": [1, 2]}) == [{"a": plain, "b": 1}, {"a": plain, "b": 2}]
    assert as_rows({"a": one}) == [{"a": plain}]
    assert grid({"a": one, "b": (1, 2)}) == as_rows({"a": one, "b": [1, 2]})


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"a": [1, 2, 3], "b": [1, 2]}, "a has 3 values, b has 2 values; must all have as many"),
        ([{"a": 1.0}, 2.0], r"row 1 = 2.0: must be rows, mappings of places to values, or columns"),
        (np.zeros((2, 2)), r"row 0 = array\(\[0\., 0\.\]\): must be rows"),
        (1.0, r"rows = 1.0: must be rows"),
        (None, r"rows = None: must be rows"),
        (pd.DataFrame([[1.0]]), "0: must be a key of the system, a text"),
        (pd.Series({"a": 1.0}), "a Series; must be a DataFrame"),
    ],
)
def test_what_is_no_rows_is_said_in_a_line(given, said):
    with pytest.raises(InputError, match=f"^sweep: {said}[^\n]*$"):
        as_rows(given)


@pytest.mark.parametrize(
    ("index", "in_a_file"),
    [
        (pd.Index([6, 2], name="run"), [6, 2]),
        (pd.Index(["left", "right"]), ["left", "right"]),
        (pd.MultiIndex.from_tuples([(1, "a"), (2, "b")]), [0, 1]),
    ],
    ids=["numbers", "texts", "several"],
)
def test_runs_come_back_under_the_index_of_the_frame(index, in_a_file):
    outcomes = [Outcome(0, {"late": True}), Outcome(1, {}, "a: failed")]
    table = table_of([{"a.p": 1.5}, {"a.p": 2.5}], outcomes, {"a.p": "N"}, [], index)
    found = table.to_pandas()
    pd.testing.assert_index_equal(found.index, index)
    assert found.attrs["units"]["a.p"] == "N"
    assert table.columns["index"] == in_a_file
    assert table.errors == {1: "a: failed"}


def test_a_cell_of_pandas_that_is_not_there_leaves_the_system_its_value():
    frame = pd.DataFrame({"a": pd.array([1, None], "Int64"), "b": [pd.NaT, 2.0]})
    assert as_rows(frame) == [{"a": 1}, {"b": 2.0}]


def test_a_table_shows_a_line_for_each_metric():
    text = repr(small())
    assert text.splitlines()[:2] == ["Table of 2 runs, 1 failed", "  varied: a.p"]
    assert "reach" in text
    outcomes = [Outcome(i, {"m": 1.0}) for i in range(1000)]
    many = table_of([{"a.p": i} for i in range(1000)], outcomes, {}, [])
    assert len(repr(many)) < 500


def test_a_table_in_a_notebook_has_its_first_rows_as_texts():
    outcomes = [Outcome(i, {}, f"<i>{i}") for i in range(30)]
    table = table_of([{"a.p": i} for i in range(30)], outcomes, {"a.p": "<N>"}, [])
    page = table._repr_html_()
    assert "a.p [&lt;N&gt;]" in page
    assert "&lt;i&gt;9" in page
    assert "&lt;i&gt;10" not in page
    assert "<i>" not in page
    assert table._ipython_key_completions_() == ["index", "a.p", "error"]


def test_equal_tables_have_one_hash():
    one, other = small(), small()
    assert one == other
    assert hash(one) == hash(other)
