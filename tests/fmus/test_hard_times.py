"""Hosts in trouble: with no import path, in threads, with a thousand lives of instances.

Each is a process of its own:  python tests/fmus/test_hard_times.py HOST FOLDER FMU...
"""

import ctypes
import gc
import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path
from threading import Thread

import pytest
from support.compiled import compile_c
from support.fmi2 import OK, Fmu, Instance
from support.kinds import all_kinds
from support.marks import slow

ROUNDS = 10

BEFORE, CYCLES = 500, 1500
"""The first cycles fill caches; growth is counted from there to the last."""

BLOCKS = {"python": 2.0}
"""Of Python's memory that a cycle may keep: pythonfmu keeps the path that it puts on sys.path, and
bytes that were refused. Else 0.5, as the smallest leak takes one.
"""

LOOSE = 40
"""Objects of one type that may have come, by chance, in any process."""

KEPT = 100
"""Bytes a cycle that malloc has given out and not got back: all that is not Python's, 0 to 15."""


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


class _Malloc(ctypes.Structure):
    """What glibc says of its heap: mallinfo2."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            "arena", "ordblks", "smblks", "hblks", "hblkhd",
            "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost",
        )
    )  # fmt: skip


def live(instance):
    """From instantiation or reset into step mode."""
    instance.initialise()
    first = instance.fmu.names("input")[0]
    for k in range(3):
        assert instance.set({first: 0.01 * k}) == OK
        assert instance.step(k * 1e-3, 1e-3) == OK
        instance.outputs()


def states(instance):
    """Save, serialise, restore."""
    state = instance.state()
    status, copy = instance.from_bytes(state.to_bytes())
    assert (status, instance.restore(copy), instance.restore(state)) == (OK, OK, OK)
    state.free()
    copy.free()


def refused(instance):
    """Calls that are refused, each with its message."""
    assert instance.set_real([4711], [0.0]) == instance.fmu.refused
    assert instance.step(5.0, 1e-3) == instance.fmu.refused
    assert instance.enter() == instance.fmu.refused
    assert instance.from_bytes(b"nonsense")[0] == instance.fmu.refused
    instance.log.clear()


def reset(instance):
    assert instance.call("Reset") == OK
    live(instance)


ACTS = [states, refused, reset, lambda _: None]


def process(mallinfo):
    """What there is in this process."""
    gc.collect()
    malloc = mallinfo()
    return {
        "blocks": sys.getallocatedblocks(),
        "malloc": malloc.uordblks + malloc.hblkhd,
        "known": [sys.path, sorted(sys.modules), sorted(sys.path_importer_cache)],
        "objects": Counter(f"{type(o).__module__}.{type(o).__name__}" for o in gc.get_objects()),
    }


def cycles(fmus):
    """Prints what there was after BEFORE and after all lives, of a kind that depends on k."""
    mallinfo = ctypes.CDLL(None).mallinfo2
    mallinfo.restype = _Malloc
    at = []
    for k in range(CYCLES):
        if k == BEFORE:
            at.append(json.dumps(process(mallinfo)))  # as one object, not to be counted itself
        with Instance(fmus[k // len(ACTS) % 2], f"instance {k % 10}") as instance:
            live(instance)
            ACTS[k % len(ACTS)](instance)
            if k % 3:  # a free without a terminate is allowed as well
                assert instance.call("Terminate") == OK
    sys.stdout.write("\n".join([*at, json.dumps(process(mallinfo))]))


HOSTS = {host.__name__: host for host in (without_an_import_path, in_threads, cycles)}


def hosted(host, folder, fmus):
    """It ends in peace; what it says."""
    done = subprocess.run(
        [sys.executable, __file__, host, folder, *fmus],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
        capture_output=True, text=True, timeout=300,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


@pytest.mark.parametrize("host", ["without_an_import_path", slow("in_threads")])
def test_the_host_lives(fmus, tmp_path, host):
    """With every other FMU, one of each room; the threads with all."""
    hosted(host, tmp_path, sorted(fmus.glob("*.fmu"))[:: 1 if host == "in_threads" else 2])


def test_threads_live_with_native_fmus_too(natives, tmp_path):
    hosted("in_threads", tmp_path, sorted(natives.glob("*.fmu")))


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux and glibc")
@all_kinds
@pytest.mark.parametrize(
    "name", ["GraspController", "GraspControllerAdaptive", "GripperPlant", "ProximitySensor"]
)
def test_a_thousand_instances_leave_nothing_behind(folder_of, kind, tmp_path, name):
    """Two copies of an FMU take turns. Of the other plants only the arithmetic differs."""
    fmu = folder_of(kind) / f"{name}.fmu"
    before, after = map(json.loads, hosted("cycles", tmp_path, [fmu, fmu]).splitlines())
    assert after["known"] == before["known"]
    resources = {str(tmp_path / copy / "resources") for copy in "01"}
    assert not resources & {*after["known"][0], *after["known"][2]}
    grown = Counter(after["objects"])
    grown.subtract(before["objects"])
    assert {kind: n for kind, n in grown.items() if n > LOOSE} == {}
    counted = CYCLES - BEFORE
    assert after["blocks"] - before["blocks"] < BLOCKS.get(kind, 0.5) * counted
    assert after["malloc"] - before["malloc"] < KEPT * counted


def test_binaries_let_go_of_python_before_the_process_ends(tmp_path):
    """pythonfmu 0.7.0 alone does that twice then, the second time in memory that was freed.

    Hosts have removed the file by then.
    """
    source, library = tmp_path / "let_go.c", tmp_path / "let_go.so"
    source.write_text(
        "#include <stdio.h>\n"
        'void finalizePythonInterpreter(void) { puts("let go"); fflush(stdout); }\n'
    )
    compile_c(["gcc", "-shared", "-fPIC", source], library)
    program = (
        "import ctypes, sys; from grasp_cosim.fmu_export import slave; ctypes.CDLL(sys.argv[1]);"
        "slave._binaries |= {sys.argv[1], '/no/such.so'};"
        "import os; os.unlink(sys.argv[1])"
    )
    done = subprocess.run([sys.executable, "-c", program, library], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (0, "let go\n", "")


if __name__ == "__main__":
    name, folder, *paths = sys.argv[1:]
    HOSTS[name]([Fmu(Path(path), Path(folder, str(i))) for i, path in enumerate(paths)])
