"""Arrow: the rows of a CSV, in less time, and what a kill left behind."""

import os

import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError, compare, load_run, simulate
from grasp_cosim.exchange.listener import Signal, Texts
from grasp_cosim.recording import arrow as module
from grasp_cosim.recording import csv
from grasp_cosim.recording.arrow import ArrowListener, read_arrow
from grasp_cosim.recording.folder import RunFolder
from recording.rows import EXPERIMENT, full_disk

pyarrow = pytest.importorskip("pyarrow")


def test_a_run_is_written_and_read_back_as_it_was(grasp, tmp_path):
    with RunFolder(tmp_path, grasp, ["run"], form="arrow") as folder:
        result = simulate(grasp, step=1e-3, listeners=[folder])
        folder.finish(result)
    assert sorted(p.name for p in tmp_path.iterdir()) == ["run.json", "signals.arrow"]
    back = load_run(tmp_path / "signals.arrow")
    assert list(back) == list(result)
    assert back.time.tobytes() == result.time.tobytes()
    for name, column in result.items():
        assert (back[name].dtype, back[name].tobytes()) == (column.dtype, column.tobytes())
    assert back.metrics == result.metrics
    assert compare(tmp_path, result).alike


def test_others_read_it_with_its_units(grasp, tmp_path):
    result = simulate(grasp, step=1e-3, stop=0.1)
    result.to_arrow(tmp_path / "signals.arrow")
    frame = pytest.importorskip("pandas").read_feather(tmp_path / "signals.arrow")
    assert list(frame) == ["time", *result]
    assert frame["plant.gap[1]"].tolist() == result["plant.gap[1]"].tolist()
    with pyarrow.ipc.open_file(tmp_path / "signals.arrow") as file:
        fields = {field.name: field for field in file.schema}
    assert fields["time"].metadata[b"unit"] == b"s"
    assert fields["plant.gap[1]"].metadata[b"unit"] == b"m"
    assert str(fields["plant.contact[1]"].type) == "bool"


def test_texts_and_integers_come_back(tmp_path):
    texts = Texts()
    numbers = [texts.number(text) for text in ("a", "ä,\n", "a")]
    signals = [Signal("a.n", None, "Integer"), Signal("a.s", None, "String", texts=texts)]
    listener = ArrowListener(tmp_path / "s.arrow")
    listener.begin(EXPERIMENT, signals)
    listener.block(np.arange(3), np.column_stack(([2.0**53, -1.0, 0.0], numbers)))
    listener.end(True)
    time, columns = read_arrow(tmp_path / "s.arrow")
    assert time.tolist() == [0.0, 1e-4, 2e-4]
    assert columns["a.n"].tolist() == [2**53, -1, 0]
    assert columns["a.s"].tolist() == ["a", "ä,\n", "a"]


@pytest.mark.parametrize("lost", [1, 100, 5000])
def test_of_a_file_that_was_cut_off_whole_batches_are_read(grasp, tmp_path, monkeypatch, lost):
    monkeypatch.setattr(module, "BATCH", 10)
    folder = RunFolder(tmp_path, grasp, ["run"], form="arrow")
    with folder, simulate.session(grasp, step=1e-3, listeners=[folder]) as session:
        while session.step(50):
            pass
    path = tmp_path / "signals.arrow"
    whole = load_run(tmp_path)
    os.truncate(path, path.stat().st_size - lost)
    found = load_run(tmp_path)
    assert 0 < len(found.time) <= len(whole.time)
    assert len(found.time) > len(whole.time) - 300
    assert found.time.tolist() == whole.time[: len(found.time)].tolist()
    assert not found.complete


def test_a_run_takes_the_place_of_one_in_the_other_form(command, tmp_path):
    for form in ("csv", "arrow", "csv"):
        code, _, err = command("run", "--stop", "0.01", "--out", "out", "--format", form)
        assert code == 0, err
        assert {p.name for p in (tmp_path / "out").iterdir()} == {f"signals.{form}", "run.json"}
        assert command("report", "out", "--out", "page.html")[0] == 0
    code, _, err = command("run", "--format", "arrow")
    assert (code, err) == (
        2, "grasp-cosim: --format arrow: needs --out, the folder for signals.arrow\n"
    )  # fmt: skip


def test_what_is_no_such_file_is_refused(tmp_path):
    (tmp_path / "s.arrow").write_bytes(b"ARROW1\0\0 and no more")
    with pytest.raises(InputError, match=r"s\.arrow: is damaged, or no Arrow file of a run: "):
        read_arrow(tmp_path / "s.arrow")


def test_a_full_disk_ends_the_run_with_a_line(grasp, tmp_path, monkeypatch):
    monkeypatch.setattr(module, "BATCH", 10)
    session = simulate.session(grasp, step=1e-3, listeners=[ArrowListener(tmp_path / "s.arrow")])
    refused = pytest.raises(SimulationError, match=r"s\.arrow: cannot be written: File too large$")
    with session, full_disk(20_000), refused:
        session.step(2999)


def test_a_large_csv_has_the_same_bits_whoever_reads_it(grasp, tmp_path, monkeypatch):
    result = simulate(grasp, step=1e-3)
    result.to_csv(tmp_path / "signals.csv")
    result.to_json(tmp_path / "run.json")
    monkeypatch.setattr(csv, "LARGE", 0)
    fast = load_run(tmp_path)
    assert {n: c.tobytes() for n, c in fast.items()} == {n: c.tobytes() for n, c in result.items()}
    with (tmp_path / "signals.csv").open("a") as file:
        file.write("3.001,1\n")
    with pytest.raises(InputError, match=r"signals\.csv: is damaged: the number of col"):
        load_run(tmp_path)
