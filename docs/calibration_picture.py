"""Runs the session of docs/how_to/calibrate.md, and draws what it measures."""

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from grasp_cosim.report.plot import add_heading, new_figure, save_figure
from grasp_cosim.report.wording import Caption

HERE = Path(__file__).parent
PORTS = {"target": "5504", "slave": "5555"}
"""Those of the page."""
LABELS = {
    "simultaneous_contact.gain": "gain in N",
    "simultaneous_contact_force": "f_s in N",
    "intensity": "intensity in V",
}
"""What each row of the picture shows: signals whose names begin so."""


def session(folder: Path, ports: Mapping[str, str] = PORTS, more: Sequence[str] = ()) -> str:
    """Run the commands of the page in a folder; return the output of the tool while it measures.

    folder has docs and fmus of a checkout. The run of the loop, whose verdict may fail where steps
    are late, gets `more` options. CalledProcessError where another command fails.
    """
    page = (HERE / "how_to/calibrate.md").read_text("utf-8")
    block = re.search(r"^```console\n(sim\$ grasp-cosim build.*?)^```", page, re.DOTALL | re.M)
    assert block is not None  # noqa: S101 - of the page
    text = (
        block[1].replace(PORTS["target"], ports["target"]).replace(PORTS["slave"], ports["slave"])
    )
    lines = re.sub(r"\\\n\s*", "", text).splitlines()
    *builds, target, tool, simulation = (_words(line.partition("$ ")[2]) for line in lines)
    for command in builds:
        subprocess.run(command, cwd=folder, check=True)  # noqa: S603 - of the page
    with ExitStack() as stack:
        running = _said(stack, folder, target, "XCP at 127.0.0.1:")
        measuring = _said(stack, folder, [*tool, "--port", ports["slave"]], "measuring ")
        done = subprocess.run([*simulation, *more], cwd=folder)  # noqa: S603 - of the page
        if done.returncode not in (0, 1):
            raise subprocess.CalledProcessError(done.returncode, simulation)
        said, _ = measuring.communicate()
        if measuring.returncode:
            raise subprocess.CalledProcessError(measuring.returncode, tool, said)
        running.terminate()
    return said


def _words(line: str) -> list[str]:
    """A command of the page, with the Python that runs this."""
    program, *options = shlex.split(line)
    ours = {"grasp-cosim": ["-m", "grasp_cosim"], "python": []}
    return [sys.executable, *ours[program], *options] if program in ours else [program, *options]


def _said(
    stack: ExitStack, folder: Path, command: Sequence[str], words: str
) -> "subprocess.Popen[str]":
    """A program that goes on once it has said a line that begins so; killed with the stack."""
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    process = stack.enter_context(
        subprocess.Popen(  # noqa: S603 - of the page
            command,
            cwd=folder,
            env=environment,
            text=True,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
        )
    )
    stack.callback(process.kill)
    assert process.stdout is not None  # noqa: S101 - it is a pipe
    said = []
    for line in process.stdout:
        said.append(line)
        if line.startswith(words):
            return process
    raise subprocess.CalledProcessError(process.wait(), command, "".join(said))


def draw(folder: Path) -> None:
    """calibration.png: what a session measures, never twice the same."""
    with TemporaryDirectory() as kept:
        for name in ("docs", "fmus"):
            Path(kept, name).symlink_to(HERE.parent / name)
        session(Path(kept))
        file = Path(kept, "measured.csv")
        measured = np.genfromtxt(file, delimiter=",", names=True, deletechars="")
    figure = new_figure(7.0, 5.2)
    rows = figure.subplots(len(LABELS), 1, sharex=True)
    for axes, (name, label) in zip(rows, LABELS.items(), strict=True):
        for column in measured.dtype.names or ():
            if column.startswith(name):
                axes.plot(measured["time_in_us"] * 1e-6, measured[column], label=column)
        axes.set_ylabel(label)
        axes.legend(loc="right", fontsize="small")
    rows[-1].set_xlabel("time in s")
    title = "A gain is changed while the controller runs on its target"
    add_heading(figure, Caption(title, "measured by XCP at each step of 1 ms"))
    save_figure(figure, folder / "calibration.png")
