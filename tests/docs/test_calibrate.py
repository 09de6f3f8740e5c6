"""The session of docs/how_to/calibrate.md: pyXCP measures and calibrates the controller.

What it measures is what the run recorded, to the bit; the gain acts from the next step on.
"""

import csv
import importlib
import re
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import grasp_system, load_run, simulate
from grasp_cosim.system.parts import Event, Port
from support.native_fmus import needs_gcc
from support.processes import kept_port

ROOT = Path(__file__).parents[2]
SIGNALS = ("force[1]", "force[2]", "simultaneous_contact_force")
GAIN = "simultaneous_contact.gain"

pytestmark = [needs_gcc, pytest.mark.slow]


def dropped():
    """Datagrams that the kernel has dropped on this machine, as a program was too slow for them."""
    lines = Path("/proc/net/snmp").read_text().splitlines()
    names, numbers = (line.split() for line in lines if line.startswith("Udp:"))
    return int(numbers[names.index("RcvbufErrors")])


@pytest.fixture
def session(checkout, monkeypatch):
    """Runs the commands of the page, with more options of the run."""
    pytest.importorskip("pyxcp")
    monkeypatch.syspath_prepend(ROOT / "docs")
    runner = importlib.import_module("calibration_picture")
    with kept_port() as target, kept_port() as slave:
        ports = {"target": str(target), "slave": str(slave)}
        yield lambda *more: runner.session(Path(), ports, more)


def test_a_minute_is_measured_and_calibrated(session):
    before = dropped()
    said = session("--stop", "60")
    assert re.search(rf"^set {re.escape(GAIN)} to 6\.0$", said, re.MULTILINE)
    with Path("measured.csv").open() as file:
        head, *rows = csv.reader(file)
    columns = dict(zip(head, np.array(rows, float).T, strict=True))
    steps = np.rint(columns["time in us"] / 1000).astype(int)
    run = load_run("calibrated")
    missing = sum(b - a - 1 for a, b in pairwise(steps) if b > a + 1)
    assert missing <= dropped() - before  # none, where nothing was too slow
    assert len({*steps}) + missing == 60001
    started = int(np.argmax(steps > 0))  # before it, the beginning, which may be worked out twice
    for name in SIGNALS:
        recorded = run[f"controller.{name}"][steps]
        assert columns[name][started:].tobytes() == recorded[started:].tobytes()
    changed = int(steps[np.argmax(columns[GAIN] == 6.0)])
    assert 1000 < changed < 60000
    # it acts in that step, as an event does at the beginning of it
    event = Event({Port("controller", GAIN): 6.0}, at_ns=(changed - 1) * 10**6)
    same = simulate(replace(grasp_system(), events=(event,)), step=1e-3, stop=60.0)
    for name in SIGNALS:
        assert same[f"controller.{name}"].tobytes() == run[f"controller.{name}"].tobytes()
