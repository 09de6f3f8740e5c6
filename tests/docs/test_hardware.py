"""The steps of docs/how_to/hardware.md, rehearsed on one machine with the commands of the page.

And those of tandem.md, which has a plant on the bench too.
"""

import csv
import json
import os
import re
import shlex
import subprocess
import sys
from contextlib import ExitStack
from pathlib import Path
from select import select
from time import monotonic

import pytest
from grasp_cosim import cli
from support import native_fmus
from support.processes import kept_port

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs/how_to/hardware.md").read_text("utf-8")
TANDEM = (ROOT / "docs/how_to/tandem.md").read_text("utf-8")
READY = re.compile(r"serving |relaying |listening on ")
STOP = "0.3"
"""s that each run simulates here."""


class Bench:
    """The terminal bench$: its programs go on in the background."""

    def __init__(self):
        self._processes = []

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.end()

    def start(self, words):
        """Start a program, and wait until it says that it listens."""
        process = subprocess.Popen(
            words,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            bufsize=0,  # a line that was read ahead is one that select() does not know of
        )
        self._processes.append(process)
        assert process.stdout is not None
        end = monotonic() + 60.0
        while select([process.stdout], [], [], end - monotonic())[0]:
            line = process.stdout.readline().decode()
            assert line, words
            if READY.match(line):
                return
        raise AssertionError(words)

    def end(self):
        for process in self._processes:
            process.kill()
            process.communicate()
        self._processes.clear()


def rehearse(page, system):
    """All blocks of a page that have the two prompts, or change the system file, in order."""
    blocks = re.findall(r"^```(console|toml)\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    with ExitStack() as stack:
        named = sorted(set(re.findall(r"\b5[56]0\d\b", page)))
        ports = {port: str(stack.enter_context(kept_port())) for port in named}
        bench = stack.enter_context(Bench())
        for kind, block in blocks:
            if kind == "toml":
                change(system, block)
                continue
            for line in re.sub(r"\\\n\s*", "", block).splitlines():
                if "$ " not in line:
                    continue  # an output
                command = re.sub(r"\b5[56]0\d\b", lambda m: ports[m.group()], line)
                prompt, _, text = command.partition("$ ")
                if prompt == "bench" and not text.startswith("cc "):
                    bench.start(words(text))
                else:
                    run(text)
            bench.end()


def words(text):
    """A command line as a program takes it; ours is that of this interpreter."""
    found = shlex.split(text, comments=True)
    if found[0] == "grasp-cosim":
        found[:1] = [sys.executable, "-m", "grasp_cosim"]
        found += ["--stop", STOP] if found[3] == "run" else []
    return found


def run(text):
    """A command of sim$, in this process where it is ours: that saves it the start."""
    if text.startswith("grasp-cosim "):
        said = re.search(r"# exit code (.*)$", text)
        codes = [int(code) for code in said[1].split(" or ")] if said else [0]
        assert cli.main(words(text)[3:]) in codes, text
    else:
        subprocess.run(text, shell=True, check=True)


def change(system, block):
    """Put each table of the block into the system file, in place of that of its name."""
    tables = system.read_text("utf-8").split("\n\n")
    for new in block.strip().split("\n\n"):
        name = new.partition("]")[0]
        (place,) = (i for i, old in enumerate(tables) if old.startswith(name))
        tables[place] = new
    system.write_text("\n\n".join(tables) + "\n", encoding="utf-8")


def columns(path):
    with path.open(encoding="utf-8", newline="") as file:
        names, *rows = csv.reader(file)
    return dict(zip(names, zip(*rows, strict=True), strict=True))


@pytest.mark.slow
@native_fmus.needs_gcc
def test_the_steps(checkout):
    rehearse(PAGE, checkout / "my_system.toml")
    simulated = columns(checkout / "simulated/signals.csv")
    assert len(simulated["time"]) == 301
    assert columns(checkout / "paced/signals.csv") == simulated
    for folder in ("lockstep", "sensors", "target"):
        found = columns(checkout / folder / "signals.csv")
        assert {name: found[name] for name in simulated} == simulated
    bench = columns(checkout / "bench/signals.csv")
    assert set(bench["plant.proxy.state"]) <= {"1", "2"}
    assert float(bench["plant.position[1]"][-1]) < 0.11
    for folder in ("mute", "half"):
        log = json.loads((checkout / folder / "run.json").read_text())
        assert log["complete"] is False
    restarted = json.loads((checkout / "restarted/run.json").read_text())
    assert len(restarted["initialised_anew"]) >= 1  # more where the machine stalls
    assert set(columns(checkout / "nasty/signals.csv")["sensor_1.proxy.state"]) <= {"1", "2"}


@pytest.mark.slow
@native_fmus.needs_gcc
def test_a_plant_on_an_arm(checkout):
    rehearse(TANDEM, checkout / "tandem.toml")
    simulated = columns(checkout / "arm_simulated/signals.csv")
    found = columns(checkout / "arm/signals.csv")
    assert {name: found[name] for name in simulated} == simulated
    assert (checkout / "controller_in_c/GraspControllerTandem.c").is_file()


@pytest.mark.slow
@native_fmus.needs_gcc
def test_two_computers(checkout):
    """Both of them this one: the addresses of the page are replaced."""
    blocks = re.findall(r"^```sh\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
    lines = re.sub(r"\\\n\s*", "", "".join(blocks)).splitlines()
    key, serve, proxy, simulate = (line for line in lines if not line.startswith("#"))
    run(key)
    assert cli.main(["init", "my_system.toml"]) == 0
    with kept_port() as port, Bench() as bench:
        assert "--host 0.0.0.0" in serve
        bench.start(words(f"{serve.replace('0.0.0.0', '127.0.0.1')} --port {port}"))
        run(f"{proxy.replace('192.168.7.2', '127.0.0.1')} --port {port}")
        (block,) = re.findall(
            r"^```toml\n(\[components\.plant\]\nfmu = .Plant.*?)^```", PAGE, re.M | re.S
        )
        change(checkout / "my_system.toml", block)
        patient = "--set plant.proxy.misses_tolerated=2000 --set plant.proxy.timeout=0.5"
        run(
            f"{simulate} {patient} --set realtime.tolerance=2 --set plant.proxy.greatest_lead=5 "
            "--set realtime.stall=5 # exit code 0 or 1"
        )
