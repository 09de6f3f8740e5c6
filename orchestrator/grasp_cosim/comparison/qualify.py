"""Swap qualification: whether an FMU may take the place of another in the closed loop.

First what the candidate declares otherwise. Where nothing of that blocks, the closed loop runs with
the original and with the candidate, and each signal and metric of the two is compared in its band.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ..base.checks import choice
from ..base.errors import InputError, SimulationError
from ..interface.interface import Value
from ..interface.units import IDENTITY, Conversion
from ..master.simulation import simulate
from ..metrics.in_si import in_si
from ..metrics.metric import Metric, metrics_of
from ..recording.result import Result
from ..system.description import System
from ..system.parts import ISOLATIONS, NANOSECONDS, Component, Isolation
from ..system.structure import SCHEMES
from .bands import SHARE, Bands, entry_for
from .compare import Comparison
from .interface_difference import Difference
from .judged import FEWEST_STEPS, Compared, Curves, Reference, curves_of, every_second
from .settings import differences
from .side import side_of
from .swap import Swap, prepare_swap
from .tube import Curve

END = Metric(
    "end_of_run", lambda run: float(run.time[-1]), "s", "where an FMU asked for the end, else stop"
)
"""Compared where one of the runs ends before the stop time."""


@dataclass(frozen=True, slots=True)
class Qualification:
    """The verdict and all that led to it; signals and metrics the worst first.

    failure is why the candidate did not run to the end, None where it did or was not run. numerics
    are the other runs of the original that derived bands are from. runs are the signals of the
    original and of the candidate, by name and in the original's units. log is what the candidate's
    run tells and the original's does not. `asked` are the metrics, `absent` those that neither run
    has a value of, `results` the runs.
    """

    swap: Swap
    signals: tuple[Compared, ...] = ()
    metrics: tuple[Compared, ...] = ()
    failure: str | None = None
    numerics: tuple[str, ...] = ()
    runs: tuple[Curves, Curves] = ({}, {})
    log: tuple[str, ...] = ()
    asked: tuple[Metric, ...] = ()
    absent: tuple[str, ...] = ()
    results: tuple[Result, Result] | None = None

    @property
    def blocks(self) -> tuple[Difference, ...]:
        """The differences that kept the candidate from being run."""
        return tuple(d for d in self.swap.differences if d.severity == "blocks")

    @property
    def outside(self) -> tuple[Compared, ...]:
        """The signals and metrics that are out of their bands."""
        return tuple(c for c in (*self.signals, *self.metrics) if not c.inside)

    @property
    def uncompared(self) -> tuple[str, ...]:
        """The signals of the original that the candidate's run lacks, or has in no such unit."""
        return tuple(name for name in self.runs[0] if name not in self.runs[1])

    @property
    def comparison(self) -> Comparison | None:
        """Both runs as those of a comparison; None where the candidate did not run."""
        if self.results is None or not self.signals:
            return None
        original, candidate = (side_of(r, str(r.settings["system"])) for r in self.results)
        names = (self.swap.original.name, self.swap.candidate.name)
        a, b = (replace(s, name=n) for s, n in zip((original, candidate), names, strict=True))
        end = float(min(a.time[-1], b.time[-1]))
        compared = [c.name for c in self.signals]
        curves = tuple({name: run[name] for name in compared} for run in self.runs)
        return Comparison(
            a,
            b,
            0.0,
            end,
            self.signals,
            self.metrics,
            (curves[0], curves[1]),
            self.asked,
            (self.uncompared, ()),
            ((), ()),
            differences(*self.results),
            self.log,
            self.absent,
            ("original", "candidate"),
        )

    @property
    def qualified(self) -> bool:
        """True if the candidate may take the original's place: all that there was to compare."""
        compared = self.signals or self.metrics
        return bool(compared) and not (self.blocks or self.failure or self.outside)


