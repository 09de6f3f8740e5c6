"""One grasp of 3 s at 10 kHz: four FMU instances, every output recorded.

Prints the real-time factor of whole runs and where a macro step's time goes. The lines below the
first are ratios to the macro step, measured alternately with it.
"""

import statistics
import time
from collections.abc import Callable
from contextlib import ExitStack

from grasp_cosim import simulate
from grasp_cosim.fmi.fmi2 import FmuInstance
from grasp_cosim.grasp import grasp_system
from grasp_cosim.master.fixed_step import Master
from grasp_cosim.recording.result import Recorder

RUNS = 7
STEPS = 500
ROUNDS = 60


def whole_runs() -> None:
    """Real-time factor of complete runs, recording included, loading not."""
    system = grasp_system()
    factors = sorted(simulate(system).metrics["real_time_factor"] for _ in range(RUNS))
    print(
        f"3 s at 10 kHz, {RUNS} runs: {factors[-1]:.2f} times real time at best, "
        f"{statistics.median(factors):.2f} median, {factors[0]:.2f} at worst"
    )


def parts() -> None:
    """Share of a macro step taken by each component's calls, and by the recorder."""
    system = grasp_system()
    with ExitStack() as stack:
        instances = [
            stack.enter_context(FmuInstance(c.name, c.interface)) for c in system.components
        ]
        master = Master(system, instances)
        master.initialise()
        recorder = Recorder(master.plan, STEPS)
        candidates: dict[str, Callable[[], object]] = {"macro step": lambda: master.advance(1)}
        for link in master.plan.links:
            for part, calls in (("send", link.send), ("receive", link.receive)):
                candidates[f"{link.instance.name} {part}"] = _all(calls)
            step = link.step[len(link.send)]
            candidates[f"{link.instance.name} step"] = step
        candidates["record a row"] = lambda: recorder(0)
        times: dict[str, list[float]] = {name: [] for name in candidates}
        for _ in range(ROUNDS):
            for name, call in candidates.items():
                times[name].append(_per_call(call))
    macro = min(times["macro step"])
    print(f"macro step without recording: {1e6 * macro:.1f} us at best")
    for name, measured in times.items():
        print(f"  {name:20s} {min(measured) / macro:6.1%}")


def _all(calls: tuple[Callable[[], int], ...]) -> Callable[[], object]:
    return lambda: [call() for call in calls]


def _per_call(call: Callable[[], object]) -> float:
    start = time.perf_counter()
    for _ in range(STEPS // 10):
        call()
    return (time.perf_counter() - start) / (STEPS // 10)


if __name__ == "__main__":
    whole_runs()
    parts()
