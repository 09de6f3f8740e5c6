"""One of the two runs, a folder or a log from elsewhere, and where the settings of two differ."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple
from warnings import warn

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError, choices
from ..base.files import check_nature
from ..base.si_units import known_unit
from ..base.text import counted
from ..interface.units import IDENTITY, Conversion, conversion
from ..metrics.metric import Metric, Signals, measure, optional_signals
from ..recording.folder import ARROW, SETTINGS, SIGNALS
from ..recording.log_names import AS_THEY_ARE, LogNames
from ..recording.read_back import load_run
from ..recording.result import Result
from ..recording.signals import LOGS, Log, read_log
from ..system.settings import given_units, given_values
from .tube import FAR, ROUNDING, Curve

AS_IT_STARTS, NONE = "as the FMU starts", "none"
"""In place of a value that was not given, and of what one run has not."""


@dataclass(frozen=True, eq=False, repr=False)
class Side:
    """The numbers that were recorded, by name, on `time` in s, which does not fall.

    A signal whose unit is not known has none in `units`. `to_si` are the conversions to SI of those
    that are not in it. `texts` are the names of Strings, `values` the start values that the system
    of the run sets, `groups` those of metrics that it names.
    """

    name: str
    time: npt.NDArray[np.float64]
    signals: Mapping[str, npt.NDArray[Any]]
    units: Mapping[str, str | None]
    to_si: Mapping[str, Conversion]
    texts: Sequence[str] = ()
    result: Result | None = None
    """The run; None of a log from elsewhere."""
    log: Log | None = None
    """That log; None of a run."""
    roles: Mapping[str, str] = field(default_factory=dict)
    values: Mapping[str, Any] = field(default_factory=dict)
    groups: Sequence[str] = ()
    silent: tuple[str, ...] = ()
    """The signals of a log that told no unit, and got that of the other run."""
    unread: Collection[str] = ()
    """The signals that its metrics do not read, because the other run lacks them."""

    def __repr__(self) -> str:
        """What it is called, and how much of it there is."""
        size = f"{counted(len(self.time), 'row')}, {counted(len(self.signals), 'signal')}"
        return f"Side {self.name}: {size}"

    @property
    def interval(self) -> float:
        """The usual time between two rows in s."""
        return float(np.median(np.diff(self.time))) if len(self.time) > 1 else 0.0

    def part(self, begin: float, end: float) -> Side:
        """The rows from begin to end in s."""
        first = int(np.searchsorted(self.time, begin - ROUNDING, side="left"))
        return self._rows(slice(first, int(np.searchsorted(self.time, end + ROUNDING, "right"))))

    def every_second(self) -> list[Side]:
        """The rows of even numbers, and those of odd ones; each with the ends."""
        is_kept = np.zeros((2, len(self.time)), bool)
        is_kept[0, ::2] = is_kept[1, 1::2] = is_kept[:, 0] = is_kept[:, -1] = True
        return [self._rows(rows) for rows in is_kept]

    def _rows(self, chosen: Any) -> Side:
        signals = {name: column[chosen] for name, column in self.signals.items()}
        return replace(self, time=self.time[chosen], signals=signals)

    def converted(self, changes: Mapping[str, Conversion | None]) -> Side:
        """With other values of signals, without those whose conversion is None."""
        conversions = {n: changes.get(n, IDENTITY) for n in self.signals}
        signals = {
            n: self.signals[n] if c == IDENTITY else c(self.signals[n])
            for n, c in conversions.items()
            if c
        }
        return replace(self, signals=signals)

    def check_shared(self, name: str, counterpart: Side) -> None:
        """InputError where a signal that the other has as numbers is none of finite ones here."""
        if name in self.texts:
            if self.log is not None:
                self.log[name]  # its error names the line that is no number
            raise InputError(
                f"{self.name}: {name}: has texts; must be numbers, as in {counterpart.name}"
            )
        if self.log is None:
            return
        wrong = np.flatnonzero(~np.isfinite(self.signals[name]))
        if len(wrong):
            at = self.time[int(wrong[0])]
            raise InputError(f"{self.name}: {name} at t = {at:.9g} s: must be a finite number")

    def curves(self) -> dict[str, Curve]:
        """The signals as curves; Booleans and integers are held between samples.

        All that is FAR from zero is the same: inf or the largest double, a distance to nothing.
        """
        return {
            name: Curve(
                self.time, np.clip(column.astype(np.float64), -FAR, FAR), column.dtype.kind != "f"
            )
            for name, column in self.signals.items()
        }

    def measured(self, metrics: Iterable[Metric]) -> dict[str, float | None]:
        """The metrics as single values by names like time_to_contact[1]; true is 1 and false 0."""
        read = {name: x for name, x in self.signals.items() if name not in self.unread}
        signals = Signals(self.time, read, self.roles, self.to_si, self.values)
        values = measure(signals, metrics).flat()
        return {name: None if v is None else float(v) for name, v in values.items()}

    def like(self, reference: Side) -> Side:
        """A log from elsewhere as one of the other's system: with its roles, its types where they
        fit, and its units where the log has none.
        """
        if self.result:
            return self
        silent = {name for name in reference.units if name in self.units and not self.units[name]}
        units = {**self.units, **{name: reference.units[name] for name in silent}}
        to_si = {
            **self.to_si,
            **{
                name: change
                for name, change in reference.to_si.items()
                if units.get(name) == reference.units.get(name)
            },
        }
        typed = {
            name: _typed(column, reference.signals.get(name))
            for name, column in self.signals.items()
        }
        return replace(
            self,
            signals=typed,
            units=units,
            to_si=to_si,
            roles=reference.roles,
            values=reference.values,
            groups=reference.groups,
            silent=tuple(name for name in self.signals if name in silent),
        )

    def change(self, name: str, reference: Side) -> Conversion | None:
        """The conversion of a signal from the other's unit to ours; None where there is none."""
        own_unit, reference_unit = self.units[name], reference.units[name]
        if own_unit == reference_unit or not own_unit or not reference_unit:
            return IDENTITY
        si_units = known_unit(reference_unit), known_unit(own_unit)
        return conversion(si_units[0], si_units[1]) if si_units[0] and si_units[1] else None


