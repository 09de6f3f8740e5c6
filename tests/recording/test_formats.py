"""CSV, Arrow and MDF: written while a run goes on, and read back to the bit."""

import csv
import json
import os
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.etree import ElementTree

import numpy as np
import pytest
from grasp_cosim import InputError, Result, SimulationError
from grasp_cosim.exchange.listener import Experiment, Signal, Texts
from grasp_cosim.recording import arrow
from grasp_cosim.recording.arrow import ArrowListener
from grasp_cosim.recording.csv import CsvListener
from grasp_cosim.recording.mdf import MdfListener, read_mdf
from grasp_cosim.recording.signals import read_signals
from grasp_cosim.system.settings import settings
from grasp_cosim.tables import delimited, read_table
from hypothesis import given
from hypothesis import strategies as st
from recording.rows import EXPERIMENT, SIGNALS, full_disk, play, rows
from support.marks import examples, slow

FORMATS = {
    "csv": (CsvListener, lambda path: read_signals(path, {"a.s"})),
    "arrow": (ArrowListener, lambda path: read_signals(path, {"a.s"})),
    "mf4": (MdfListener, lambda path: read_mdf(path)[:2]),
}
MODULES = {"arrow": "pyarrow", "mf4": "asammdf"}
formats = pytest.mark.parametrize("form", FORMATS)

TEXTS = st.text('aä€𝄞=\\"\n\r\t\0, ')
ROW = st.tuples(st.floats(), st.integers(-(2**53), 2**53), st.booleans(), TEXTS)


def listener(form, path):
    if form in MODULES:
        pytest.importorskip(MODULES[form])
    return FORMATS[form][0](path)


@formats
@examples(60)
@given(
    table=st.lists(ROW, min_size=1, max_size=20),
    gaps=st.lists(st.integers(1, 10**6), min_size=20),
    block=st.integers(1, 7),
)
def test_every_value_reads_back_with_the_same_bits(form, table, gaps, block):
    texts = Texts()
    signals = (*SIGNALS, Signal("a.s", None, "String", texts=texts))
    numbers = np.array([(x, n, on, texts.number(s)) for x, n, on, s in table], np.float64)
    steps = np.cumsum(gaps[: len(table)])
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"new.{form}"
        play(listener(form, path), numbers, steps, block, signals)
        assert [p.name for p in Path(folder).iterdir()] == [path.name]
        time, columns = FORMATS[form][1](path)
        assert time.tolist() == [k * 100_000 / 1e9 for k in steps.tolist()]
        expected = dict(
            zip(("a.x[1]", "a.n", "a.on", "a.s"), zip(*table, strict=True), strict=True)
        )
        if form == "mf4":  # which a log of numbers is read from
            del expected["a.s"]
        assert list(columns) == list(expected)
        real, told = columns.pop("a.x[1]"), np.array(expected.pop("a.x[1]"))
        assert np.array_equal(real, told, equal_nan=True)
        assert (np.signbit(real) == np.signbit(told))[~np.isnan(told)].all()
        assert {name: column.tolist() for name, column in columns.items()} == {
            name: list(column) for name, column in expected.items()
        }


def test_csv_is_the_shortest_text_with_names_and_texts_in_quotes(tmp_path):
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
    play(CsvListener(tmp_path / "s.csv"), np.empty((3, 0)), signals=())
    assert (tmp_path / "s.csv").read_text() == '"time"\n0.0\n0.0001\n0.0002\n'
    name = "a.der('x,y\", [1]')"
    play(CsvListener(tmp_path / "s.csv"), np.zeros((1, 1)), signals=(Signal(name, "m", "Real"),))
    with (tmp_path / "s.csv").open(newline="") as file:
        assert next(csv.reader(file)) == ["time", name]


