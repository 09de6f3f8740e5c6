"""Stimuli: columns of numbers over time that drive inputs, read from a CSV file.

The file is as FMPy and fmusim take it: names in the first line, the time in the first column, two
rows of one time for a jump. A column is `component.variable`, with a unit in brackets if it is in
another one than the variable: `plant.force [kN]`.
"""

from __future__ import annotations

import csv
import hashlib
import math
import re
from array import array
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from itertools import pairwise
from pathlib import Path
from typing import Literal, get_args

from ..base.checks import choice, real
from ..base.errors import InputError, reason
from ..base.si_units import known_unit
from ..base.text import counted, from_cell
from ..interface.units import conversion
from .parts import Port, as_port
from .times import LONGEST, NANOSECONDS

Interpolation = Literal["linear", "held"]
INTERPOLATIONS: tuple[str, ...] = get_args(Interpolation)

_UNIT = re.compile(r"(.*\S)\s+\[([^\[\]]*)\]")
_TIME = re.compile(r"time\s*(?:\[([^\[\]]*)\])?", re.IGNORECASE)


@dataclass(frozen=True)
class Column:
    """The samples of one input, in its unit or in the one named.

    With texts, such as the names of an enumeration, they are their places among these. Sequences
    are arrays, which take 8 bytes a number.
    """

    samples: Sequence[float]
    unit: str | None = None
    texts: tuple[str, ...] = ()

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


@dataclass(frozen=True)
class Stimuli:
    """Samples that drive inputs: columns, and the times of the rows in ns, which do not fall.

    "linear" interpolates continuous Reals and holds all others from row to row; "held" holds all.
    Before the first row and after the last one their values are held. lines are those of the rows
    in the file where they are not simply one after the other. partial says that FMUs may yet be
    swapped, so that a column may be of a variable which is not there.
    """

    file: str
    times: Sequence[int]
    columns: Mapping[Port, Column]
    interpolation: Interpolation = "linear"
    lines: Sequence[int] = field(default_factory=lambda: array("q"))
    partial: bool = field(default=False, compare=False)

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
        line = 1 if row is None else self.lines[row] if self.lines else row + 2
        return _place(self.file, line, [*self.columns].index(port) + 2, str(port))


def read_stimuli(
    path: str | Path, interpolation: str = "linear", place: str = "interpolation"
) -> Stimuli:
    """The stimuli of a CSV file; place says where the interpolation comes from.

    InputError where there is none, or at the first cell that is not as it must be, but for what
    depends on the variables: see validity.py.
    """
    path = Path(path)
    chosen: Interpolation = choice(place, interpolation, INTERPOLATIONS)
    line = 0
    rows = []
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            reader = csv.reader(file, strict=True, skipinitialspace=True)
            for row in reader:
                line = reader.line_num
                if any(map(str.strip, row)):
                    rows.append((line, row))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        after = f"after line {line}: " if line else ""
        raise InputError(f"{path}: {after}{reason(error)}; must be a CSV file") from error
    return _stimuli(path.name, rows, chosen)


def _stimuli(file: str, rows: list[tuple[int, list[str]]], interpolation: Interpolation) -> Stimuli:
    if len(rows) < 2:
        raise InputError(f"{file}: is empty; must be names, time,component.variable, and rows")
    names = [from_cell(name.strip()) for name in rows.pop(0)[1]]
    ports, units, factor = _header(file, names)
    for line, row in rows:
        if len(row) != len(names):
            said = f"{file}: line {line} has {counted(len(row), 'cell')}"
            raise InputError(f"{said}; must have {len(names)}, as line 1")
    lines = array("q", (line for line, _ in rows))

    def cell(column: int, row: int) -> str:
        return _place(file, lines[row], column + 1, names[column])

    cells = zip(*(row for _, row in rows), strict=True)
    time, *columns = (
        _column(partial(cell, i), texts, unit)
        for i, (texts, unit) in enumerate(zip(cells, [None, *units], strict=True))
    )
    return Stimuli(
        file,
        _times(partial(cell, 0), time, factor),
        dict(zip(ports, columns, strict=True)),
        interpolation,
        array("q") if lines[-1] == len(lines) + 1 else lines,
    )


def _column(place: Callable[[int], str], cells: Sequence[str], unit: str | None) -> Column:
    """The numbers of a column, or its texts; InputError at the first cell without a value."""
    stripped, texts = [*map(str.strip, cells)], dict[str, int]()
    try:
        samples = array("d", map(real, cells))
    except ValueError:
        samples = array("d", (texts.setdefault(cell, len(texts)) for cell in stripped))
    for row, (cell, sample) in enumerate(zip(stripped, samples, strict=True)):
        if not cell:
            raise InputError(f"{place(row)}: missing; must be a value")
        if not math.isfinite(sample):
            raise InputError(f"{place(row)} = {cell}: must be a finite number")
    return Column(samples, unit, tuple(texts))


def _header(file: str, names: Sequence[str]) -> tuple[list[Port], list[str | None], float]:
    """The ports of the columns after the time, their units, and the time's in s."""
    time = _TIME.fullmatch(names[0])
    if not time or len(names) < 2:
        raise InputError(
            f"{_place(file, 1, 1)} = {names[0]!r}: must be time, then component.variable, with "
            "commas between them and points in numbers"
        )
    ports: dict[Port, str | None] = {}
    for i, name in enumerate(names[1:], 2):
        found = _UNIT.fullmatch(name)
        port = as_port(_place(file, 1, i), found[1] if found else name)
        if port in ports:
            raise InputError(f"{_place(file, 1, i)} = {name!r}: appears twice; must appear once")
        ports[port] = found[2] if found else None
    second, given = known_unit("s"), known_unit(time[1] or "s")
    change = conversion(given, second) if given and second else None
    if change is None:
        raise InputError(f"{_place(file, 1, 1)} = {names[0]!r}: must be in a unit of time, like ms")
    return [*ports], [*ports.values()], change.factor


def _times(place: Callable[[int], str], column: Column, factor: float) -> array[int]:
    """The times in ns."""
    samples = column.samples
    for i, text in enumerate(column.texts):
        try:
            real(text)
        except ValueError:
            where = place(samples.index(i))
            raise InputError(f"{where} = {text!r}: must be a number") from None
    for row, (before, time) in enumerate(pairwise(samples), 1):
        if time < before:
            raise InputError(f"{place(row)} = {time!r}: is before {before!r}; must not fall")
    if (last := max(map(abs, samples)) * factor) > LONGEST:
        raise InputError(f"{place(0)}: to {last:g} s; must be at most {LONGEST:g} s")
    return array("q", (round(factor * NANOSECONDS * t) for t in samples))


def input_entry(stimuli: Stimuli) -> dict[str, str]:
    """The stimuli for run.json: the file, the interpolation, and a hash of the samples."""
    made_of = hashlib.sha256(array("q", stimuli.times))
    for port, column in stimuli.columns.items():
        made_of.update(f"\0{port}\0{column.unit}\0{column.texts}\0".encode())
        made_of.update(array("d", column.samples))
    return {
        "file": stimuli.file,
        "interpolation": stimuli.interpolation,
        "sha256": made_of.hexdigest(),
    }


def _place(file: str, line: int, column: int, name: str = "") -> str:
    return f"{file}: line {line}, column {column}{name and f', {name}'}"