def qualify(
    system: System,
    component: str,
    candidate: str | Path | Component,
    *,
    rename: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    values: Mapping[str, Value] | None = None,
    bands: Bands | None = None,
    isolation: Isolation = "process",
    progress: bool = False,
    metrics: Sequence[Metric] = (),
) -> Qualification:
    """Compare a candidate FMU with that of a component, as declared and in the closed loop.

    The candidate may be a component of another system, with its names, units and values. An FMU has
    the names and units of the component it is to replace, as far as they fit it; rename maps the
    system's names to the candidate's, units variables of the candidate to the names of their units,
    where it declares none or a wrong one. values like {'plant.object_width': 0.06}
    are set in both systems, in the unit of the original, or in the one that has such a variable.
    bands are derived where they are not given. The candidate runs in a process of its own, which a
    crash does not leave, unless isolation says otherwise. metrics are compared beside those of the
    system. InputError where the input is wrong or the original refuses,
    SimulationError where the original fails, KeyboardInterrupt at Ctrl-C.
    """
    bands = bands or Bands()
    choice("isolation", isolation, ISOLATIONS)
    new = candidate if isinstance(candidate, Component) else Path(candidate)
    swap = prepare_swap(system, component, new, rename or {}, values or {}, isolation, units)
    if swap.swapped is None:
        return Qualification(swap)
    asked = tuple(m for m in metrics_of(system.metrics, metrics) if not m.reason)
    more = _conversions_of_candidate(swap.swapped, asked)
    reference = _run(swap.system, progress and "original")
    asked += (END,) if _ended_early(reference) else ()
    original = _reference(swap, reference, asked, more)
    signals, singles = original.entries(bands, metrics=(END.name,))
    result, failure = _tried(swap.swapped, progress)
    again: list[Curves] = []
    numerics: list[str] = []
    there = {n for n, v in original.values(original.curves).items() if v is not None}
    asked_of = (*signals.values(), *(entry for n, entry in singles.items() if n in there))
    if not all(entry and entry.wide for entry in asked_of):
        again, numerics = _other_numerics(swap.system, original.curves, progress)
    theirs = _converted(curves_of(result), swap) if result else {}
    if result and _ended_early(result) and END not in asked:
        original = replace(original, asked=(*asked, END))
        singles = {**singles, END.name: entry_for(bands.metrics, END.name)}
    singly = original.values(theirs)
    return Qualification(
        swap,
        original.signals(theirs, again, signals),
        () if failure else original.metrics(singly, again, singles),
        failure,
        tuple(numerics),
        (original.curves, theirs),
        _remarks(reference, result) if result else (),
        original.asked,
        () if failure else original.absent(singly),
        (reference, result) if result else None,
    )


def _reference(
    swap: Swap, run: Result, asked: tuple[Metric, ...], more: Mapping[str, Conversion]
) -> Reference:
    """The run of the original to compare with; more are conversions of signals that it lacks."""
    to_si = {n: c for n, c in more.items() if n not in run} | dict(run.to_si)
    shift, roles = _shift(swap.system), swap.system.roles
    return Reference(
        curves_of(run), run.units, shift, asked, roles, to_si, swap.nominals, given=run.given
    )


def _tried(swapped: System, progress: bool) -> tuple[Result | None, str | None]:
    """The candidate's run as far as it got, and why it did not get to the end."""
    try:
        return _run(swapped, progress and "candidate"), None
    except SimulationError as error:
        return error.result, str(error)
    except InputError as error:  # does not load, or refuses its initialisation
        return None, str(error)


def _conversions_of_candidate(
    swapped: System, metrics: Sequence[Metric]
) -> Mapping[str, Conversion]:
    """The conversions to SI of the system with the candidate; InputError if a unit is wrong."""
    try:
        return in_si(swapped, metrics).conversions
    except InputError as error:
        raise InputError(
            f"{error}; of the candidate: --set components.NAME.units.VARIABLE=UNIT"
        ) from error


def _run(system: System, progress: str | bool) -> Result:
    result = simulate(system, progress=progress)
    if not result.complete:
        raise KeyboardInterrupt
    return result


def _ended_early(result: Result) -> bool:
    """True if an FMU asked for the end before the stop time."""
    return result.complete and bool(result.time[-1] < result.settings["stop"])


def _other_numerics(
    system: System, original: Curves, progress: bool
) -> tuple[list[Curves], list[str]]:
    """The original thinned, with twice the step and in the other scheme, as far as it runs so.

    And what they are, in words.
    """
    runs = every_second(original)
    said = ["every second sample"]
    for name, other in _variants(system):
        try:
            runs.append(curves_of(_run(other, progress and f"original, {name}")))
            said.append(name)
        except (InputError, SimulationError) as error:
            said.append(f"not {name}: {error}")
    return runs, said


def _variants(system: System) -> Iterator[tuple[str, System]]:
    twice = 2 * system.step_ns
    steps = [
        system.stop_ns - system.start_ns,
        *(c.step_ns for c in system.components if c.step_ns is not None),
    ]
    if not any(step % twice for step in steps):
        step = twice / NANOSECONDS
        yield f"step {step:g} s", system.with_experiment(step=step)
    for scheme in SCHEMES:
        if scheme != system.scheme:
            yield f"scheme {scheme}", system.with_experiment(scheme=scheme)


def _remarks(reference: Result, result: Result) -> tuple[str, ...]:
    """Lines that only the candidate's run said, and on what is not compared."""
    texts = [name for name in reference if name not in reference.numbers]
    said = [line for line in result.log if line not in reference.log]
    return (*said, *(f"{name} is a String: not compared" for name in texts))


def _shift(system: System) -> float:
    """The shift in time in s that a derived band allows."""
    return (
        max(SHARE * (system.stop_ns - system.start_ns), FEWEST_STEPS * system.step_ns) / NANOSECONDS
    )


def _converted(curves: Curves, swap: Swap) -> dict[str, Curve]:
    """The signals in the original's units, but for those that cannot be."""
    return {
        name: Curve(c.time, change(c.values), c.held)
        for name, c in curves.items()
        if (change := swap.back.get(name, IDENTITY)) is not None
    }
