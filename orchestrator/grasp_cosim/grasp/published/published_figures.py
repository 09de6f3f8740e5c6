"""The figures that the paper publishes: contact times by setting and case, from its tables."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ...base.text import to_cell
from ...tables.read_table import read_table
from ..metrics import FINGERS

Source = Literal["simulation", "experiment"]
"""Where published figures are from."""

Table = Literal["position", "reflectance"]

REFLECTANCE_X_M = 0.03
"""m; where the object stands in the table of colours, and in the figures."""


class Setting(NamedTuple):
    """Where the object stands, in m, and the reflectance of its right and left surface."""

    x_m: float
    alpha_1: float = 1.0
    alpha_2: float = 1.0

    @property
    def equal_colours(self) -> bool:
        """True if both surfaces of the object have the same reflectance."""
        return self.alpha_1 == self.alpha_2

    @property
    def label(self) -> str:
        """Like 0.03 m, with the reflectances where they are not 1."""
        x_m, alpha_1, alpha_2 = self
        colours = "" if alpha_1 == alpha_2 == 1.0 else f", {alpha_1:.2f}/{alpha_2:.2f}"
        return f"{x_m:.2f} m{colours}"


WHITE = Setting(REFLECTANCE_X_M)
RED = Setting(REFLECTANCE_X_M, 0.92, 0.92)
"""The settings of the pictures: both faces white, or red."""


class PublishedFigure(NamedTuple):
    """A published figure in s: the contact time of a finger, or, finger None, the difference.

    `condition` is the position of the object in m, or the colours like "brown/white".
    """

    table: Table
    condition: float | str
    setting: Setting
    case: int
    finger: int | None
    published: float


def published_figures(source: Source) -> list[PublishedFigure]:
    """The figures of a source: its half of the position table, of the experiment the colours too.

    There is one per finger and case, and one for the difference.
    """
    figures: list[PublishedFigure] = []
    for line in _lines("table_position.csv"):
        if line["source"] == source:
            x_m = float(line["x_m"])
            figures += _figures_of_line("position", x_m, Setting(x_m), line)
    if source == "experiment":
        for line in _lines("table_reflectance.csv"):
            setting = Setting(REFLECTANCE_X_M, float(line["alpha_1"]), float(line["alpha_2"]))
            colours = f"{line['color_1']}/{line['color_2']}"
            figures += _figures_of_line("reflectance", colours, setting, line)
    return figures


def _figures_of_line(
    table: Table, condition: float | str, setting: Setting, line: Mapping[str, str]
) -> Iterator[PublishedFigure]:
    """The figures in a line of a published table."""
    for case in (1, 2):
        for finger in FINGERS:
            time = float(line[f"case{case}_t{finger}"])
            yield PublishedFigure(table, condition, setting, case, finger, time)
        difference = float(line[f"case{case}_dt"])
        yield PublishedFigure(table, condition, setting, case, None, difference)


def _lines(name: str) -> Iterator[dict[str, str]]:
    """The rows of a published table, as texts by the names of its columns."""
    table = read_table(Path(__file__).with_name(name))
    cells = {column.name: column.texts() for column in table.columns}
    for row in range(table.row_count):
        yield {column: texts[row] for column, texts in cells.items()}


def table_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """The rows, of one form, as CSV; no cell is a formula, see plain.to_cell()."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    for cells in (list(rows[0]), *(row.values() for row in rows)):
        writer.writerow([to_cell(cell) for cell in cells])
    return text.getvalue()
