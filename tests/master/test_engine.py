"""Both engines: the same bits, errors and rows; the loop in C is built once and kept."""

import ctypes
import math
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError, simulate
from grasp_cosim.base.c_compilers import find_compiler
from grasp_cosim.base.calls import STEP_2, Call, Native
from grasp_cosim.master import engine, loop
from grasp_cosim.master.engine import make_loop
from grasp_cosim.master.loop import CALL, COPY, LOAD, LOAD_LONG, SCALE, STEP, STORE
from grasp_cosim.master.plan import Plan
from support.grasps import CASES
from support.marks import engines, needs_compiler
from support.mocks import Mock, Run, make_system

pytestmark = needs_compiler


def plan(values, operations, **parts):
    lists = {name: list(part) for name, part in parts.items()}
    return Plan(np.array(values, float), np.zeros(3), list(operations), **lists)


def run(made, engine, steps, operation=0):
    """What the loop returns, and the rows."""
    call = make_loop(made, engine)
    rows = np.full((steps, len(made.values)), np.nan)
    return call(rows, operation, 0, steps, 0, 1_000_000, 10**9), rows


@engines
def test_a_copy_keeps_the_sign_of_zero_and_a_scale_computes(engine):
    connections = ((0, 1, 1.0, 0.0), (0, 2, 3.0, 0.1))
    made = plan(
        [-0.0, 5.0, 5.0], [(COPY, 0, 1, 1, 0), (SCALE, 1, 2, 1, 0)], connections=connections
    )
    result, rows = run(made, engine, 1)
    assert result == (1, 0, 0)
    assert rows[0].tobytes() == np.array([-0.0, -0.0, 3.0 * -0.0 + 0.1]).tobytes()


@engines
@pytest.mark.parametrize("name", engine.ELEMENTS)
def test_numbers_of_every_type_come_through(engine, name):
    dtype = np.dtype(name)
    ends = [0, 1]
    if dtype.kind in "iu":
        info = np.iinfo(dtype)
        ends = [max(info.min, 1 - 2**53), min(info.max, 2**53 - 1)]
    elif dtype.kind == "f":
        ends = [np.float32(0.1), np.float32(-3e38)]
    source, target = np.array(ends, dtype), np.zeros(2, dtype)
    long = LOAD_LONG if dtype.itemsize == 8 else LOAD
    made = plan(
        [0.0, 0.0], [(long, 0, 2, 1, 0), (STORE, 2, 4, 1, 0)],
        casts=((0, 0, 0), (0, 1, 1), (1, 0, 0), (1, 1, 1)), buffers=(source, target),
    )  # fmt: skip
    result, rows = run(made, engine, 1)
    assert result == (1, 0, 0)
    assert rows[0].tolist() == [float(x) for x in ends]
    assert target.tobytes() == source.tobytes()


@engines
def test_any_byte_but_zero_is_true(engine):
    """As a C compiler that does not know fmi3Boolean for a bool leaves it."""
    found = np.array([0, 1, 255], np.uint8).view(np.bool_)
    casts = tuple((0, i, i) for i in range(3))
    made = plan([7.0, 7.0, 7.0], [(LOAD, 0, 3, 1, 0)], casts=casts, buffers=(found,))
    assert run(made, engine, 1)[1].tolist() == [[0.0, 1.0, 1.0]]


@engines
@pytest.mark.parametrize(("name", "value"), [("int64", -(2**53)), ("uint64", 2**64 - 1)])
def test_an_integer_that_a_float_does_not_hold_is_refused(engine, name, value):
    made = plan(
        [7.0], [(LOAD_LONG, 0, 1, 1, 0)], casts=((0, 0, 0),), buffers=(np.array([value], name),)
    )
    assert run(made, engine, 1)[0] == (0, 0, loop.TOO_LONG)
    assert made.values[0] == 7.0


@engines
def test_a_slow_operation_runs_in_its_phase_with_its_own_time(engine):
    seen = []

    def call():
        seen.append(made.clock.tolist())
        return 0

    made = plan([0.0], [(STEP, 0, 1, 3, 2)], calls=(Call(call),))
    run(made, engine, 7)
    assert seen == [[0.0, 2.0, 0.003], [0.003, 5.0, 0.006]]


@engines
def test_a_bad_status_says_where_and_the_run_can_go_on_behind_it(engine):
    statuses = iter([0, 1, 2, 0, 0])
    made = plan([0.0], [(CALL, 0, 1, 1, 0), (CALL, 1, 2, 1, 0)], calls=(
        Call(lambda: next(statuses)), Call(lambda: 0),
    ))  # fmt: skip
    assert run(made, engine, 4)[0] == (2, 0, 2)
    assert run(made, engine, 2, operation=1)[0] == (2, 0, 0)


@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
@pytest.mark.parametrize(("case", "step"), [(0, 2e-4), (1, 1e-3), (2, 1e-3)])
def test_the_grasp(grasp, case, step, scheme):
    system = grasp.with_values(CASES[case]).with_experiment(step, 0.4 if case == 0 else 2.5, scheme)
    one, two = (simulate(system, engine=engine) for engine in ("python", "compiled"))
    assert list(one) == list(two)
    assert one.time.tobytes() == two.time.tobytes()
    assert [n for n in one if one[n].tobytes() != two[n].tobytes()] == []


@engines
def test_what_a_call_raises_ends_the_run(tmp_path, engine):
    """An exception must not get lost in compiled code."""

    def output(u, t):
        if t > 0.25:
            raise SimulationError("a: enough")
        return t

    mocks = [Mock(tmp_path, "a", output, direct=False)]
    run = Run(make_system(mocks, []), mocks, engine)
    with pytest.raises(SimulationError, match="a: enough"):
        run.to_the_end()
    assert run.signals()["a.y"] == pytest.approx([0.0, 0.1, 0.2])