def unread(a: Side, b: Side, metrics: Iterable[Metric]) -> tuple[str, ...]:
    """The signals of one run that the other lacks, and that metrics use but can do without.

    A metric of both is then of the same signals: moments of the plant have other errors than those
    of samples.
    """
    metrics = tuple(metrics)
    optional = {n: None for s in (a, b) for n in optional_signals(metrics, s.signals, s.roles)}
    return tuple(name for name in optional if (name in a.signals) != (name in b.signals))


MAX_WINDOWS = 3
"""So many windows of a triggered run are named."""


def side_of(run: Result, called: str) -> Side:
    """The side of a result, which is `called` so; InputError of a triggered run, for its gaps."""
    if run.is_triggered:
        windows = [str(Path(called) / part.subfolder) for part in run.windows] or ["another run"]
        raise InputError(
            f"{called}: recorded windows with gaps between; must be one of them: "
            f"{choices(windows, MAX_WINDOWS)}"
        )
    texts = [name for name in run if name not in run.numbers]
    return Side(
        called, run.time, run.numbers, run.units, run.to_si, texts, run, None, run.roles, run.given,
        run.groups,
    )  # fmt: skip


def read_side(path: Path, names: LogNames = AS_THEY_ARE) -> Side:
    """The run in a folder, of its signals.csv or run.json; or the log in a file of LOGS, by names.

    InputError where it is missing, damaged or none of these.
    """
    one_of_its = path.name in (SIGNALS, ARROW, SETTINGS) and path.with_name(SETTINGS).is_file()
    if path.is_dir() or one_of_its:
        return side_of(load_run(path), str(path))
    valid = f"a folder that `run --out` wrote, or a {choices(LOGS)} file"
    if not path.is_file():
        raise InputError(f"{path}: no such run; must be {valid}")
    if path.suffix.lower() in LOGS:
        return _of_log(read_log(path, names))
    check_nature(path, "run")
    raise InputError(f"{path}: must be {valid} of signals")


