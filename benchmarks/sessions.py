"""What a session adds to simulate(): python -m benchmarks.sessions

The grasp of the paper, native, in steps of 0.1 ms. Each part is measured in one round with the
steps of a run in one piece, as simulate() takes them; the ratios are the medians of the rounds, in
these steps. Times are of the processor, which others that run on the machine change less.
"""

import statistics
import sys
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from grasp_cosim import Session, System, grasp_system, simulate

ROUNDS, WHOLE, STEPS = 9, 20_000, 2000
VISCOSITY = "controller.impact_reduction.viscosity[1]"


def timed(act: Callable[[], object], times: int) -> float:
    """The time in us of one of so many calls."""
    begin = time.process_time()
    for _ in range(times):
        act()
    return 1e6 * (time.process_time() - begin) / times


def parts(session: Session) -> dict[str, float]:
    """The times in us of what a session does, by its name."""
    session.reset()
    state = session.save()

    def detour() -> None:
        session.save()
        session.restore(state)

    return {
        "session.step()": timed(session.step, STEPS),
        "session.step(10)": timed(lambda: session.step(10), STEPS // 10),
        "session['plant.gap[1]']": timed(lambda: session["plant.gap[1]"], STEPS),
        "session.set()": timed(lambda: session.set(VISCOSITY, -0.2), STEPS),
        "save() and restore()": timed(detour, STEPS // 4),
        "reset()": timed(session.reset, STEPS // 4),
        "reset() to other values": timed(lambda: session.reset({"plant.object_width": 0.06}), 20),
    }


def control_step(system: System) -> dict[str, float]:
    """The time in us of a control step of 1 ms of an environment, where gymnasium is there."""
    try:
        from grasp_cosim.gym import Environment
    except Exception as error:
        print(f"{error}", file=sys.stderr)
        return {}
    gaps = {f"plant.gap[{j}]": (-0.01, 0.2) for j in (1, 2)}
    actions, action = {VISCOSITY: (-0.5, 0.5)}, np.zeros(1)
    made = Environment(system, gaps, actions, "plant.contact_force[1]", step=1e-3, stop=2.0)
    made.reset()
    took = timed(lambda: made.step(action), 1500)
    made.close()
    return {"a control step of 1 ms (gym)": took}


def main() -> None:
    """Print a table of medians."""
    system = grasp_system()
    found: dict[str, list[tuple[float, float]]] = {}
    for _ in range(ROUNDS):
        with simulate.session(system) as session:
            step = timed(partial(session.step, WHOLE), 1) / WHOLE
        opened = timed(lambda: simulate.session(system).close(), 5)
        with simulate.session(system) as session:
            times = {**parts(session), "a session, opened and closed": opened}
        for name, took in {"a step of simulate()": step, **times, **control_step(system)}.items():
            found.setdefault(name, []).append((took, took / step))
    print("| | best, us | median, us | in steps of simulate() |\n|---|---|---|---|")
    for name, measured in found.items():
        best, median = min(t for t, _ in measured), statistics.median(t for t, _ in measured)
        ratio = statistics.median(ratio for _, ratio in measured)
        print(f"| {name} | {best:.2f} | {median:.2f} | {ratio:.3g} |")


if __name__ == "__main__":
    main()
