"""From the master to the listeners: every row once, in order, whatever happens."""

import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError, simulate
from grasp_cosim.recording.csv import CsvListener
from grasp_cosim.recording.memory import MemoryListener
from recording.rows import full_disk


@pytest.mark.parametrize("every", [1, 300])
def test_a_file_written_on_the_way_is_the_one_written_afterwards(grasp, tmp_path, every):
    result = simulate(grasp, stop=0.1, every=every, listeners=[CsvListener(tmp_path / "on.csv")])
    result.to_csv(tmp_path / "after.csv")
    assert result.time.tolist() == [k / 1e4 for k in (*range(0, 1000, every), 1000)]
    assert (tmp_path / "on.csv").read_bytes() == (tmp_path / "after.csv").read_bytes()


def test_a_run_that_is_broken_off_keeps_what_was_recorded(grasp, tmp_path):
    """Every 30th point and the last; a look on the way has its own point, which is not kept."""
    path = tmp_path / "s.csv"
    with simulate.session(grasp, stop=0.1, every=30, listeners=[CsvListener(path)]) as session:
        session.step(35)
        assert session.result().time.tolist() == [0.0, 0.003, 0.0035]
        session.step(30)
    times = [line.partition(",")[0] for line in path.read_text().splitlines()]
    assert times == ['"time"', "0.0", "0.003", "0.006", "0.0065"]


def test_where_a_listener_fails_the_others_keep_their_rows(grasp, tmp_path):
    full, memory = CsvListener(tmp_path / "s.csv"), MemoryListener()
    with simulate.session(grasp, stop=0.1, listeners=[memory, full]) as session:
        session.step(35)
        with full_disk(20_000), pytest.raises(SimulationError, match=r"s\.csv: cannot b") as caught:
            session.step(900)
    result = caught.value.result
    assert result is not None
    assert not result.complete
    rows = len((tmp_path / "s.csv").read_text().splitlines()) - 1
    assert 10 < rows < len(memory.columns()[0]) == len(result.time)
    assert (np.diff(memory.columns()[0]) > 0.0).all()


def test_where_a_listener_does_not_begin_no_file_is_left(grasp, tmp_path):
    (tmp_path / "file").touch()
    places = [tmp_path / "s.csv", tmp_path / "file" / "s.csv"]
    with pytest.raises(InputError, match=r"file/s\.csv: cannot be written: "):
        simulate(grasp, stop=0.1, listeners=[CsvListener(path) for path in places])
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_where_the_run_does_not_begin_no_file_is_left(grasp, tmp_path):
    wide = grasp.with_values({"plant.object_width": 0.5})
    with pytest.raises(InputError, match=r"object_width = 0\.5 m"):
        simulate(wide, stop=0.1, listeners=[CsvListener(tmp_path / "s.csv")])
    assert list(tmp_path.iterdir()) == []


def test_where_a_listener_does_not_end_the_others_do(grasp, tmp_path):
    paths = [tmp_path / name for name in ("1.csv", "2.csv", "3.csv")]
    session = simulate.session(grasp, stop=0.1, listeners=[*map(CsvListener, paths)])
    session.step(10)
    paths[1].mkdir()
    with pytest.raises(SimulationError, match=r"2\.csv: cannot be written: Is a directory"):
        session.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["1.csv", "2.csv", "3.csv"]
    assert [len(path.read_text().splitlines()) for path in (paths[0], paths[2])] == [12, 12]
