"""Runs by the clock: the same bits, a timing that is kept, an end on Ctrl-C.

Native FMUs alone wait and step without Python's lock.
"""

import json
import os
import re
import shutil
import signal
import threading

import pytest
from grasp_cosim import InputError, Realtime, RunInterruptedError, SimulationError, System, simulate
from grasp_cosim.base.calls import PACE
from grasp_cosim.base.typed_json import Decoder
from grasp_cosim.master import engine
from grasp_cosim.master import paced as paced_master
from grasp_cosim.master.engine import has_compiler
from grasp_cosim.realtime.pacer import HAS_CLOCK
from grasp_cosim.realtime.timing import Timing
from grasp_cosim.recording.folder import RunFolder
from grasp_cosim.recording.read_back import load_run
from grasp_cosim.recording.run_json import TimingEntry
from report.runs import paced
from support.marks import engines, slow
from support.native_fmus import TYPES, build

FAST = Realtime(factor=1e4)
"""Not to wait at all in a test."""

PARTS = ["step", "start", "plant", "sensor_1", "sensor_2", "controller", "exchange", "between"]


def same_bits(one, two):
    same = [one[name].tobytes() == two[name].tobytes() for name in one]
    return all(same) and one.time.tobytes() == two.time.tobytes() and list(one) == list(two)


@engines
@pytest.mark.parametrize("scheme", ["sequential", slow("jacobi")])
def test_a_paced_run_has_the_same_bits_and_a_timing(grasp, engine, scheme):
    options = {"step": 1e-3, "stop": 1.0, "scheme": scheme, "engine": engine}
    free, run = simulate(grasp, **options), simulate(grasp, realtime=FAST, **options)
    assert free.timing is None
    assert same_bits(free, run)
    timing = run.timing
    assert (timing.steps, timing.factor, timing.period) == (1000, 1e4, 1e-7)
    assert list(timing.parts) == [*PARTS, "recording"]
    assert all(0.0 <= p.median <= p.p99 <= p.p999 <= p.worst for p in timing.parts.values())
    assert min(timing.parts[name].median for name in ("plant", "exchange")) > 0.0
    assert timing.overruns == 1000 == sum(timing.culprits.values())
    assert 0.0 < timing.real_time_factor < 1e4


@engines
def test_a_session_is_paced_as_the_system_says_unless_the_call_does(grasp, engine):
    system = grasp.with_settings({"realtime.factor": "2000", "realtime.overrun": "continue"})
    for realtime, expected in (
        (True, (2000.0, "continue")),
        (Realtime(factor=3000.0), (3000.0, "catch-up")),
    ):
        with simulate.session(
            system, step=1e-3, stop=0.02, engine=engine, realtime=realtime
        ) as session:
            while session.step(7):
                pass
            timing = session.result().timing
        assert (timing.steps, timing.factor, timing.overrun) == (20, *expected)


def test_a_timing_is_plain_data_and_what_is_damaged_is_refused_in_one_line():
    timing = paced(steps=200, hiccups=12, listed=5)
    entry = json.loads(json.dumps(timing.as_dict()))
    assert Timing.from_dict("here", Decoder().decoded(TimingEntry, "here", entry)) == timing
    for damaged in (
        7, {**entry, "overruns": 7}, {**entry, "factor": "much"}, {**entry, "parts": {"a": {}}},
        {key: value for key, value in entry.items() if key != "period"},
    ):  # fmt: skip
        with pytest.raises(InputError, match=r"^here[^\n]*; must [^\n]*$"):
            Decoder().decoded(TimingEntry, "here", damaged)
    histogram = {"edges": [0.0, 1.0], "counts": [1]}
    for damaged, reason in (
        ({"listed": []}, "it has overruns, and does not say of which step"),
        ({"edges": [0.0]}, "a histogram has not one edge more than counts"),
        ({"name": "nobody"}, "there are histograms of other parts"),
    ):
        wrong = json.loads(json.dumps(entry))
        if "listed" in damaged:
            wrong["overruns"].update(damaged)
        else:
            name = damaged.pop("name", "step")
            wrong["histograms"][name] = {**histogram, **damaged}
        line = f"here: is damaged ({reason}); must be a file of `grasp-cosim run --realtime --out`"
        with pytest.raises(InputError, match=f"^{re.escape(line)}$"):
            Timing.from_dict("here", wrong)


@pytest.mark.parametrize("factor", [1e-12, 1e9])
def test_a_period_that_no_clock_can_keep_is_refused(grasp, factor):
    with pytest.raises(InputError, match=r"a step of 0\.0001 s would begin every .* 1 ns to a yea"):
        simulate(grasp, stop=0.1, realtime=Realtime(factor=factor))


@pytest.mark.slow
def test_a_terminal_shows_how_it_goes(grasp, monkeypatch, capsys):
    monkeypatch.setattr("sys.stderr.isatty", lambda: False)
    simulate(grasp, stop=0.05, progress=True, realtime=FAST)
    assert capsys.readouterr().err == ""
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    simulate(grasp, stop=0.05, progress=True, realtime=FAST)
    said = r"0\.05 of 0\.05 s .*x, worst step [\d.]+ ms, 500 over"
    assert re.search(said, capsys.readouterr().err)


# ----------------------------------------------------------------- native FMUs alone


