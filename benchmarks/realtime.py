"""The grasp in real time, four FMUs at 1 and 10 kHz, beside what the machine itself does.

    python -m benchmarks.realtime [--seconds 60] [--rates 1000 10000] [--priority P] [--cpu N]
        [--python]

Two measurements for each rate, under the same priority and on the same CPU. The gaps of a loop that
only looks at the clock are times in which this machine ran nothing of ours: nobody can do better.
Then comes the run. What it shows beyond is our share.
"""

import argparse
import time

from grasp_cosim import Realtime, simulate
from grasp_cosim.grasp.system import grasp_system
from grasp_cosim.realtime.pacer import privileges
from grasp_cosim.report.terminal import timing_lines

GAPS = (100_000, 1_000_000, 10_000_000)
"""ns: gaps longer than each of these are counted."""

STRETCH, NAP = 9_000_000, 1e-3
"""ns of looking at the clock, and s of sleep after it."""

SHORT = 10_000
"""ns: gaps up to this are looks at the clock."""


def spin(seconds: float) -> tuple[list[int], int]:
    """Look at the clock for so long; the longer gaps, and how long it ran, in ns.

    In between it sleeps, which does not count: the kernel takes 50 ms of each second from a thread
    of a real-time priority that runs all the time.
    """
    gaps: list[int] = []
    now, ran = time.monotonic_ns, 0
    while ran < seconds * 1e9:
        start = last = now()
        while last - start < STRETCH:
            t = now()
            if t - last > SHORT:
                gaps.append(t - last)
            last = t
        ran += last - start
        time.sleep(NAP)
    return gaps, ran


def measure(seconds: float, rate: int, realtime: Realtime, native: bool) -> None:
    """Both at a rate in Hz."""
    system = grasp_system(native=native).with_experiment(1.0 / rate, seconds, None)
    simulate(system, stop=10 / rate)  # compiles the loop
    with privileges(realtime):
        gaps, ran = spin(seconds)
    timing = simulate(system, progress=True, realtime=realtime).timing
    assert timing is not None  # noqa: S101 - it is paced
    print(f"\n== {rate} Hz for {seconds:g} s; granted: {', '.join(timing.granted) or 'nothing'}")
    for line in timing.refused:
        print(line)
    counts = ", ".join(
        f"{sum(gap > limit for gap in gaps)} over {limit / 1e6:g} ms" for limit in GAPS
    )
    worst, lost = max(gaps, default=0) / 1e6, sum(gaps) / ran
    print(f"machine: gaps {counts}; worst {worst:.3f} ms; {lost:.2%} of the time lost")
    quantiles = "p50 {:9.1f}  p99 {:9.1f}  p99.9 {:9.1f}  worst {:9.1f} us".format
    for name, part in timing.parts.items():
        us = quantiles(*(1e6 * second for second in part[:4]))
        print(f"run, {name:14s} {us} at t = {part.worst_at:.4f} s")
    for line in timing_lines(timing):
        print(f"run: {line}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--rates", type=int, nargs="+", default=[1000, 10_000])
    parser.add_argument("--priority", type=int)
    parser.add_argument("--cpu", type=int)
    parser.add_argument("--python", action="store_true", help="FMUs in Python, not native ones")
    given = parser.parse_args()
    for rate in given.rates:
        measure(
            given.seconds, rate, Realtime(priority=given.priority, cpu=given.cpu), not given.python
        )
