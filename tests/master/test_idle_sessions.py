"""A run of FMUs that are loaded already is as the first one, in all but the time it takes."""

import os
import threading
from contextlib import suppress

import numpy as np
import pytest
from grasp_cosim import InputError, grasp_system, metric, simulate
from grasp_cosim.base.errors import SimulationError
from grasp_cosim.master import idle_sessions
from support.marks import needs_compiler

pytestmark = needs_compiler

WIDTHS = (0.05, 0.07, 0.06, 0.07)
SHORT = {"step": 1e-3, "stop": 0.3}


@pytest.fixture(autouse=True)
def _none_is_kept():
    idle_sessions.close_all()
    yield
    idle_sessions.close_all()


@pytest.fixture(scope="module")
def native():
    return grasp_system(native=True).with_experiment(**SHORT)


@pytest.fixture
def made(monkeypatch):
    """The sessions that are made, one entry each."""
    sessions = []
    begin = idle_sessions.Session._begin
    monkeypatch.setattr(
        idle_sessions.Session, "_begin", lambda *a: (sessions.append(a[0]), begin(*a))
    )
    return sessions


def wide(system, width):
    return system.with_values({"plant.object_width": width})


def all_of(result):
    """Everything that a result has but the time that the run took."""
    timed = "wall_time", "real_time_factor"
    figures = {name: value for name, value in result.metrics.items() if name not in timed}
    columns = {name: column.tobytes() for name, column in result.items()}
    return columns, repr(figures), result.log, dict(result.settings), result.complete


def test_runs_that_follow_are_as_runs_that_load_their_fmus(native, made):
    fresh = {}
    for width in WIDTHS:
        fresh[width] = all_of(simulate(wide(native, width)))
        idle_sessions.close_all()
    loaded = len(made)
    results = [simulate(wide(native, width)) for width in WIDTHS * 2]
    assert [all_of(result) for result in results] == [fresh[width] for width in WIDTHS * 2]
    assert len(made) == loaded + 1


def test_no_window_is_left_to_the_next_run(native, made):
    """Not even the rows that may come into one."""
    triggered = native.with_experiment(step=1e-3, stop=3.0)
    times = {"before": 0.1, "after": 0.2}
    triggered = triggered.with_record(trigger="plant.contact[1] == true", **times)
    widths = WIDTHS * 2
    results = [simulate(wide(triggered, width)) for width in widths]
    assert len(made) == 1
    again = dict(zip(widths, results, strict=True))
    for width, result in zip(widths, results, strict=True):
        assert all_of(result) == all_of(again[width])
        (window,) = result.windows
        assert window.window.number == 1
        assert len(window.time) == 301


def test_a_run_leaves_nothing_to_the_next_one(native, made):
    """Neither states of noise, nor what was set on the way, nor events, nor a value of before."""
    text = {"sensor_1.noise.enabled": True, "sensor_1.noise.seed": 3}
    noisy = native.with_values(text)
    first, plain = all_of(simulate(noisy)), all_of(simulate(native))
    assert all_of(simulate(noisy)) == first != plain
    assert all_of(simulate(native)) == plain
    assert len(made) == 1


def test_what_a_result_has_stays_as_it_is(native):
    first = simulate(native)
    before = all_of(first)
    simulate(wide(native, 0.05))
    assert all_of(first) == before


def test_memory_is_used_again_where_no_result_refers_to_it(native):
    def place(result):
        return result["plant.gap[1]"].ctypes.data

    first = place(simulate(native))
    column = simulate(native)["plant.gap[1]"]
    assert column.ctypes.data == first
    before = column.tobytes()
    kept = simulate(wide(native, 0.05))
    assert place(kept) != first
    assert column.tobytes() == before
    assert place(simulate(native)) not in (first, place(kept))


def test_a_run_that_fails_is_not_gone_on_with(native, made):
    simulate(native)
    for _ in range(2):
        with pytest.raises(InputError, match=r"GripperPlant.fmu refused .*object_width = 0\.9"):
            simulate(wide(native, 0.9))
    unstable = native.with_values({"controller.impact_reduction.viscosity[1]": -900.0})
    with pytest.raises(SimulationError, match=r"ProximitySensor\.fmu returned error"):
        simulate(unstable, step=2e-3)
    number = len(made)
    simulate(native)
    assert number == len(made) - 1


@metric("end", needs=["plant.gap[1]"])
def end(run):
    return float(run["plant.gap[1]"][-1])


@pytest.mark.parametrize(
    "more",
    [{"stop": 0.2}, {"every": 2}, {"engine": "python"}, {"scheme": "jacobi"}, {"metrics": [end]}],
)
def test_another_run_loads_its_own_fmus(native, made, more):
    plain = all_of(simulate(native))
    other = all_of(simulate(native, **more))
    assert len(made) == 2
    assert all_of(simulate(native)) == plain
    assert all_of(simulate(native, **more)) == other
    assert len(made) == 2


class Nobody:
    def begin(self, experiment, signals): ...
    def block(self, steps, rows): ...
    def end(self, complete): ...


@pytest.mark.parametrize(
    "more", [{"listeners": [Nobody()]}, {"note": lambda line: None}, {"until": lambda s: False}]
)
def test_where_somebody_listens_the_fmus_are_freed(native, made, more):
    for _ in range(2):
        simulate(native, **more)
    assert len(made) == 2


def test_fmus_in_python_and_in_their_own_process_are_freed(native, made):
    alone = native.with_settings({"components.plant.isolation": "process"})
    for system in (native.natively(False), alone):
        for _ in range(2):
            simulate(system, stop=0.01)
    assert len(made) == 4


def test_threads_have_a_session_each_and_few_are_kept(native, made):
    lines, runs = {}, threading.Barrier(3)

    def run(width):
        runs.wait()
        lines[width] = [all_of(simulate(wide(native, width))) for _ in range(3)]

    threads = [threading.Thread(target=run, args=(width,)) for width in (0.05, 0.06, 0.07)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for width, found in lines.items():
        assert found == [all_of(simulate(wide(native, width)))] * 3
    assert len(made) <= 3
    for every in range(1, idle_sessions.MAX_IDLE + 4):
        simulate(native, stop=0.01, every=every)
    assert len(idle_sessions._idle) == idle_sessions.MAX_IDLE


def test_a_run_that_is_halted_ends_in_good_order(native, made):
    halt = threading.Event()
    halt.set()
    for _ in range(2):
        result = simulate(native, halt=halt)
        assert not result.complete
        assert np.array_equal(result.time, [0.0])
    halt.clear()
    assert simulate(native, halt=halt).complete
    assert len(made) == 3


@pytest.mark.skipif(not hasattr(os, "fork"), reason="NO fork on this system")
@pytest.mark.filterwarnings("ignore:.*multi-threaded.*:DeprecationWarning")
def test_a_fork_loads_its_own_fmus(native):
    """Those of its parent would end it, with 0: see end_fork()."""
    expected = all_of(simulate(native))
    child = os.fork()
    if not child:
        with suppress(BaseException):
            os._exit(7 if all_of(simulate(native)) == expected else 1)
        os._exit(2)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 7
