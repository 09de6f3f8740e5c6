"""The grasps of the paper's settings run again, and how far their figures are from the published.

The simulation and the experiments on the bench preset are run again in the same way; what differs
is in REPRODUCTIONS.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.interruption import raised
from ...base.parallel import Crew
from ...base.progress import Progress, phase
from ...interface.fmi_types import Value
from ...master.simulation import simulate
from ...metrics.metric import resolved
from ...recording.result import Result
from ...system.description import System
from ...system.times import in_seconds
from ..metrics import FINGERS, IMPACT_WINDOW
from ..presets import CASES, start_in_si, with_case, with_si_values
from .published_figures import RED, WHITE, PublishedFigure, Setting, Source, published_figures

TOUCH_CHECK_INTERVAL = 0.05
"""s; how often a run checks whether both fingers touch."""


def run_grasp(system: System, hold_time: float | None = None) -> Result:
    """Run a grasp to its stop time, or until `hold_time` s after both fingers touch, if sooner.

    The end is known to TOUCH_CHECK_INTERVAL; a result that ends early is not complete.
    KeyboardInterrupt on Ctrl-C.
    """
    steps = max(1, round(TOUCH_CHECK_INTERVAL / in_seconds(system.step_ns)))
    contacts = [resolved(f"plant.contact[{j}]", system.roles) for j in FINGERS]
    with simulate.session(system) as session, raised(session.halt.set):
        end = in_seconds(system.stop_ns)
        awaits_touch = hold_time is not None
        while not session.halt.is_set() and session.time < end and session.step(steps):
            if hold_time is not None and awaits_touch and all(session[c] for c in contacts):
                awaits_touch, end = False, session.time + hold_time
        return session.result()


SENSOR_CONTACT = 0.37e-3
"""m; the gap at which contact, were it declared there, would explain the published times best."""

AT_SENSOR_CONTACT = "_at_0.37_mm"
"""Behind the name of a figure that is of a contact declared there."""


@dataclass(frozen=True, slots=True)
class GraspRun:
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


GraspRuns = dict[tuple[Setting, int], GraspRun]
"""By setting and case."""


def grasp_run(result: Result, setting: Setting, case: int) -> GraspRun:
    """Part of a grasp that an evaluation keeps; InputError where a finger does not touch."""
    first, second = (_sensor_contact(result, j) for j in FINGERS)
    times: Any = result.metrics["time_to_contact"]
    if first is None or second is None or None in times:
        raise InputError(
            f"evaluate: x_m = {setting.x_m} m, Case {case}: a finger does not reach the object"
        )
    target = result.by_role["controller.target_position"]
    side = math.copysign(1.0, setting.x_m)
    right, left = (_touch_force(result, j, time) for j, time in zip(FINGERS, times, strict=True))
    return GraspRun(
        setting,
        case,
        metrics=dict(result.metrics),
        times_at_sensor_contact=(first, second),
        overshoot=float(np.max((target - setting.x_m) * side)),
        touch_forces=(right, left),
        result=result if setting == WHITE or (setting == RED and case == 2) else None,
    )


def _sensor_contact(result: Result, finger: int) -> float | None:
    """When a finger's gap first falls to SENSOR_CONTACT, s, interpolated; None if it never does."""
    time, gap = result.time, result.by_role[f"plant.gap[{finger}]"]
    below = np.flatnonzero(gap <= SENSOR_CONTACT)
    if not len(below):
        return None
    k = max(int(below[0]), 1)
    fraction = (gap[k - 1] - SENSOR_CONTACT) / (gap[k - 1] - gap[k])
    return float(time[k - 1] + fraction * (time[k] - time[k - 1]))


def _touch_force(result: Result, finger: int, touch_time: float) -> float:
    """The highest contact force in N within IMPACT_WINDOW of touching."""
    rows = (result.time >= touch_time) & (result.time <= touch_time + IMPACT_WINDOW)
    return float(np.abs(result.by_role[f"plant.contact_force[{finger}]"][rows]).max())


class Evidence(NamedTuple):
    """The grasps, the published figures, the rows of the report with both, and their deviations."""

    runs: GraspRuns
    published: Sequence[PublishedFigure]
    rows: Sequence[dict[str, Any]]
    rms: dict[str, float]
    system: System


Job = tuple[System, Setting, int, Source]