@pytest.mark.parametrize("form", ["csv", "mf4"])
@pytest.mark.parametrize("complete", [True, False])
def test_the_file_takes_its_name_at_the_end_if_it_has_rows(tmp_path, form, complete):
    path = tmp_path / "new" / f"s.{form}"
    one = listener(form, path)
    one.begin(EXPERIMENT, SIGNALS)
    one.end(complete)
    assert list(path.parent.iterdir()) == []
    one.begin(EXPERIMENT, SIGNALS)
    one.block(np.arange(10), rows(10))
    assert not path.exists()
    if form == "csv":
        (part,) = path.parent.iterdir()
        assert len(part.read_text().splitlines()) == 11  # nothing waits in memory
    one.end(complete)
    assert list(path.parent.iterdir()) == [path]
    assert len(FORMATS[form][1](path)[0]) == 10


def test_arrow_has_units_descriptions_and_types(tmp_path):
    play(listener("arrow", tmp_path / "s.arrow"), rows(4))
    with arrow.pyarrow().ipc.open_file(tmp_path / "s.arrow") as file:
        told = [
            (str(f.type), f.metadata[b"unit"], f.metadata.get(b"description")) for f in file.schema
        ]
    assert told == [
        ("double", b"s", None), ("double", b"m", b"Where it is"), ("int64", b"", b""),
        ("bool", b"", b"Whether <it> is & was"),
    ]  # fmt: skip


@pytest.mark.parametrize("complete", [True, False])
def test_mdf_has_units_descriptions_texts_and_the_settings(grasp, tmp_path, complete):
    asammdf = pytest.importorskip("asammdf")
    texts, count = Texts(), 20_001
    red, blue = map(texts.number, ("red", "blü"))
    signals = (*SIGNALS, Signal("a.s", None, "String", texts=texts))
    table = np.column_stack((rows(count), np.resize([red, blue], count)))
    experiment = Experiment.of(settings(grasp))
    play(MdfListener(tmp_path / "s.mf4"), table, None, 1000, signals, complete, experiment)
    with asammdf.MDF(tmp_path / "s.mf4") as file:
        found = [file.get(channel.name) for channel in file.groups[0].channels]
        comment = ElementTree.fromstring(file.header.comment)
        assert (file.version, len(file.groups)) == ("4.10", 1)
    assert [(c.name, c.unit, c.comment) for c in found] == [
        ("time", "s", ""), ("a.x[1]", "m", "Where it is"), ("a.n", "", ""),
        ("a.on", "", "Whether <it> is & was"), ("a.s", "", ""),
    ]  # fmt: skip
    assert [c.samples.dtype.str for c in found[1:4]] == ["<f8", "<i8", "|u1"]
    assert found[1].samples.tolist() == table[:, 0].tolist()
    assert [t.decode() for t in found[4].samples[:3]] == ["red", "blü", "red"]
    assert json.loads(comment.findtext("TX")) == settings(grasp)
    assert {e.get("name"): json.loads(e.text) for e in comment.iter("e")} == {
        "system": "grasp.toml", "scheme": "sequential", "step": 1e-4, "stop": 3.0,
        "complete": complete,
    }  # fmt: skip


@pytest.mark.parametrize("lost", [1, 100, 1500])
def test_of_an_arrow_file_that_was_cut_off_whole_batches_are_read(tmp_path, monkeypatch, lost):
    monkeypatch.setattr(arrow, "BATCH", 10)
    path = tmp_path / "s.arrow"
    play(listener("arrow", path), rows(500), block=10)
    whole, _ = read_signals(path, ())
    os.truncate(path, path.stat().st_size - lost)
    found, columns = read_signals(path, ())
    assert 400 < len(found) <= 500
    assert found.tolist() == whole[: len(found)].tolist()
    assert columns["a.x[1]"].tolist() == rows(500)[: len(found), 0].tolist()
    path.write_bytes(b"ARROW1\0\0 and no more")
    with pytest.raises(InputError, match=r"s\.arrow: is damaged, or no Arrow file: "):
        read_signals(path, ())


