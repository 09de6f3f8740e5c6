"""The paper's tables and figures run again, and its claims about them, each of which can fail.

A claim is its text, with our figures in it, and whether it holds.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from ...base.files import check_folder, write_json, write_text
from ...base.progress import Progress
from ...base.text import on_a_screen
from ...recording.recorded_run import UNITS
from ...report.plot import new_figure
from ..metrics import IMPACT_WINDOW, METRICS
from ..presets import start_in_si, with_preset
from ..system import grasp_system
from .evaluation_page import CLAIM_TITLES, evaluation_html
from .published_figures import REFLECTANCE_X_M, Setting, Source, table_csv
from .reproduction import Evidence, GraspRun, reproduce

TIME_BAND = 0.10
DIFFERENCE_BAND = 0.03
"""s; how far contact times and time differences may be from the published ones."""

TARGET_TOLERANCE = 1e-4
"""m; the target has converged when it is this close to the object's centre."""

RMS_BAND = 0.35
"""s; the contact times of positions and equal colours are that near in the root mean square."""

COLOUR_BAND = 0.1
"""Nearly independent of the colour: contact times differ by less than this share of their mean."""


INTERCHANGE_BAND = 0.1
"""s; almost no difference: interchanged colours change the time difference by less than this."""


class Claim(NamedTuple):
    """A statement about the runs that holds or fails, and whether the paper makes it."""

    text: str
    holds: bool
    of_paper: bool = True

    def as_dict(self) -> dict[str, Any]:
        """The claim as types that JSON has; its origin is "paper" or "reproduction"."""
        origin = "paper" if self.of_paper else "reproduction"
        return {"text": self.text, "holds": bool(self.holds), "origin": origin}


"""A statement, and True if it holds."""

NOT_REPEATABLE = ("wall_time", "real_time_factor")
"""Metrics that differ from one repetition of a grasp to the next."""


class Evaluation(dict[str, Any]):
    """What evaluate() returns; it shows itself as the claims and the deviations."""

    def __repr__(self) -> str:
        return on_a_screen(verdict(self).splitlines())


def evaluate(
    *,
    bench: bool = False,
    controller: str = "published",
    out: str | Path | None = None,
    native: bool | None = None,
    progress: bool = False,
) -> Evaluation:
    """Run Cases 0, 1 and 2 in all settings of the paper's simulations, and compare the figures.

    Args:
        bench: True runs the settings of the paper's experiments, with the preset "bench".
        controller: "published" or "adaptive": see grasp_system().
        out: A folder for the report: evaluation.json, evaluation.csv and, with pictures,
            evaluation.html. None writes nothing.
        native: Which FMUs run: see System.natively().
        progress: True shows on standard error how far it is.

    Returns:
        A dictionary with `rows`, each a published figure next to the simulated one, and `rms` of
        the differences in s. `claims` tells which claims hold, `runs` has the metrics of each
        grasp, `units` the units.

    Raises:
        InputError: Before anything runs, `out` cannot be written to, or matplotlib is not installed
            that draws its pictures.
        SimulationError: A run fails.
        KeyboardInterrupt: Ctrl-C.

    Example:
        >>> from grasp_cosim import evaluate
        >>> report = evaluate()  # takes about 10 s
        >>> all(claim["holds"] for claim in report["claims"])
        True
    """
    folder = None if out is None else Path(out)
    if folder:
        check_folder(folder)
        new_figure(1.0, 1.0)
    source: Source = "experiment" if bench else "simulation"
    with Progress("compiling the native FMUs, once for these sources", unit="", shown=progress):
        system = grasp_system(controller, native)
    system = with_preset(system, "bench") if bench else system
    evidence = reproduce(system, source, os.cpu_count() or 1, progress)
    report = evaluation_of(evidence, source)
    if folder:
        write_evaluation(folder, evidence, report, source)
    return report


def write_evaluation(
    out: Path, evidence: Evidence, report: Mapping[str, Any], source: Source
) -> None:
    """Write the page of a report, and its numbers, into a folder."""
    write_json(out / "evaluation.json", report)
    rows = [{**row, "finger": row["finger"] or "difference"} for row in evidence.rows]
    write_text(out / "evaluation.csv", table_csv(rows))
    write_text(out / "evaluation.html", evaluation_html(evidence, report["claims"], source))


def evaluation_of(evidence: Evidence, source: Source) -> Evaluation:
    """What evaluate() returns; a condition is a position in m, or names the colours."""
    return Evaluation(
        rows=evidence.rows,
        rms=evidence.rms,
        claims=check_claims(source, evidence),
        runs=[_run_entry(run, source) for run in evidence.runs.values()],
        units=_units(evidence),
    )


