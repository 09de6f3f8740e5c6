"""Python hosts in trouble: with no import path, in threads.

Each is a process of its own:  python tests/fmus/test_hard_times.py HOST FOLDER FMU...
"""

import os
import subprocess
import sys
from pathlib import Path
from threading import Thread

import pytest
from support.compiled import compile_c
from support.fmi2 import OK, Fmu, Instance
from support.marks import slow

ROUNDS = 10


def without_an_import_path(fmus):
    """The host may do as it likes with sys.path."""
    with Instance(fmus[0]) as instance:
        instance.initialise()
        path = sys.path.copy()
        sys.path.clear()
        assert instance.call("Reset") == OK
        sys.path[:] = path
        instance.initialise()
        assert instance.step(0.0, 1e-3) == OK


def in_threads(fmus):
    """Instances of different FMUs made at the same time."""

    def live(fmu):
        for _ in range(ROUNDS):
            with Instance(fmu) as instance:
                instance.initialise()
                assert instance.step(0.0, 1e-3) == OK
                finished.append(fmu.name)

    finished = []
    before = sys.path.copy()
    threads = [Thread(target=live, args=(fmu,)) for fmu in fmus]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(finished) == ROUNDS * len(fmus)
    assert sys.path == before


HOSTS = {host.__name__: host for host in (without_an_import_path, in_threads)}


@pytest.mark.parametrize("host", [slow(h) if h == "in_threads" else h for h in HOSTS])
def test_the_host_lives(fmus, tmp_path, host):
    """With every other FMU, one of each room; the threads with all."""
    hosted(host, tmp_path, sorted(fmus.glob("*.fmu"))[:: 1 if host == "in_threads" else 2])


def test_binaries_let_go_of_python_before_the_process_ends(tmp_path):
    """pythonfmu 0.7.0 alone does that twice then, the second time in memory that was freed."""
    source, library = tmp_path / "let_go.c", tmp_path / "let_go.so"
    source.write_text(
        "#include <stdio.h>\n"
        'void finalizePythonInterpreter(void) { puts("let go"); fflush(stdout); }\n'
    )
    compile_c(["gcc", "-shared", "-fPIC", source], library)
    program = (
        "import ctypes, sys; from grasp_fmus import slave; ctypes.CDLL(sys.argv[1]);"
        "slave._binaries |= {sys.argv[1], '/no/such.so'}"
    )
    done = subprocess.run([sys.executable, "-c", program, library], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "let go\n", "")


def test_threads_live_with_native_fmus_too(natives, tmp_path):
    hosted("in_threads", tmp_path, sorted(natives.glob("*.fmu")))


def hosted(host, folder, fmus):
    """It ends in peace."""
    done = subprocess.run(
        [sys.executable, __file__, host, folder, *fmus],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")


if __name__ == "__main__":
    name, folder, *paths = sys.argv[1:]
    HOSTS[name]([Fmu(Path(path), Path(folder, Path(path).stem)) for path in paths])
