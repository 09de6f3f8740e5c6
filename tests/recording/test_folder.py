"""The folder of a run while it goes on: never a mixture, whole lines, the same file in the end."""

import json
import os
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, Realtime, simulate
from grasp_cosim.recording.folder import FORMS, RunFolder
from grasp_cosim.recording.load import load_run
from recording.rows import EXPERIMENT, SIGNALS, rows

DRAWN = ("grasp.png", "timing.png", "report.html", "signals.mf4")


@pytest.fixture
def run(grasp, tmp_path):
    with RunFolder(tmp_path, grasp, ["grasp-cosim", "run"]) as folder:
        yield folder


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("realtime", [False, Realtime()])
def test_it_ends_as_a_result_writes_it_and_is_read_back_as_it_was(grasp, tmp_path, form, realtime):
    """Paced or not, in the place of a run of the other form."""
    if form == "arrow":
        pytest.importorskip("pyarrow")
    system, on = grasp.with_experiment(step=1e-3, stop=0.1), tmp_path / "on"
    on.mkdir()
    for name in ("run.json", "signals.csv", "signals.arrow"):
        (on / name).touch()
    with RunFolder(on, system, ["run"], paced=bool(realtime), form=form) as folder:
        result = simulate(system, realtime=realtime, listeners=[folder], diverging="continue")
        folder.finish(result)
    (result.to_csv if form == "csv" else result.to_arrow)(tmp_path / f"signals.{form}")
    result.to_json(tmp_path / "run.json")
    assert sorted(p.name for p in on.iterdir()) == ["run.json", f"signals.{form}"]
    if form == "csv":
        assert (on / "signals.csv").read_bytes() == (tmp_path / "signals.csv").read_bytes()
    written, plain = (json.loads((p / "run.json").read_text()) for p in (on, tmp_path))
    assert {*written} - {*plain} == {"date", "versions", "fmus", "command"}
    assert {key: written[key] for key in plain} == plain
    for place in (on / f"signals.{form}", tmp_path):
        back = load_run(place)
        assert list(back) == list(result)
        assert back.time.tobytes() == result.time.tobytes()
        for name, column in result.items():
            assert (back[name].dtype, back[name].tobytes()) == (column.dtype, column.tobytes())
        assert (back.units, back.settings) == (dict(result.units), result.settings)
        assert back.settings["diverging"] == "continue"
        assert back.metrics == result.metrics


def test_what_waits_is_written_in_spare_time(grasp, tmp_path):
    table = rows(100)
    with RunFolder(tmp_path, grasp, paced=True) as folder:
        folder.begin(EXPERIMENT, SIGNALS)
        folder.block(np.arange(1), table[:1])
        folder.block(np.arange(1, 100), table[1:])
        lines = (tmp_path / "signals.csv").read_text().splitlines()
        assert len(lines) == 2
        while folder.spare(1e5):
            pass
        lines = (tmp_path / "signals.csv").read_text().splitlines()
        assert len(lines) == 101
        folder.end(complete=False)


@pytest.mark.parametrize("torn", [0, 1, 7, 40])
def test_it_can_be_read_while_the_run_goes_on(run, tmp_path, torn):
    """Also where a kill came while a line was written."""
    table = rows(50)
    run.begin(EXPERIMENT, SIGNALS)
    run.block(np.arange(50), table)
    data = (tmp_path / "signals.csv").read_bytes()
    (tmp_path / "signals.csv").write_bytes(data[: len(data) - torn])
    settings = json.loads((tmp_path / "run.json").read_text())
    missing = {"components": {}, "connections": [], "events": [], "faults": []}
    (tmp_path / "run.json").write_text(json.dumps({**missing, "initialisation": {}, **settings}))
    read = load_run(tmp_path)
    whole = 50 if not torn else 49
    assert (read.complete, read.wall_time, len(read.time)) == (False, None, whole)
    assert read["a.x[1]"].tolist() == table[:whole, 0].tolist()
    assert read["a.on"].dtype == np.bool_
    assert read.metrics["real_time_factor"] is None
    assert read.origin["command"] == ["grasp-cosim", "run"]
    run.end(complete=False)


def test_without_a_row_the_older_run_stays(run, tmp_path):
    for name in ("run.json", "signals.csv", *DRAWN):
        (tmp_path / name).write_text("older")
    run.begin(EXPERIMENT, SIGNALS)
    run.end(complete=False)
    assert {p.read_text() for p in tmp_path.iterdir()} == {"older"}


class Killed(BaseException):
    """Stands for a kill between two changes of the folder."""


@pytest.mark.parametrize("moment", range(12))
def test_a_kill_at_no_moment_leaves_a_mixture(run, tmp_path, monkeypatch, moment):
    """The older run with what there is of it, ours, or no run at all: nothing without run.json."""
    for name in ("run.json", "signals.csv", *DRAWN):
        (tmp_path / name).write_text("older")
    left = moment

    def counted(change):
        real = getattr(Path, change)

        def changed(self, *arguments, **options):
            nonlocal left
            if left == 0:
                raise Killed
            left -= 1
            return real(self, *arguments, **options)

        monkeypatch.setattr(Path, change, changed)

    for change in ("unlink", "replace"):
        counted(change)
    run.begin(EXPERIMENT, SIGNALS)
    with suppress(Killed):
        run.block(np.arange(1), rows(1))
    monkeypatch.undo()
    run.end(complete=False)
    there = {p.name for p in tmp_path.iterdir() if not p.name.endswith(".part")}
    if "run.json" in there:
        older = (tmp_path / "run.json").read_text() == "older"
        assert ((tmp_path / "signals.csv").read_text() == "older") == older
        assert older or not there & {*DRAWN}
    else:
        assert not there & {*DRAWN}


def test_two_runs_do_not_share_a_folder(run, grasp, tmp_path):
    run.begin(EXPERIMENT, SIGNALS)
    run.block(np.arange(2), rows(2))
    with RunFolder(tmp_path, grasp) as second:
        second.begin(EXPERIMENT, SIGNALS)
        with pytest.raises(InputError, match="another process records a run in it; must end"):
            second.block(np.arange(2), rows(2))
        second.end(complete=False)
    run.end(complete=True)
    assert len((tmp_path / "signals.csv").read_text().splitlines()) == 3


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_folder_that_cannot_be_written_is_one_line(run, tmp_path):
    tmp_path.chmod(0o555)
    run.begin(EXPERIMENT, SIGNALS)
    with pytest.raises(InputError, match="cannot be written: Permission denied"):
        run.block(np.arange(1), rows(1))
