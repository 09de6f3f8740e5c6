"""Text of others is harmless in a terminal and in a spreadsheet, and reads back the same."""

import csv
import io
import unicodedata

import pytest
from grasp_cosim.base.plain_text import from_cell, on_one_line, printable, to_cell
from hypothesis import given
from hypothesis import strategies as st

ANY = st.text(st.characters(codec=None), max_size=12) | st.text(
    "=+-@\t\r\n\\'\" ax,;\x1b", max_size=6
)


@given(ANY)
def test_a_cell_is_no_formula_has_no_line_break_and_reads_back(text):
    cell = to_cell(text)
    assert from_cell(cell) == text
    assert cell[:1] not in ("=", "+", "-", "@", "\t", "\r", "＝", "＋", "－", "＠")
    assert len(cell.splitlines()) <= 1
    assert not any(unicodedata.category(c) in ("Cc", "Cs", "Zl", "Zp") for c in cell)
    file = io.StringIO()
    csv.writer(file).writerow([cell, "after"])
    assert next(csv.reader([file.getvalue()])) == [cell, "after"]


@pytest.mark.parametrize("text", ["plant.gap[1]", "a.b c", "Größe", "x-y", "1", "", "'=1'"])
def test_plain_names_stay(text):
    assert to_cell(text) == text == printable(text)


def test_numbers_stay_numbers():
    assert [to_cell(v) for v in (-0.5, -1, True, None)] == [-0.5, -1, True, None]


@given(ANY)
def test_nothing_steers_a_terminal(text):
    shown = printable(text)
    categories = {unicodedata.category(c) for c in shown.replace("\n", "").replace("\t", "")}
    assert not categories & {"Cc", "Cs", "Zl", "Zp"}
    assert not any(unicodedata.bidirectional(c) in ("RLO", "LRO", "RLE", "RLI") for c in shown)
    assert len(on_one_line(text).splitlines()) <= 1


def test_what_is_escaped_can_be_read():
    assert printable("\x1b]0;own\x07\u202e\r\ud800") == "\\x1b]0;own\\x07\\u202e\\r\\ud800"
    assert printable("two\nlines\t.") == "two\nlines\t."
    assert on_one_line("two\nlines") == "two\\nlines"
