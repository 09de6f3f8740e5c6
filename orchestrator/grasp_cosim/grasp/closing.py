"""A grasp that is run no longer than it takes."""

from ..base.interruption import interrupts
from ..master.simulation import simulate
from ..metrics.metric import resolved
from ..recording.result import Result
from ..system.description import System
from ..system.parts import NANOSECONDS
from .metrics import FINGERS

LOOK = 0.05
"""s; how often is asked whether both fingers touch."""


def close(system: System, after: float | None = None) -> Result:
    """Run a grasp until `after` s after both fingers touch, else or at the latest to its stop time.

    The end is known to LOOK; a result that ends early is not complete. KeyboardInterrupt on Ctrl-C.
    """
    steps = max(1, round(LOOK * NANOSECONDS / system.step_ns))
    with simulate.session(system) as session, interrupts(session.halt.set):
        end = system.stop_ns / NANOSECONDS
        touching = False
        contacts = [resolved(f"plant.contact[{j}]", system.roles) for j in FINGERS]
        while session.time < end and session.step(steps):
            if session.halt.is_set():
                raise KeyboardInterrupt
            if after is not None and not touching and all(session[name] for name in contacts):
                touching, end = True, session.time + after
        return session.result()
