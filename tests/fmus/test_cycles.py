"""A thousand instances come and go, and leave nothing behind in the process.

Measured in a process of its own:  python tests/fmus/test_cycles.py FMU FOLDER
"""

import atexit
import ctypes
import gc
import json
import os
import subprocess
import sys
from collections import Counter
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from conftest import Folder
from support.fmi2 import OK, Fmu, Instance
from support.kinds import Kind, all_kinds
from support.packages import skip_where_it_cannot_run

NAMES = (
    "GraspController", "GraspControllerAdaptive", "GripperPlant", "GripperPlantMuJoCo",
    "ProximitySensor",
)  # fmt: skip
"""The other plants are GripperPlant's adapter with arithmetic that keeps nothing."""

BEFORE, CYCLES = 500, 1500
"""The first cycles fill caches; growth is counted from there to the last."""

WARM, CALLS = 100, 500
"""Calls of every kind, in one instance."""

BLOCKS = 0.5
"""Of Python's memory that a cycle may keep; the smallest leak takes one."""

LOOSE = 40
"""Objects of one type that may have come, by chance, in any process."""

KEPT = 100
"""Bytes a cycle that malloc has given out and not got back: all that is not Python's, 0 to 15."""

RESIDENT = 1e6
"""Bytes: a megabyte is what Python takes at a time."""


class _Malloc(ctypes.Structure):
    """What glibc says of its heap: mallinfo2."""

    _fields_ = tuple(
        (name, ctypes.c_size_t)
        for name in (
            "arena", "ordblks", "smblks", "hblks", "hblkhd",
            "usmblks", "fsmblks", "uordblks", "fordblks", "keepcost",
        )
    )  # fmt: skip


def live(instance: Instance) -> None:
    """From instantiation or reset into step mode."""
    instance.initialise()
    first = instance.fmu.names("input")[0]
    for k in range(3):
        assert instance.set({first: 0.01 * k}) == OK
        assert instance.step(k * 1e-3, 1e-3) == OK
        instance.outputs()


def states(instance: Instance) -> None:
    """Save, serialise, restore."""
    state = instance.state()
    status, copy = instance.from_bytes(state.to_bytes())
    assert (status, instance.restore(copy), instance.restore(state)) == (OK, OK, OK)
    state.free()
    copy.free()


def refused(instance: Instance) -> None:
    """Calls that are refused, each with its message."""
    assert instance.set_real([4711], [0.0]) == instance.fmu.refused
    assert instance.step(5.0, 1e-3) == instance.fmu.refused
    assert instance.enter() == instance.fmu.refused
    instance.log.clear()


def damaged(instance: Instance) -> None:
    """Bytes that are no state."""
    assert instance.from_bytes(b"nonsense")[0] == instance.fmu.refused
    instance.log.clear()


def reset(instance: Instance) -> None:
    assert instance.call("Reset") == OK
    live(instance)


KINDS: dict[str, Callable[[Instance], None]] = {
    "states": states,
    "refused": refused,
    "damaged": damaged,
    "reset": reset,
}


def cycle(fmu: Fmu, k: int) -> None:
    """A life, of a kind that depends on k; a free without a terminate is allowed as well."""
    with Instance(fmu, f"instance {k % 10}") as instance:
        live(instance)
        for act in list(KINDS.values())[k % 5 : k % 5 + 1]:
            act(instance)
        if k % 3:
            assert instance.call("Terminate") == OK


@cache
def _mallinfo() -> Callable[[], Any]:
    """Loaded once: each loading makes a class, for which Python's own tables grow at times."""
    function = ctypes.CDLL(None).mallinfo2
    function.restype = _Malloc
    return function


def memory() -> dict[str, int]:
    """What Python's own objects and malloc hold."""
    gc.collect()
    malloc = _mallinfo()()
    return {"blocks": sys.getallocatedblocks(), "malloc": malloc.uordblks + malloc.hblkhd}


def process() -> dict[str, Any]:
    """What there is in this process."""
    held = memory()
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return {
        "sys.path": list(sys.path),
        "sys.modules": sorted(sys.modules),
        "sys.path_importer_cache": sorted(sys.path_importer_cache),
        "atexit": atexit._ncallbacks(),
        "objects": Counter(f"{type(o).__module__}.{type(o).__name__}" for o in gc.get_objects()),
        "resident": pages * os.sysconf("SC_PAGE_SIZE"),
        **held,
    }


def main(fmu: str, folder: str) -> None:
    """Prints what there was after BEFORE and after all cycles; two copies of the FMU take turns.

    Then what one instance adds by CALLS calls of every kind.
    """
    fmus = [Fmu(Path(fmu), Path(folder, name)) for name in "ab"]
    at: list[str] = []
    for k in range(CYCLES):
        if k == BEFORE:
            at.append(json.dumps(process()))  # as one object, not to be counted itself
        cycle(fmus[k // 5 % 2], k)
    at.append(json.dumps(process()))
    added = {}
    with Instance(fmus[0]) as instance:
        live(instance)
        for name, act in KINDS.items():
            for k in range(CALLS + WARM):
                if k == WARM:
                    before = memory()
                act(instance)
            after = memory()
            added[name] = {key: after[key] - before[key] for key in after}
    json.dump((*map(json.loads, at), added), sys.stdout)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="asks Linux and glibc")
@all_kinds
@pytest.mark.parametrize("name", NAMES)
def test_a_thousand_instances_leave_nothing_behind(
    folder_of: Folder, kind: Kind, tmp_path: Path, name: str
) -> None:
    skip_where_it_cannot_run(name)
    done = subprocess.run(
        [sys.executable, __file__, folder_of(kind) / f"{name}.fmu", tmp_path],
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
        capture_output=True, text=True,
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    before, after, added = json.loads(done.stdout)
    for key in ("sys.path", "sys.modules", "sys.path_importer_cache", "atexit"):
        assert after[key] == before[key]
    ours = {str(tmp_path / folder / "resources") for folder in "ab"}
    assert not ours & {*after["sys.path"], *after["sys.path_importer_cache"]}
    grown = Counter(after["objects"])
    grown.subtract(before["objects"])
    cycles = CYCLES - BEFORE
    assert {kind: n for kind, n in grown.items() if n > LOOSE} == {}
    assert after["blocks"] - before["blocks"] < BLOCKS * cycles
    assert after["malloc"] - before["malloc"] < KEPT * cycles
    assert after["resident"] - before["resident"] < RESIDENT
    assert {kind: n for kind, n in added.items() if max(n.values()) > CALLS / 2} == {}


if __name__ == "__main__":
    main(*sys.argv[1:])