def _run_entry(run: GraspRun, source: Source) -> dict[str, Any]:
    """The condition, the case and the metrics of a grasp."""
    condition = run.setting.x_m if source == "simulation" else run.setting.label
    metrics = {name: value for name, value in run.metrics.items() if name not in NOT_REPEATABLE}
    return {"condition": condition, "case": run.case, **metrics}


def _units(evidence: Evidence) -> dict[str, str | None]:
    """The units of the entries of an evaluation, by name."""
    units = {metric.name: metric.unit for metric in METRICS}
    units |= {name: unit for name, unit in UNITS.items() if name not in NOT_REPEATABLE}
    units |= {name: "s" for name, value in evidence.rows[0].items() if isinstance(value, float)}
    return {**units, "rms": "s", "condition": "m"}


def verdict(report: Mapping[str, Any]) -> str:
    """The claims and the deviations of a report as lines for a terminal."""
    lines = []
    for origin, title in CLAIM_TITLES.items():
        claims = [claim for claim in report["claims"] if claim["origin"] == origin]
        if claims:
            lines.append(f"{title}:")
        lines += [f"{'holds' if c['holds'] else 'FAILS'}  {c['text']}" for c in claims]
    rms = ", ".join(
        f"{name.replace('_', ' ')} {deviation:.3f}" for name, deviation in report["rms"].items()
    )
    return "\n".join([*lines, f"root mean square of the differences in s: {rms}"])


# Claims


def check_claims(source: Source, evidence: Evidence) -> list[dict[str, Any]]:
    """The claims of `evaluate --json` about what the paper says of this source of figures."""
    return [claim.as_dict() for claim in CLAIMS[source](evidence)]


def _claims_on_simulation(e: Evidence) -> Iterator[Claim]:
    of_fingers = [row["difference"] for row in e.rows if row["finger"]]
    between = [row["difference"] for row in e.rows if not row["finger"]]
    yield _near_published("contact time", TIME_BAND, of_fingers)
    yield _near_published("time difference", DIFFERENCE_BAND, between)
    settings = _off_centre(e)
    yield _touching_together(e, settings, "wherever the object is off centre,")
    yield _balancing(e, settings)
    soft = max(_of_fingers("impact_velocity", e, (1, 2)))
    hard = min(_of_fingers("impact_velocity", e, (0,)))
    yield Claim(
        f"Impact reduction: the fastest contact in Cases 1 and 2 ({1e3 * soft:.1f} mm/s) has "
        f"less than a tenth of the speed of the slowest in Case 0 ({1e3 * hard:.0f} mm/s).",
        soft < 0.1 * hard,
    )
    settled = _settled_force(e)
    forces = _of_fingers("steady_contact_force", e, (0, 1, 2))
    worst = max(abs(force - settled) for force in forces)
    yield Claim(
        f"Contact force control: every finger settles at K_i·W/2 = {settled:.2f} N within 1 % "
        f"(largest deviation {worst:.4f} N).",
        worst <= 0.01 * settled,
        of_paper=False,
    )
    yield _converging(e, settings, "off centre")


def _claims_on_experiments(e: Evidence) -> Iterator[Claim]:
    rms = e.rms["contact_times"]
    settings = sorted({setting for setting, _ in e.runs})
    yield Claim(
        f"The contact times of the position rows and of equal colours are within {RMS_BAND:.2f} s "
        f"of the published ones in the root mean square ({rms:.3f} s).",
        rms < RMS_BAND,
        of_paper=False,
    )
    yield _touching_together(e, settings, "in every row")
    yield _balancing(e, _off_centre(e))
    worst = max(_spreads_over_colours(e, settings))
    yield Claim(
        "The contact times hardly depend on the colour where it is the same on both sides: each "
        f"differs by less than {100 * COLOUR_BAND:.0f} % of its mean (most: {100 * worst:.1f} %).",
        worst < COLOUR_BAND,
    )
    yield _touching_mixed_colours_together(e)
    yield _interchanging_colours(e)
    settled = _settled_force(e)
    soft = max(max(run.touch_forces) for run in e.runs.values() if run.case > 0)
    hard = min(min(run.touch_forces) for run in e.runs.values() if run.case == 0)
    yield Claim(
        "With alpha = 200 1/s of the contact, "
        f"Case 0 has an impact, Cases 1 and 2 have none: within {1e3 * IMPACT_WINDOW:.0f} ms of "
        f"touching every contact force rises above the settled {settled:.2f} N in Case 0 (to "
        f"{hard:.1f} N or more) and none does in Cases 1 and 2 (to {soft:.1f} N or less).",
        soft < settled < hard,
    )
    equal_colours = [setting for setting in _off_centre(e) if setting.equal_colours]
    yield _converging(e, equal_colours, "off centre, equal colours")


CLAIMS: Mapping[Source, Callable[[Evidence], Iterator[Claim]]] = {
    "simulation": _claims_on_simulation,
    "experiment": _claims_on_experiments,
}


