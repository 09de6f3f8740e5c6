"""How much faster two workers are than one: rounds of whole grasps at 1 ms, one after the other.

Beside it stands how much faster two processes are at plain arithmetic, right before and after: it
is what the machine has to give at that time.
"""

import argparse
import os
import statistics
import tempfile
import time
from multiprocessing import get_context
from pathlib import Path

from grasp_cosim import System
from grasp_cosim.grasp.presets import SYSTEM, with_case
from grasp_cosim.sweep.design import Design
from grasp_cosim.sweep.distributions import Uniform
from grasp_cosim.sweep.study import Parameter, Study
from grasp_cosim.sweep.sweep import Sweep, sweep
from grasp_fmus.build import build

from benchmarks.harness import head, row

POSITION = Parameter("position", ("plant.initial_object_position",), Uniform(-0.04, 0.04))
RATIO = Parameter(
    "ratio", ("sensor_1.reflectance",), Uniform(0.8, 1.25), ratio_to="sensor_2.reflectance"
)


def timed(study: Study, folder: Path, workers: int) -> tuple[float, Sweep]:
    """Wall time of a sweep in s, with the start of its processes, and the sweep."""
    start = time.perf_counter()
    done = sweep(study, folder, workers)
    return time.perf_counter() - start, done


def arithmetic(seconds: float) -> float:
    """Additions per second, over so many seconds."""
    start, total, additions = time.perf_counter(), 0.0, 0
    while (passed := time.perf_counter() - start) < seconds:
        for i in range(10_000):
            total += i * 0.5
        additions += 10_000
    return additions / passed


def machine(seconds: float = 2.0) -> float:
    """How many times as much plain arithmetic two processes do as one."""
    with get_context("spawn").Pool(2) as pool:
        pool.map(arithmetic, [0.1] * 4, chunksize=1)
        one = [pool.apply(arithmetic, (seconds,)) for _ in range(2)]
        two = pool.map(arithmetic, [seconds] * 2, chunksize=1)
    return 2.0 * sum(two) / sum(one)


def main() -> None:
    """Build the FMUs and measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100, help="of a round, for each count")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--step", type=float, default=1e-3)
    given = parser.parse_args()
    ratios, given_by_machine, walls = [], [], {1: 0.0, 2: 0.0}
    with tempfile.TemporaryDirectory(prefix="grasp_bench_") as name:
        build(Path(name, "fmus"))
        system = with_case(System.load(SYSTEM, Path(name, "fmus")), 2)
        system = system.with_experiment(step=given.step)
        print(f"{given.runs} grasps a round, step {given.step:g} s, {os.cpu_count()} processors")
        head("round", "1 worker, s", "2 workers, s", "times as fast", "plain arithmetic", "load")
        before = machine()
        for k in range(given.rounds):
            study = Study("bench", system, (POSITION, RATIO), Design("random", given.runs, k))
            load, found = os.getloadavg()[0], {}
            for workers in (1, 2) if k % 2 else (2, 1):
                found[workers] = timed(study, Path(name, f"{k}-{workers}"), workers)
                walls[workers] += found[workers][0]
            (one, first), (two, second) = found[1], found[2]
            if first.outcomes != second.outcomes or first.failed:
                raise RuntimeError("one and two workers differ")
            after = machine()
            ratios.append(one / two)
            given_by_machine.append(0.5 * (before + after))
            before = after
            times = f"{one:.1f}", f"{two:.1f}", f"{one / two:.2f}"
            row(k + 1, *times, f"{given_by_machine[-1]:.2f}", f"{load:.2f}")
    print(
        f"\nmedian: {statistics.median(ratios):.2f} times; "
        f"plain arithmetic: {statistics.median(given_by_machine):.2f} times; "
        f"all rounds together: {walls[1] / walls[2]:.2f} times"
    )


if __name__ == "__main__":
    main()
