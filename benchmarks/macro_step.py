"""One grasp of 3 s at 10 kHz: four FMU instances, every output recorded.

Prints the real-time factor of whole runs with both engines, and where a macro step's time goes in
plain Python. The machine's noise is shown, not averaged away.
"""

import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import replace

import numpy as np
from grasp_cosim import simulate
from grasp_cosim.fmi.instance import Call
from grasp_cosim.fmi.load import load
from grasp_cosim.grasp.system import grasp_system
from grasp_cosim.master.compiled import has_compiler
from grasp_cosim.master.engine import Engine, make_loop
from grasp_cosim.master.loop import STEP
from grasp_cosim.master.master import Master

from benchmarks.harness import spread

RUNS = 7
STEPS = 50
ROUNDS = 400


def whole_runs(engine: Engine) -> None:
    """Real-time factor of complete runs, recording included, loading not."""
    system = grasp_system()
    simulate(system, stop=0.01, engine=engine)  # compiles the loop
    factors = [simulate(system, engine=engine).metrics["real_time_factor"] for _ in range(RUNS)]
    worst, median, best = spread(factors)
    print(
        f"3 s at 10 kHz, {engine}, {RUNS} runs: {best:.2f} times real time at best, "
        f"{median:.2f} median, {worst:.2f} at worst"
    )


def parts() -> None:
    """Print the share of a macro step that each component's calls take, at best."""
    system = grasp_system()
    spent: dict[str, float] = {}
    with ExitStack() as stack:
        instances = [load(component) for component in system.components]
        for instance in instances:
            stack.callback(instance.close)
        master = Master(system, instances, lambda *_: None, "python")
        master.initialise()
        plan = master.plan
        steps = {first for kind, first, *_ in plan.operations if kind == STEP}
        calls = []
        for i, (call, owner) in enumerate(zip(plan.calls, plan.owners, strict=True)):
            name = "exchange" if owner is None else owner.name
            calls.append(
                Call(_timed(call.python, f"{name} {'step' if i in steps else 'values'}", spent))
            )
        run = make_loop(replace(plan, calls=calls), "python")
        rows = np.empty((STEPS, len(plan.values)))
        rounds = []
        for first in range(0, ROUNDS * STEPS, STEPS):
            spent.update(dict.fromkeys(spent, 0.0))
            start = time.perf_counter()
            reached, _, status = run(rows, 0, first, first + STEPS, system.step_ns)
            rounds.append({"macro step": time.perf_counter() - start, **spent})
            if status:
                raise RuntimeError(f"step {reached}: status {status}")
    least = {name: min(times[name] for times in rounds) / STEPS for name in rounds[0]}
    macro = least.pop("macro step")
    print(f"macro step in plain Python without recording: {1e6 * macro:.1f} us at best")
    for name, seconds in least.items():
        print(f"  {name:20s} {seconds / macro:6.1%}")


def _timed(call: Callable[[], int], name: str, spent: dict[str, float]) -> Callable[[], int]:
    """The call, with the time it takes added to what was spent under the name."""
    spent[name] = 0.0

    def timed() -> int:
        start = time.perf_counter()
        status = call()
        spent[name] += time.perf_counter() - start
        return status

    return timed


if __name__ == "__main__":
    if has_compiler():
        whole_runs("compiled")
    whole_runs("python")
    parts()
