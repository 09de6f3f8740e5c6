"""The figures of the paper, and ours beside them: the grasps of their settings, the deviations.

One way for both sources, the simulation and the experiments on the bench preset; what differs is in
SOURCES.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.interruption import raised
from ...base.parallel import Crew
from ...base.progress import Progress, phase
from ...base.text import to_cell
from ...interface.fmi_types import Value
from ...master.simulation import simulate
from ...metrics.metric import resolved
from ...recording.result import Result
from ...system.description import System
from ...system.times import in_seconds
from ...tables.read_table import read_table
from ..metrics import FINGERS, IMPACT_WINDOW
from ..presets import CASES, start_in_si, with_case, with_si_values

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
    """The rows of a published table, as texts by the names of its columns."""
    table = read_table(Path(__file__).with_name(name))
    cells = {column.name: column.texts() for column in table.columns}
    for row in range(table.row_count):
        yield {column: texts[row] for column, texts in cells.items()}


def table_csv(rows: Sequence[Mapping[str, Any]]) -> str:
    """The rows, of one form, as CSV; no cell is a formula, see plain.to_cell()."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    table = [list(rows[0]), *(list(row.values()) for row in rows)]
    writer.writerows([to_cell(cell) for cell in row] for row in table)
    return text.getvalue()


LOOK = 0.05
"""s; how often is asked whether both fingers touch."""


def close(system: System, after: float | None = None) -> Result:
    """Run a grasp until `after` s after both fingers touch, else or at the latest to its stop time.

    The end is known to LOOK; a result that ends early is not complete. KeyboardInterrupt on Ctrl-C.
    """
    steps = max(1, round(LOOK / in_seconds(system.step_ns)))
    with simulate.session(system) as session, raised(session.halt.set):
        end = in_seconds(system.stop_ns)
        touching = False
        contacts = [resolved(f"plant.contact[{j}]", system.roles) for j in FINGERS]
        while not session.halt.is_set() and session.time < end and session.step(steps):
            if after is not None and not touching and all(session[name] for name in contacts):
                touching, end = True, session.time + after
        return session.result()


SENSOR_CONTACT = 0.37e-3
"""m; the gap at which contact, were it declared there, would explain the published times best."""

AT_SENSOR_CONTACT = "_at_0.37_mm"
"""Behind the name of a figure that is of a contact declared there."""


@dataclass(frozen=True, slots=True)
class Run:
    """One grasp of an evaluation; times in s, per finger."""

    setting: Setting
    case: int
    metrics: dict[str, Any]
    times_at_sensor_contact: tuple[float, float]
    overshoot: float
    """m by which the target passes the centre of the object, seen from the start."""
    touch_forces: tuple[float, float]
    """The highest contact force within IMPACT_WINDOW of touching, in N."""
    result: Result | None
    """Every signal, for the runs that the figures show."""

    @property
    def times(self) -> tuple[float, float]:
        """When the fingers touch, in s."""
        first, second = self.metrics["time_to_contact"]
        return first, second

    @property
    def apart(self) -> float:
        """The time difference of contact in s."""
        first, second = self.times
        return abs(second - first)

    @property
    def off_target(self) -> float:
        """Distance of the target from the centre of the object in the end, m."""
        return abs(float(self.metrics["target_position"]) - self.setting.x_m)


Runs = dict[tuple[Setting, int], Run]
"""By setting and case."""


def as_run(result: Result, setting: Setting, case: int) -> Run:
    """Part of a grasp that an evaluation keeps; InputError where a finger does not touch."""
    first, second = (_sensor_contact(result, j) for j in FINGERS)
    times: Any = result.metrics["time_to_contact"]
    if first is None or second is None or None in times:
        raise InputError(
            f"evaluate: x_m = {setting.x_m} m, Case {case}: a finger does not reach the object"
        )
    target = result.by_role["controller.target_position"]
    beyond = float(np.max((target - setting.x_m) * math.copysign(1.0, setting.x_m)))
    shown = result if setting == Setting(REFLECTANCE_X_M) else None
    right, left = map(partial(_touch_force, result), FINGERS, times)
    return Run(setting, case, dict(result.metrics), (first, second), beyond, (right, left), shown)


def _sensor_contact(result: Result, finger: int) -> float | None:
    """When a finger's gap first falls to SENSOR_CONTACT, s, interpolated; None if it never does."""
    time, gap = result.time, result.by_role[f"plant.gap[{finger}]"]
    below = np.flatnonzero(gap <= SENSOR_CONTACT)
    if not len(below):
        return None
    k = max(int(below[0]), 1)
    fraction = (gap[k - 1] - SENSOR_CONTACT) / (gap[k - 1] - gap[k])
    return float(time[k - 1] + fraction * (time[k] - time[k - 1]))