@pytest.fixture
def two(tmp_path):
    """A system of two native FMUs, the integral of one the input of the other; 2 s at 1 ms."""
    if not (HAS_CLOCK and has_compiler() and shutil.which("gcc")):
        pytest.skip("no compiler, or this system's clock is read in Python")

    def system(version="2.0", scheme="sequential", more="", **given):
        fmu = build(tmp_path, "native", version, strings=False)
        real, whole = ("Real", "Integer") if version == "2.0" else ("Float64", "Int32")
        own = {"Boolean": "true", "String": "''", "Enumeration": "1", "Float32": "0.5"}
        own[real] = "0.25"
        components = ""
        for name, connected in (("a", whole), ("b", real)):
            starts = {f"u_{t}": own.get(t, "3") for t in TYPES[version] if t != connected} | given
            values = ", ".join(f"{key} = {value}" for key, value in starts.items())
            components += f"[components.{name}]\nfmu = '{fmu.name}'\nvalues = {{ {values} }}\n"
        path = tmp_path / "two.toml"
        path.write_text(
            f'connections = ["a.x -> b.u_{real}", "b.y_{whole} -> a.u_{whole}"]\n'
            f"[experiment]\nstep = 1e-3\nstop = 2.0\nscheme = '{scheme}'\n{components}{more}"
        )
        return System.load(path)

    return system


class Once:
    """A listener that does something with the first step that it hears of."""

    def __init__(self, act):
        self.left = [act]

    def begin(self, *_): ...
    def end(self, *_): ...
    def block(self, steps, _):
        if steps[-1] > 0 and self.left:
            self.left.pop()()


def interrupts():
    return Once(lambda: os.kill(os.getpid(), signal.SIGINT))


@pytest.mark.parametrize("version", ["2.0", slow("3.0")])
@pytest.mark.parametrize("scheme", ["jacobi", slow("sequential")])
def test_it_has_the_bits_of_a_free_run_in_its_folder_too(two, tmp_path, version, scheme):
    system = two(version, scheme)
    with simulate.session(system, realtime=FAST) as session:
        assert session.master.runs_alone
        shapes = [c.native and c.native.shape for c in session.master.plan.calls]
        assert shapes.count(PACE) == 1
    with RunFolder(tmp_path / "out", system, paced=True) as folder:
        result = simulate(system, realtime=FAST, listeners=[folder])
        folder.finish(result)
    assert same_bits(simulate(system, engine="python"), result)
    assert same_bits(load_run(tmp_path / "out"), result)
    assert result.timing.steps == 2000
    assert result.timing.overruns == sum(result.timing.culprits.values())
    assert "recording" not in {*result.timing.culprits, *result.timing.parts}


def test_steps_that_wait_for_the_clock_begin_when_they_should(two):
    """In compiled code too: half of the steps at least, on a machine that stalls."""
    start = simulate(two(), stop=0.4, realtime=True).timing.parts["start"]
    assert start.median < 1e-3
    assert start.worst_at < 0.4


def test_rows_go_round_in_their_room(two, monkeypatch):
    system = two()
    monkeypatch.setattr(paced_master, "MAX_ROWS_ASIDE", 7)
    monkeypatch.setattr(engine, "PAUSE", 1e-6)
    monkeypatch.setattr(paced_master, "LONG", 0.0)
    assert same_bits(simulate(system), simulate(system, realtime=FAST))


def test_steps_in_pieces_and_looks_in_between_come_to_the_same(two):
    system = two()
    with simulate.session(system, realtime=FAST) as session:
        for steps in (1, 1, 3, 700, 5, 5000):
            assert session.step(steps)
            assert len(session.result().time) == round(session.time * 1e3) + 1
        assert session.complete
        assert same_bits(session.result(), simulate(system.as_steered()))


def test_what_fails_is_late_or_discarded_does_what_it_does_in_a_free_run(two):
    for at in (0.5005, 1.9995):
        with pytest.raises(SimulationError, match="returned error") as caught:
            simulate(two(error_at=at), realtime=FAST)
        assert len(caught.value.result.time) == int(at * 1e3) + 1
    with pytest.raises(SimulationError, match=r"the step at t = 0(\.\d+)? s ended .* ms late"):
        simulate(two(), realtime=Realtime(factor=1e6, overrun="stop"))
    system = two(discard_at=0.5005)
    free, run = simulate(system), simulate(system, realtime=FAST)
    assert free.rejections == run.rejections
    assert free.rejections.keys() == {"a", "b"}
    assert same_bits(free, run)


@pytest.mark.parametrize("factor", [1.0, 1e6])
def test_ctrl_c_ends_it_soon_and_keeps_what_was_recorded(two, factor):
    """While it sleeps between steps, and where it never does."""
    long, realtime = two().with_experiment(stop=1e5), Realtime(factor=factor)
    with pytest.raises(RunInterruptedError) as interrupted:
        simulate(long, realtime=realtime, every=10, listeners=[interrupts()])
    result = interrupted.value.result
    assert not result.complete
    assert 0 < result.time[-1] < 1e5
    with simulate.session(long, realtime=realtime, listeners=[interrupts()]) as session:
        with pytest.raises(KeyboardInterrupt):
            session.step(10**8)
        assert len(session.result().time) == round(session.time * 1e3) + 1 > 1
        with pytest.raises(InputError, match="broken off"):
            session.step()


def test_a_halt_from_another_thread_ends_it(two):
    begun = threading.Event()
    with simulate.session(
        two().with_experiment(stop=1e5), realtime=Realtime(), every=100, listeners=[Once(begun.set)]
    ) as session:

        def halt():
            begun.wait()
            session.halt.set()

        other = threading.Thread(target=halt)
        other.start()
        assert session.step(10**8)
        other.join()
        assert not session.complete
        assert not session.step(1)


@pytest.mark.slow
def test_a_python_call_in_the_plan_keeps_the_pacer_in_python(two):
    """An event, say: nobody would hand the rows on in its wait otherwise."""
    system = two(more="[[events]]\nat = 0.5\nset = { 'a.gain' = 2.0 }\n")
    with simulate.session(system, realtime=FAST) as session:
        assert not session.master.runs_alone
    assert same_bits(simulate(system), simulate(system, realtime=FAST))