def test_a_large_csv_has_the_same_bits_whoever_reads_it(tmp_path, monkeypatch):
    pytest.importorskip("pyarrow")
    path, texts = tmp_path / "s.csv", Texts()
    signals = (*SIGNALS, Signal("a.s", None, "String", texts=texts))
    texts.listed += ['a "b",\n', "", "\\"]
    play(CsvListener(path), np.column_stack((rows(200), np.arange(200) % 3)), signals=signals)
    plain = read_signals(path, {"a.s"})[1]
    monkeypatch.setattr(delimited, "MIN_BYTES_FOR_ARROW", 0)
    with monkeypatch.context() as only:
        only.setattr(read_table, "Numbers", None)
        fast = read_signals(path, {"a.s"})[1]
    assert {n: c.tolist() for n, c in fast.items()} == {n: c.tolist() for n, c in plain.items()}
    with path.open("a") as file:
        file.write("3.001,1\n")
    with pytest.raises(InputError, match=r"s\.csv: line 202 has 2 cells; must have 5, as line 1"):
        read_signals(path, {"a.s"})


@formats
def test_a_place_that_cannot_be_written_is_a_wrong_input(tmp_path, form):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=rf"^.*file/s\.{form}: cannot be written: "):
        listener(form, tmp_path / "file" / f"s.{form}").begin(EXPERIMENT, SIGNALS)
    if form == "csv":
        with full_disk(5), pytest.raises(InputError, match=r"^.*s\.csv: cannot be written: "):
            CsvListener(tmp_path / "s.csv").begin(EXPERIMENT, SIGNALS)
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


@formats
def test_a_full_disk_is_said_and_leaves_whole_lines_or_nothing(tmp_path, form, monkeypatch):
    monkeypatch.setattr(arrow, "BATCH", 10)
    one = listener(form, tmp_path / f"s.{form}")
    one.begin(EXPERIMENT, SIGNALS)
    refused = pytest.raises(SimulationError, match=rf"^.*s\.{form}: cannot be written: File too l")
    with full_disk(30_000):
        one.block(np.arange(200), rows(200))
        with refused:
            one.block(np.arange(200, 10_000), rows(9_800))
            one.end(False)  # where asammdf writes at last
        with suppress(SimulationError):
            one.end(False)
    if form == "csv":
        *lines, last = (tmp_path / "s.csv").read_text().split("\n")
        assert last == ""
        assert {line.count(",") for line in lines} == {3}
        assert 200 < len(lines) < 1500
    if form == "mf4":
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("form", "size"),
    [("csv", 4000), ("arrow", 4000), ("mdf", 4000), ("json", 100), slow("png", 100)],
)
def test_a_full_disk_leaves_the_file_of_a_result_that_was_there(tmp_path, form, size):
    made = {
        "system": "bare", "scheme": "sequential", "step": 1e-3, "stop": 1.0, "components": {},
    }  # fmt: skip
    time = np.arange(1001, dtype=np.float64) * 0.001
    noise = np.random.default_rng(1).standard_normal(1001)
    result = Result(made, time, {"a.x": noise}, {"a.x": "m"}, 1.0, True)
    path = tmp_path / f"s.{form}"
    if form == "png":
        pytest.importorskip("matplotlib")
        result.plot(path)  # matplotlib may write a cache of its own
    path.write_text("before")
    write = result.plot if form == "png" else getattr(result, f"to_{form}")
    with (
        full_disk(size),
        pytest.raises((SimulationError, OSError), match="ile too large") as caught,
    ):
        write(path)
    assert str(path) in str(caught.value)
    assert [(p.name, p.read_text()) for p in tmp_path.iterdir()] == [(path.name, "before")]


def test_mdf_needs_signals_and_asammdf(tmp_path, monkeypatch):
    with pytest.raises(InputError, match=r"s\.mf4: nothing to record; must be a system with out"):
        listener("mf4", tmp_path / "s.mf4").begin(EXPERIMENT, ())
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(InputError, match=r"^asammdf is not .*pip install 'asammdf>=[0-9.]+'$"):
        MdfListener(tmp_path / "s.mf4")
