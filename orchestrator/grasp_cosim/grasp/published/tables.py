"""The figures of the paper: its table by object position and its table of surface colours."""

import csv
import io
from collections.abc import Iterator, Mapping, Sequence
from importlib.resources import files
from typing import Any, Literal, NamedTuple

from ...base.text import to_cell
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


class Row(NamedTuple):
    """A published figure in s: the contact time of a finger, or, finger None, the difference.

    condition is the position of the object in m, or the colours like "brown/white".
    """

    table: Table
    condition: float | str
    setting: Setting
    case: int
    finger: int | None
    published: float


def published_rows(source: Source) -> list[Row]:
    """The figures of a source: its half of the position table, of the experiment the colours too.

    A row per finger, and one for the difference.
    """
    rows: list[Row] = []
    for line in _lines("table_position.csv"):
        if line["source"] == source:
            x_m = float(line["x_m"])
            rows += _rows("position", x_m, Setting(x_m), line)
    for line in _lines("table_reflectance.csv") if source == "experiment" else ():
        setting = Setting(REFLECTANCE_X_M, float(line["alpha_1"]), float(line["alpha_2"]))
        rows += _rows("reflectance", f"{line['color_1']}/{line['color_2']}", setting, line)
    return rows


def _rows(
    table: Table, condition: float | str, setting: Setting, line: dict[str, str]
) -> Iterator[Row]:
    for case in (1, 2):
        for finger in FINGERS:
            time = float(line[f"case{case}_t{finger}"])
            yield Row(table, condition, setting, case, finger, time)
        yield Row(table, condition, setting, case, None, float(line[f"case{case}_dt"]))


def _lines(name: str) -> Iterator[dict[str, str]]:
    text = files(__package__).joinpath(name).read_text("utf-8")
    yield from csv.DictReader(io.StringIO(text))


def table_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """The rows, of one form, as CSV; no cell is a formula, see plain.to_cell()."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    table = [list(rows[0]), *(list(row.values()) for row in rows)]
    writer.writerows([to_cell(cell) for cell in row] for row in table)
    return text.getvalue()
