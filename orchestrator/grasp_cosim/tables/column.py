"""A column of a table: its name, its unit, and cells that are read when somebody uses them."""

from __future__ import annotations

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

    `head` is what stands there, `name` and `unit` what it says: the unit is the text in brackets
    behind the name, None where there is none. `values` are the cells as numbers, None where one of
    them is no number; `read_texts` reads them as they stand in the file. `lines` are those of the
    rows in a file of lines; where it is empty, they are simply one after the other, below the
    first. `number` counts the columns from 1.
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
        where = self.heading if row is None else f"{self.row_place(row)}, column {self.number}"
        return f"{where}, {self.name}" if self.name else where

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
                problem = NOT_A_NUMBER.format(cell.strip()) if cell.strip() else MISSING
                raise InputError(f"{self.place(row)}{problem}{point_advice(cell)}") from None
        return numbers  # decimal ones of Arrow, say

    def to_unit(self, name: str) -> Conversion:
        """The conversion of the numbers into a unit, in which they are where the column has none.

        InputError where the column is in a unit of something else, or in one that is not known.
        """
        source, target = known_unit(self.unit or name), known_unit(name)
        change = conversion(source, target) if source and target else None
        if change is None:
            raise no_conversion(self.place(), self.unit, name)
        return change

    def is_time(self) -> bool:
        """True for the column of the time: `time`, or `Time`, with a unit or without."""
        return self.name.lower() == "time"

    def time_unit(self) -> Fraction:
        """The unit of a column of times in s, exactly; InputError where it is none of time."""
        unit, second = known_unit(self.unit or "s"), known_unit("s")
        if unit is None or second is None or conversion(unit, second) is None:
            raise InputError(f"{self.heading} = {self.head!r}: must be in a unit of time, like ms")
        return Fraction(repr(unit.factor))


MISSING = ": missing; must be a number"
NOT_A_NUMBER = " = {!r}: must be a number"


@dataclass(frozen=True, eq=False)
class Table:
    """The columns of a file, in its order, and how many rows there are."""

    file: str
    columns: Sequence[Column]
    count: int

    def named(self, name: str) -> Column:
        """The column of that name; InputError where there is none, or where there are several."""
        same = [column for column in self.columns if column.name == name]
        if not same:
            names = [column.name for column in self.columns if column.name]
            raise InputError(f"{self.file}: no column {name!r}; {nearest(name, names)}")
        if len(same) > 1:
            raise InputError(
                f"{same[1].heading} = {same[1].head!r}: appears twice; must appear once"
            )
        return same[0]
