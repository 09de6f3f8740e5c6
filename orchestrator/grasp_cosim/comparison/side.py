"""One of the two runs: a folder, or a log from elsewhere, CSV or ASAM MDF."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from si_units import known_unit

from ..base.errors import InputError
from ..base.files import check_nature
from ..interface.units import IDENTITY, Conversion, conversion
from ..metrics.metric import Metric, Signals
from ..recording.load import ARROW, SETTINGS, SIGNALS, load_run, read_mdf
from ..recording.result import Result
from ..system.parts import NANOSECONDS
from ..system.stimuli import read_stimuli
from .tube import ROUNDING, Curve, curve

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Side:
    """The numbers that were recorded, by name, on `time` in s, which does not fall.

    A signal whose unit is not known has none in `units`. `to_si` are the conversions to SI of those
    that are not in it. `texts` are the names of Strings.
    """

    name: str
    time: Floats
    signals: Mapping[str, npt.NDArray[Any]]
    units: Mapping[str, str | None]
    to_si: Mapping[str, Conversion]
    texts: tuple[str, ...] = ()
    result: Result | None = None
    """The run; None of a log from elsewhere."""
    roles: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    """The start values that the system of the run sets."""
    groups: Sequence[str] = ()
    """The groups of metrics that the system of the run names."""
    silent: tuple[str, ...] = ()
    """The signals of a log that told no unit, and got that of the other run."""

    @property
    def interval(self) -> float:
        """The usual time between two rows in s."""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0

    def part(self, begin: float, end: float) -> Side:
        """The rows from begin to end in s."""
        first = int(np.searchsorted(self.time, begin - ROUNDING, side="left"))
        rows = slice(first, int(np.searchsorted(self.time, end + ROUNDING, side="right")))
        signals = {name: column[rows] for name, column in self.signals.items()}
        return replace(self, time=self.time[rows], signals=signals)

    def curves(self) -> dict[str, Curve]:
        """The signals as curves."""
        return {name: curve(self.time, column) for name, column in self.signals.items()}

    def by_role(self) -> Signals:
        """The signals as metrics take them."""
        return Signals(self.time, self.signals, self.roles, self.to_si, self.values)

    def like(self, other: Side) -> Side:
        """A log from elsewhere as one of the other's system: with its roles, its types where they
        fit, and its units where the log tells of none.
        """
        if self.result:
            return self
        silent = {name for name in other.units if name in self.units and not self.units[name]}
        same = {n for n in other.units if n in silent or self.units.get(n) == other.units[n]}
        return replace(
            self,
            signals={n: _typed(c, other.signals.get(n)) for n, c in self.signals.items()},
            units={**self.units, **{name: other.units[name] for name in silent}},
            to_si={**self.to_si, **{n: c for n, c in other.to_si.items() if n in same}},
            roles=other.roles,
            values=other.values,
            groups=other.groups,
            silent=tuple(n for n in self.signals if n in silent),
        )

    def change(self, name: str, other: Side) -> Conversion | None:
        """The conversion of a signal from the other's unit to ours; None where there is none."""
        ours, theirs = self.units[name], other.units[name]
        if ours == theirs or not ours or not theirs:
            return IDENTITY
        known = known_unit(theirs), known_unit(ours)
        return conversion(known[0], known[1]) if known[0] and known[1] else None

    @property
    def recorded_metrics(self) -> tuple[Metric, ...]:
        """The metrics of the run's own file of metrics, as they were recorded."""
        return self.result.more_metrics if self.result else ()


def side_of(run: Result | str | Path, called: str) -> Side:
    """The side of a result, which is `called` so, or of what read_side() takes."""
    return _run(called, run) if isinstance(run, Result) else read_side(Path(run))


def read_side(path: Path) -> Side:
    """The run in a folder, of its signals.csv or run.json; or the log in a .csv or .mf4 file.

    InputError where it is missing, damaged or none of these.
    """
    one_of_its = path.name in (SIGNALS, ARROW, SETTINGS) and path.with_name(SETTINGS).is_file()
    if path.is_dir() or one_of_its:
        return _run(str(path), load_run(path))
    if not path.is_file():
        raise InputError(
            f"{path}: no such run; must be a folder that `run --out` wrote, a .csv or an .mf4 file"
        )
    if path.suffix.lower() == ".mf4":
        time, columns, units = read_mdf(path)
        return _log(path, time, columns, units)
    if path.suffix.lower() == ".csv":
        return _csv(path)
    check_nature(path, "run")
    raise InputError(
        f"{path}: must be a folder that `run --out` wrote, a .csv or an .mf4 file of signals"
    )


def _run(name: str, result: Result) -> Side:
    texts = tuple(name for name in result if name not in result.numbers)
    return Side(
        name, result.time, result.numbers, result.units, result.to_si, texts, result,
        result.roles, result.given, result.groups,
    )  # fmt: skip


def _csv(path: Path) -> Side:
    read = read_stimuli(path)
    numbers: dict[str, npt.NDArray[Any]] = {}
    for port, column in read.columns.items():
        samples = np.asarray(column.samples, np.float64)
        names = [text.lower() for text in column.texts]
        if not names:
            numbers[str(port)] = samples
        elif set(names) <= {"true", "false"}:
            numbers[str(port)] = np.array([name == "true" for name in names])[samples.astype(int)]
    names = [str(port) for port in read.columns]
    units = {str(port): c.unit for port, c in read.columns.items() if str(port) in numbers}
    time = np.asarray(read.times, np.float64) / NANOSECONDS
    return _log(path, time, numbers, units, [n for n in names if n not in numbers])


def _log(
    path: Path,
    time: Floats,
    columns: Mapping[str, npt.NDArray[Any]],
    units: Mapping[str, str | None],
    texts: Iterable[str] = (),
) -> Side:
    """A log from elsewhere; InputError where a number is not finite, or the time falls."""
    for name, column in columns.items():
        if not np.isfinite(column).all():
            at = time[int(np.flatnonzero(~np.isfinite(column))[0])]
            raise InputError(f"{path}: {name} at t = {at:.9g} s: must be a finite number")
    if not np.isfinite(time).all() or (np.diff(time) < 0.0).any():
        raise InputError(f"{path}: the time falls; must grow from row to row")
    known = {name: known_unit(unit or "1") for name, unit in units.items()}
    to_si = {n: Conversion(u.factor, u.offset) for n, u in known.items() if u and not u.si}
    return Side(str(path), time, columns, units, to_si, tuple(texts))


def _typed(column: npt.NDArray[Any], like: npt.NDArray[Any] | None) -> npt.NDArray[Any]:
    """The column in the element type of the other's, where that keeps its values."""
    typed = column if like is None else column.astype(like.dtype)
    return typed if np.array_equal(typed, column) else column
