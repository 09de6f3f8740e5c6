"""Compares two runs over the time that both have: signals and metrics, each in its band."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from ..base.errors import InputError, choices
from ..interface.units import Conversion
from ..master.simulation import simulate
from ..metrics.groups import metrics_of
from ..metrics.metric import Metric
from ..recording.log_names import AS_THEY_ARE, LogNames
from ..recording.result import Result
from ..system.description import FILES, System
from ..system.times import in_seconds, nearest_time
from .bands import SHARE, Bands
from .judge import Judge, Values, common_curves
from .offset import fit_offset, shifted
from .outcome import ComparisonData
from .side import Side, differences, read_side, side_of, unread
from .summary import short_text
from .tube import ROUNDING

FEWEST_STEPS = 2
"""The least shift in time a derived band allows, in steps: one for the step, one for the scheme."""


class Comparison(ComparisonData):
    """Two runs next to each other: true where they are alike, `if compare(a, b):`.

    What it has of them is as of a ComparisonData.
    """

    __slots__ = ()

    def __repr__(self) -> str:
        """The verdict, what the runs are, and the worst signals and metrics."""
        return short_text(self)

    def _repr_html_(self) -> str:
        """The same, as notebooks show it."""
        from .comparison_page import short_html  # only here: pages take long to import

        return short_html(self)


def compare(
    a: Result | str | Path,
    b: Result | str | Path,
    *,
    bands: Bands | None = None,
    metrics: Sequence[Metric] = (),
    names: LogNames = AS_THEY_ARE,
) -> Comparison:
    """Compare two runs: their signals and metrics, each against a band.

    Args:
        a: A result, a folder that `run --out` wrote, or a CSV or MDF file. It is the reference. One
            of the two may be a system file: that is run, as long as the other run is.
        b: The other run, as `a`.
        bands: How far signals and metrics may be apart, as read_bands() has it from a file. What it
            does not name is derived from `a` only, as in a qualification.
        metrics: Metrics to be compared in addition to those of the system.
        names: The names of the columns of a log from elsewhere, with the offset of its time in s,
            as read_log_names() has it from a file.

    Returns:
        The comparison, true where the two are alike.

    Raises:
        InputError: A run cannot be read, or the two have no time or no signal in common.
        SimulationError: A system file was given, and its run fails.

    Example:
        >>> from grasp_cosim import compare, grasp_system, simulate
        >>> white = simulate(grasp_system(), step=1e-3, stop=0.5)
        >>> dark = simulate(
        ...     grasp_system().with_values({"sensor_1.reflectance": 0.5}), step=1e-3, stop=0.5
        ... )
        >>> bool(compare(white, white)), bool(compare(white, dark))
        (True, False)
    """
    first, second = (_recorded(run, called, names) for run, called in ((a, "A"), (b, "B")))
    first, second = first or _ran(a, second), second or _ran(b, first)
    first, second, clock_notes = _on_one_clock(first, second, names)
    first, second = first.like(second), second.like(first)
    begin, end = _overlap(first, second)
    first_part, second_part = first.part(begin, end), second.part(begin, end)
    changes, stated = _changes(first_part, second_part), bands or Bands()
    first_metrics = _metrics_of(first, first_part, metrics)
    second_metrics = _metrics_of(second, second_part, metrics)
    aside = unread(first_part, second_part, (*first_metrics, *second_metrics))
    first_part, second_part = (replace(s, unread=aside) for s in (first_part, second_part))
    values = first_part.measured(first_metrics), second_part.measured(second_metrics)
    stated.check({**first_part.signals, **second_part.signals}, values[0])
    interval = max(first_part.interval, second_part.interval)
    shift = max(SHARE * (end - begin), FEWEST_STEPS * interval)
    runs = (first.result, second.result) if first.result and second.result else None
    required = [m.name for m in second_metrics] if runs else []
    repetitions = first_part.every_second()
    judge = Judge(first_part, repetitions, stated, shift, required=required)
    comparison = compared_by(judge, second_part.converted(changes), values, first_metrics)
    return replace(
        comparison,
        a=first,
        b=second,
        begin=begin,
        end=end,
        only=_only(first_part.signals, second_part.signals),
        differences=differences(*runs) if runs else (),
        notes=(*clock_notes, *_notes(first, second, begin, end, changes), *_without(aside)),
    )


def compared_by(
    judge: Judge,
    candidate: Side,
    values: tuple[Values, Values],
    definitions: tuple[Metric, ...],
) -> Comparison:
    """Compare two runs, both in the units of the reference, up to the end that comes first.

    Args:
        judge: It has the reference and the bands.
        candidate: The other run.
        values: The values of the metrics of the two.
        definitions: These metrics.
    """
    reference = judge.reference
    curves, candidate_curves = common_curves(reference, candidate)
    measured, candidate_measured = values
    signals = judge.signals(curves, candidate_curves)
    metrics = judge.metrics(measured, candidate_measured, definitions)
    signals.sort(key=lambda signal: -signal.ratio)
    metrics.sort(key=lambda metric: -metric.ratio)
    absent = [
        name
        for name, value in measured.items()
        if value is None and candidate_measured.get(name) is None
    ]
    begin = float(max(reference.time[0], candidate.time[0]))
    end = float(min(reference.time[-1], candidate.time[-1]))
    return Comparison(
        reference,
        candidate,
        begin,
        end,
        tuple(signals),
        tuple(metrics),
        (curves, candidate_curves),
        definitions,
        tuple(absent),
        _only(reference.signals, candidate.signals),
        _only(measured, candidate_measured),
    )


def _on_one_clock(a: Side, b: Side, names: LogNames) -> tuple[Side, Side, list[str]]:
    """Both sides, with the offset of a log's clock found where that is asked for; what it is."""
    if names.file and a.result and b.result:
        raise InputError(f"{names.file}: neither {a.name} nor {b.name} is a log from elsewhere")
    if names.offset is not None:
        return a, b, []
    log, run = (a, b) if b.result else (b, a)
    if run.result is None:
        must = "one of the two must be a run of grasp-cosim"
        raise InputError(f"{names.file}: time.offset = 'fit': {must}")
    alike = log.like(run)
    changes = {name: run.change(name, alike) for name in alike.signals if name in run.signals}
    offset = fit_offset(alike.converted(changes), run)
    note = f"the clock of {log.name} is off: {offset:.6g} s were added to its times"
    moved = shifted(log, offset)
    return (moved, b, [note]) if log is a else (a, moved, [note])


