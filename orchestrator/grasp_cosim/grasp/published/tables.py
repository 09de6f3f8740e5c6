"""The figures of the paper: its table by object position and its table of surface colours."""

import csv
import io
from collections.abc import Iterator
from importlib.resources import files
from typing import Literal, NamedTuple

from ..metrics import FINGERS

REFLECTANCE_X_M = 0.03
"""m; where the object stands in the table of colours, and in the figures."""


class Setting(NamedTuple):
    """Where the object stands, in m, and the reflectance of its right and left surface."""

    x_m: float
    alpha_1: float = 1.0
    alpha_2: float = 1.0


class Row(NamedTuple):
    """A published figure in s: the contact time of a finger, or, finger None, the difference.

    condition is the position of the object in m, or the colours like "brown/white".
    """

    table: Literal["position", "reflectance"]
    condition: float | str
    setting: Setting
    case: int
    finger: int | None
    published: float


def simulated_rows() -> list[Row]:
    """The simulated half of the position table: a row per finger, one per difference."""
    return list(_positions("simulation"))


def experimental_rows() -> list[Row]:
    """The experimental half of the position table, and the table of colours."""
    return [*_positions("experiment"), *_colours()]


def _positions(source: str) -> Iterator[Row]:
    for line in _lines("table_position.csv"):
        if line["source"] == source:
            x_m = float(line["x_m"])
            yield from _rows("position", x_m, Setting(x_m), line)


def _colours() -> Iterator[Row]:
    for line in _lines("table_reflectance.csv"):
        setting = Setting(REFLECTANCE_X_M, float(line["alpha_1"]), float(line["alpha_2"]))
        colours = f"{line['color_1']}/{line['color_2']}"
        yield from _rows("reflectance", colours, setting, line)


def _rows(
    table: Literal["position", "reflectance"],
    condition: float | str,
    setting: Setting,
    line: dict[str, str],
) -> Iterator[Row]:
    for case in (1, 2):
        for finger in FINGERS:
            time = float(line[f"case{case}_t{finger}"])
            yield Row(table, condition, setting, case, finger, time)
        yield Row(table, condition, setting, case, None, float(line[f"case{case}_dt"]))


def _lines(name: str) -> Iterator[dict[str, str]]:
    text = files(__package__).joinpath(name).read_text("utf-8")
    yield from csv.DictReader(io.StringIO(text))
