"""Runs of the grasp by the clock: the same bits, a timing that is kept, an end on Ctrl-C."""

import io
import json
import os
import re
import signal
import sys

import pytest
from grasp_cosim import InputError, Realtime, simulate
from grasp_cosim.base.calls import CLOCK
from grasp_cosim.realtime.pacer import HAS_CLOCK
from grasp_cosim.realtime.privileges import check_cpu
from grasp_cosim.realtime.timing import Timing
from grasp_cosim.recording.load import load_run
from realtime.fake import Fake
from support.marks import ENGINES, slow
from support.mocks import Mock, make_system

FAST = Realtime(factor=1e4)
"""Not to wait at all in a test."""

PARTS = ["step", "start", "plant", "sensor_1", "sensor_2", "controller", "exchange", "between"]


@pytest.fixture(params=ENGINES)
def engine(request):
    return request.param


@pytest.mark.parametrize("scheme", ["sequential", slow("jacobi")])
def test_a_paced_run_has_the_same_bits(grasp, engine, scheme):
    options = {"step": 1e-3, "stop": 2.0, "scheme": scheme, "engine": engine}
    free, paced = simulate(grasp, **options), simulate(grasp, realtime=FAST, **options)
    assert free.timing is None
    assert list(free) == list(paced)
    assert free.time.tobytes() == paced.time.tobytes()
    assert [n for n in free if free[n].tobytes() != paced[n].tobytes()] == []
    timing = paced.timing
    assert timing is not None
    assert (timing.steps, timing.factor, timing.period) == (2000, 1e4, 1e-7)
    assert list(timing.parts) == [*PARTS, "recording"]
    assert all(0.0 <= p.median <= p.p99 <= p.p999 <= p.worst for p in timing.parts.values())
    assert timing.parts["plant"].median > 0.0
    assert timing.overruns == 2000 == sum(timing.culprits.values())
    assert 0.0 < timing.real_time_factor < 1e4


@pytest.mark.skipif(not HAS_CLOCK, reason="this system's clock is read in Python")
def test_compiled_code_reads_the_clock_itself(grasp):
    with simulate.session(grasp, stop=0.01, realtime=FAST) as session:
        natives = [call.native for call in session._master.plan.calls]
    assert [n.shape for n in natives if n].count(CLOCK) == 8
    with simulate.session(grasp, stop=0.01) as session:
        assert not [c for c in session._master.plan.calls if c.native and c.native.shape == CLOCK]
        assert len(session._master.values) == len(session._master.slots)


def test_the_timing_comes_back_from_the_folder(grasp, tmp_path):
    result = simulate(grasp, step=1e-3, stop=0.1, realtime=FAST)
    result.to_csv(tmp_path / "signals.csv")
    result.to_json(tmp_path / "run.json")
    assert result.timing is not None
    assert load_run(tmp_path).timing == result.timing
    text = json.loads((tmp_path / "run.json").read_text())
    assert list(text["realtime"]) == [
        "factor", "period", "overrun", "granted", "refused", "steps", "real_time_factor",
        "overruns", "parts", "histograms",
    ]  # fmt: skip
    assert set(text["realtime"]["parts"]["step"]) == {"median", "p99", "p99.9", "worst", "worst_at"}
    text["realtime"]["overruns"] = 7
    (tmp_path / "run.json").write_text(json.dumps(text))
    with pytest.raises(InputError, match=r"run\.json: realtime: is damaged \(TypeError: .*must be"):
        load_run(tmp_path)


def test_a_run_that_is_not_paced_has_no_timing(grasp, tmp_path):
    result = simulate(grasp, stop=0.01)
    result.to_csv(tmp_path / "signals.csv")
    result.to_json(tmp_path / "run.json")
    assert "realtime" not in json.loads((tmp_path / "run.json").read_text())
    assert load_run(tmp_path).timing is None


def test_a_session_is_paced_as_well(grasp, engine):
    with simulate.session(grasp, stop=0.1, engine=engine, realtime=FAST) as session:
        while session.step(7):
            pass
        timing = session.result().timing
    assert timing is not None
    assert timing.steps == 1000
    assert Timing.from_dict("here", timing.as_dict()) == timing


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.slow
def test_a_terminal_shows_how_it_goes(grasp, monkeypatch):
    terminal, file = Terminal(), io.StringIO()
    for stream in (terminal, file):
        monkeypatch.setattr(sys, "stderr", stream)
        simulate(grasp, stop=0.05, progress=True, realtime=FAST)
    assert file.getvalue() == ""
    assert re.search(r"0\.05 of 0\.05 s .*x, worst step [\d.]+ ms, 500 over", terminal.getvalue())


@pytest.mark.usefixtures("ctrl_c")
@pytest.mark.parametrize("engine", ["python", "auto"])
def test_ctrl_c_does_not_wait_for_the_next_step(tmp_path, monkeypatch, engine):
    """Which would begin only after 1000 s."""
    mock, fake = Mock(tmp_path, "a", lambda u, t: t), Fake()
    fake.on_sleep = lambda: os.kill(os.getpid(), signal.SIGINT)
    monkeypatch.setattr("grasp_cosim.master.simulation.load", lambda component: mock)
    monkeypatch.setattr("grasp_cosim.realtime.pacer.Clock", lambda: fake.clock)
    result = simulate(make_system([mock], [], 10), engine=engine, realtime=Realtime(factor=1e-4))
    assert len(fake.sleeps) == 1
    assert not result.complete
    assert result.time.tolist() == [0.0, 0.1]


def test_the_system_says_how_it_is_paced_unless_the_call_does(grasp):
    system = grasp.with_settings({"realtime.factor": "2000", "realtime.overrun": "continue"})
    options = {"step": 1e-3, "stop": 0.02}
    paced = simulate(system, realtime=True, **options).timing
    assert paced is not None
    assert (paced.factor, paced.overrun) == (2000.0, "continue")
    other = simulate(system, realtime=Realtime(factor=3000.0), **options).timing
    assert other is not None
    assert (other.factor, other.overrun) == (3000.0, "catch-up")
    assert simulate(system, **options).timing is None


def test_where_a_system_does_not_list_its_cpus_any_may_be_asked_for(monkeypatch, tmp_path):
    monkeypatch.setattr("grasp_cosim.realtime.privileges.ONLINE", tmp_path / "none")
    check_cpu(Realtime(cpu=99))


@pytest.mark.parametrize("engine", ["python", "auto"])
def test_a_halted_session_does_not_wait_and_does_no_step(tmp_path, monkeypatch, engine):
    """The second step would begin only after 1000 s."""
    mock = Mock(tmp_path, "a", lambda u, t: t)
    monkeypatch.setattr("grasp_cosim.master.simulation.load", lambda component: mock)
    pace = Realtime(factor=1e-4)
    with simulate.session(make_system([mock], [], 10), engine=engine, realtime=pace) as session:
        assert session.step()
        session.halt.set()
        assert not session.step()
        assert (session.time, session.complete) == (0.1, False)


@pytest.mark.parametrize("factor", [1e-12, 1e9])
def test_a_period_that_no_clock_can_keep_is_refused(grasp, factor):
    with pytest.raises(InputError, match=r"a step of 0\.0001 s would begin every .* 1 ns to a yea"):
        simulate(grasp, stop=0.1, realtime=Realtime(factor=factor))
