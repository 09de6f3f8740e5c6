"""How long sweeps of whole grasps take on one worker and on two, native, and whether they agree."""

import argparse
import os
import statistics
import time

from grasp_cosim import grasp_system, sweep
from grasp_cosim.sweeps.table import Table

from benchmarks.harness import head, row


def timed(rows: dict[str, list[float]], step: float, workers: int) -> tuple[float, Table]:
    """Wall time of a sweep in s, with the start of its processes, and its table."""
    system, start = grasp_system().with_experiment(step=step), time.perf_counter()
    table = sweep(system, rows, workers=workers)
    return time.perf_counter() - start, table


def main() -> None:
    """Measure in rounds, one and two workers by turns."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--runs", type=int, default=100, help="of a sweep")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--step", type=float, default=1e-4)
    given = parser.parse_args()
    positions = [0.05 * k / given.runs for k in range(given.runs)]
    rows, ratios = {"plant.initial_object_position": positions}, []
    print(f"{given.runs} grasps of 3 s, step {given.step:g} s, {os.cpu_count()} processors")
    head("round", "1 worker, s", "2 workers, s", "times as fast", "load")
    for k in range(given.rounds):
        load = os.getloadavg()[0] if hasattr(os, "getloadavg") else float("nan")
        found = {n: timed(rows, given.step, n) for n in ((1, 2) if k % 2 else (2, 1))}
        (one, first), (two, second) = found[1], found[2]
        if first != second or first.errors:
            raise RuntimeError("one and two workers differ")
        ratios.append(one / two)
        row(k + 1, f"{one:.2f}", f"{two:.2f}", f"{one / two:.2f}", f"{load:.2f}")
    print(f"\nmedian: {statistics.median(ratios):.2f} times")


if __name__ == "__main__":
    main()