def test_a_value_that_is_not_finite_at_t_0_is_kept_too(tmp_path, monkeypatch):
    mock = Mock(tmp_path, "a", lambda u, t: math.nan)
    monkeypatch.setattr("grasp_cosim.master.session.load", lambda component: mock)
    with pytest.raises(SimulationError, match=r"^a\.y = nan at step 0: must be finite") as caught:
        simulate(make_system([mock], []))
    assert caught.value.result.time.tolist() == [0.0]
    assert not caught.value.result.complete
    assert mock.calls[-1] == "close"


@pytest.mark.parametrize("compiler", [True, False])
@pytest.mark.parametrize("there", [True, False])
@pytest.mark.parametrize("steps", [1, engine.LONG - 1, engine.LONG, None])
def test_auto_takes_it_where_it_is_there_and_builds_it_for_long_runs(
    monkeypatch, there, compiler, steps
):
    monkeypatch.setattr(engine, "is_there", lambda: there)
    monkeypatch.setattr(engine, "has_compiler", lambda: compiler)
    monkeypatch.setattr(engine, "CompiledLoop", lambda plan: "in C")
    found = make_loop(Plan(np.zeros(1), np.zeros(3)), "auto", steps)
    long = steps in (engine.LONG, None)
    assert (found == "in C") is (there or (long and compiler))


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty cache folder, of a process that has not loaded the loop."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    forget()
    yield tmp_path / "cache"
    forget()


def forget():
    engine.library.cache_clear()
    engine._file.cache_clear()


def kept(cache):
    return sorted(path for path in cache.rglob("*") if path.is_file())


def counts(steps=3):
    """Runs a loop of one call; how often it was made."""
    seen = []

    def call():
        seen.append(1)
        return 0

    made = Plan(np.zeros(1), np.zeros(3), [(loop.CALL, 0, 1, 1, 0)], calls=[Call(call)])
    rows = np.zeros((steps, 1))
    assert make_loop(made, "compiled")(rows, 0, 0, steps, 0, 1000, 10**9) == (steps, 0, 0)
    return len(seen)


def test_it_is_built_once_and_kept(cache, monkeypatch):
    assert not engine.is_there()
    assert counts() == 3
    (file,) = kept(cache)
    assert file.parent == cache / "grasp-cosim/compiled"
    forget()
    assert engine.is_there()
    monkeypatch.setattr(engine, "compile_all", None)
    assert counts() == 3


def test_what_was_built_from_other_constants_is_not_taken(monkeypatch):
    before = engine._job().kept_as
    monkeypatch.setattr(engine, "EARLY", 7)
    assert engine._job().kept_as != before


@pytest.mark.usefixtures("cache")
@pytest.mark.parametrize(
    ("cc", "said"),
    [
        ("false", "loop.c: false: exit code 1: no message"),
        ("nonexistent", "CC=nonexistent: no such program; must be a C compiler, or unset"),
    ],
)
def test_a_compiler_that_is_none_is_one_line_and_auto_goes_on(grasp, monkeypatch, cc, said):
    monkeypatch.setenv("CC", cc)
    with pytest.raises(InputError) as error:
        simulate(grasp, stop=1e-3, engine="compiled")
    assert str(error.value) == f"engine compiled: {said}; engine python needs no compiler"
    monkeypatch.setattr("grasp_cosim.master.engine.LONG", 1)
    assert simulate(grasp, stop=1e-3).complete


def test_it_compiles_without_warnings(tmp_path):
    strict = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-fPIC", "-shared"]
    for level in ("-O0", "-O2", "-O3"):
        macros = [f"-D{macro}" for macro in engine._constants()]
        command = [*find_compiler().command, *strict, level, *macros, engine.SOURCE]
        subprocess.run([*command, "-o", tmp_path / "loop.so"], check=True)


def calling(function, argument, keeps_lock=False):
    """A loop of one native call, function(argument) of the C library, by the shape of a step."""
    address = ctypes.cast(ctypes.CDLL(None)[function], ctypes.c_void_p).value or 0
    call = Call(lambda: 0, Native(STEP_2, address, argument), keeps_lock)
    plan = Plan(np.zeros(1), np.zeros(3), [(loop.CALL, 0, 1, 1, 0)], calls=[call])
    return make_loop(plan, "compiled")


@pytest.mark.parametrize("keeps_lock", [False, True])
def test_other_threads_run_meanwhile_unless_a_component_is_python(keeps_lock):
    run = calling("usleep", 1000, keeps_lock)
    begun, ran = threading.Event(), threading.Event()

    def other():
        begun.wait()
        ran.set()

    thread = threading.Thread(target=other)
    thread.start()
    interval = sys.getswitchinterval()
    sys.setswitchinterval(3600.0)  # only who gives the lock away loses it
    try:
        begun.set()
        for _ in range(1 if keeps_lock else 10_000):  # the other's turn comes when the system likes
            run(np.zeros((5, 1)), 0, 0, 5, 0, 1000, 10**9)
            if seen := ran.is_set():
                break
    finally:
        sys.setswitchinterval(interval)
    thread.join()
    assert seen is not keeps_lock


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_in_the_loop_is_raised_behind_it():
    run = calling("raise", signal.SIGINT)
    rows = np.zeros((5, 1))
    with pytest.raises(KeyboardInterrupt):
        run(rows, 0, 0, 5, 0, 1000, 10**9)
