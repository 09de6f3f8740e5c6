"""Whatever a host calls, with whatever: no FMU ends its process, takes long, or keeps memory.

random_calls.py makes the calls, in a process of its own; what a refused call does is in test_fuzz.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from grasp_cosim.hil.served import Service
from support import campaign
from support.kinds import all_kinds
from support.proxies import build_proxy, serving

CALLER = Path(__file__).with_name("random_calls.py")

LONGEST = 10.0
"""s of the processor that a call may take."""

GROWTH = 4e6
"""Bytes by which the process may grow over the second half of ten seeds or more."""


def called(folder, seeds, calls, fmus, statuses):
    """The calls by name and status; nothing else than these statuses may come of them."""
    folder.mkdir()
    done = subprocess.run(
        [sys.executable, CALLER, folder, *map(str, (seeds[0], len(seeds), calls)), *fmus],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(CALLER.parents[1])},
        capture_output=True, text=True, timeout=1800,
    )  # fmt: skip
    last = folder / "last"
    assert done.returncode == 0, f"{last.read_text()}\n{done.stderr}"
    report = json.loads(done.stdout.splitlines()[-1])
    assert report["longest"][0] < LONGEST, report["longest"]
    assert {name.rpartition(" ")[2] for name in report["calls"]} <= {"", *statuses}
    assert min(report["calls"][f"{name} 0"] for name in ("DoStep", "SetReal")) > 0
    memory = report["memory"]
    assert len(seeds) < 10 or memory[-1] - memory[len(seeds) // 2] < GROWTH, memory
    return dict(report["calls"])


SIZES = pytest.mark.parametrize(
    ("seeds", "calls"),
    [
        (range(1), 100),
        pytest.param(campaign.seeds(100), 800, marks=[pytest.mark.slow, pytest.mark.campaign]),
    ],
    ids=["few", "many"],
)


@all_kinds
@SIZES
def test_the_fmus_live(folder_of, kind, tmp_path, seeds, calls):
    """pythonfmu answers fmi2Fatal for what a slave refuses; a native one has no such."""
    refused = "4" if kind == "python" else "3"
    made = sorted(folder_of(kind).glob("*.fmu"))
    done = called(tmp_path / "host", seeds, calls, made, "034" if kind == "python" else "023")
    for name in ("SetFMUstate", "DeSerializeFMUstate"):
        assert done[f"{name} 0"] > 0
        assert done[f"{name} {refused}"] > 0


@pytest.mark.slow
@SIZES
def test_proxies_live(fmus, tmp_path, seeds, calls):
    """With a peer, and one without."""
    fmu = fmus / "GripperPlant.fmu"
    with serving(fmu, Service(lockstep=True)) as server:
        proxies = [
            build_proxy(fmu, tmp_path / f"{name}.fmu", port)
            for name, port in (("Bench", server.address[1]), ("Alone", 9))
        ]
        called(tmp_path / "host", seeds, min(calls, 250), proxies, "0123")
