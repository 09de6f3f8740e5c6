"""The log of another logger as signals: which columns they are, scaled, and what is left of it."""

import numpy as np
import pytest
from grasp_cosim.recording.log_names import LogColumn, LogNames
from grasp_cosim.recording.signals import read_log

TIME, X, ON = [0.0, 0.5, 1.0], [1.0, 2.0, 4.0], [0, 1, 1]


def log_of(folder, form, **columns):
    """The same columns beside the time as CSV, or as Arrow with their types."""
    path = folder / f"log.{form}"
    if form == "csv":
        rows = zip(*columns.values(), strict=True)
        lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows)]
        path.write_text("\n".join(lines) + "\n")
    else:
        arrow = pytest.importorskip("pyarrow")
        table = arrow.table(columns)
        with arrow.OSFile(str(path), "wb") as sink, arrow.ipc.new_file(sink, table.schema) as file:
            file.write_table(table)
    return path


@pytest.mark.parametrize("form", ["csv", "arrow"])
@pytest.mark.parametrize(
    ("factor", "offset"), [(1.0, 0.0), (2.0, 0.0), (1.0, 0.5), (-1e-3, 0.25), (1.0, -1.0)]
)
def test_a_signal_is_a_factor_times_its_column_plus_an_offset(tmp_path, form, factor, offset):
    path = log_of(tmp_path, form, time=TIME, raw=X, spare=X)
    names = LogNames("map.toml", columns={"a.x": LogColumn("raw", None, factor, offset)})
    log = read_log(path, names)
    assert [*log] == ["a.x", "spare"]
    assert log["a.x"].tolist() == [factor * x + offset for x in X]
    assert log["spare"].tolist() == X
    assert log.time.tolist() == TIME


def test_as_it_is_a_column_keeps_its_type(tmp_path):
    path = log_of(tmp_path, "arrow", time=TIME, raw=[False, True, True])
    names = LogNames("map.toml", columns={"a.on": LogColumn("raw")})
    assert read_log(path, names)["a.on"].dtype == np.bool_
    scaled = LogNames("map.toml", columns={"a.on": LogColumn("raw", None, 2.0)})
    assert read_log(path, scaled)["a.on"].tolist() == [0.0, 2.0, 2.0]


@pytest.mark.parametrize("column", ["x", "raw"])
def test_a_name_of_the_map_goes_before_a_column_of_that_name(tmp_path, column):
    """Be it its own column or another one, the plain one does not come again."""
    path = log_of(tmp_path, "csv", time=TIME, x=X, raw=ON)
    log = read_log(path, LogNames("map.toml", columns={"x": LogColumn(column, None, 3.0)}))
    plain = X if column == "x" else ON
    assert log["x"].tolist() == [3.0 * value for value in plain]
    assert [*log] == (["x", "raw"] if column == "x" else ["x"])


def test_one_column_may_be_two_signals(tmp_path):
    path = log_of(tmp_path, "csv", time=TIME, raw=X)
    columns = {"a.x": LogColumn("raw"), "b.x": LogColumn("raw", None, -1.0)}
    log = read_log(path, LogNames("map.toml", columns=columns))
    assert [*log] == ["a.x", "b.x"]
    assert log["b.x"].tolist() == [-x for x in X]


def test_the_time_is_in_its_unit_and_by_the_other_clock(tmp_path):
    path = log_of(tmp_path, "csv", t=[0, 500, 1000], time=X, x=X)
    log = read_log(path, LogNames("map.toml", "t", "ms", 12.5))
    assert log.time.tolist() == [12.5, 13.0, 13.5]
    assert log["x"].tolist() == X
