"""The loop in C: built at the first need, kept, shared by processes; Python's lock, Ctrl-C."""

import ctypes
import signal
import subprocess
import sys
import threading

import numpy as np
import pytest
from c_compilers import find_compiler
from grasp_cosim import InputError, simulate
from grasp_cosim.base.calls import STEP_2, Call, Native
from grasp_cosim.master import engine, loop
from grasp_cosim.master.engine import make_loop
from grasp_cosim.master.plan import Plan
from support.marks import needs_compiler

pytestmark = needs_compiler


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

    made = Plan(np.zeros(1), np.zeros(2), [(loop.CALL, 0, 1, 1, 0)], calls=[Call(call)])
    rows = np.zeros((steps, 1))
    assert make_loop(made, "compiled")(rows, 0, 0, steps, 0, 1000) == (steps, 0, 0)
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


@pytest.mark.slow
def test_processes_that_build_it_at_once_all_run(cache):
    code = (
        "from grasp_cosim.master import engine; import sys; sys.stdin.read(1)\n"
        "print(engine.library(True).run.argtypes is not None, engine.is_there())"
    )
    started = [
        subprocess.Popen([sys.executable, "-c", code], stdin=-1, stdout=-1, stderr=-1, text=True)
        for _ in range(4)
    ]
    for process in started:
        assert process.stdin
        process.stdin.write("\n")
        process.stdin.flush()
    assert [p.communicate() for p in started] == [("True True\n", "")] * 4
    assert [path.suffix for path in kept(cache)] == [".so"]


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
    plan = Plan(np.zeros(1), np.zeros(2), [(loop.CALL, 0, 1, 1, 0)], calls=[call])
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
            run(np.zeros((5, 1)), 0, 0, 5, 0, 1000)
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
        run(rows, 0, 0, 5, 0, 1000)
