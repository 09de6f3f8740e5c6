"""Compares two runs over the time that both have: signals and metrics, each in its band."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from math import inf
from pathlib import Path

import numpy as np

from ..base.errors import InputError, choices
from ..interface.units import Conversion
from ..master.simulation import simulate
from ..metrics.groups import metrics_of
from ..metrics.metric import Metric
from ..recording.log_names import AS_THEY_ARE, LogNames
from ..recording.result import Result
from ..system.description import FILES, System
from ..system.times import in_seconds, nearest_time
from .bands import SHARE, Band, Bands, Compared, metric_band, plain, signal_band
from .offset import fit_offset, shifted
from .outcome import ComparisonData
from .side import Side, differences, read_side, side_of
from .tube import ROUNDING, deviation
from .words import short_text

FEWEST_STEPS = 2
"""The least shift in time a derived band allows, in steps: one for the step, one for the scheme."""

Values = Mapping[str, float | None]


class Comparison(ComparisonData):
    """Two runs beside each other: true where they are alike, `if compare(a, b):`.

    What it has of them is as of a ComparisonData.
    """

    __slots__ = ()

    def __repr__(self) -> str:
        """The verdict, what the runs are, and the worst signals and metrics."""
        return short_text(self)

    def _repr_html_(self) -> str:
        """The same, as notebooks show it."""
        from .page import short_html  # only here: pages take long to import

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
            does not name is derived from `a` alone, as in a qualification.
        metrics: Metrics to be compared beside those of the system.
        names: The names of the columns of a log from elsewhere, with the offset of its time in s,
            as read_log_names() has it from a file.

    Returns:
        The comparison, true where the two are alike.

    Raises:
        InputError: A run cannot be read, or the two have no time or no signal in common.
        SimulationError: A system file was given, and its run fails.
    """
    first, second = (_recorded(run, called, names) for run, called in ((a, "A"), (b, "B")))
    first, second = first or _ran(a, second), second or _ran(b, first)
    first, second, said = _on_one_clock(first, second, names)
    first, second = first.like(second), second.like(first)
    begin, end = _overlap(first, second)
    ours, theirs = first.part(begin, end), second.part(begin, end)
    changes, given = _changes(ours, theirs), bands or Bands()
    asked, other = (_asked(side, part, metrics) for side, part in ((first, ours), (second, theirs)))
    values = ours.measured(asked), theirs.measured(other)
    given.check({**ours.signals, **theirs.signals}, values[0])
    shift = max(SHARE * (end - begin), FEWEST_STEPS * max(ours.interval, theirs.interval))
    again = ours.every_second()
    runs = (first.result, second.result) if first.result and second.result else None
    required = [m.name for m in other] if runs else []
    changed = theirs.converted(changes)
    found = judge(ours, changed, values, asked, again, given, shift, required=required)
    return replace(
        found,
        a=first,
        b=second,
        begin=begin,
        end=end,
        only=_only(ours.signals, theirs.signals),
        differences=differences(*runs) if runs else (),
        notes=(*said, *_notes(first, second, begin, end, changes)),
    )