def _of_log(log: Log) -> Side:
    """A log from elsewhere; InputError where the time falls."""
    if not np.isfinite(log.time).all() or (np.diff(log.time) < 0.0).any():
        raise InputError(f"{log.path}: the time falls; must grow from row to row")
    readable = [name for name in log if log.readable(name)]
    texts = [name for name in log if name not in readable]
    units = {name: log.units[name] for name in readable}
    si_unit_of = {name: known_unit(unit or "1") for name, unit in units.items()}
    to_si = {n: Conversion(u.factor, u.offset) for n, u in si_unit_of.items() if u and not u.si}
    signals = {name: log[name] for name in readable}
    return Side(str(log.path), log.time, signals, units, to_si, texts, log=log)


def _typed(column: npt.NDArray[Any], like: npt.NDArray[Any] | None) -> npt.NDArray[Any]:
    """The column in the element type of the other's, where that keeps its values."""
    typed = column if like is None else column.astype(like.dtype)
    return typed if np.array_equal(typed, column) else column


class Difference(NamedTuple):
    """A setting that differs between two runs, and its value in each of them, in words."""

    setting: str
    a: str
    b: str

    @property
    def what(self) -> str:
        """The setting, by its former name, which is gone in the next version."""
        warn("Difference.what is now Difference.setting", DeprecationWarning, stacklevel=2)
        return self.setting


def differences(a: Result, b: Result) -> tuple[Difference, ...]:
    """Where the settings of two runs, the FMUs and the versions differ."""
    first, second = dict(_facts(a)), dict(_facts(b))
    values = {name for run in (a, b) for name in given_values(run.settings)}
    different = []
    for setting in dict.fromkeys((*first, *second)):
        absent = AS_IT_STARTS if setting in values else NONE
        in_a, in_b = first.get(setting, absent), second.get(setting, absent)
        if in_a != in_b:
            different.append(Difference(setting, in_a, in_b))
    return tuple(different)


def _facts(run: Result) -> Iterator[tuple[str, str]]:
    """The settings, FMUs and versions of a run by name, each in words; equal for equal runs."""
    settings, fmus = run.settings, run.origin.get("fmus", {})
    yield from run.view.traits(run).items()
    for key in ("system", "scheme", "step", "stop"):
        yield key, _words(settings[key]) + (" s" if key in ("step", "stop") else "")
    yield from _nested("initialisation ", settings["initialisation"])
    yield "order of the components", ", ".join(settings["components"])
    for name, component in settings["components"].items():
        ran = fmus.get(name, {})
        twin = ", native" if "native_twin_of" in ran else ""
        guid = f" {ran['guid']}" if "guid" in ran else ""
        yield f"FMU of {name}", f"{component['fmu']}{guid}{twin}"
        for key in ("step", "isolation", "solver", "tolerance", "rename", "units"):
            if isinstance(entry := component.get(key), Mapping):
                yield from _nested(f"{key} of {name} ", entry)
            elif entry is not None:
                yield f"{key} of {name}", _words(entry) + (" s" if key == "step" else "")
    units = given_units(settings)
    for name, value in given_values(settings).items():
        yield name, f"{_words(value)} {units.get(name, '')}".strip()
    yield from _nested("role ", settings.get("roles", {}))
    for connection in settings["connections"]:
        factor, offset = connection["factor"], connection["offset"]
        scaled = "" if factor is None else f" x {_words(factor)}"
        shifted = f" + {_words(offset)}" if offset else ""
        yield f"source of {connection['to']}", f"{connection['from']}{scaled}{shifted}"
    for kind in ("events", "faults"):
        yield kind, "; ".join(map(_words, settings[kind])) or NONE
    yield from _nested("input ", settings.get("input", {}))
    yield from _nested("trigger: ", settings.get("trigger", {}))
    yield from _nested("version of ", run.origin.get("versions", {}))


def _nested(prefix: str, entries: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    yield from ((f"{prefix}{key}", _words(value)) for key, value in entries.items())


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} = {_words(v)}" for key, v in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_words, value))
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)
