"""A column of a table: its name, its unit, and cells that are read when somebody uses them."""

from __future__ import annotations

import re
from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import TYPE_CHECKING, Any, Union

from ..base.checks import point_advice, real
from ..base.errors import InputError, nearest
from ..base.si_units import known_unit
from ..interface.units import Conversion, conversion, no_conversion

if TYPE_CHECKING:  # stimuli need no numpy, which takes time to load
    import numpy.typing as npt

Values = Union[Sequence[float], "npt.NDArray[Any]"]
"""Numbers; of a file of text an array of float64, of Arrow those of its type."""


@dataclass(frozen=True, eq=False)
class Column:
    """The cells of a file that stand below one name.

    `head` is the text at the top of the column. It holds the `name` and, in brackets behind it, the
    `unit`, which is None where there is none. `values` are the cells as numbers, None where one of
    them is no number; `read_texts` reads them as they stand in the file. `lines` are the numbers of
    the lines in which the rows stand; where it is empty, the rows follow each other below the
    heads. `number` counts the columns from 1.
    """

    file: str
    number: int
    head: str
    name: str
    unit: str | None
    values: Values | None
    read_texts: Callable[[], Sequence[str]]
    lines: Sequence[int] = ()
    is_text_file: bool = True

    def place(self, row: int | None = None) -> str:
        """The column for a message, and in it the cell of a row: "a.csv: line 3, column 2, u"."""
        place = self.heading if row is None else f"{self.row_place(row)}, column {self.number}"
        return f"{place}, {self.name}" if self.name else place

    def row_place(self, row: int) -> str:
        """A row for a message: "a.csv: line 3"."""
        if not self.is_text_file:
            return f"{self.file}: row {row + 1}"
        return f"{self.file}: line {self.lines[row] if self.lines else row + 2}"

    @property
    def heading(self) -> str:
        """The place of its name, for a message about that: "a.csv: line 1, column 2"."""
        line = "line 1, " if self.is_text_file else ""
        return f"{self.file}: {line}column {self.number}"

    def texts(self) -> Sequence[str]:
        """The cells as they stand in the file."""
        return self.read_texts()

    def numbers(self) -> Values:
        """The cells as numbers; InputError at the first one that is none."""
        if self.values is not None:
            return self.values
        numbers = array("d")
        for row, cell in enumerate(self.texts()):
            try:
                numbers.append(real(cell))
            except ValueError:
                text = cell.strip()
                problem = (
                    f" = {text!r}: must be a number" if text else ": missing; must be a number"
                )
                raise InputError(f"{self.place(row)}{problem}{point_advice(cell)}") from None
        return numbers  # decimal ones of Arrow, say

    def to_unit(self, name: str) -> Conversion:
        """The conversion of the numbers into a unit, in which they are where the column has none.

        InputError where the column is in a unit of something else, or in one that is not known.
        """
        source, target = known_unit(self.unit or name), known_unit(name)
        to_target = conversion(source, target) if source and target else None
        if to_target is None:
            raise no_conversion(self.place(), self.unit, name)
        return to_target

    def is_time(self) -> bool:
        """True for the column of the time: `time`, or `Time`, with a unit or without."""
        return self.name.lower() == "time"

    def time_unit(self) -> Fraction:
        """The unit of a column of times in s, exactly; InputError where it is none of time."""
        unit, second = known_unit(self.unit or "s"), known_unit("s")
        if unit is None or second is None or conversion(unit, second) is None:
            raise InputError(f"{self.heading} = {self.head!r}: must be in a unit of time, like ms")
        return Fraction(repr(unit.factor))


_NAME_AND_UNIT = re.compile(r"(.*\S)\s+\[([^\[\]]*)\]", re.DOTALL)
_TIME_AND_UNIT = re.compile(r"(time)\s*\[([^\[\]]*)\]", re.IGNORECASE)
"""The time may have its unit without a space before it."""


def split_head(head: str) -> tuple[str, str | None]:
    """The name and the unit in the head of a column; `u[1]` is a name without a unit."""
    match = _NAME_AND_UNIT.fullmatch(head) or _TIME_AND_UNIT.fullmatch(head)
    return (match[1], match[2]) if match else (head, None)


def head_of(name: str, unit: str | None) -> str:
    """The head of a column with a name and a unit, which split_head() takes apart again."""
    return f"{name} [{unit}]" if unit else name


@dataclass(frozen=True, eq=False)
class FileTable:
    """The columns of a file, in its order, and how many rows there are."""

    file: str
    columns: Sequence[Column]
    row_count: int

    def column(self, name: str) -> Column:
        """The column of that name; InputError where there is none, or where there are several."""
        matches = [column for column in self.columns if column.name == name]
        if not matches:
            names = [column.name for column in self.columns if column.name]
            raise InputError(f"{self.file}: no column {name!r}; {nearest(name, names)}")
        if len(matches) > 1:
            second = matches[1]
            raise InputError(f"{second.heading} = {second.head!r}: appears twice; must appear once")
        return matches[0]