def judge(
    a: Side,
    b: Side,
    values: tuple[Values, Values],
    asked: tuple[Metric, ...],
    again: Sequence[Side],
    bands: Bands,
    shift: float,
    nominals: Mapping[str, float | None] | None = None,
    required: Collection[str] = (),
) -> Comparison:
    """Compare two runs, both in the units of a, up to the end of the one that ends first.

    `values` are the metrics `asked` of each, `again` is the run of a with other numerics, `shift`
    the one in time in s which a derived band allows, `nominals` are the declared nominal values.
    A metric that is `required` and not optional is out where only one has it, and so is a signal
    that is a finite number in one of them only.
    """
    ours, theirs, runs = a.curves(), b.curves(), [run.curves() for run in again]
    ours = {name: curve for name, curve in ours.items() if name in theirs}
    theirs = {n: c._replace(held=c.held or ours[n].held) for n, c in theirs.items() if n in ours}
    signals = []
    for name, reference in ours.items():
        other, nominal = theirs[name].until(float(reference.time[-1])), (nominals or {}).get(name)
        gaps, other_gaps = reference.until(float(other.time[-1])).gaps, other.gaps
        reference, other = reference.without_gaps(), other.without_gaps()
        if not len(reference.time) and not len(other.time):
            continue
        unit, stated = a.units[name], bands.of_signal(name)
        if not np.array_equal(gaps, other_gaps):
            exact = Band(0.0, shift, "derived")
            band = stated.band(0.0, exact) if stated else exact
            time = float(np.setxor1d(gaps, other_gaps)[0])
            signals.append(Compared(name, unit, band, inf, None, None, time))
            continue
        numerics = [c for run in runs if len((c := run[name].without_gaps()).time)]
        band = signal_band(reference, numerics, nominal, shift, stated)
        apart = deviation(reference.until(float(other.time[-1])), other, band.time)
        worst = apart.values.argmax()
        time, distance, was, now = (float(column[worst]) for column in apart)
        low, high = reference.range
        signals.append(Compared(name, unit, band, distance, was, now, time, high - low))
    metrics, own, measured = [], values[0], [run.measured(asked) for run in again]
    by_name = {m.name: m for m in asked}
    for name in dict.fromkeys((*own, *values[1])):
        metric, value, found = by_name.get(plain(name)), own.get(name), values[1].get(name)
        if metric is None or value is found is None:
            continue
        judged = metric.name in required and not metric.optional
        if not judged and (name not in own or name not in values[1]):
            continue
        least = shift if metric.unit == "s" else SHARE if metric.unit == "1" else 0.0
        band = metric_band(value, (m.get(name) for m in measured), least, bands.of_metric(name))
        distance = inf if value is None or found is None else abs(found - value)
        metrics.append(Compared(name, metric.unit, band, distance, value, found))
    return Comparison(
        a,
        b,
        float(max(a.time[0], b.time[0])),
        float(min(a.time[-1], b.time[-1])),
        tuple(sorted(signals, key=lambda c: -c.ratio)),
        tuple(sorted(metrics, key=lambda c: -c.ratio)),
        (ours, theirs),
        asked,
        tuple(name for name, v in own.items() if v is values[1].get(name) is None),
        _only(a.signals, b.signals),
        _only(own, values[1]),
    )


def _on_one_clock(a: Side, b: Side, names: LogNames) -> tuple[Side, Side, list[str]]:
    """Both sides, with the offset of a log's clock found where that is asked for; what it is."""
    if names.file and a.result and b.result:
        raise InputError(f"{names.file}: neither {a.name} nor {b.name} is a log from elsewhere")
    if names.offset is not None:
        return a, b, []
    log, run = (a, b) if b.result else (b, a)
    if run.result is None:
        must = "one of the two must be a run of ours"
        raise InputError(f"{names.file}: time.offset = 'fit': {must}")
    alike = log.like(run)
    changes = {name: run.change(name, alike) for name in alike.signals if name in run.signals}
    offset = fit_offset(alike.converted(changes), run)
    said = f"the clock of {log.name} is off: {offset:.6g} s were added to its times"
    moved = shifted(log, offset)
    return (moved, b, [said]) if log is a else (a, moved, [said])


def _recorded(run: Result | str | Path, called: str, names: LogNames) -> Side | None:
    """The side of a result, which is `called` so, or of a file; None of a system."""
    if isinstance(run, Result):
        return side_of(run, called)
    return None if Path(run).suffix.lower() in FILES else read_side(Path(run), names)


def _ran(system: Result | str | Path, other: Side | None) -> Side:
    """The run of a system file, no longer than the other run."""
    loaded = System.load(str(system)).natively()
    if other:
        span = nearest_time(float(other.time[-1])) - loaded.start_ns
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
    for side, other in ((a, b), (b, a)):
        for name in (*side.signals, *side.texts):
            if name in other.signals:
                side.check_shared(name, other)
    found = {name: a.change(name, b) for name in a.signals if name in b.signals}
    if not any(found.values()):
        names = [f"{side.name} has {choices(side.signals, 3)}" for side in (a, b)]
        raise InputError(f"{'; '.join(names)}: must have a signal of one name and quantity")
    return found


def _asked(side: Side, part: Side, more: Sequence[Metric]) -> tuple[Metric, ...]:
    """The metrics of a side, those of its own file as they were recorded if all of it counts."""
    taken, whole = {m.name for m in more}, len(side.time) == len(part.time)
    recorded = side.result.more_metrics if side.result and whole else ()
    own = [m for m in recorded if m.name not in taken]
    return tuple(m for m in metrics_of(side.groups, [*more, *own]) if not m.reason)


def _only(
    ours: Collection[str], theirs: Collection[str]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    return tuple(n for n in ours if n not in theirs), tuple(n for n in theirs if n not in ours)


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
