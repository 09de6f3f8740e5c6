"""Stimuli: columns of numbers over time that drive inputs and tunable parameters, from a table.

A CSV file is as FMPy and fmusim take it: names in the first line, the time in the first column, two
rows of one time for a jump. A column is `component.variable`, with a unit in brackets if it is in
another one than the variable: `plant.force [kN]`.
"""

from __future__ import annotations

import hashlib
import math
from array import array
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypedDict, get_args

from ..base.checks import choice
from ..base.errors import InputError, choices
from ..base.typed_json import Decoder, json_in
from .parts import Connection, Port, as_port, as_signal
from .times import LONGEST, NANOSECONDS

if TYPE_CHECKING:
    from ..tables.column import Column

Interpolation = Literal["linear", "held"]
INTERPOLATIONS: tuple[str, ...] = get_args(Interpolation)

MAX_NAMED = 3
"""So many columns are named in the repr() of stimuli."""


RecordedConnection = TypedDict(
    "RecordedConnection", {"from": str, "to": str, "factor": float | None, "offset": float | None}
)
"""A connection as run.json has it."""


class RecordedConnections(TypedDict):
    """What is read here of run.json."""

    connections: list[RecordedConnection]


RECORDED_STEM, RUN_FILE = "signals", "run.json"
"""The stem of a file that a run records, and the file next to it that has its connections."""


@dataclass(frozen=True)
class Stimulus:
    """The samples of one input or parameter, in its unit or in the one named.

    With texts, such as the names of an enumeration, they are their places among these. Sequences
    are arrays, which take 8 bytes a number.
    """

    samples: Sequence[float]
    unit: str | None = None
    texts: tuple[str, ...] = ()
    number: int = 0
    """That of its column in the file, from 1; 0 where it is not known, as in earlier archives."""

    def text(self, row: int) -> str:
        """The sample of a row as a text."""
        sample = self.samples[row]
        return self.texts[int(sample)] if self.texts else repr(sample).removesuffix(".0")

    @cached_property
    def extremes(self) -> tuple[int, ...]:
        """The first rows with the smallest and the largest sample."""
        return tuple(self.samples.index(find(self.samples)) for find in (min, max))

    @cached_property
    def distinct(self) -> tuple[int, ...]:
        """The first row of each sample that differs from all before it."""
        first: dict[float, int] = {}
        for row, sample in enumerate(self.samples):
            first.setdefault(sample, row)
        return tuple(first.values())


@dataclass(frozen=True, repr=False)
class Stimuli:
    """Samples that drive inputs and tunable parameters: columns, and the times of the rows in ns,
    which do not fall.

    "linear" interpolates continuous Reals and holds all others from row to row; "held" holds all.
    Before the first row and after the last one their values are held. lines are those of the rows
    in the file where they are not simply one after the other. partial says that FMUs may yet be
    swapped, so that a column may be of a variable which is not there. behind are the columns of the
    file that variables have their samples of, where these have other names. is_text_file is False
    for a file of Arrow or Parquet, which has no lines.
    """

    file: str
    times: Sequence[int]
    columns: Mapping[Port, Stimulus]
    interpolation: Interpolation = "linear"
    lines: Sequence[int] = field(default_factory=lambda: array("q"))
    partial: bool = field(default=False, compare=False)
    behind: Mapping[Port, Port] = field(default_factory=dict, compare=False)
    is_text_file: bool = True
    recorded: tuple[Connection, ...] | None = field(default=None, compare=False)
    """Of a file that a run has recorded, the connections of that: see replay.py."""
    recorded_columns: Mapping[Port, Stimulus] = field(default_factory=dict, compare=False)
    path: str | None = field(default=None, compare=False)
    """Of the file, absolute; None where it is in an archive."""

    def __repr__(self) -> str:
        return f"Stimuli of {self.file}, {len(self.times)} rows: {choices(self.columns, MAX_NAMED)}"

    def __post_init__(self) -> None:
        """ValueError where the columns could not be read from a file."""
        count, columns = len(self.times), self.columns.values()
        good = all(len(c.samples) == count and all(map(math.isfinite, c.samples)) for c in columns)
        texts = all(set(c.samples) <= {*range(len(c.texts))} for c in columns if c.texts)
        rises = [*self.times] == sorted(self.times)
        if not (count and good and texts and rises and len(self.lines) in (0, count)):
            raise ValueError(f"{self.file}: times and samples do not go together")

    def place(self, port: Port, row: int | None = None) -> str:
        """A column, and in it a row, for messages."""
        parts = []
        if not self.is_text_file:
            if row is not None:
                parts.append(f"row {row + 1}")
        elif row is None:
            parts.append("line 1")
        else:
            parts.append(f"line {self.lines[row] if self.lines else row + 2}")
        if number := self.columns[port].number:
            parts.append(f"column {number}")
        return f"{self.file}: {', '.join([*parts, str(self.behind.get(port, port))])}"


