"""Is the step small enough? A run repeated over steps, metrics or signals against their limit."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import cached_property
from typing import Any

from ..checks import number
from ..errors import InputError, SimulationError, choices, nearest
from ..master.simulation import simulate
from ..metrics.metric import Metric, available, check_portable, measure, registered
from ..metrics.units import in_si
from ..numerals import fixed
from ..parallel import run_all
from ..system.description import System
from ..system.made_of import changed
from ..system.parts import NANOSECONDS
from .extrapolation import Convergence, converge

FACTORS = tuple(Fraction(2) ** power for power in range(-2, 6))
"""The steps of a study as multiples of the system's own: 1/4 to 32."""

TOLERANCE = 1e-3
"""s; for times, by default. For a grasp a tenth of the time between the contacts of its fingers."""

FEWEST = 3
"""Steps that an order needs."""

ENERGY = ".exchange_energy"
"""Signals with this in their name are energies in J that sample and hold created."""


@dataclass(frozen=True, slots=True)
class StepRun:
    """What a run with one step left: the quantities in question, energies in J at the end.

    `values` has None for a moment that never came. failure is what an FMU said where the run broke
    off, else None.
    """

    step_ns: int
    values: Mapping[str, float | None]
    energies: Mapping[str, float]
    failure: str | None = None

    @property
    def step(self) -> float:
        """The communication step in s."""
        return self.step_ns / NANOSECONDS


