"""Writes ASAM MDF 4, read back with asammdf."""

import json
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError
from grasp_cosim.exchange.listener import Experiment
from grasp_cosim.recording.mdf import PIECE, MdfListener
from grasp_cosim.system.settings import settings
from recording.rows import EXPERIMENT, SIGNALS, full_disk, play, rows

asammdf = pytest.importorskip("asammdf")


def channels(path):
    with asammdf.MDF(path) as file:
        return {channel.name: file.get(channel.name) for channel in file.groups[0].channels}


@pytest.mark.parametrize(("count", "block"), [(100, 1), (100, 7), (PIECE, 100), (20_001, 5000)])
def test_values_come_back_with_their_types(tmp_path, count, block):
    table, path = rows(count), tmp_path / "new" / "s.mf4"
    play(MdfListener(path), table, block=block)
    assert list(path.parent.iterdir()) == [path]
    found = channels(path)
    assert list(found) == ["time", "a.x[1]", "a.n", "a.on"]
    assert found["time"].samples.tolist() == [k * 100_000 / 1e9 for k in range(count)]
    types = {"a.x[1]": np.float64, "a.n": np.int64, "a.on": np.uint8}
    for (name, element), column in zip(types.items(), table.T, strict=True):
        assert found[name].samples.dtype == element
        assert found[name].samples.tolist() == column.tolist()
        assert found[name].timestamps.tolist() == found["time"].samples.tolist()


def test_time_is_that_of_the_step_numbers(tmp_path):
    play(MdfListener(tmp_path / "s.mf4"), rows(4), np.array([0, 30_000, 60_000, 70_001]))
    assert channels(tmp_path / "s.mf4")["a.n"].timestamps.tolist() == [0.0, 3.0, 6.0, 7.0001]


def test_channels_have_units_and_descriptions(tmp_path):
    play(MdfListener(tmp_path / "s.mf4"), rows(4))
    found = channels(tmp_path / "s.mf4")
    assert [c.unit for c in found.values()] == ["s", "m", "", ""]
    assert [c.comment for c in found.values()] == ["", "Where it is", "", "Whether <it> is & was"]


@pytest.mark.parametrize("complete", [True, False])
def test_the_header_has_the_settings(grasp, tmp_path, complete):
    """An interrupted run is kept all the same."""
    listener = MdfListener(tmp_path / "s.mf4")
    listener.begin(Experiment.of(settings(grasp)), SIGNALS)
    listener.block(np.arange(4), rows(4))
    listener.end(complete)
    with asammdf.MDF(tmp_path / "s.mf4") as file:
        assert file.version == "4.10"
        assert file.groups[0].channel_group.cycles_nr == 4
        comment = ElementTree.fromstring(file.header.comment)
    assert json.loads(comment.findtext("TX") or "") == settings(grasp)
    assert {e.get("name"): json.loads(e.text or "") for e in comment.iter("e")} == {
        "system": "grasp.toml",
        "scheme": "sequential",
        "step": 1e-4,
        "stop": 3.0,
        "complete": complete,
    }


def test_a_run_without_signals_is_refused(tmp_path):
    with pytest.raises(InputError, match=r"s.mf4: nothing to record; must be a system with out"):
        MdfListener(tmp_path / "s.mf4").begin(EXPERIMENT, ())


def test_a_full_disk_leaves_nothing(tmp_path):
    listener = MdfListener(tmp_path / "s.mf4")
    listener.begin(EXPERIMENT, SIGNALS)
    with full_disk(5_000):
        listener.block(np.arange(1000), rows(1000))
        with pytest.raises(SimulationError, match=r"^.*s.mf4: cannot be written: File too large$"):
            listener.end(True)
    assert list(tmp_path.iterdir()) == []


def test_a_place_that_cannot_be_written_is_a_wrong_input(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match=r"^.*file/s.mf4: cannot be written: "):
        MdfListener(tmp_path / "file" / "s.mf4").begin(EXPERIMENT, SIGNALS)


def test_without_asammdf_the_message_says_how_to_get_it(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "asammdf", None)
    with pytest.raises(InputError, match=r"^asammdf is not .*pip install 'asammdf>=[0-9.]+'$"):
        MdfListener(tmp_path / "s.mf4")
