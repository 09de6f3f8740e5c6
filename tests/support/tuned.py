"""A problem with a known solution: least 1/(g·u) where g² + u² keeps a limit.

x is the integral of g·u. With the limit 2·r², the solution is g = u = r, and 1/r².
"""

from collections.abc import Sequence
from pathlib import Path

from grasp_cosim import System
from grasp_cosim.metrics.metric import Metric, load_metrics
from grasp_cosim.tuning.problem import Condition, Gain, Problem
from grasp_cosim.tuning.search import Point, Runs
from support.made_studies import write_native

METRICS = """
from grasp_cosim import metric

@metric("slowness", unit="s")
def slowness(run):
    return run.time[-1] / run["a.x"][-1]

@metric("effort")
def effort(run):
    u = run["a.y_Real"][-1]
    return u**2 + (run["a.x"][-1] / run.time[-1] / u) ** 2

@metric("sometimes")
def sometimes(run):
    return None if run["a.x"][-1] > 0.3 else [1.0, 2.0]
"""

GAINS = (Gain(("a.gain",), 0.5, 8.0), Gain(("a.u_Real",), 0.5, 8.0))


def metrics(folder: Path) -> tuple[Metric, ...]:
    """Those of METRICS."""
    (folder / "mine.py").write_text(METRICS, "utf-8")
    return load_metrics(folder / "mine.py")


def known_problem(
    folder: Path,
    most: float | None = 18.0,
    gains: Sequence[Gain] = GAINS,
    checks: Sequence[dict[str, float]] = (),
) -> Problem:
    """The problem, its system's gains 1 and 2: it is solved by g = u = sqrt(most/2)."""
    write_native(folder)
    system = System.load(folder / "system.toml").with_values({"a.gain": 1.0})
    return Problem(
        tuple(gains),
        "slowness",
        {"effort": most},
        (Condition("as it is", system),),
        tuple(Condition(str(values), system.with_values(values)) for values in checks),
        metrics(folder),
    )


class Computed(Runs):
    """The same by the formulas, without runs; `most_at_once` is the size of a generation."""

    batches: list[int]

    def measured(self, wanted):  # type: ignore[no-untyped-def]
        """A point for each pair of gains and conditions."""
        self.batches = [*getattr(self, "batches", []), len(wanted)]
        return [
            Point((g, u), {"slowness": 1.0 / (g * u), "effort": g * g + u * u})
            for (g, u), _ in wanted
        ]
