"""Is the step small enough? A grasp repeated over steps, its contact times against their limit."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

from ..errors import InputError, SimulationError
from ..grasp.metrics import FINGERS, is_grasp
from ..master.simulation import simulate
from ..parallel import run_all
from ..system.description import System
from ..system.parts import NANOSECONDS
from .extrapolation import Convergence, converge

FACTORS = tuple(Fraction(2) ** power for power in range(-2, 6))
"""The steps of a study as multiples of the system's own: 1/4 to 32."""

TOLERANCE = 1e-3
"""s; for contact times, by default. A tenth of the time between the contacts of the two fingers."""

FEWEST = 3
"""Steps that an order needs."""

ENERGY = ".exchange_energy"
"""Signals with this in their name are energies in J that sample and hold created."""


@dataclass(frozen=True, slots=True)
class StepRun:
    """What a run with one step left: contact times in s, energies in J at the end, by signal.

    failure is what an FMU said where the run broke off, else None.
    """

    step_ns: int
    contact_times: tuple[float | None, float | None]
    energies: Mapping[str, float]
    failure: str | None = None

    @property
    def step(self) -> float:
        """The communication step in s."""
        return self.step_ns / NANOSECONDS


@dataclass(frozen=True)
class StepStudy:
    """Runs of one system with rising steps, and what they say. tolerance in s."""

    system: str
    scheme: str
    stop: float
    step_ns: int
    tolerance: float
    runs: tuple[StepRun, ...]

    @cached_property
    def fingers(self) -> Mapping[int, Convergence]:
        """How the contact time of each finger that touches in any run tends to its limit."""
        steps = [run.step for run in self.runs]
        times = {j: [run.contact_times[j - 1] for run in self.runs] for j in FINGERS}
        return {j: converge(steps, t) for j, t in times.items() if any(x is not None for x in t)}

    @cached_property
    def kept(self) -> tuple[bool, ...]:
        """Whether a run keeps every contact time within the tolerance of its limit."""
        return tuple(
            bool(self.fingers) and all(c.within(i, self.tolerance) for c in self.fingers.values())
            for i in range(len(self.runs))
        )

    @property
    def largest(self) -> float | None:
        """The largest step in s that keeps the tolerance, as all finer ones do; None: none."""
        count = self.kept.index(False) if False in self.kept else len(self.runs)
        return self.runs[count - 1].step if count else None

    @property
    def holds(self) -> bool:
        """Whether the system's own step keeps the tolerance, and all finer ones do."""
        return self.largest is not None and self.step_ns <= round(self.largest * NANOSECONDS)

    def as_json(self) -> dict[str, Any]:
        """The study as plain values for JSON; times in s, energies in J."""
        return {
            "system": self.system,
            "scheme": self.scheme,
            "stop": self.stop,
            "step": self.step_ns / NANOSECONDS,
            "tolerance": self.tolerance,
            "holds": self.holds,
            "largest_step": self.largest,
            "fingers": [
                {
                    "finger": j,
                    "limit": c.limit,
                    "uncertainty": c.uncertainty,
                    "order": c.order,
                    "order_up_to": self.runs[c.settled - 1].step if c.settled else None,
                    "remark": c.remark or None,
                }
                for j, c in self.fingers.items()
            ],
            "runs": [self._run_as_json(i) for i in range(len(self.runs))],
        }

    def _run_as_json(self, i: int) -> dict[str, Any]:
        run = self.runs[i]
        found = [self.fingers.get(j) for j in FINGERS]
        return {
            "step": run.step,
            "time_to_contact": list(run.contact_times),
            "error": [c.errors[i] if c else None for c in found],
            "order": [c.orders[i] if c else None for c in found],
            "exchange_energy": dict(run.energies),
            "kept": self.kept[i],
            "failure": run.failure,
        }

    def as_text(self) -> str:
        """The study as a table, what each finger shows, and a verdict."""
        head = (
            f"{self.system}, {self.scheme}, to {self.stop:g} s, "
            f"tolerance {1e3 * self.tolerance:g} ms"
        )
        return "\n".join([head, *self._table(), *self._findings(), self._verdict()])

    def _table(self) -> list[str]:
        names = list(dict.fromkeys(name for run in self.runs for name in run.energies))
        heads = ["step ms"]
        for j in self.fingers:
            heads += [f"contact {j} s", "error ms", "order"]
        heads += [f"energy uJ: {name.replace(ENERGY, ' ')}" for name in names]
        rows = [heads]
        for i, run in enumerate(self.runs):
            own = "*" if run.step_ns == self.step_ns else ""
            row = [f"{own}{1e3 * run.step:g}"]
            for j, c in self.fingers.items():
                row.append(_number(run.contact_times[j - 1], ".6f"))
                row.append(_number(c.errors[i], ".4f", 1e3))
                row.append(_number(c.orders[i], ".2f"))
            row += [_number(run.energies.get(name), ".2f", 1e6) for name in names]
            rows.append(row)
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = [
            "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
            for row in rows
        ]
        verdicts = ["", *(self._note(i) for i in range(len(self.runs)))]
        return [
            f"{line}  {verdict}".rstrip() for line, verdict in zip(lines, verdicts, strict=True)
        ]

    def _note(self, i: int) -> str:
        if self.runs[i].failure:
            return f"failed: {self.runs[i].failure}"
        return "out of tolerance" if self.fingers and not self.kept[i] else ""

    def _findings(self) -> list[str]:
        lines = ["*: the system's own step"]
        for j in FINGERS:
            c = self.fingers.get(j)
            if c is None:
                lines.append(f"finger {j}: touches in no run")
                continue
            words = []
            if c.limit is not None and c.uncertainty is not None:
                words.append(f"limit {c.limit:.7f} s, uncertain by {1e3 * c.uncertainty:.2g} ms")
            if c.order is not None:
                coarsest = 1e3 * self.runs[c.settled - 1].step
                words.append(f"observed order {c.order:.2f} up to {coarsest:g} ms")
            if c.remark:
                words.append(c.remark)
            lines.append(f"finger {j}: {'; '.join(words)}")
        return lines

    def _verdict(self) -> str:
        if not self.fingers:
            return f"no finger touches until {self.stop:g} s: nothing to judge; try a later --stop"
        within = f"the contact times within {1e3 * self.tolerance:g} ms"
        largest = self.largest
        if largest is None:
            return f"no step here keeps {within}; the finest is {1e3 * self.runs[0].step:g} ms"
        own = "does" if self.holds else "does not"
        return (
            f"the largest step that keeps {within} is {1e3 * largest:g} ms; "
            f"the system's own, {self.step_ns / NANOSECONDS * 1e3:g} ms, {own}"
        )


