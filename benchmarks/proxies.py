"""What a proxy costs, and how soon it notices that its peer is gone.

Prints the cost of a step of the grasp with its plant here and behind a proxy. The proxy is in
lockstep on the loopback; its peer serves the Python FMU in its own process; the same with native
FMUs, the controller behind a proxy, and its peer in C; and for 200 peers killed at seeded moments
the time until the outputs were at their failsafe values, and the declared time: proxy.timeout for
each miss that is tolerated, and one step, which waits as long."""

import random
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from dataclasses import replace
from io import StringIO
from pathlib import Path

from grasp_cosim import System, cli, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.grasp.system import grasp_system
from grasp_cosim.interface.fmi_types import Value

from benchmarks.masters import by_turns

STEPS = 2000
ROUNDS = 5
KILLS = 200
TOLERATED, TIMEOUT = 3, 0.02
TARGET = Path(__file__).parent.parent / "docs/controller_target.c"


def _made(*command: str | Path) -> None:
    """Do a command that prints nothing: only figures are printed."""
    with redirect_stdout(StringIO()):
        if code := cli.main([*map(str, command)]):
            raise RuntimeError(f"{command}: exit code {code}")


@contextmanager
def serving(system: System, name: str) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A process that serves a component in lockstep, and its port; it is ended with the block."""
    fmu = str(system.component(name, name).fmu)
    command = [sys.executable, "-m", "grasp_cosim", "serve", fmu, "--lockstep", "--port", "0"]
    with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as process:
        try:
            said = next(line for line in process.stderr or () if line.startswith("serving "))
            yield process, int(said.partition(", ")[0].rpartition(":")[2])
        finally:
            process.kill()


def proxied(system: System, name: str, folder: Path) -> System:
    """The system with a component behind a proxy."""
    fmu, proxy = system.component(name, name).fmu, folder / f"{name}_proxy.fmu"
    _made("proxy", fmu, "-o", proxy)
    return system.swap(name, proxy).with_values(
        {f"{name}.proxy.timeout": 10.0, f"{name}.proxy.misses_tolerated": TOLERATED}
    )


def compare(direct: System, there: System, where: str) -> None:
    """Print what a step costs with a component here and there."""

    def run(system: System) -> float:
        return 1e6 * (simulate(system, step=1e-3, stop=STEPS * 1e-3).wall_time or 0.0) / STEPS

    found = by_turns({"direct": lambda: run(direct), "behind a proxy": lambda: run(there)}, ROUNDS)
    for name, times in found.items():
        best, median = min(times), statistics.median(times)
        print(f"macro step, {where} {name}: {best:.1f} us best, {median:.1f}")


def cost(system: System, folder: Path) -> None:
    """Print what a step costs in Python with the plant here and there."""
    with serving(system, "plant") as (_, port):
        there = proxied(system, "plant", folder).with_values({"plant.proxy.port": port})
        compare(system, there, "plant")


def native_cost(folder: Path) -> None:
    """Print the same in C, with the controller there."""
    fmus, code, target = folder / "native", folder / "c", folder / "target"
    header = code / "grasp_controller.h"
    _made("build", "--native", "--out", fmus)
    _made("build", "--native", "--c-only", code, "GraspController")
    _made("proxy", fmus / "GraspController.fmu", "--c-header", header)
    sources = [TARGET, *(code / f"GraspController{part}.c" for part in ("", "_text"))]
    flags = ["-std=c99", "-O2", "-ffp-contract=off", "-I", code]
    command = ["cc", *flags, *sources, "-o", target, "-lm"]
    subprocess.run(list(map(str, command)), check=True)
    system = System.load(SYSTEM, fmus)
    there = proxied(system, "controller", folder)
    with subprocess.Popen([target, "0"], stdout=subprocess.PIPE, text=True) as process:
        port = int((process.stdout or sys.stdin).readline().split()[-1])
        there = there.with_values({"controller.proxy.port": port})
        compare(system, there, "controller, all native,")
        process.kill()


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
    for seed in range(KILLS):
        with serving(system, "controller") as (process, port):
            served = alone.with_values({"controller.proxy.port": port})
            with simulate.session(served) as session:
                moment = time.perf_counter() + random.Random(seed).uniform(0.0, 0.02)  # noqa: S311
                while time.perf_counter() < moment:
                    session.step()
                process.kill()
                process.wait()
                start = time.perf_counter()
                while session["controller.proxy.state"] != 3 and session.step():
                    pass
                took.append(1e3 * (time.perf_counter() - start))
    median, worst = statistics.median(took), max(took)
    print(
        f"{KILLS} peers killed: failsafe after {median:.1f} ms (median), {worst:.1f} ms (worst), "
        f"declared {1e3 * TIMEOUT * (TOLERATED + 1):.0f} ms plus the time of the steps"
    )


def main() -> None:
    """All of it, in its own folder."""
    system = grasp_system(native=False)
    with tempfile.TemporaryDirectory() as folder:
        cost(system, Path(folder))
        native_cost(Path(folder))
        kills(system, Path(folder))


if __name__ == "__main__":
    main()