def read_stimuli(
    path: str | Path, interpolation: str = "linear", place: str = "interpolation"
) -> Stimuli:
    """The stimuli of a table; place says where the interpolation comes from.

    InputError where there is none, or at the first cell that is not as it must be, but for what
    depends on the variables: see validity.py.
    """
    from ..tables.read_table import read_table  # only here: most runs have no stimuli

    path = Path(path)
    chosen: Interpolation = choice(place, interpolation, INTERPOLATIONS)
    table = read_table(path, path.name)
    time, *columns_of_ports = table.columns
    if not time.is_time() or not columns_of_ports:
        raise InputError(
            f"{time.heading} = {time.head!r}: must be time, then component.variable, with commas, "
            "semicolons or tabs between them and points in numbers"
        )
    if not table.row_count:
        raise InputError(f"{path.name}: has no row below its names; must have one")
    ports: dict[Port, Column] = {}
    for column in columns_of_ports:
        if not column.name:  # what a spreadsheet leaves behind the last one
            continue
        port = as_signal(column.heading, column.name)
        if port in ports:
            raise InputError(f"{column.heading} = {column.head!r}: appears twice; must appear once")
        ports[port] = column
    recorded = recorded_connections(path)
    if recorded is None:
        columns = {port: _samples(column) for port, column in ports.items()}
    else:
        columns = _finite_ones(ports)
    return Stimuli(
        path.name,
        _times(time),
        columns,
        chosen,
        array("q", time.lines),
        is_text_file=time.is_text_file,
        recorded=recorded,
        recorded_columns=columns if recorded is not None else {},
        path=str(path.absolute()),
    )


def recorded_connections(path: Path) -> tuple[Connection, ...] | None:
    """The connections of the run that has recorded a file; None where no run has.

    InputError where its run.json is damaged.
    """
    settings = path.with_name(RUN_FILE)
    if path.stem != RECORDED_STEM or not settings.is_file():
        return None
    content = json_in(str(settings), settings.read_bytes())
    entries = Decoder().decoded(RecordedConnections, str(settings), content)["connections"]
    return tuple(
        Connection(
            as_port(str(settings), entry["from"]),
            as_port(str(settings), entry["to"]),
            entry["factor"],
            entry["offset"],
        )
        for entry in entries
    )


def _finite_ones(ports: Mapping[Port, Column]) -> dict[Port, Stimulus]:
    """The columns that can be stimuli: a run records others too."""
    stimuli: dict[Port, Stimulus] = {}
    for port, column in ports.items():
        with suppress(InputError):
            stimuli[port] = _samples(column)
    return stimuli


def _samples(column: Column) -> Stimulus:
    """The numbers of a column, or its texts; InputError at the first cell without a value."""
    texts: dict[str, int] = {}
    if column.values is not None:
        samples = array("d", column.values)
    else:
        cells = [cell.strip() for cell in column.texts()]
        if "" in cells:
            raise InputError(f"{column.place(cells.index(''))}: missing; must be a value")
        samples = array("d", (texts.setdefault(cell, len(texts)) for cell in cells))
    _check_finite(column, samples)
    return Stimulus(samples, column.unit, tuple(texts), column.number)


def _check_finite(column: Column, samples: Sequence[float]) -> None:
    if all(map(math.isfinite, samples)):
        return
    for row, sample in enumerate(samples):
        if not math.isfinite(sample):
            raise InputError(f"{column.place(row)} = {sample}: must be a finite number")


def _times(column: Column) -> array[int]:
    """The times in ns."""
    unit, samples = column.time_unit(), array("d", column.numbers())
    _check_finite(column, samples)
    for row, (previous, time) in enumerate(pairwise(samples), 1):
        if time < previous:
            raise InputError(
                f"{column.place(row)} = {time!r}: is before {previous!r}; must not fall"
            )
    if (last := max(map(abs, samples)) * float(unit)) > LONGEST:
        raise InputError(f"{column.place(0)}: to {last:g} s; must be at most {LONGEST:g} s")
    per_unit = float(unit * NANOSECONDS)
    return array("q", (round(per_unit * time) for time in samples))


def input_entry(stimuli: Stimuli) -> dict[str, str]:
    """The stimuli for run.json: the file, the interpolation, and a hash of the samples."""
    digest = hashlib.sha256(array("q", stimuli.times))
    for port, column in stimuli.columns.items():
        digest.update(f"\0{port}\0{column.unit}\0{column.texts}\0".encode())
        digest.update(array("d", column.samples))
    return {
        "file": stimuli.file,
        "interpolation": stimuli.interpolation,
        "sha256": digest.hexdigest(),
    }
