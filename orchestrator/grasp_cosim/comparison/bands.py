"""Each signal and metric of two runs in its band, given in a file or derived from the reference.

docs/explanation/tolerance_bands.md explains them. A file overrides that for the signals and metrics
that it names, in the unit of the original:

    [signals]
    "plant.gap[1]" = { absolute = 1e-5, relative = 1e-3, time = 2e-3 }
    "controller.*" = { relative = 0.01 }      # * stands for anything; an exact name goes first
    "plant.contact*" = { absolute = inf }     # not judged

    [metrics]
    time_to_contact = { absolute = 0.002 }    # of both fingers; or "time_to_contact[1]"
"""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from pathlib import Path
from typing import Any, Literal, TypedDict

from ..base.checks import known, number, toml_table
from ..base.errors import InputError, choices, nearest
from ..base.typed_json import Decoder, json_in
from .tube import FAR, Curve, deviation

SHARE = 1e-3
"""The smallest derived width as a share of the range, and time as a share of the duration."""

SMALL = 1e-6
"""The smallest derived width as a share of the size of a signal."""

BOTH = 2.0
"""The numerical errors of two runs, of that of one."""


@dataclass(frozen=True, slots=True)
class Band:
    """How far a signal or a metric of two runs may be apart."""

    width: float
    """The deviation that is allowed, in the unit of the signal or metric."""
    time: float
    """The shift in time that is allowed, in s."""
    source: Literal["given", "derived"]
    """"given" by the user, or "derived" from the reference."""


@dataclass(frozen=True, slots=True)
class Given:
    """An entry of a file; relative is a share of the signal's range, or of the metric's value."""

    absolute: float | None = None
    relative: float | None = None
    time: float | None = None

    @property
    def wide(self) -> bool:
        """True if it gives a width; else that is derived."""
        return self.absolute is not None or self.relative is not None

    def band(self, scale: float, derived: Band) -> Band:
        """The band it makes where relative is of scale; what it does not give stays derived."""
        stated_width = (self.absolute or 0.0) + (self.relative * scale if self.relative else 0.0)
        time = derived.time if self.time is None else self.time
        return Band(stated_width if self.wide else derived.width, time, "given")


@dataclass(frozen=True, slots=True)
class Bands:
    """The bands that a user states, as read_bands() has them from a file."""

    place: str = ""
    """The file, at the beginning of messages."""
    signals: Mapping[str, Given] = field(default_factory=dict)
    """The bands of signals by the pattern of their names."""
    metrics: Mapping[str, Given] = field(default_factory=dict)
    """The bands of metrics by the pattern of their names."""

    def of_signal(self, name: str) -> Given | None:
        """The band for a signal.

        Args:
            name: The name of the signal.

        Returns:
            The entry whose pattern fits; None where there is none.
        """
        return entry_for(self.signals, name)

    def of_metric(self, name: str) -> Given | None:
        """The band for a metric, by its name or that of all its values.

        Args:
            name: The name of the metric, or of one of its values, "time_to_contact[1]".

        Returns:
            The entry whose pattern fits; None where there is none.
        """
        return entry_for(self.metrics, name, plain(name))

    def check(self, signals: Collection[str], metrics: Iterable[str]) -> None:
        """Refuse a pattern that no name fits: most likely it is misspelt.

        Args:
            signals: The names of the signals.
            metrics: The names of the metrics.

        Raises:
            InputError: No name fits a pattern.
        """
        both = [n for name in metrics for n in dict.fromkeys((plain(name), name))]
        kinds = (("signals", self.signals, signals), ("metrics", self.metrics, both))
        for kind, entries, names in kinds:
            for pattern in entries:
                if not any(_fits(pattern, name) for name in names):
                    place = f"{self.place}: [{kind}]: nothing is called {pattern!r}"
                    raise InputError(f"{place}; {nearest(pattern, names)}")


def read_bands(path: str | Path) -> Bands:
    """Read bands from a file.

    Args:
        path: A TOML file; or a JSON file, what `qualify --json` printed: the bands that were used.

    Returns:
        The bands.

    Raises:
        InputError: The file cannot be read, or an entry is wrong; with its name.
    """
    path = Path(path)
    if path.suffix == ".json":
        table = _bands_of_qualification(path)
    else:
        table = toml_table(path, "file of bands")
    valid = {"signals": ("absolute", "relative", "time"), "metrics": ("absolute", "relative")}
    for key in table:
        known(f"{path}: unknown entry", key, valid)
    tables = (_entries(f"{path}: [{key}]", table.get(key, {}), of) for key, of in valid.items())
    return Bands(str(path), *tables)


class QualificationBands(TypedDict):
    """The bands in the JSON of a qualification: by kind, pattern and key; null is infinite."""

    bands: Mapping[str, Mapping[str, Mapping[str, float | None]]]


