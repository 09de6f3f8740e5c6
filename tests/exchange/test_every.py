"""Of every N-th point and the last one nothing is lost, in any form that a run is recorded in."""

import numpy as np
import pytest
from grasp_cosim import System, load_run, simulate
from grasp_cosim.recording.arrow import ArrowListener
from grasp_cosim.recording.csv import CsvListener
from grasp_cosim.recording.mdf import MdfListener, read_mdf
from grasp_cosim.recording.signals import read_signals

POINTS = 1000
"""Of the run after its start; rows come by in blocks of fewer."""


@pytest.fixture(scope="module")
def clock():
    """Two components of Python code: the time in ms, and one that looks at it."""

    def count(t, inputs):
        return {"ms": 1e3 * t}

    def watch(t, inputs):
        return {}

    return System(
        components={"clock": count, "watch": watch},
        connections=["clock.ms -> watch.ms"],
        experiment={"step": 1e-3, "stop": POINTS / 1e3, "scheme": "sequential"},
    )


def expected(every):
    points = list(range(0, POINTS, every))
    return [*points, POINTS]


@pytest.mark.parametrize("every", [1, 7, 127, 250, 999, 1001, 10**9])
def test_the_last_row_is_there_once_in_csv_arrow_mdf_and_memory(clock, tmp_path, every):
    pytest.importorskip("pyarrow")
    pytest.importorskip("asammdf")
    csv, arrow, mdf = (tmp_path / f"s.{form}" for form in ("csv", "arrow", "mf4"))
    listeners = [CsvListener(csv), ArrowListener(arrow), MdfListener(mdf)]
    result = simulate(clock, every=every, listeners=listeners)
    points = expected(every)
    assert (result.time * 1e3).round(6).tolist() == points
    assert result["clock.ms"].round(6).tolist() == points
    written = [read_signals(csv, ()), read_signals(arrow, ()), read_mdf(mdf)[:2]]
    for time, columns in written:
        assert time.tolist() == result.time.tolist()
        assert columns["clock.ms"].tolist() == result["clock.ms"].tolist()


@pytest.mark.parametrize("steps", [1, 6, 7, 8, 300])
def test_a_session_that_goes_on_drops_the_point_it_looked_at(clock, steps):
    with simulate.session(clock, every=7) as session:
        session.step(steps)
        points = [*range(0, steps, 7), steps]
        assert np.round(session.result().time * 1e3, 6).tolist() == points
        session.step(POINTS - steps)
        assert np.round(session.result().time * 1e3, 6).tolist() == expected(7)


def test_a_session_goes_back_to_its_last_row(clock):
    with simulate.session(clock, every=7) as session:
        session.step(20)
        state = session.save()
        session.step(200)
        session.restore(state)
        assert (session.result()["clock.ms"].round(6) == [0, 7, 14, 20]).all()
        session.step(9)
        assert (session.result()["clock.ms"].round(6) == [0, 7, 14, 21, 28, 29]).all()


def test_run_every_writes_the_last_row(command, tmp_path):
    short = ("run", "--stop", "0.01", "--quiet", "--every", "30")
    assert command(*short, "--out", "r")[0] == 0
    assert load_run(tmp_path / "r").time.tolist() == [0.0, 0.003, 0.006, 0.009, 0.01]