def _recorded(run: Result | str | Path, called: str, names: LogNames) -> Side | None:
    """The side of a result, which is `called` so, or of a file; None of a system."""
    if isinstance(run, Result):
        return side_of(run, called)
    return None if Path(run).suffix.lower() in FILES else read_side(Path(run), names)


def _ran(system: Result | str | Path, counterpart: Side | None) -> Side:
    """The run of a system file, no longer than the other run."""
    loaded = System.load(str(system)).untriggered()
    if counterpart:
        span = nearest_time(float(counterpart.time[-1])) - loaded.start_ns
        stop = min(loaded.stop_ns, loaded.time_ns(max(int(span // loaded.step_ns), 1)))
        loaded = loaded.with_experiment(stop=in_seconds(stop))
    return side_of(simulate(loaded), str(system))


def _overlap(a: Side, b: Side) -> tuple[float, float]:
    """The first and the last time in s that both have; InputError where there is none."""
    begin, end = max(a.time[0], b.time[0]), min(a.time[-1], b.time[-1])
    if begin > end + ROUNDING:
        spans = [f"{s.name}: {s.time[0]:.6g} to {s.time[-1]:.6g} s" for s in (a, b)]
        raise InputError(f"{'; '.join(spans)}: must have some time in common")
    for side in (a, b):
        if not len(side.part(begin, end).time):
            span = f"{begin:.6g} to {end:.6g} s"
            raise InputError(f"{side.name}: has no row from {span}; must have one")
    return float(begin), float(end)


def _changes(a: Side, b: Side) -> dict[str, Conversion | None]:
    """The conversion of each signal that both have to the unit of a; None where there is none."""
    for side, counterpart in ((a, b), (b, a)):
        for name in (*side.signals, *side.texts):
            if name in counterpart.signals:
                side.check_shared(name, counterpart)
    changes = {name: a.change(name, b) for name in a.signals if name in b.signals}
    if not any(changes.values()):
        names = [f"{side.name} has {choices(side.signals, 3)}" for side in (a, b)]
        raise InputError(f"{'; '.join(names)}: must have a signal of one name and quantity")
    return changes


def _metrics_of(side: Side, part: Side, extra: Sequence[Metric]) -> tuple[Metric, ...]:
    """The metrics of a side, those of its file as they were recorded if all of it counts."""
    taken, is_whole = {m.name for m in extra}, len(side.time) == len(part.time)
    recorded = side.result.more_metrics if side.result and is_whole else ()
    recorded_besides = [m for m in recorded if m.name not in taken]
    return tuple(m for m in metrics_of(side.groups, [*extra, *recorded_besides]) if not m.reason)


def _without(aside: Sequence[str]) -> Iterator[str]:
    """A line on signals that metrics could have used, had both runs them."""
    if aside:
        yield f"metrics of both do without what one run lacks: {choices(aside, 4)}"


def _only(
    first: Collection[str], second: Collection[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return tuple(n for n in first if n not in second), tuple(n for n in second if n not in first)


def _notes(
    a: Side, b: Side, begin: float, end: float, changes: Mapping[str, Conversion | None]
) -> Iterator[str]:
    """Lines on the time compared, on runs that ended early, and on units that were assumed."""
    sides = (("A", a), ("B", b))
    spans = [f"{letter} is {s.time[0]:.6g} to {s.time[-1]:.6g} s" for letter, s in sides]
    if (a.time[0], a.time[-1]) != (b.time[0], b.time[-1]):
        yield f"compared from {begin:.6g} to {end:.6g} s, where both are: {', '.join(spans)}"
    for letter, side in sides:
        if not side.result:
            yield f"{letter} is a log from elsewhere: its settings are not known"
            if side.silent:
                yield f"{letter} tells no units of {choices(side.silent, 6)}: taken as in the other"
        elif side.result.every > 1:
            yield f"{letter} recorded one row in {side.result.every}: its metrics are of these"
        if side.texts:
            yield f"{letter} has texts, which are not compared: {choices(side.texts, 6)}"
    unlike = [f"{n} ({a.units[n]}, {b.units[n]})" for n, change in changes.items() if not change]
    if unlike:
        yield f"not compared, as the units do not convert: {choices(unlike, 6)}"
