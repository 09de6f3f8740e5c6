"""Commands ended at random moments: nothing torn, nothing mixed, and the same command goes on."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim.recording.load import load_run
from grasp_cosim.scratch import PREFIX
from support.native_fmus import build, needs_gcc

pytestmark = [needs_gcc, pytest.mark.slow, pytest.mark.usefixtures("ctrl_c")]

HOW = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
ENDS = {-signal.SIGKILL, -signal.SIGTERM, -signal.SIGINT, 130, 143, 0}
"""A signal that comes before a command has begun ends it as it does any process."""

ROUNDS = int(os.environ.get("KILLS", "8"))
"""So many of each signal."""


def system_file(folder: Path) -> Path:
    """A native FMU alone, x = gain t."""
    fmu = build(folder, "native", "2.0")
    path = folder / "system.toml"
    path.write_text(
        f'[experiment]\nstep = 0.001\nstop = 40.0\n[components.a]\nfmu = "{fmu.name}"\n'
        "values = { u_Real = 1.0, u_Integer = 0, u_Enumeration = 1, u_Boolean = false, "
        'u_String = "" }\n'
    )
    return path


def command(folder: Path, *arguments: str) -> subprocess.Popen[bytes]:
    (folder / "tmp").mkdir(exist_ok=True)
    return subprocess.Popen(
        [sys.executable, "-m", "grasp_cosim", *arguments],
        cwd=folder,
        env={**os.environ, "TMPDIR": str(folder / "tmp")},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        start_new_session=True,
    )


def ended(process: subprocess.Popen[bytes], how: int, after: float) -> int:
    """The exit code of a command that gets a signal after so many s, unless it has ended."""
    try:
        return process.wait(after)
    except subprocess.TimeoutExpired:
        process.send_signal(how)
        return process.wait(60)


def check(folder: Path) -> None:
    """All in the folder is of one run, if there is a run at all."""
    if not (folder / "run.json").exists():
        assert not list(folder.glob("*.html"))
        return
    run = load_run(folder)
    gain = run.settings["components"]["a"]["values"]["gain"]
    assert run["a.x"] == pytest.approx(gain * run.time, rel=1e-9, abs=1e-9)
    assert np.array_equal(run.time, np.arange(len(run.time)) / 1000)
    if (folder / "report.html").exists():
        assert f"gain = {gain:g}" in (folder / "report.html").read_text("utf-8")


def test_runs_and_reports(tmp_path: Path) -> None:
    """Each with another gain, into one folder; every other time a report is made of it."""
    generator, out = random.Random(14), tmp_path / "out"
    system, seen = str(system_file(tmp_path)), set()
    start = time.monotonic()
    run = command(tmp_path, "run", system, "--out", "out", "--set", "a.gain=0.5")
    assert run.wait(120) == 0
    whole = time.monotonic() - start
    for k, how in enumerate(HOW * ROUNDS):
        words = (
            ("report", "out")
            if k % 4 == 3
            else ("run", system, "--out", "out", "--set", f"a.gain={k + 1}")
        )
        if words[0] == "report" and not (out / "run.json").exists():
            continue
        code = ended(command(tmp_path, *words), how, generator.uniform(0.0, 1.2 * whole))
        seen.add(code)
        assert code in ENDS, words
        check(out)
    assert len(seen) > 2
    assert command(tmp_path, "run", system, "--out", "out", "--set", "a.gain=2").wait(120) == 0
    check(out)
    assert sorted(p.name for p in out.iterdir()) == ["run.json", "signals.csv"]
    assert json.loads((out / "run.json").read_text())["complete"]
    assert not [p.name for p in (tmp_path / "tmp").iterdir() if p.name.startswith(PREFIX)]