def _touch_force(result: Result, finger: int, touch: float) -> float:
    near = (result.time >= touch) & (result.time <= touch + IMPACT_WINDOW)
    return float(np.abs(result.by_role[f"plant.contact_force[{finger}]"][near]).max())


class Evidence(NamedTuple):
    """The grasps, the published figures, the rows of the report with both, and their deviations."""

    runs: Runs
    published: Sequence[Row]
    rows: Sequence[dict[str, Any]]
    rms: dict[str, float]
    system: System


Job = tuple[System, Setting, int, Source]


class How(NamedTuple):
    """How the figures of one source are run again.

    A grasp lasts `stop` s, or ends `after` s once both fingers touch; pictures end at `shown` s.
    """

    title: str
    stop: float
    after: float | None
    shown: float


SOURCES: Mapping[Source, How] = {
    # The slowest contact is at 2.7 s, and the layers settle with a time constant of 0.2 s.
    "simulation": How("Published simulation", 4.5, None, 3.0),
    # Twice the slowest published contact; a grasp goes on for 1.5 s once both fingers touch.
    "experiment": How("Published experiments", 10.0, 1.5, 5.0),
}


def compared(system: System, source: Source, workers: int, progress: bool) -> Evidence:
    """Run Cases 0, 1 and 2 in all published settings of a source.

    InputError where a finger does not reach the object, KeyboardInterrupt at Ctrl-C.
    """
    published = published_rows(source)
    settings = sorted({row.setting for row in published})
    jobs = [(system, setting, case, source) for setting in settings for case in CASES]
    bar = Progress("evaluate", len(jobs), shown=progress)
    with phase(f"{len(jobs)} runs on {workers} processes"), bar, Crew(workers) as crew:
        found = crew.map(_run, jobs, bar)
    runs = {(run.setting, run.case): run for run in found}
    rows = [_compared(row, runs[row.setting, row.case], source) for row in published]
    return Evidence(runs, published, rows, deviations(published, rows), system)


def _run(job: Job) -> Run:
    """One grasp; the reflectances of a setting are shares of those of the system."""
    system, setting, case, source = job
    x_m, *shares = setting
    values: dict[str, Value] = {"plant.initial_object_position": x_m}
    for j, share in zip(FINGERS, shares, strict=True):
        name = f"sensor_{j}.reflectance"
        values[name] = share * start_in_si(system, name)
    how = SOURCES[source]
    chosen = with_si_values(with_case(system, case), values, "evaluate:")
    return as_run(close(chosen.with_experiment(stop=how.stop), how.after), setting, case)


def _compared(row: Row, run: Run, source: Source) -> dict[str, Any]:
    """The published figure with ours beside it and the difference, simulated less published."""
    found = {k: value for k, value in row._asdict().items() if k != "setting"}
    for suffix, times in (("", run.times), (AT_SENSOR_CONTACT, run.times_at_sensor_contact)):
        if not suffix or source == "simulation":
            ours = abs(times[1] - times[0]) if row.finger is None else times[row.finger - 1]
            found[f"simulated{suffix}"] = ours
            found[f"difference{suffix}"] = ours - row.published
    return found


def deviations(published: Sequence[Row], rows: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Root mean square of the differences in s by name, contact times and time differences apart.

    "contact_times" are those of the position rows and of equal colours; white on both sides,
    which is the position row of 0.03 m again, counts once. Of a source with colours there are
    those of each table, too.
    """
    colours = any(row.table == "reflectance" for row in published)
    groups: dict[str, list[float]] = {}
    for row, ours in zip(published, rows, strict=True):
        alike = "positions" if row.table == "position" else "equal_colours"
        names = [alike if row.setting.equal_colours else "mixed_colours"] * colours
        if row.setting.equal_colours and row.condition != "white/white":
            names.append("contact_times")
        for name in names if row.finger else ["time_differences"]:
            for suffix in ("", AT_SENSOR_CONTACT):
                if f"difference{suffix}" in ours:
                    groups.setdefault(name + suffix, []).append(ours[f"difference{suffix}"])
    # correctly rounded sums: sum() of Python 3.12 and later is not that of 3.11
    return {
        name: math.sqrt(math.fsum(v * v for v in values) / len(values))
        for name, values in sorted(groups.items())
    }
