"""What a proxy costs, and how soon it notices that its peer is gone.

Prints the cost of a step of the grasp with its plant here and behind a proxy (lockstep, loopback, a
peer in a process of its own), and for 200 peers killed at seeded moments the time until the outputs
were at their failsafe values, beside what is declared: proxy.timeout for each miss that is
tolerated, and one step, which waits as long.
"""

import random
import statistics
import subprocess
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from grasp_cosim import System, cli, simulate
from grasp_cosim.grasp.system import grasp_system
from grasp_cosim.interface.interface import Value

STEPS = 2000
ROUNDS = 5
KILLS = 200
TOLERATED, TIMEOUT = 3, 0.02
PEERS = Path(__file__).parent.parent / "tests/hil/peers.py"


class Peers:
    """Processes that serve an FMU in lockstep."""

    def __init__(self, fmu: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(PEERS), str(fmu)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def say(self, line: str) -> str:
        """A line to the program that starts and kills them; its answer."""
        stdin, stdout = self._process.stdin, self._process.stdout
        if stdin is None or stdout is None:
            raise RuntimeError("no pipe")
        stdin.write(f"{line}\n")
        stdin.flush()
        return stdout.readline()

    def start(self) -> tuple[int, int]:
        """Process id and port of a new one."""
        child, port = self.say("start").split()
        return int(child), int(port)

    def close(self) -> None:
        """End them all."""
        self._process.communicate()


def proxied(system: System, name: str, folder: Path) -> System:
    """The system with a component behind a proxy."""
    fmu, proxy = system.component(name, name).fmu, folder / f"{name}_proxy.fmu"
    if cli.main(["proxy", str(fmu), "-o", str(proxy)]):
        raise RuntimeError(f"{fmu}: no proxy")
    return system.swap(name, proxy).with_values(
        {f"{name}.proxy.timeout": 10.0, f"{name}.proxy.misses_tolerated": TOLERATED}
    )


def cost(system: System, folder: Path) -> None:
    """Print what a step costs with the plant here and there."""
    peers = Peers(system.component("plant", "plant").fmu)
    child, port = peers.start()
    there = proxied(system, "plant", folder).with_values({"plant.proxy.port": port})
    found: dict[str, list[float]] = {"direct": [], "behind a proxy": []}
    for _ in range(ROUNDS):
        for name, each in (("direct", system), ("behind a proxy", there)):
            result = simulate(each, step=1e-3, stop=STEPS * 1e-3)
            found[name].append(1e6 * result.wall_time / STEPS)
    peers.say(f"end {child}")
    peers.close()
    for name, times in found.items():
        print(f"macro step, plant {name}: {min(times):.1f} us best, {statistics.median(times):.1f}")


def kills(system: System, folder: Path) -> None:
    """Print how long it takes from the death of the peer to the failsafe values."""
    peers = Peers(system.component("controller", "controller").fmu)
    whole = proxied(system, "controller", folder).with_experiment(step=1e-3, stop=0.5)
    part = whole.component("controller", "controller")
    values: dict[str, Value] = {
        v.name: 0.1 * (-1) ** i for i, v in enumerate(part.interface.of("input"))
    }
    part = replace(part, values={**part.values, **values, "proxy.timeout": TIMEOUT})
    alone = replace(whole, components=(part,), connections=())
    took = []
    for seed in range(KILLS):
        child, port = peers.start()
        chosen: dict[str, Value] = {
            "controller.proxy.port": port,
            "controller.proxy.on_loss": "failsafe",
        }
        with simulate.session(alone.with_values(chosen)) as session:
            moment = time.perf_counter() + random.Random(seed).uniform(0.0, 0.02)  # noqa: S311
            while time.perf_counter() < moment:
                session.step()
            peers.say(f"end {child}")
            start = time.perf_counter()
            while session["controller.proxy.state"] != 3 and session.step():
                pass
            took.append(time.perf_counter() - start)
    peers.close()
    declared = TIMEOUT * TOLERATED + TIMEOUT
    took.sort()
    print(
        f"{KILLS} peers killed: failsafe after {1e3 * took[len(took) // 2]:.1f} ms (median), "
        f"{1e3 * took[-1]:.1f} ms (worst), declared {1e3 * declared:.0f} ms: "
        f"{TOLERATED} misses of {1e3 * TIMEOUT:.0f} ms and a step that waits as long, beside what "
        "the steps compute"
    )


def main() -> None:
    """Both, in a folder of their own."""
    system = grasp_system()
    with tempfile.TemporaryDirectory() as folder:
        cost(system, Path(folder))
        kills(system, Path(folder))


if __name__ == "__main__":
    main()
