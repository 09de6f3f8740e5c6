"""How much faster two workers are than one: rounds of whole grasps at 1 ms, one after the other.

The processor time of the workers is shown, too: where it is less than their wall time together,
the machine had other work, and the ratio is of what was left of it.
"""

import argparse
import os
import resource
import statistics
import tempfile
import time
from pathlib import Path

from grasp_cosim import System
from grasp_cosim.grasp import CASES, SYSTEM
from grasp_cosim.sweep.design import Design
from grasp_cosim.sweep.distributions import Uniform
from grasp_cosim.sweep.study import Parameter, Study
from grasp_cosim.sweep.sweep import Sweep, sweep
from grasp_fmus.build import build

POSITION = Parameter("position", ("plant.initial_object_position",), Uniform(-0.04, 0.04))
RATIO = Parameter(
    "ratio", ("sensor_1.reflectance",), Uniform(0.8, 1.25), ratio_to="sensor_2.reflectance"
)


def timed(study: Study, folder: Path, workers: int) -> tuple[float, float, Sweep]:
    """Wall and processor time of a sweep in s, with the start of its processes, and the sweep."""
    start, used = time.perf_counter(), processor_time()
    done = sweep(study, folder, workers)
    return time.perf_counter() - start, processor_time() - used, done


def processor_time() -> float:
    """Of all ended children, s."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return children.ru_utime + children.ru_stime


def main() -> None:
    """Build the FMUs and measure."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100, help="of a round, for each count")
    parser.add_argument("--rounds", type=int, default=10)
    parser.add_argument("--step", type=float, default=1e-3)
    given = parser.parse_args()
    ratios = []
    with tempfile.TemporaryDirectory(prefix="grasp_bench_") as name:
        build(Path(name, "fmus"))
        system = System.load(SYSTEM, Path(name, "fmus")).with_values(CASES[2])
        system = system.with_experiment(step=given.step)
        print(f"{given.runs} grasps a round, step {given.step:g} s, {os.cpu_count()} processors\n")
        print(
            "| round | 1 worker, s | processor | 2 workers, s | processor | times as fast | load |"
        )
        print("|---|---|---|---|---|---|---|", flush=True)
        for k in range(given.rounds):
            study = Study("bench", system, (POSITION, RATIO), Design("random", given.runs, k))
            load = os.getloadavg()[0]
            one, used_one, first = timed(study, Path(name, f"{k}-1"), 1)
            two, used_two, second = timed(study, Path(name, f"{k}-2"), 2)
            if first.outcomes != second.outcomes or first.failed:
                raise RuntimeError("one and two workers differ")
            ratios.append(one / two)
            print(
                f"| {k + 1} | {one:.1f} | {used_one:.1f} | {two:.1f} | {used_two:.1f} "
                f"| {one / two:.2f} | {load:.2f} |",
                flush=True,
            )
    print(f"\nmedian: {statistics.median(ratios):.2f} times")


if __name__ == "__main__":
    main()