def step_study(
    system: System,
    tolerance: float = TOLERANCE,
    steps: Sequence[float] | None = None,
    workers: int = 1,
    progress: bool = False,
) -> StepStudy:
    """Repeat a grasp over steps in s, its own always among them, and compare the contact times.

    By default the steps are FACTORS of the system's own, as far as they divide the stop time and
    the steps of the components, which stay as they are. tolerance in s. Each of the workers is a
    process; the results are the same for any number of them. A run in which an FMU fails is one of
    the findings.

    InputError where the system is no grasp, the tolerance is not positive, a given step does not
    fit, or fewer than three steps do. KeyboardInterrupt at Ctrl-C.
    """
    check_study(system, tolerance)
    chosen = _ladder(system) if steps is None else _given(system, steps)
    if len(chosen) < FEWEST:
        listed = ", ".join(f"{ns / NANOSECONDS:g}" for ns in chosen)
        raise InputError(
            f"{system.name}: only {len(chosen)} steps fit the stop time, {listed} s; must be at "
            f"least {FEWEST}: a stop time that more of them divide, or other steps"
        )
    jobs = [replace(system, step_ns=ns) for ns in chosen]  # the finest, which is the longest, first
    runs = run_all(run_step, jobs, min(workers, len(jobs)), progress, "steps")
    return StepStudy(
        system.name,
        system.scheme,
        system.stop_ns / NANOSECONDS,
        system.step_ns,
        tolerance,
        tuple(runs),
    )


def check_study(system: System, tolerance: float) -> None:
    """InputError where there is no study of that system or with that tolerance in s."""
    if not (math.isfinite(tolerance) and tolerance > 0.0):
        raise InputError(f"tolerance = {tolerance!r} s: must be a number greater than 0")
    outputs = (f"{c.name}.{v.name}" for c in system.components for v in c.interface.of("output"))
    if not is_grasp(outputs):
        raise InputError(
            f"{system.name}: no contact times to study; must be a system with a gripper plant and "
            "a controller. For another one compare runs with several --step by their signals"
        )


def _ladder(system: System) -> list[int]:
    """The steps in ns that fit, rising."""
    wanted = [factor * system.step_ns for factor in FACTORS]
    return [int(ns) for ns in wanted if ns.denominator == 1 and _fits(system, int(ns))]


def _fits(system: System, step_ns: int) -> bool:
    own = [c.step_ns for c in system.components if c.step_ns is not None]
    return all(span % step_ns == 0 for span in (system.stop_ns, *own))


def _given(system: System, steps: Sequence[float]) -> list[int]:
    """The given steps and the system's own in ns, rising; InputError where one does not fit."""
    chosen = {system.with_experiment(step=step).step_ns for step in steps}
    return sorted(chosen | {system.step_ns})


def run_step(system: System) -> StepRun:
    """The run of a system with its own step; KeyboardInterrupt where it was interrupted."""
    try:
        result = simulate(system)
    except SimulationError as error:
        return StepRun(system.step_ns, (None, None), {}, str(error))
    if not result.complete:
        raise KeyboardInterrupt
    first, second = result.metrics["time_to_contact"]
    energies = {name: float(result[name][-1]) for name in result if ENERGY in name}
    return StepRun(system.step_ns, (first, second), energies)


def _number(value: float | None, form: str, factor: float = 1.0) -> str:
    return "-" if value is None else f"{factor * value:{form}}"
