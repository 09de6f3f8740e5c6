"""The one reader of tables: separators, marks, units, numbers and texts, CSV, Arrow and Parquet."""

import os
import re
import threading
from fractions import Fraction
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from grasp_cosim import InputError
from grasp_cosim.tables.column import split_head
from grasp_cosim.tables.read_table import names_in, read_table
from hypothesis import given
from hypothesis import strategies as st
from support.marks import examples

NAMES = st.text('abc.[]1 ,;\t"', min_size=1, max_size=6).map(str.strip).filter(bool)
CELLS = st.one_of(
    st.floats(allow_nan=False).map(repr),
    st.text('ab ,;\t"1_', min_size=1, max_size=6).map(str.strip).filter(bool),
)


def table_of(folder, content, name="t.csv"):
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return read_table(path)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_files_of_spreadsheets_are_the_same_table(tmp_path, encoding, separator, end):
    lines = [["time [ms]", "é.u", "a.v [kN]"], ["0", "1st run", "-1e3"], ["", "", ""],
             ["2.5", "", " 7 "]]  # fmt: skip
    text = end.join(map(separator.join, lines))
    table = table_of(tmp_path, text.encode(encoding))
    time, u, v = table.columns
    assert [(c.name, c.unit) for c in table.columns] == [
        ("time", "ms"), ("é.u", None), ("a.v", "kN")
    ]  # fmt: skip
    assert (table.row_count, time.is_time(), time.time_unit()) == (2, True, Fraction(1, 1000))
    assert (list(time.numbers()), list(v.numbers())) == ([0.0, 2.5], [-1000.0, 7.0])
    assert (u.values, u.texts()) == (None, ["1st run", ""])
    assert v.place(1) == f"{tmp_path / 't.csv'}: line 4, column 3, a.v"
    assert v.to_unit("N") == (1000.0, 0.0)


@given(
    st.sampled_from(",;\t"),
    st.lists(NAMES, min_size=2, max_size=4, unique=True),
    st.lists(CELLS, min_size=8, max_size=8),
)
def test_what_a_writer_of_csv_has_quoted_is_read_as_it_was(separator, names, cells):
    import csv

    with TemporaryDirectory() as folder:
        path = Path(folder) / "t.csv"
        with path.open("w", newline="") as file:
            writer = csv.writer(file, delimiter=separator, quoting=csv.QUOTE_ALL)
            writer.writerow(names)
            writer.writerows([cells[: len(names)], cells[len(names) : 2 * len(names)]])
        table = read_table(path)
        assert [column.head for column in table.columns] == names
        for place, column in enumerate(table.columns):
            assert column.texts() == [cells[place], cells[place + len(names)]]


def test_a_separator_is_taken_where_all_lines_show_it(tmp_path):
    table = table_of(tmp_path, "time;plant.der(x,y)\n0;1\n1;2\n")
    assert [column.name for column in table.columns] == ["time", "plant.der(x,y)"]
    with pytest.raises(InputError, match=r"line 1 holds commas and semicolons; must be separated"):
        table_of(tmp_path, "a;b,c\n0;1,2\n")
    with pytest.raises(
        InputError, match=r"line 2, column 2, a.u = '1,5': .*, with a point before its"
    ):
        table_of(tmp_path, "time;a.u\n0;1,5\n").columns[1].numbers()


@pytest.mark.parametrize(
    ("head", "name", "unit"),
    [
        ("a.u [kN]", "a.u", "kN"), ("a.u[1]", "a.u[1]", None), ("a.u[1] [1]", "a.u[1]", "1"),
        ("time[ms]", "time", "ms"), ("Time [s]", "Time", "s"), ("a []", "a", ""), ("", "", None),
    ],
)  # fmt: skip
def test_a_head_is_a_name_and_a_unit(head, name, unit):
    assert split_head(head) == (name, unit)


@pytest.mark.parametrize("cell", ["", "x", "1st", "1_0", "\u0661", "1,5x", "0x10", "1 000"])
def test_a_cell_that_is_no_number_is_named_by_line_and_column(tmp_path, cell):
    """Also far below the first lines, and not before somebody uses the column."""
    rows = "".join(f"{row},{row}\n\n" for row in range(3000))
    table = table_of(tmp_path, f'a,b\n{rows}7,"{cell}"\n')
    assert len(table.columns[0].numbers()) == 3001
    problem = f" = {cell!r}: must be a number" if cell else ": missing; must be a number"
    with pytest.raises(InputError, match=re.escape(f"t.csv: line 6002, column 2, b{problem}")):
        table.columns[1].numbers()


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", "t.csv: is empty; must have names in its first line"),
        ("a,b\n1\n", "t.csv: line 2 has 1 cell; must have 2, as line 1"),
        ('a,b\n1,"2\n', "t.csv: after line 1: unexpected end of data; must be a CSV file"),
        (b"a,\xfc\n", "can't decode byte 0xfc"),
    ],
)
def test_what_is_no_table_is_one_line(tmp_path, content, said):
    with pytest.raises(InputError, match=re.escape(said)):
        table_of(tmp_path, content)
    assert names_in(tmp_path / "t.csv") == (["a", "b"] if b"a,b" in _bytes(content) else [])