@dataclass(frozen=True)
class StepStudy:
    """Runs of one system with rising steps, and how a quantity tends to its limit.

    `quantities` are the names of single values, like "time_to_contact[1]" or "plant.gap[1]", all in
    `unit`, and so is the tolerance.
    """

    system: str
    scheme: str
    stop: float
    step_ns: int
    tolerance: float
    unit: str | None
    quantities: tuple[str, ...]
    runs: tuple[StepRun, ...]
    changed: Mapping[str, Any] = field(default_factory=dict)
    """What of the system was not as it was read: see system.made_of."""

    @cached_property
    def limits(self) -> Mapping[str, Convergence]:
        """How each quantity that has a value in any run tends to its limit."""
        steps = [run.step for run in self.runs]
        found = {name: [run.values.get(name) for run in self.runs] for name in self.quantities}
        return {
            name: converge(steps, values)
            for name, values in found.items()
            if any(v is not None for v in values)
        }

    @cached_property
    def kept(self) -> tuple[bool, ...]:
        """True for each run that keeps every quantity within the tolerance of its limit."""
        return tuple(
            bool(self.limits) and all(c.within(i, self.tolerance) for c in self.limits.values())
            for i in range(len(self.runs))
        )

    @property
    def largest(self) -> float | None:
        """The largest step in s that keeps the tolerance, as all finer ones do; None: none."""
        count = self.kept.index(False) if False in self.kept else len(self.runs)
        return self.runs[count - 1].step if count else None

    @property
    def holds(self) -> bool:
        """True if the system's own step keeps the tolerance, and all finer ones do."""
        return self.largest is not None and self.step_ns <= round(self.largest * NANOSECONDS)

    @property
    def shown(self) -> tuple[float, str]:
        """Factor and unit in which errors and the tolerance are shown: ms, mm, mm/s."""
        shown = {"s": (1e3, "ms"), "m": (1e3, "mm"), "m/s": (1e3, "mm/s")}
        return shown.get(self.unit or "", (1.0, self.unit or ""))

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
            "quantities": [
                {
                    "name": name,
                    "limit": c.limit,
                    "uncertainty": c.uncertainty,
                    "order": c.order,
                    "order_up_to": self.runs[c.settled - 1].step if c.settled else None,
                    "remark": c.remark or None,
                }
                for name, c in self.limits.items()
            ],
            "runs": [self._run_as_json(i) for i in range(len(self.runs))],
            "units": {
                **dict.fromkeys(("stop", "step", "largest_step", "order_up_to"), "s"),
                **dict.fromkeys(("tolerance", "limit", "uncertainty", "value", "error"), self.unit),
                "exchange_energy": "J",
            },
        }

    def _run_as_json(self, i: int) -> dict[str, Any]:
        run = self.runs[i]
        found = {name: self.limits.get(name) for name in self.quantities}
        return {
            "step": run.step,
            "value": {name: run.values.get(name) for name in self.quantities},
            "error": {name: c.errors[i] if c else None for name, c in found.items()},
            "order": {name: c.orders[i] if c else None for name, c in found.items()},
            "exchange_energy": dict(run.energies),
            "kept": self.kept[i],
            "failure": run.failure,
        }

    def as_text(self) -> str:
        """The study as a table, what each quantity shows, and a verdict."""
        head = f"{self.system}, {self.scheme}, to {self.stop:g} s, tolerance {self._tolerance()}"
        return "\n".join([head, *self._table(), *self._findings(), self._verdict()])

    def _tolerance(self) -> str:
        factor, unit = self.shown
        return f"{factor * self.tolerance:g} {unit}".rstrip()

    def _table(self) -> list[str]:
        names = list(dict.fromkeys(name for run in self.runs for name in run.energies))
        factor, unit = self.shown
        heads = ["step ms"]
        for name in self.limits:
            heads += [f"{name} {self.unit or ''}".rstrip(), f"error {unit}".rstrip(), "order"]
        heads += [f"energy uJ: {name.replace(ENERGY, ' ')}" for name in names]
        rows = [heads]
        for i, run in enumerate(self.runs):
            own = "*" if run.step_ns == self.step_ns else ""
            row = [f"{own}{1e3 * run.step:g}"]
            for name, c in self.limits.items():
                row.append(_number(run.values.get(name), 6))
                row.append(_number(c.errors[i], 4 if self.unit == "s" else None, factor))
                row.append(_number(c.orders[i], 2))
            row += [_number(run.energies.get(name), 2, 1e6) for name in names]
            rows.append(row)
        widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
        lines = [
            "  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True))
            for row in rows
        ]
        notes = [""]
        for run, kept in zip(self.runs, self.kept, strict=True):
            out = "out of tolerance" if self.limits and not kept else ""
            notes.append(f"failed: {run.failure}" if run.failure else out)
        return [f"{line}  {note}".rstrip() for line, note in zip(lines, notes, strict=True)]

    def _findings(self) -> list[str]:
        factor, unit = self.shown
        lines = ["*: the system's own step"]
        for name in self.quantities:
            c = self.limits.get(name)
            if c is None:
                lines.append(f"{name}: has no value in any run")
                continue
            words = []
            if c.limit is not None and c.uncertainty is not None:
                words.append(
                    f"limit {fixed(c.limit, 7)} {self.unit or ''}".rstrip()
                    + f", uncertain by {factor * c.uncertainty:.2g} {unit}".rstrip()
                )
            if c.order is not None:
                coarsest = 1e3 * self.runs[c.settled - 1].step
                words.append(f"observed order {c.order:.2f} up to {coarsest:g} ms")
            if c.remark:
                words.append(c.remark)
            lines.append(f"{name}: {'; '.join(words)}")
        return lines

    def _verdict(self) -> str:
        asked = " and ".join(dict.fromkeys(name.partition("[")[0] for name in self.quantities))
        if not self.limits:
            return f"{asked}: no value until {self.stop:g} s, nothing to judge; try a later --stop"
        within = f"{asked} within {self._tolerance()}"
        largest = self.largest
        if largest is None:
            return f"no step here keeps {within}; the finest is {1e3 * self.runs[0].step:g} ms"
        own = "does" if self.holds else "does not"
        return (
            f"the largest step that keeps {within} is {1e3 * largest:g} ms; "
            f"the system's own, {self.step_ns / NANOSECONDS * 1e3:g} ms, {own}"
        )


@dataclass(frozen=True, slots=True)
class Question:
    """What a study of steps asks about: metrics or signals of one unit, to a tolerance in it.

    A signal counts with its value at the end. `metrics` are a user's own.
    """

    metrics: tuple[Metric, ...]
    signals: tuple[str, ...]
    unit: str | None
    tolerance: float

    @property
    def quantities(self) -> tuple[str, ...]:
        """The names of the single values."""
        return (*(c for m in self.metrics for c in m.columns), *self.signals)


