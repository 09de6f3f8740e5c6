"""What a proxy costs, and how soon it notices that its peer is gone.

Prints the cost of a step of the grasp with its plant here and behind a proxy (lockstep, loopback, a
peer in a process of its own), and for 200 peers killed at seeded moments the time until the outputs
were at their failsafe values, beside what is declared: proxy.timeout for each miss that is
tolerated, and one step, which waits as long.
"""

import random
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from grasp_cosim import System, cli, simulate
from grasp_cosim.grasp.system import grasp_system
from grasp_cosim.interface.interface import Value

from benchmarks.harness import Program, by_turns, spread

STEPS = 2000
ROUNDS = 5
KILLS = 200
TOLERATED, TIMEOUT = 3, 0.02
PEERS = Path(__file__).parent.parent / "tests/hil/peers.py"


def peers(system: System, name: str) -> Program:
    """A program that starts processes which serve a component in lockstep, and kills them.

    It ends them all when it ends itself.
    """
    return Program(sys.executable, str(PEERS), str(system.component(name, name).fmu))


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

    def run(system: System) -> float:
        return 1e6 * (simulate(system, step=1e-3, stop=STEPS * 1e-3).wall_time or 0.0) / STEPS

    with peers(system, "plant") as program:
        port = int(program.ask("start").split()[1])
        there = proxied(system, "plant", folder).with_values({"plant.proxy.port": port})
        found = by_turns(
            {"direct": lambda: run(system), "behind a proxy": lambda: run(there)}, ROUNDS
        )
    for name, times in found.items():
        best, median, _ = spread(times)
        print(f"macro step, plant {name}: {best:.1f} us best, {median:.1f}")


def kills(system: System, folder: Path) -> None:
    """Print how long it takes from the death of the peer to the failsafe values."""
    whole = proxied(system, "controller", folder).with_experiment(step=1e-3, stop=0.5)
    part = whole.component("controller", "controller")
    values: dict[str, Value] = {
        v.name: 0.1 * (-1) ** i for i, v in enumerate(part.interface.of("input"))
    }
    part = replace(part, values={**part.values, **values, "proxy.timeout": TIMEOUT})
    alone = replace(whole, components=(part,), connections=())
    alone = alone.with_values({"controller.proxy.on_loss": "failsafe"})
    took = []
    with peers(system, "controller") as program:
        for seed in range(KILLS):
            child, port = map(int, program.ask("start").split())
            served = alone.with_values({"controller.proxy.port": port})
            with simulate.session(served) as session:
                moment = time.perf_counter() + random.Random(seed).uniform(0.0, 0.02)  # noqa: S311
                while time.perf_counter() < moment:
                    session.step()
                program.ask(f"end {child}")
                start = time.perf_counter()
                while session["controller.proxy.state"] != 3 and session.step():
                    pass
                took.append(1e3 * (time.perf_counter() - start))
    declared = TIMEOUT * TOLERATED + TIMEOUT
    _, median, worst = spread(took)
    print(
        f"{KILLS} peers killed: failsafe after {median:.1f} ms (median), "
        f"{worst:.1f} ms (worst), declared {1e3 * declared:.0f} ms: "
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