def _bytes(content):
    return content if isinstance(content, bytes) else content.encode()


def test_a_last_line_without_an_end_counts_unless_it_is_torn(tmp_path):
    (tmp_path / "t.csv").write_text("a\n1\n23")
    assert list(read_table(tmp_path / "t.csv").columns[0].numbers()) == [1.0, 23.0]
    assert list(read_table(tmp_path / "t.csv", torn=True).columns[0].numbers()) == [1.0]


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="there are no named pipes")
def test_a_pipe_is_read_once(tmp_path):
    path = tmp_path / "pipe"
    os.mkfifo(path)
    writer = threading.Thread(target=path.write_text, args=("a;b\n1;word\n",))
    writer.start()
    first, second = read_table(path).columns
    writer.join()
    assert (list(first.numbers()), second.texts()) == ([1.0], ["word"])


@pytest.mark.parametrize("kind", ["arrow", "feather", "parquet"])
def test_tables_of_arrow_have_units_in_metadata_or_names(tmp_path, kind):
    arrow = pytest.importorskip("pyarrow")
    from pyarrow import feather, parquet

    schema = arrow.schema([
        arrow.field("time [ms]", arrow.float32()),
        arrow.field("a.u", arrow.int64(), metadata={"unit": "mm"}),
        arrow.field("a.on", arrow.bool_()),
        arrow.field("word", arrow.string()),
    ])  # fmt: skip
    columns = [[0.0, 0.5], [2**60, -1], [True, False], ["x", None]]
    made = arrow.table([arrow.array(c, f.type) for c, f in zip(columns, schema, strict=True)],
                       schema=schema)  # fmt: skip
    path = tmp_path / f"t.{kind}"
    write = parquet.write_table if kind == "parquet" else feather.write_feather
    write(made, path, compression="none" if kind == "parquet" else "uncompressed")
    time, u, on, word = read_table(path).columns
    assert [(c.name, c.unit) for c in (time, u)] == [("time", "ms"), ("a.u", "mm")]
    assert (time.numbers().dtype, time.numbers().tolist()) == ("float64", [0.0, 0.5])
    assert (u.numbers().tolist(), on.numbers().tolist()) == (columns[1], columns[2])
    assert (on.texts(), word.texts()) == (["true", "false"], ["x", ""])
    with pytest.raises(InputError, match=r"row 1, column 4, word = 'x': must be a number"):
        word.numbers()
    path.write_bytes(path.read_bytes()[: 40 if kind == "parquet" else 20])
    with pytest.raises(InputError, match=r"is damaged, or no (Arrow|Parquet) file: ") as refused:
        read_table(path)
    assert "\n" not in str(refused.value)


@examples(50)
@given(st.sampled_from(["t.arrow", "t.parquet"]), st.data())
def test_a_damaged_table_of_arrow_is_one_line(name, data):
    """Whatever bytes change: texts whose lengths are wrong are not read from anywhere."""
    arrow = pytest.importorskip("pyarrow")
    from pyarrow import feather, parquet

    made = arrow.table({"time": [0.0, 1.0] * 9, "n": [*range(18)], "w": ["x", "yy", None] * 6})
    with TemporaryDirectory() as folder:
        path = Path(folder) / name
        if name == "t.arrow":
            feather.write_feather(made, path, compression="uncompressed")
        else:
            parquet.write_table(made, path)
        content = bytearray(path.read_bytes())
        for _ in range(data.draw(st.integers(1, 3))):
            content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
        path.write_bytes(content[: data.draw(st.integers(1, len(content)))])
        try:
            columns = read_table(path).columns
        except InputError as error:
            said = str(error)
        else:
            said = "".join(column.head for column in columns if column.texts() is None)
    assert "\n" not in said


def test_decimals_of_arrow_are_numbers(tmp_path):
    arrow = pytest.importorskip("pyarrow")
    from decimal import Decimal

    from pyarrow import parquet

    made = arrow.table({"a": arrow.array([Decimal("1.5"), Decimal("-2")])})
    parquet.write_table(made, tmp_path / "t.parquet")
    assert list(read_table(tmp_path / "t.parquet").columns[0].numbers()) == [1.5, -2.0]
