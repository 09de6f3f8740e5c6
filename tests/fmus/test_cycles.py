"""A thousand instances come and go, and leave nothing behind in the process.

Measured in a process of its own:  python tests/fmus/test_cycles.py FMU FOLDER
"""

import ctypes
import gc
import json
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path

import pytest
from support.fmi2 import OK, Fmu, Instance
from support.kinds import all_kinds

NAMES = ("GraspController", "GraspControllerAdaptive", "GripperPlant", "ProximitySensor")
"""The other plants are GripperPlant's adapter with arithmetic that keeps nothing."""

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


def cycle(fmu, k):
    """A life, of a kind that depends on k; a free without a terminate is allowed as well."""
    with Instance(fmu, f"instance {k % 10}") as instance:
        live(instance)
        ACTS[k % len(ACTS)](instance)
        if k % 3:
            assert instance.call("Terminate") == OK


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


def main(fmu, folder):
    """Prints what there was after BEFORE and after all cycles; two copies of the FMU take turns."""
    mallinfo = ctypes.CDLL(None).mallinfo2
    mallinfo.restype = _Malloc
    fmus = [Fmu(Path(fmu), Path(folder, name)) for name in "ab"]
    at = []
    for k in range(CYCLES):
        if k == BEFORE:
            at.append(json.dumps(process(mallinfo)))  # as one object, not to be counted itself
        cycle(fmus[k // len(ACTS) % 2], k)
    at.append(json.dumps(process(mallinfo)))
    json.dump([*map(json.loads, at)], sys.stdout)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux and glibc")
@all_kinds
@pytest.mark.parametrize("name", NAMES)
def test_a_thousand_instances_leave_nothing_behind(folder_of, kind, tmp_path, name):
    done = subprocess.run(
        [sys.executable, __file__, folder_of(kind) / f"{name}.fmu", tmp_path],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
        capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    before, after = json.loads(done.stdout)
    assert after["known"] == before["known"]
    resources = {str(tmp_path / copy / "resources") for copy in "ab"}
    assert not resources & {*after["known"][0], *after["known"][2]}
    grown = Counter(after["objects"])
    grown.subtract(before["objects"])
    assert {kind: n for kind, n in grown.items() if n > LOOSE} == {}
    cycles = CYCLES - BEFORE
    assert after["blocks"] - before["blocks"] < BLOCKS.get(kind, 0.5) * cycles
    assert after["malloc"] - before["malloc"] < KEPT * cycles


if __name__ == "__main__":
    main(*sys.argv[1:])
