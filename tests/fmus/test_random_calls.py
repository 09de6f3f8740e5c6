"""Whatever a host calls, with whatever: no FMU ends its process, takes long, or keeps memory.

random_calls.py makes the calls, in a process of its own; what a refused call does is in test_fuzz.
"""

import json
import os
import subprocess
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
from conftest import Folder
from grasp_cosim.hil.served import Service
from support import campaign
from support.kinds import Kind, all_kinds
from support.packages import runnable
from support.proxies import build_proxy, serving
from support.slow import platforms

CALLER = Path(__file__).with_name("random_calls.py")

LONGEST = 10.0
"""s of the processor that a call may take."""

GROWTH = 4e6
"""Bytes by which the process may grow over the second half of ten seeds or more."""


def called(folder: Path, seeds: range, calls: int, fmus: Sequence[Path]) -> dict[str, Any]:
    """What random_calls.py reports."""
    folder.mkdir()
    done = subprocess.run(
        [sys.executable, CALLER, folder, *map(str, (seeds[0], len(seeds), calls)), *fmus],
        cwd=folder, env={**os.environ, "PYTHONPATH": str(CALLER.parents[1])},
        capture_output=True, text=True, timeout=1800,
    )  # fmt: skip
    last = folder / "last"
    assert done.returncode == 0, f"{last.read_text()}\n{done.stderr}"
    report: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    assert report["longest"][0] < LONGEST, report["longest"]
    statuses = {name.rpartition(" ")[2] for name in report["calls"]}
    assert statuses <= {"", "0", "2", "3"}  # neither a warning nor fatal
    assert min(report["calls"][f"{name} 0"] for name in ("DoStep", "SetReal")) > 0
    if len(seeds) >= 10:
        memory = report["memory"]
        assert memory[-1] - memory[len(seeds) // 2] < GROWTH, memory
    return report


a_campaign = [pytest.mark.slow, pytest.mark.campaign]


@all_kinds
@pytest.mark.parametrize(
    ("seeds", "calls"),
    [(range(1), 100), pytest.param(campaign.seeds(120), 800, marks=a_campaign)],
    ids=["few", "many"],
)
def test_the_fmus_live(
    folder_of: Folder, kind: Kind, tmp_path: Path, seeds: range, calls: int
) -> None:
    report = called(tmp_path / "host", seeds, calls, runnable(folder_of(kind)))
    for name in ("SetFMUstate", "DeSerializeFMUstate"):
        assert report["calls"][f"{name} 0"] > 0
        assert report["calls"][f"{name} 3"] > 0


@pytest.mark.slow
@pytest.mark.parametrize("fmi", ["2", platforms("3")])
@pytest.mark.parametrize(
    ("seeds", "calls"),
    [(range(1), 60), pytest.param(campaign.seeds(100), 250, marks=a_campaign)],
    ids=["few", "many"],
)
def test_proxies_live(fmus: Path, fmi: str, tmp_path: Path, seeds: range, calls: int) -> None:
    """With a peer, and one without."""
    with ExitStack() as stack:
        proxies = []
        for name in ("GripperPlant", "ProximitySensor"):
            fmu = fmus / f"{name}.fmu"
            port = stack.enter_context(serving(fmu, Service(lockstep=True))).port_socket
            proxy = tmp_path / f"{name}Proxy.fmu"
            proxies.append(build_proxy(fmu, proxy, port.getsockname()[1], "--fmi", fmi))
        alone = tmp_path / "Alone.fmu"
        proxies.append(build_proxy(fmus / "GraspController.fmu", alone, 9, "--fmi", fmi))
        called(tmp_path / "host", seeds, calls, proxies)
