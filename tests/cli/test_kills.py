"""Commands ended at random moments: nothing torn, nothing mixed, and the same command goes on."""

import json
import os
import random
import signal
import subprocess
import sys
import time
import zipfile
from collections import Counter
from dataclasses import dataclass, field
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim.base.scratch import sweep
from grasp_cosim.recording.load import load_run
from support import campaign
from support.native_fmus import build, needs_gcc

pytestmark = [
    needs_gcc,
    pytest.mark.slow,
    pytest.mark.campaign,
    pytest.mark.usefixtures("ctrl_c"),
]

HOW = (signal.SIGKILL, signal.SIGTERM, signal.SIGINT)
ENDS = {-signal.SIGKILL, -signal.SIGTERM, -signal.SIGINT, 130, 143, 0}
"""A signal that comes before a command has begun ends it as it does any process."""

ROUNDS = campaign.part(20)
"""So many of each signal."""

LIMIT = 20
"""Rounds more in which none came before the command had ended: then something is wrong."""

ORPHANED = 60.0
"""s after which no process of a command that has ended may be there."""


@dataclass
class Rounds:
    """Starts a command again and again in a folder, and ends it at random moments."""

    folder: Path
    chance: random.Random = field(default_factory=lambda: random.Random(campaign.first_seed))
    came: Counter[int] = field(default_factory=Counter)
    """How often each signal came before the command had ended."""
    whole: float = 0.0
    """The longest moment, in s: what the last one took that no signal ended."""

    def signals(self):
        """ROUNDS of each, and more until each has come in time."""
        yield from HOW * ROUNDS
        for how in HOW * LIMIT:
            if not self.came[how]:
                yield how
        assert all(self.came[how] for how in HOW), self.came

    def start(self, *words: str):
        """Start a command with a TMPDIR of its own, which all its processes know."""
        self.scratch = self.folder / f"scratch{time.monotonic_ns()}"
        self.scratch.mkdir()
        return subprocess.Popen(
            [sys.executable, "-m", "grasp_cosim", *words],
            cwd=self.folder,
            env={**os.environ, "TMPDIR": str(self.scratch)},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )

    def done(self, *words: str):
        """Let a command do all it does, and take the time that it takes."""
        began = time.monotonic()
        assert self.start(*words).wait(300) == 0
        self.whole = time.monotonic() - began
        self.nothing_left()

    def ended(self, how, *words):
        """The exit code of a command that gets a signal at a random moment, unless it has ended."""
        began = time.monotonic()
        process = self.start(*words)
        try:
            code = process.wait(self.chance.uniform(0.0, self.whole))
            self.whole = time.monotonic() - began
        except subprocess.TimeoutExpired:
            process.send_signal(how)
            code = process.wait(60)
        self.came[how] += code != 0
        assert code in ENDS, words
        self.nothing_left()
        return code

    def nothing_left(self):
        """No process goes on; after what the next start does first, there is no folder."""
        deadline = time.monotonic() + ORPHANED
        while orphans := going_on(f"TMPDIR={self.scratch}".encode()):
            assert time.monotonic() < deadline, orphans
            time.sleep(0.02)
        sweep.__wrapped__(str(self.scratch))
        self.scratch.rmdir()


def going_on(mark):
    """The command lines of processes with this in their environment."""
    found = []
    for process in Path("/proc").glob("[0-9]*"):
        try:
            if mark in (process / "environ").read_bytes().split(b"\0"):
                found.append((process / "cmdline").read_text())
        except OSError:  # of another user, or it has ended
            continue
    return found


def contents(folder):
    """The files in a folder, which need not be there."""
    return {p.name: p.read_bytes() for p in folder.glob("*") if p.is_file()}


def whole_files(folder):
    """The names of the files there, but those of temporary ones."""
    return {name for name in contents(folder) if not name.endswith(".part")}


@pytest.fixture
def built(fmus, tmp_path):
    """The FMUs are where a command looks for them."""
    (tmp_path / "fmus").mkdir()
    (tmp_path / "fmus/build").symlink_to(fmus)


def system_file(folder):
    """A native FMU alone, x = gain t."""
    fmu = build(folder, "native", "2.0")
    path = folder / "system.toml"
    path.write_text(
        f'[experiment]\nstep = 0.001\nstop = 10.0\n[components.a]\nfmu = "{fmu.name}"\n'
        "values = { u_Real = 1.0, u_Integer = 0, u_Enumeration = 1, u_Boolean = false, "
        'u_String = "" }\n'
    )
    return path