def ask(
    system: System,
    of: Sequence[str] = (),
    tolerance: float | None = None,
    metrics: Sequence[Metric] = (),
) -> Question:
    """The question about metrics or signals `of` these names, by default the primary metrics.

    `tolerance` is in the unit of these, by default TOLERANCE for times. `metrics` are there beside
    those that every result is asked for. InputError where there is no such quantity, they are of
    several units, or the tolerance is missing or not positive.
    """
    check_portable(metrics)
    in_si(system, registered(metrics))
    recorded = {str(port): v for port, v in system.recorded.items()}
    units = {name: v.unit for name, v in recorded.items() if v.is_number}
    known, reasons = available(registered(metrics), recorded, system.roles)
    by_name = {m.name: m for m in known if m.unit is not None}
    names = list(of) or [m.name for m in known if m.primary]
    if not names:
        because = f" ({choices(reasons)})" if reasons else ""
        raise InputError(
            f"{system.name}: nothing to study by default{because}; name metrics or signals: "
            f"valid: {choices([*by_name, *units])}"
        )
    for name in names:
        if name not in by_name and name not in units:
            raise InputError(
                f"{system.name}: no metric or signal {name!r}; {nearest(name, [*by_name, *units])}"
            )
    asked = {by_name[n].unit if n in by_name else units[n] for n in names}
    if len(asked) > 1:
        listed = choices(unit or "no unit" for unit in sorted(asked, key=str))
        raise InputError(f"{system.name}: {choices(names)} are in {listed}; must be of one unit")
    (unit,) = asked
    if tolerance is None and unit != "s":
        raise InputError(f"tolerance: must be given for {choices(names)}, in {unit or 'its unit'}")
    chosen = TOLERANCE if tolerance is None else tolerance
    number("tolerance", chosen, 0.0, above=True, must="a number greater than 0", unit=unit or "")
    return Question(
        tuple(by_name[n] for n in names if n in by_name),
        tuple(n for n in names if n not in by_name),
        unit,
        chosen,
    )


def step_study(
    system: System,
    tolerance: float | None = None,
    steps: Sequence[float] | None = None,
    workers: int = 1,
    progress: bool = False,
    *,
    of: Sequence[str] = (),
    metrics: Sequence[Metric] = (),
) -> StepStudy:
    """Repeat a run over `steps` in s, its own always among them, and compare quantities.

    By default the steps are FACTORS of the system's own, as far as they divide the stop time and
    the steps of the components, which stay as they are. For `of`, `tolerance` and `metrics` see
    ask(). Each of the workers is a process; the results are the same for any number of them. A run
    in which an FMU fails is one of the findings.

    InputError as from ask(), or where a given step does not fit, or fewer than three steps do.
    KeyboardInterrupt at Ctrl-C.
    """
    question = ask(system, of, tolerance, metrics)
    given = {system.with_experiment(step=step).step_ns for step in steps or ()}
    chosen = _ladder(system) if steps is None else sorted(given | {system.step_ns})
    if len(chosen) < FEWEST:
        listed = ", ".join(f"{ns / NANOSECONDS:g}" for ns in chosen)
        raise InputError(
            f"{system.name}: steps that fit the stop time: only {listed} s; must be at "
            f"least {FEWEST}: a stop time that more of them divide, or other steps"
        )
    # the finest, which is the longest, first
    jobs = [(replace(system, step_ns=ns), question) for ns in chosen]
    runs = run_all(run_step, jobs, min(workers, len(jobs)), progress, "step study")
    found = dict.fromkeys(name for run in runs for name in run.values)
    return StepStudy(
        system.name,
        system.scheme,
        system.stop_ns / NANOSECONDS,
        system.step_ns,
        question.tolerance,
        question.unit,
        tuple(found) or question.quantities,
        tuple(runs),
        changed(system),
    )


def _ladder(system: System) -> list[int]:
    """The steps in ns that fit, rising."""
    spans = [system.stop_ns, *(c.step_ns for c in system.components if c.step_ns is not None)]
    wanted = (factor * system.step_ns for factor in FACTORS)
    return [
        int(ns) for ns in wanted if ns.denominator == 1 and all(span % ns == 0 for span in spans)
    ]


def run_step(job: tuple[System, Question]) -> StepRun:
    """The run of a system with its own step; KeyboardInterrupt where it was interrupted."""
    system, question = job
    try:
        result = simulate(system)
    except SimulationError as error:
        return StepRun(system.step_ns, {}, {}, str(error))
    if not result.complete:
        raise KeyboardInterrupt
    found = measure(result.by_role, question.metrics).flat()
    values = {name: None if v is None else float(v) for name, v in found.items()}
    values |= {name: float(result[name][-1]) for name in question.signals}
    energies = {name: float(result[name][-1]) for name in result if ENERGY in name}
    return StepRun(system.step_ns, values, energies)


def _number(value: float | None, decimals: int | None, factor: float = 1.0) -> str:
    """A number in a table; without `decimals` it has three digits, whatever its size."""
    if value is None:
        return "-"
    return f"{factor * value:.3g}" if decimals is None else fixed(factor * value, decimals)
