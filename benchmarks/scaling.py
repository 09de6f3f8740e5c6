"""How the cost of a run grows with its steps and its instances, and that its memory does not.

    python -m benchmarks.scaling

One plant and as many sensors as it takes to come to so many instances, all sensors on the same gap;
with the Python FMUs and with native ones. Each figure is the least CPU time of several
runs, so that other work on the machine disturbs less.
"""

import resource
import time
from dataclasses import replace
from pathlib import Path

from grasp_cosim import System, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.system.parts import Connection, Port

from benchmarks.harness import built_fmus, head, row

INSTANCES = (2, 4, 8, 16, 32, 64)
LENGTHS = (1_000, 2_000, 4_000, 8_000)
"""In macro steps."""

MEMORY_LENGTHS = (100_000, 200_000, 400_000, 800_000, 1_600_000)
EVERY = 1_000
"""Of so many communication points one is recorded, when memory is measured."""

RUNS = 5
STEP = 1e-4


def star(folder: Path, instances: int) -> System:
    """A plant at rest, and the rest sensors that all look at its first gap."""
    grasp = System.load(SYSTEM, folder)
    plant, sensor, *_ = grasp.components
    plant = replace(plant, values={**plant.values, "force[1]": 0.0, "force[2]": 0.0})
    sensors = [replace(sensor, name=f"sensor_{i}") for i in range(1, instances)]
    gap = Port("plant", "gap[1]")
    return replace(
        grasp,
        components=(plant, *sensors),
        connections=tuple(Connection(gap, Port(s.name, "gap")) for s in sensors),
    )


def per_step(system: System, steps: int, every: int = 1) -> float:
    """us of CPU time per macro step, recording included, loading and initialisation not."""
    best = float("inf")
    for _ in range(RUNS):
        with simulate.session(system, step=STEP, stop=steps * STEP, every=every) as session:
            start = time.process_time()
            session.step(steps)
            best = min(best, time.process_time() - start)
    return 1e6 * best / steps


def growth(folder: Path, kind: str) -> None:
    """Print the cost per step against the number of steps, and of instances."""
    four = star(folder, 4)
    per_step(four, 10)  # compiles the loop
    head(f"{kind}, 4 instances: steps", "us per step")
    for steps in LENGTHS:
        row(steps, f"{per_step(four, steps):.2f}")
    head(f"{kind}: instances", "us per step", "us per step and instance")
    for n in INSTANCES:
        cost = per_step(star(folder, n), LENGTHS[0])
        row(n, f"{cost:.2f}", f"{cost / n:.3f}")


def memory(folder: Path) -> None:
    """Print the most memory this process ever had, after runs of growing length."""
    system = star(folder, 4)
    head(f"steps, one in {EVERY} recorded", "peak memory, MB")
    for steps in MEMORY_LENGTHS:
        simulate(system, step=STEP, stop=steps * STEP, every=EVERY)
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # in kB on Linux
        row(steps, f"{peak / 1024:.1f}")


def main() -> None:
    """Build the FMUs and measure."""
    with built_fmus() as (python, native):
        growth(python, "Python FMUs")
        growth(native, "native FMUs")
        memory(native)


if __name__ == "__main__":
    main()
