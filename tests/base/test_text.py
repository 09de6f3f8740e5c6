"""Numbers in tables; text of others, harmless in a terminal and in a spreadsheet, reads back."""

import csv
import io
import math
import unicodedata

import pytest
from grasp_cosim.base.text import (
    MOST,
    NOISE,
    counted,
    fixed,
    from_cell,
    on_one_line,
    printable,
    to_cell,
)
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


@given(st.floats(0.001, 0.999 * MOST), st.booleans(), st.integers(3, 6), st.integers(0, 12))
def test_usual_sizes_have_their_decimals(size, down, decimals, width):
    value = -size if down else size
    assert fixed(value, decimals, width=width) == f"{value:{width}.{decimals}f}"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (4.6e40, "4.6e+40"), (-4.03977e41, "-4.04e+41"), (1.306e-13, "0.000"), (6.3e-8, "6.3e-08"),
        (4e-4, "0.0004"), (0.0, "0.000"), (0.0006, "0.001"), (math.inf, "inf"), (math.nan, "nan"),
    ],
)  # fmt: skip
def test_others_have_a_power_of_ten(value, text):
    assert fixed(value, 3) == text


@given(st.floats(allow_nan=False))
def test_no_number_is_long_or_looks_like_0(value):
    text = fixed(value, 3)
    assert len(text) <= len("-999999999.999")
    assert (float(text) == 0.0) == (abs(value) < NOISE)


def test_what_is_too_small_may_be_rounded_to_0():
    assert fixed(6.3e-15, 3, sign="+", rounded=True) == "+0.000"
    assert fixed(4.6e40, 3, sign="+", rounded=True) == "+4.6e+40"


@pytest.mark.parametrize(("count", "text"), [(0, "0 faults"), (1, "1 fault"), (2, "2 faults")])
def test_a_noun_agrees_with_its_number(count, text):
    assert counted(count, "fault") == text