class Reproduction(NamedTuple):
    """How the figures of one source are run again.

    A grasp lasts `stop` s, or ends `hold_time` s after both fingers touch; pictures end at
    `picture_end` s.
    """

    title: str
    stop: float
    hold_time: float | None
    picture_end: float


REPRODUCTIONS: Mapping[Source, Reproduction] = {
    # The slowest contact is at 2.7 s, and the layers settle with a time constant of 0.2 s.
    "simulation": Reproduction("Published simulation", 4.5, None, 3.0),
    # Twice the slowest published contact; a grasp goes on for 1.5 s once both fingers touch.
    "experiment": Reproduction("Published experiments", 10.0, 1.5, 5.0),
}


def reproduce(system: System, source: Source, workers: int, progress: bool) -> Evidence:
    """Run Cases 0, 1 and 2 in all published settings of a source.

    InputError where a finger does not reach the object, KeyboardInterrupt at Ctrl-C.
    """
    published = published_figures(source)
    settings = sorted({figure.setting for figure in published})
    jobs = [(system, setting, case, source) for setting in settings for case in CASES]
    bar = Progress("evaluate", len(jobs), shown=progress)
    with phase(f"{len(jobs)} runs on {workers} processes"), bar, Crew(workers) as crew:
        finished = crew.map(_run, jobs, bar)
    runs = {(run.setting, run.case): run for run in finished}
    rows = [_report_row(figure, runs[figure.setting, figure.case], source) for figure in published]
    return Evidence(runs, published, rows, deviations(published, rows), system)


def _run(job: Job) -> GraspRun:
    """One grasp; the reflectances of a setting are shares of those of the system."""
    system, setting, case, source = job
    x_m, *shares = setting
    values: dict[str, Value] = {"plant.initial_object_position": x_m}
    for j, share in zip(FINGERS, shares, strict=True):
        name = f"sensor_{j}.reflectance"
        values[name] = share * start_in_si(system, name)
    reproduction = REPRODUCTIONS[source]
    system = with_si_values(with_case(system, case), values, "evaluate:")
    system = system.with_experiment(stop=reproduction.stop)
    return grasp_run(run_grasp(system, reproduction.hold_time), setting, case)


def _report_row(figure: PublishedFigure, run: GraspRun, source: Source) -> dict[str, Any]:
    """The published figure with the simulated one next to it and the difference, simulated less
    published.
    """
    row = figure._asdict()
    del row["setting"]
    times = {"": run.times}
    if source == "simulation":
        times[AT_SENSOR_CONTACT] = run.times_at_sensor_contact
    for suffix, (first, second) in times.items():
        if figure.finger is None:
            simulated = abs(second - first)
        else:
            simulated = (first, second)[figure.finger - 1]
        row[f"simulated{suffix}"] = simulated
        row[f"difference{suffix}"] = simulated - figure.published
    return row


def deviations(
    published: Sequence[PublishedFigure], rows: Sequence[Mapping[str, Any]]
) -> dict[str, float]:
    """Root mean square of the differences in s by name, contact times and time differences apart.

    "contact_times" are those of the position rows and of equal colours; white on both sides,
    which is the position row of 0.03 m again, counts once. Of a source with colours there are
    those of each table, too.
    """
    has_colours = any(figure.table == "reflectance" for figure in published)
    groups: dict[str, list[float]] = {}
    for figure, row in zip(published, rows, strict=True):
        for name in _groups_of(figure, has_colours):
            for suffix in ("", AT_SENSOR_CONTACT):
                if f"difference{suffix}" in row:
                    groups.setdefault(name + suffix, []).append(row[f"difference{suffix}"])
    # fsum rounds once: sum() of Python 3.12 and later is not that of 3.11.
    return {
        name: math.sqrt(math.fsum(value * value for value in values) / len(values))
        for name, values in sorted(groups.items())
    }


def _groups_of(figure: PublishedFigure, has_colours: bool) -> Iterator[str]:
    """The names of the deviations in which a figure counts."""
    if figure.finger is None:
        yield "time_differences"
        return
    if has_colours:
        if not figure.setting.equal_colours:
            yield "mixed_colours"
        else:
            yield "positions" if figure.table == "position" else "equal_colours"
    if figure.setting.equal_colours and figure.condition != "white/white":
        yield "contact_times"
