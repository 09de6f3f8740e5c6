"""The peer killed at any moment: the run ends or goes to its failsafe in time, and keeps its rows.

Time is counted in steps without an answer, each of which takes proxy.timeout at most.
"""

import os
import random
import subprocess
import sys
import threading
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import SimulationError, simulate
from grasp_cosim.base.errors import InputError
from support.campaign import seeds
from support.proxies import build_proxy

MOMENTS, PORTION = seeds(200), 20
TOLERATED = 3
TIMEOUT = 0.01
PATIENCE = 0.2
"""s that a proxy waits for a peer that is killed before the run has begun."""

STEPS = 1000
"""Within which it is killed, at any point of the step at hand."""

AFTER = 10
"""Steps without it, in which it is lost."""

FAILSAFE = {"force[1]": -0.125, "force[2]": 0.25}

HELD = ("proxy.hold.target_position", "proxy.hold.virtual_position[1]")


class Peers:
    """Starts and kills processes that serve an FMU."""

    def __init__(self, fmu):
        program = Path(__file__).with_name("peers.py")
        self._process = subprocess.Popen(
            [sys.executable, str(program), str(fmu)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        )

    def start(self):
        """Process id and port of a new one."""
        child, port = self._say("start").split()
        return int(child), int(port)

    def kill(self, child):
        assert self._say(f"end {child}") == f"{child} ended\n"

    def close(self):
        self._process.communicate(timeout=60)

    def _say(self, line):
        stdin, stdout = self._process.stdin, self._process.stdout
        assert stdin is not None
        assert stdout is not None
        stdin.write(f"{line}\n")
        stdin.flush()
        return stdout.readline()


@pytest.fixture(scope="module")
def peers(fmus):
    found = Peers(fmus / "GraspController.fmu")
    yield found
    found.close()


@pytest.fixture(scope="module")
def proxied(grasp, tmp_path_factory):
    """The controller on the bench, alone: it moves its fingers although nothing follows them."""
    controller = grasp.component("controller", "test")
    proxy = build_proxy(
        controller.fmu, tmp_path_factory.mktemp("bench") / "controller_bench.fmu", 5501,
    )  # fmt: skip
    values = {
        "position[1]": 0.11,
        "position[2]": -0.11,
        "velocity[1]": -0.05,
        "velocity[2]": 0.05,
        "intensity[1]": 0.3,
        "intensity[2]": 0.2,
        "proxy.timeout": TIMEOUT,
        "proxy.misses_tolerated": TOLERATED,
        **{f"proxy.failsafe.{name}": value for name, value in FAILSAFE.items()},
        **dict.fromkeys(HELD, True),
    }
    part = replace(controller, fmu=proxy, values=values)
    return replace(grasp.with_experiment(step=1e-3, stop=1e3), components=(part,), connections=())


def run_until_killed(system, peers, seed):
    """A run whose peer is killed at a moment; None where that was before the first step."""
    chance = random.Random(seed)
    child, port = peers.start()
    policy = ("failsafe", "hold", "stop")[seed % 3]
    # One in twenty while it is loaded and initialised, the others in the run
    early = seed % 20 == 0
    values = {
        "controller.proxy.port": port,
        "controller.proxy.on_loss": policy,
        "controller.proxy.connect_timeout": PATIENCE if early else 60.0,
    }
    killer = threading.Timer(chance.uniform(0.0, 0.1) if early else 0.0, peers.kill, [child])
    if early:
        killer.start()
    try:
        with simulate.session(system.with_values(values)) as session:
            session.step(chance.randint(1, STEPS))
            if not early:
                killer.start()
            while killer.is_alive():
                session.step()
            session.step(AFTER)
            return session.result()
    except InputError as error:
        refused = f"no answer from 127.0.0.1:{port} within {PATIENCE:g} s"
        if refused not in str(error) or not early:
            raise
        return None
    except SimulationError as error:
        lost = f"127.0.0.1:{port} is lost, {TOLERATED + 1} missed in a row"
        if lost not in str(error) or policy != "stop":
            raise
        return error.result
    finally:
        if killer.ident is None:  # a busy machine has lost it before
            killer.start()
        killer.join()


def check(result):
    """Whenever it was killed, what was recorded is what the parameters promise."""
    policy = result.settings["components"]["controller"]["values"]["proxy.on_loss"]
    state, row = result["controller.proxy.state"], result["controller.proxy.consecutive_missed"]
    forces = {name: result[f"controller.{name}"] for name in FAILSAFE}
    assert len(result.time) == len(state)
    lost = np.flatnonzero(state == 3)
    if policy == "stop":  # at the step after those tolerated: the declared time
        assert not len(lost)
        assert list(row[-TOLERATED:]) == list(range(1, TOLERATED + 1))
    else:
        assert len(lost)
    late = np.diff(result["controller.proxy.late"], prepend=0) > 0  # taken, as the newest there is
    missing = np.flatnonzero((state == 2) & ~late)
    for name, force in forces.items():
        assert (force[missing] == force[missing - 1]).all(), name
    for first in lost[:1]:
        assert row[first] == TOLERATED + 1
        assert list(state[first - TOLERATED : first]) == [2] * TOLERATED
        assert len(lost) == len(state) - first  # it stays lost
        for name, force in forces.items():
            kept = FAILSAFE[name] if policy == "failsafe" else force[first - (not late[first])]
            assert (force[first:] == kept).all(), name
        target = result["controller.target_position"]
        held = target[first - (not late[first])]
        assert (target[first:] == held).all()  # under either policy
        missed = result["controller.proxy.missed"]
        assert (missed[first:] == missed[first]).all()  # and asks nobody any more


@pytest.mark.slow
@pytest.mark.campaign
@pytest.mark.parametrize("first", MOMENTS[::PORTION])
def test_the_peer_killed_at_any_moment(proxied, peers, first):
    found = dict.fromkeys(("not begun", "ended", "lost"), 0)
    for seed in range(first, first + PORTION):
        result = run_until_killed(proxied, peers, seed)
        if result is None:
            found["not begun"] += 1
            continue
        check(result)
        found["lost" if 3 in result["controller.proxy.state"] else "ended"] += 1
    assert sum(found.values()) == PORTION
    assert min(found["lost"], found["ended"]) > 2, found