def check_run(folder):
    """All in the folder is of one run, if there is a run at all."""
    if not (folder / "run.json").exists():
        assert not list(folder.glob("*.html"))
        return
    run = load_run(folder)
    gain = run.settings["components"]["a"]["values"]["gain"]
    assert np.allclose(run["a.x"], gain * run.time, rtol=1e-9, atol=1e-9)
    assert np.array_equal(run.time, np.arange(len(run.time)) / 1000)
    if (folder / "report.html").exists():
        assert f"gain = {gain:g}" in (folder / "report.html").read_text("utf-8")


def test_run(tmp_path):
    """Each with another gain, into one folder, that of the last has been reported at times."""
    rounds, out, system = Rounds(tmp_path), tmp_path / "out", str(system_file(tmp_path))

    def run(gain):
        return ("run", system, "--out", "out", "--set", f"a.gain={gain}")

    rounds.done(*run(0.5))
    for k, how in enumerate(rounds.signals()):
        if k % 5 == 4:
            assert rounds.start("report", "out").wait(60) in (0, 2)  # 2 where there is no run
        rounds.ended(how, *run(k + 1))
        check_run(out)
    rounds.done(*run(2))
    check_run(out)
    assert set(contents(out)) == {"run.json", "signals.csv"}
    assert json.loads((out / "run.json").read_text())["complete"]


def test_report(tmp_path, built):
    """The page and its picture are as those that nobody has disturbed, or there are none."""
    rounds, out = Rounds(tmp_path), tmp_path / "out"
    rounds.done("run", "--stop", "0.3", "--out", "out")
    rounds.done("report", "out")
    made = contents(out)
    assert set(made) == {"run.json", "signals.csv", "report.html", "grasp.png"}
    for k, how in enumerate(rounds.signals()):
        if k % 2:
            for name in ("report.html", "grasp.png"):
                (out / name).unlink(missing_ok=True)
        rounds.ended(how, "report", "out")
        assert all(made[name] == (out / name).read_bytes() for name in whole_files(out))
    rounds.done("report", "out")
    assert contents(out) == made


def test_sweep(tmp_path, built):
    """No finished run is lost or done again, and the last start comes to the same table."""
    rows = "plant.initial_object_position=-0.04:0.04:6"
    words = ("sweep", "--vary", rows, "--step", "1e-3", "--stop", "0.3", "--workers", "2", "--out")
    rounds, table, kept = Rounds(tmp_path), tmp_path / "out.csv", b""
    rounds.done(*words, "whole.csv")
    made = (tmp_path / "whole.csv").read_bytes()
    beside = tmp_path / "out.csv.rows"
    for how in rounds.signals():
        code = rounds.ended(how, *words, "out.csv")
        now = beside.read_bytes().rpartition(b"\n")[0] if beside.exists() else b""
        assert code or (table.exists() and not beside.exists())
        assert table.exists() or now.startswith(kept)
        if table.exists():
            assert table.read_bytes() == made
            table.unlink()
        kept = now
    rounds.done(*words, "out.csv")
    assert table.read_bytes() == made


def test_build(tmp_path):
    """Each file is the one that was there or the new one, and none is taken for another."""
    rounds, out, choice = Rounds(tmp_path), tmp_path / "out", random.Random(campaign.first_seed + 1)
    rounds.done("build", "--out", "out")
    made = contents(out)
    old = {name: older(name, data) for name, data in made.items()}
    for how in rounds.signals():
        for name in choice.sample(sorted(old), 6):
            (out / name).write_bytes(old[name])
        for name in choice.sample(sorted(old), 6):
            (out / name).unlink(missing_ok=True)
        code = rounds.ended(how, "build", "--out", "out")
        now, written = contents(out), whole_files(out)
        assert all(now[name] in (made[name], old[name]) for name in written)
        if code == 0:
            assert {name: now[name] for name in written} == made
    rounds.done("build", "--out", "out")
    assert {name: contents(out)[name] for name in whole_files(out)} == made


def older(name, data):
    """A file as an older build might have left it."""
    if not name.endswith(".fmu"):
        return data + b"\n"
    file = BytesIO(data)
    with zipfile.ZipFile(file, "a") as archive:
        archive.writestr("resources/older.txt", "older")
    return file.getvalue()
