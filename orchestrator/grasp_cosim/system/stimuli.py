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
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import islice
from operator import le
from pathlib import Path
from typing import Literal, get_args

from si_units import known_unit

from ..base.checks import choice, real
from ..base.errors import InputError
from ..base.text import counted, from_cell
from ..interface.units import conversion
from .parts import LONGEST, NANOSECONDS, Port

Interpolation = Literal["linear", "held"]
INTERPOLATIONS: tuple[str, ...] = get_args(Interpolation)

_Reader = Iterator[list[str]]

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
        return self.texts[int(sample)] if self.texts else _text(sample)

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
        columns, count = self.columns.values(), len(self.times)
        good = (
            count
            and all(len(c.samples) == count for c in columns)
            and len(self.lines) in (0, count)
            and all(map(le, self.times, islice(self.times, 1, None)))
            and all(all(map(math.isfinite, c.samples)) for c in columns)
            and all(set(c.samples) <= {*range(len(c.texts))} for c in columns if c.texts)
        )
        if not good:
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
    depends on the variables: see stimuli_checks.py.
    """
    path = Path(path)
    chosen: Interpolation = choice(place, interpolation, INTERPOLATIONS)
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            return _read(path, csv.reader(file, strict=True, skipinitialspace=True), chosen)
    except FileNotFoundError:
        raise InputError(f"{path}: no such input file; must be a CSV file") from None
    except OSError as error:
        raise InputError(f"{path}: {error.strerror}; must be a CSV file") from error
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: not UTF-8 text: {error.reason}; must be a CSV file") from error


def _read(path: Path, reader: _Reader, interpolation: Interpolation) -> Stimuli:
    file, rows = path.name, _rows(path.name, reader)
    _, names = next(rows, (0, []))
    if not names:
        raise InputError(f"{file}: is empty; must begin with names: time,component.variable")
    names = [from_cell(name.strip()) for name in names]
    ports, units, factor = _header(file, names)
    lines: array[int] = array("q")
    cells: list[list[str]] = [[] for _ in names]
    for line, row in rows:
        lines.append(line)
        for column, cell in zip(cells, row, strict=True):
            column.append(cell)
    if not lines:
        raise InputError(f"{file}: has no row after the names; must have one at least")
    columns = [
        _column(file, i, name, lines, cells[i - 1], unit)
        for i, (name, unit) in enumerate(zip(names, [None, *units], strict=True), 1)
    ]
    return Stimuli(
        file,
        _times(file, columns[0], factor, lines),
        dict(zip(ports, columns[1:], strict=True)),
        interpolation,
        array("q") if lines[-1] == len(lines) + 1 else lines,
    )


def _column(
    file: str, number: int, name: str, lines: Sequence[int], cells: list[str], unit: str | None
) -> Column:
    """The numbers of a column, or its texts; InputError at the first cell without a value."""
    texts: dict[str, int] = {}
    try:
        samples = array("d", map(real, cells))
        good = map(math.isfinite, samples)
    except ValueError:
        stripped = [*map(str.strip, cells)]
        samples, good = array("d"), map(bool, stripped)
        samples.extend(texts.setdefault(cell, len(texts)) for cell in stripped)
    for line, fine, cell in zip(lines, good, cells, strict=True):
        if not fine:
            place, said = _place(file, line, number, name), cell.strip()
            what = f" = {said}: must be a finite number" if said else ": missing; must be a value"
            raise InputError(f"{place}{what}")
    return Column(samples, unit, tuple(texts))


def _rows(file: str, reader: _Reader) -> Iterator[tuple[int, list[str]]]:
    """The rows that are not empty, each with its line; InputError where one is not as long."""
    width = 0
    try:
        for row in reader:
            line: int = reader.line_num  # type: ignore[attr-defined]
            if not any(map(str.strip, row)):
                continue
            width = width or len(row)
            if len(row) < width:
                raise InputError(f"{_place(file, line, len(row) + 1)}: missing; must be a value")
            if len(row) > width:
                raise InputError(
                    f"{_place(file, line, width + 1)} = {row[width]!r}: has no name; must have "
                    f"{counted(width, 'cell')}"
                )
            yield line, row
    except csv.Error as error:
        line = reader.line_num  # type: ignore[attr-defined]
        raise InputError(f"{file}: line {line}: not CSV: {error}") from error


def _header(file: str, names: Sequence[str]) -> tuple[list[Port], list[str | None], float]:
    """The ports of the columns after the time, their units, and the time's in s."""
    time, *found = _TIME.fullmatch(names[0]), *map(_UNIT.fullmatch, names[1:])
    others = [(m[1], m[2]) if m else (name, None) for m, name in zip(found, names[1:], strict=True)]
    if not time:
        raise InputError(
            f"{_place(file, 1, 1)} = {names[0]!r}: must be time, then component.variable, with "
            "commas between them and points in numbers"
        )
    if not others:
        raise InputError(
            f"{file}: line 1: has the time alone; must have columns component.variable"
        )
    ports: list[Port] = []
    for i, (name, _) in enumerate(others, 2):
        component, dot, variable = name.partition(".")
        port = Port(component, variable)
        if not (component and dot and variable):
            raise InputError(f"{_place(file, 1, i)} = {name!r}: must be component.variable")
        if port in ports:
            raise InputError(f"{_place(file, 1, i)} = {name!r}: appears twice; must appear once")
        ports.append(port)
    second, given = known_unit("s"), known_unit(time[1] or "s")
    change = conversion(given, second) if given and second else None
    if change is None:
        raise InputError(f"{_place(file, 1, 1)} = {names[0]!r}: must be in a unit of time, like ms")
    return ports, [unit for _, unit in others], change.factor


def _times(file: str, column: Column, factor: float, lines: Sequence[int]) -> array[int]:
    """The times in ns."""
    samples = column.samples
    for row in range(len(lines) if column.texts else 0):
        try:
            real(column.text(row))
        except ValueError:
            place = _place(file, lines[row], 1, "time")
            raise InputError(f"{place} = {column.text(row)!r}: must be a number") from None
    span = max(map(abs, samples)) * factor
    if span > LONGEST:
        raise InputError(f"{file}: time to {span:g} s; must be at most {LONGEST:g} s")
    scale = factor * NANOSECONDS
    times = array("q", (round(scale * t) for t in samples))
    for row in range(1, len(times)):
        if times[row] < times[row - 1]:
            raise InputError(
                f"{_place(file, lines[row], 1, 'time')} = {samples[row]!r}: is before "
                f"{samples[row - 1]!r} of line {lines[row - 1]}; must not fall"
            )
    return times


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


def _text(sample: float) -> str:
    """A number as it may have been written."""
    return repr(sample).removesuffix(".0")


def _place(file: str, line: int, column: int, name: str = "") -> str:
    return f"{file}: line {line}, column {column}{name and f', {name}'}"