def _bands_of_qualification(path: Path) -> dict[str, Any]:
    """The bands in the JSON of a qualification, as those of a TOML file."""
    must = "the file must be what `qualify --json` printed"
    try:
        content = json_in(str(path), path.read_bytes())
        decoded = Decoder().decoded(QualificationBands, str(path), content)
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; {must}") from error
    except InputError as error:
        raise InputError(f"{error}; {must}") from error
    return {
        kind: {
            pattern: {key: inf if value is None else value for key, value in entry.items()}
            for pattern, entry in entries.items()
        }
        for kind, entries in decoded["bands"].items()
    }


def entry_for(entries: Mapping[str, Given], *names: str) -> Given | None:
    """The entry of the first of the names that has one; else the first pattern that fits one."""
    exact = [entries[name] for name in names if name in entries]
    fitting = (e for pattern, e in entries.items() if any(_fits(pattern, n) for n in names))
    return exact[0] if exact else next(fitting, None)


def plain(name: str) -> str:
    """The name of a metric that has a value of this name, like time_to_contact[1]."""
    return name.partition("[")[0]


def signal_band(
    reference: Curve,
    repetitions: Iterable[Curve],
    nominal: float | None,
    time: float,
    stated: Given | None = None,
) -> Band:
    """The band of a signal from its reference and from the same run with other numerics.

    time in s is the shift allowed unless given says otherwise, nominal the declared nominal value;
    None stands for 1, as in FMI. A held curve (Booleans, integers) has the derived width 0.
    """
    distances = [
        float(deviation(reference, repetition, time).values.max()) for repetition in repetitions
    ]
    distances = [distance for distance in distances if distance < SMALL * FAR]
    low, high = reference.range
    width, span = BOTH * max(distances, default=0.0), high - low
    if not reference.held:
        size = max(abs(low), abs(high), 1.0 if nominal is None else abs(nominal))
        width = max(SHARE * span, SMALL * size, width)
    derived = Band(width, time, "derived")
    return stated.band(span, derived) if stated else derived


def metric_band(
    value: float | None,
    repetitions: Iterable[float | None],
    least: float,
    stated: Given | None = None,
) -> Band:
    """The band of a metric from its value and those of the same run with other numerics.

    least is the smallest derived width where that is not a share of the value: of a time the shift
    allowed for signals, of a share of something else SHARE. None is the value of a moment that
    never comes.
    """
    size = abs(value or 0.0)
    distances = [
        abs(repetition - value)
        for repetition in repetitions
        if repetition is not None and value is not None
    ]
    width = max(least, SHARE * size, SMALL, BOTH * max(distances, default=0.0))
    derived = Band(width, 0.0, "derived")
    return stated.band(size, derived) if stated else derived


def _fits(pattern: str, name: str) -> bool:
    """True if a name fits a pattern, in which only * is special: names have brackets."""
    return re.fullmatch(".*".join(map(re.escape, pattern.split("*"))), name) is not None


def _entries(place: str, table: Any, valid: Sequence[str]) -> dict[str, Given]:
    if not isinstance(table, dict):
        raise InputError(f"{place}: {table!r}: must be a table")
    entry_of = {}
    for pattern, entry in table.items():
        entry_place = f"{place}: {pattern!r}"
        if not isinstance(entry, dict) or not entry:
            raise InputError(
                f"{entry_place} = {entry!r}: must be a table with one of {choices(valid)}"
            )
        for key, value in entry.items():
            known(f"{entry_place}: unknown entry", key, valid)
            infinite = ", inf where it is not judged" if key == "absolute" else ""
            if not (infinite and value == inf):
                number(
                    f"{entry_place}: {key}", value, 0.0, must=f"a number of at least 0{infinite}"
                )
        entry_of[pattern] = Given(**{key: float(value) for key, value in entry.items()})
    return entry_of


@dataclass(frozen=True, slots=True)
class Compared:
    """A signal or metric of both runs, in the unit of the original, which is the reference."""

    name: str
    """Its name."""
    unit: str | None
    """The unit of the values and of the deviation; None without one."""
    band: Band
    """How far the two may be apart."""
    deviation: float
    """The largest deviation; inf where only one run has a value of a metric."""
    original: float | None
    """The value of the original there; None where it has none."""
    candidate: float | None
    """The value of the candidate there, the nearest within the shift that the band allows; None
    where it has none.
    """
    time: float | None = None
    """The time of the largest deviation in s; None of a metric."""
    span: float | None = None
    """The range of the original's signal; None of a metric."""

    @property
    def ratio(self) -> float:
        """The deviation in widths of its band."""
        if self.deviation == 0.0 or self.band.width == inf:
            return 0.0
        return self.deviation / self.band.width if self.band.width else inf

    @property
    def inside(self) -> bool:
        """True if the deviation is in its band."""
        return self.ratio <= 1.0
