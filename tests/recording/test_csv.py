"""Writes CSV as the FMI cross-check has it, while the run goes on."""

import csv
import math
import struct
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError
from grasp_cosim.exchange.listener import Signal
from grasp_cosim.recording.csv import CsvListener
from hypothesis import given
from hypothesis import strategies as st
from recording.rows import EXPERIMENT, SIGNALS, full_disk, peak, play, rows


def bits(value):
    return b"nan" if math.isnan(value) else struct.pack("d", value)


ROW = st.tuples(st.floats(), st.integers(-(2**53), 2**53), st.booleans())


@given(st.lists(ROW, min_size=1, max_size=20), st.integers(1, 7))
def test_every_number_reads_back_with_the_same_bits(table, block):
    with TemporaryDirectory() as folder:
        path = Path(folder) / "signals.csv"
        play(CsvListener(path), np.array(table, np.float64), block=block)
        with path.open(newline="") as file:
            names, *lines = csv.reader(file)
    assert names == ["time", "a.x[1]", "a.n", "a.on"]
    assert len(lines) == len(table)
    for k, ((time, x, n, on), row) in enumerate(zip(lines, table, strict=True)):
        assert float(time) == k * 100_000 / 1e9
        assert bits(float(x)) == bits(row[0])
        assert (n, on) == (str(row[1]), str(int(row[2])))


def test_the_text_is_the_shortest_one(tmp_path):
    table = np.array([[0.1, 1, 0], [-1e16, -5, 1], [1e-7, 0, 1], [float("nan"), 2, 0]])
    play(CsvListener(tmp_path / "s.csv"), table, np.array([0, 3, 20_000, 7]))
    assert (tmp_path / "s.csv").read_bytes().split(b"\n") == [
        b'"time","a.x[1]","a.n","a.on"',
        b"0.0,0.1,1,0",
        b"0.0003,-1e+16,-5,1",
        b"2.0,1e-07,0,1",
        b"0.0007,nan,2,0",
        b"",
    ]


def test_a_run_without_signals_is_its_time(tmp_path):
    play(CsvListener(tmp_path / "s.csv"), np.empty((3, 0)), signals=())
    assert (tmp_path / "s.csv").read_text() == '"time"\n0.0\n0.0001\n0.0002\n'


def test_names_may_have_commas_and_quotes(tmp_path):
    name = "a.der('x,y\", [1]')"
    play(CsvListener(tmp_path / "s.csv"), np.zeros((1, 1)), signals=(Signal(name, "m", "Real"),))
    with (tmp_path / "s.csv").open(newline="") as file:
        assert next(csv.reader(file)) == ["time", name]


@pytest.mark.parametrize("complete", [True, False])
def test_the_file_takes_its_name_at_the_end(tmp_path, complete):
    path, table = tmp_path / "new" / "s.csv", rows(10)
    listener = CsvListener(path)
    listener.begin(EXPERIMENT, SIGNALS)
    listener.block(np.arange(10), table)
    (part,) = path.parent.iterdir()
    assert part != path
    assert len(part.read_text().splitlines()) == 11  # nothing waits in memory
    listener.end(complete)
    assert list(path.parent.iterdir()) == [path]
    assert len(path.read_text().splitlines()) == 11


def test_memory_does_not_grow_with_the_run(tmp_path):
    def run(count):
        table, steps = rows(count), np.arange(count)
        return peak(lambda: play(CsvListener(tmp_path / "s.csv"), table, steps))

    one, four = run(2_500), run(10_000)
    assert four < one + 10_000
    assert four < 1_000_000


def test_a_full_disk_leaves_whole_lines(tmp_path):
    listener = CsvListener(tmp_path / "s.csv")
    listener.begin(EXPERIMENT, SIGNALS)
    with full_disk(60_000):
        listener.block(np.arange(500), rows(500))
        with pytest.raises(SimulationError, match=r"^.*s.csv: cannot be written: File too large$"):
            listener.block(np.arange(500, 10_000), rows(9_500))
        listener.end(False)
    *lines, last = (tmp_path / "s.csv").read_text().split("\n")
    assert last == ""
    assert {line.count(",") for line in lines} == {3}
    assert 500 < len(lines) < 3000


def test_a_place_that_cannot_be_written_is_a_wrong_input(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"^.*file/s.csv: cannot be written: "):
        CsvListener(tmp_path / "file" / "s.csv").begin(EXPERIMENT, SIGNALS)
    with full_disk(5), pytest.raises(InputError, match=r"^.*s.csv: cannot be written: "):
        CsvListener(tmp_path / "s.csv").begin(EXPERIMENT, SIGNALS)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]