def _off_centre(e: Evidence) -> list[Setting]:
    """The settings in which the object is not in the middle of the fingers."""
    return sorted({setting for setting, _ in e.runs if setting.x_m})


def _of_fingers(metric: str, e: Evidence, cases: Sequence[int]) -> Iterator[float]:
    """A metric of each finger in these cases."""
    return chain.from_iterable(run.metrics[metric] for run in e.runs.values() if run.case in cases)


def _near_published(figure: str, band: float, differences: Sequence[float]) -> Claim:
    """The figures of one kind are as they were published, within a band in s."""
    worst = max(map(abs, differences))
    return Claim(
        f"Each {figure} is within {band:.2f} s of the published one (largest deviation "
        f"{worst:.3f} s).",
        worst <= band,
        of_paper=False,
    )


def _spreads_over_colours(e: Evidence, settings: Sequence[Setting]) -> Iterator[float]:
    """By how much a contact time differs between equal colours, as a share of its mean."""
    equal = [s for s in settings if s.x_m == REFLECTANCE_X_M and s.equal_colours]
    for case in (1, 2):
        for times in zip(*(e.runs[setting, case].times for setting in equal), strict=True):
            yield (max(times) - min(times)) * len(times) / sum(times)


def _touching_mixed_colours_together(e: Evidence) -> Claim:
    """Layer 3 brings the contacts together where the faces are of two colours, too."""
    apart = [run.apart for run in _of_mixed_colours(e)]
    most = max(row.published for row in e.published if row.case == 2 and row.finger is None)
    times = " s and ".join(f"{time:.3f}" for time in apart)
    return Claim(
        f"Brown and white are still touched simultaneously in either order, in Case 2 {times} s "
        f"apart: no more than the most in any published row, {most:.2f} s.",
        max(apart) <= most,
    )


def _interchanging_colours(e: Evidence) -> Claim:
    """Sec. V: which of the fingers has the darker face makes almost no difference."""
    apart = [run.apart for run in _of_mixed_colours(e)]
    published = [
        row.published
        for row in e.published
        if row.case == 2 and row.finger is None and not row.setting.equal_colours
    ]
    change, published_change = max(apart) - min(apart), max(published) - min(published)
    return Claim(
        "Interchanging brown and white makes almost no difference: in Case 2 it changes the time "
        f"difference of contact by less than {INTERCHANGE_BAND:.1f} s ({change:.3f} s; published "
        f"{published_change:.2f} s).",
        change < INTERCHANGE_BAND,
    )


def _of_mixed_colours(e: Evidence) -> list[GraspRun]:
    """The grasps of Case 2 of faces of two colours."""
    return [
        run for (setting, case), run in e.runs.items() if case == 2 and not setting.equal_colours
    ]


def _settled_force(e: Evidence) -> float:
    """K_i·W/2 in N, with which a finger presses in the end where friction does not hold it."""
    stiffness = start_in_si(e.system, "controller.contact_force.stiffness")
    return 0.5 * stiffness * start_in_si(e.system, "plant.object_width")


def _touching_together(e: Evidence, settings: Sequence[Setting], condition: str) -> Claim:
    """Layer 3 brings the contacts closer together."""
    closer = [s for s in settings if e.runs[s, 2].apart < e.runs[s, 1].apart]
    return Claim(
        f"Simultaneous contact: {condition} the fingers touch closer together in time in Case 2 "
        f"than in Case 1 ({len(closer)} of {len(settings)} settings).",
        closer == settings,
    )


def _balancing(e: Evidence, settings: Sequence[Setting]) -> Claim:
    """Layer 3 delays the nearer finger, the first, and hastens the farther one."""
    balanced = []
    for setting in settings:
        nearer_1, farther_1 = e.runs[setting, 1].times
        nearer_2, farther_2 = e.runs[setting, 2].times
        if nearer_2 > nearer_1 and farther_2 < farther_1:
            balanced.append(setting)
    return Claim(
        "Off centre, Case 2 makes the nearer finger touch later and the farther one earlier "
        f"({len(balanced)} of {len(settings)} settings).",
        balanced == settings,
    )


def _converging(e: Evidence, settings: Sequence[Setting], condition: str) -> Claim:
    """The target of Case 2 passes the centre of the object, and comes back to it."""
    case_2 = [e.runs[setting, 2] for setting in settings]
    overshoot = min(run.overshoot for run in case_2)
    off_target = max(run.off_target for run in case_2)
    return Claim(
        f"In Case 2 the target overshoots the centre of the object (by {1e3 * overshoot:.1f} mm or "
        f"more {condition}) and converges to it (to {1e3 * off_target:.2f} mm).",
        overshoot > TARGET_TOLERANCE and off_target < TARGET_TOLERANCE,
    )
