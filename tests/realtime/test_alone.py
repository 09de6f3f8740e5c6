"""Runs in real time of native FMUs alone: the loop waits and steps without Python's lock."""

import os
import signal
import threading

import numpy as np
import pytest
from grasp_cosim import InputError, Realtime, SimulationError, System, simulate
from grasp_cosim.base.calls import PACE
from grasp_cosim.master import master, side_thread
from grasp_cosim.realtime.pacer import HAS_CLOCK
from grasp_cosim.recording.folder import RunFolder
from grasp_cosim.recording.load import load_run
from support.marks import needs_compiler, slow
from support.native_fmus import TYPES, build, needs_gcc

pytestmark = [
    needs_compiler,
    needs_gcc,
    pytest.mark.skipif(not HAS_CLOCK, reason="this system's clock is read in Python"),
]
FAST = Realtime(factor=1e4)


def system(folder, version="2.0", scheme="sequential", **given):
    """Two native FMUs, the integral of one the input of the other; 2 s at 1 ms."""
    fmu = build(folder, "native", version, strings=False)
    real, whole = ("Real", "Integer") if version == "2.0" else ("Float64", "Int32")
    starts = {"Boolean": "true", "String": "''", "Enumeration": "1", "Float32": "0.5", real: "0.25"}
    components = ""
    for name, connected in (("a", whole), ("b", real)):
        own = {f"u_{t}": starts.get(t, "3") for t in TYPES[version] if t != connected}
        values = ", ".join(f"{key} = {value}" for key, value in {**own, **given}.items())
        components += f"[components.{name}]\nfmu = '{fmu.name}'\nvalues = {{ {values} }}\n"
    path = folder / "two.toml"
    path.write_text(
        f'connections = ["a.x -> b.u_{real}", "b.y_{whole} -> a.u_{whole}"]\n'
        f"[experiment]\nstep = 1e-3\nstop = 2.0\nscheme = '{scheme}'\n{components}"
    )
    return System.load(path)


class Once:
    """A listener that does something with the first step that it hears of."""

    def __init__(self, act):
        self.left = [act]

    def begin(self, *_): ...
    def end(self, *_): ...
    def block(self, steps, _):
        if steps[-1] > 0 and self.left:
            self.left.pop()()


def kills(number):
    """Sends this process a signal."""
    return Once(lambda: os.kill(os.getpid(), number))


def same_bits(one, two):
    same = [one[name].tobytes() == two[name].tobytes() for name in one]
    return all(same) and one.time.tobytes() == two.time.tobytes() and list(one) == list(two)


@pytest.mark.parametrize("version", ["2.0", slow("3.0")])
@pytest.mark.parametrize("scheme", ["jacobi", slow("sequential")])
def test_it_has_the_bits_of_a_free_run_and_a_timing(tmp_path, version, scheme):
    two = system(tmp_path, version, scheme)
    with simulate.session(two, realtime=FAST) as session:
        assert session._master.runs_alone
        shapes = [c.native and c.native.shape for c in session._master.plan.calls]
        assert shapes.count(PACE) == 1
    free, paced = simulate(two, engine="python"), simulate(two, realtime=FAST)
    assert same_bits(free, paced)
    assert paced.timing
    assert paced.timing.steps == 2000
    assert paced.timing.overruns == sum(paced.timing.culprits.values())
    assert "recording" not in {*paced.timing.culprits, *paced.timing.parts}


def test_rows_go_round_in_their_room(tmp_path, monkeypatch):
    two = system(tmp_path)
    monkeypatch.setattr(master, "ROOM", 7)
    monkeypatch.setattr(side_thread, "PAUSE", 1e-6)
    monkeypatch.setattr(master, "LONG", 0.0)
    assert same_bits(simulate(two), simulate(two, realtime=FAST))


def test_steps_in_pieces_and_looks_in_between_come_to_the_same(tmp_path):
    two = system(tmp_path)
    with simulate.session(two, realtime=FAST) as session:
        for steps in (1, 1, 3, 700, 5, 5000):
            assert session.step(steps)
            assert len(session.result().time) == round(session.time * 1e3) + 1
        assert session.complete
        assert same_bits(session.result(), simulate(two))


def test_the_folder_has_every_row_of_it(tmp_path):
    two = system(tmp_path)
    with RunFolder(tmp_path / "out", two, paced=True) as folder:
        result = simulate(two, realtime=FAST, listeners=[folder])
        folder.finish(result)
    assert same_bits(load_run(tmp_path / "out"), result)


@pytest.mark.parametrize("at", [0.5005, 1.9995])
def test_an_fmu_that_fails_ends_it_with_what_was_recorded(tmp_path, at):
    with pytest.raises(SimulationError, match="returned error") as caught:
        simulate(system(tmp_path, error_at=at), realtime=FAST)
    assert caught.value.result is not None
    assert len(caught.value.result.time) == int(at * 1e3) + 1


def test_a_step_that_is_discarded_is_taken_in_parts(tmp_path):
    two = system(tmp_path, discard_at=0.5005)
    free, paced = simulate(two), simulate(two, realtime=FAST)
    assert free.rejections == paced.rejections
    assert free.rejections.keys() == {"a", "b"}
    assert same_bits(free, paced)


def test_a_late_step_ends_it_where_it_should(tmp_path):
    with pytest.raises(SimulationError, match=r"the step at t = 0(\.\d+)? s ended .* ms late"):
        simulate(system(tmp_path), realtime=Realtime(factor=1e6, overrun="stop"))


@pytest.mark.parametrize("waits", [True, False])
def test_ctrl_c_ends_it_soon_and_keeps_what_was_recorded(tmp_path, waits):
    """While it sleeps between steps, and where it never does."""
    long = system(tmp_path).with_experiment(stop=1e5)
    realtime = Realtime(factor=1.0 if waits else 1e6)
    result = simulate(long, realtime=realtime, every=10, listeners=[kills(signal.SIGINT)])
    assert not result.complete
    assert 0 < result.time[-1] < 1e5


def test_ctrl_c_in_a_session_is_raised_and_keeps_what_was_recorded(tmp_path):
    long = system(tmp_path).with_experiment(stop=1e5)
    ends = kills(signal.SIGINT)
    with simulate.session(long, realtime=Realtime(), listeners=[ends]) as session:
        with pytest.raises(KeyboardInterrupt):
            session.step(10**8)
        result = session.result()
        assert len(result.time) == round(session.time * 1e3) + 1 > 1
        with pytest.raises(InputError, match="broken off"):
            session.step()


def test_a_halt_from_another_thread_ends_it(tmp_path):
    long = system(tmp_path).with_experiment(stop=1e5)
    begun = threading.Event()
    ends = Once(begun.set)
    with simulate.session(long, realtime=Realtime(), every=100, listeners=[ends]) as session:

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
def test_a_python_call_in_the_plan_keeps_the_pacer_in_python(tmp_path):
    """An event, say: nobody would hand the rows on in its wait otherwise."""
    system(tmp_path)
    path = tmp_path / "two.toml"
    path.write_text(path.read_text() + "[[events]]\nat = 0.5\nset = { 'a.gain' = 2.0 }\n")
    two = System.load(path)
    with simulate.session(two, realtime=FAST) as session:
        assert not session._master.runs_alone
    assert same_bits(simulate(two), simulate(two, realtime=FAST))
    assert np.isfinite(simulate(two)["a.x"]).all()
