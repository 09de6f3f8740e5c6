"""Statements of the paper about its simulation and its experiments, each of which can fail.

A claim is a function of the Evidence that returns its text, with our figures in it, and if it
holds. Those of the simulation are CLAIMS["simulation"], of the experiments CLAIMS["experiment"].
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..metrics import IMPACT_WINDOW
from .compared import Evidence, balances, off_centre, settled_force
from .tables import REFLECTANCE_X_M, Source

TIME_BAND = 0.10
DIFFERENCE_BAND = 0.03
"""s; how far contact times and time differences may be from the published ones."""

TARGET_TOLERANCE = 1e-4
"""m; the target has converged when it is this close to the object's centre."""

RMS_BAND = 0.35
"""s; the contact times of positions and equal colours are that near in the root mean square."""

COLOUR_BAND = 0.1
"""Nearly independent of the colour: contact times differ by less than this share of their mean."""


Claim = tuple[str, bool]
"""A statement, and True if it holds."""


def check_claims(source: Source, evidence: Evidence) -> list[dict[str, Any]]:
    """The claims of `evaluate --json` about what the paper says of this source of figures."""
    found = (claim(evidence) for claim in CLAIMS[source])
    return [{"text": text, "holds": bool(holds)} for text, holds in found]


def _times_are_near(e: Evidence) -> Claim:
    return _near("contact time", TIME_BAND, [r for r in e.rows if r["finger"]])


def _differences_are_near(e: Evidence) -> Claim:
    return _near("time difference", DIFFERENCE_BAND, [r for r in e.rows if not r["finger"]])


def _near(what: str, band: float, rows: Sequence[Mapping[str, Any]]) -> Claim:
    worst = max(abs(r["difference"]) for r in rows)
    return (
        f"Each {what} is within {band:.2f} s of the published one (largest deviation {worst:.3f} "
        "s).",
        worst <= band,
    )


def _touching_together(e: Evidence) -> Claim:
    """Layer 3 brings the contacts closer together."""
    return (
        "Simultaneous contact: wherever the object is off centre, the fingers touch closer "
        "together in time in Case 2 than in Case 1.",
        all(e.runs[s, 2].apart < e.runs[s, 1].apart for s in off_centre(e.runs)),
    )


def _balancing(e: Evidence) -> Claim:
    """Layer 3 delays the nearer finger and hastens the farther one."""
    return (
        "Off centre, Case 2 makes the nearer finger touch later and the farther one earlier.",
        all(balances(e.runs, s) for s in off_centre(e.runs)),
    )


def _soft_impact(e: Evidence) -> Claim:
    """Layer 2 takes the speed out of the contact."""
    soft = max(max(r.metrics["impact_velocity"]) for r in e.runs.values() if r.case > 0)
    hard = min(min(r.metrics["impact_velocity"]) for r in e.runs.values() if r.case == 0)
    return (
        f"Impact reduction: the fastest contact in Cases 1 and 2 ({1e3 * soft:.1f} mm/s) has less "
        f"than a tenth of the speed of the slowest in Case 0 ({1e3 * hard:.0f} mm/s).",
        soft < 0.1 * hard,
    )


def _controlled_force(e: Evidence) -> Claim:
    """Layer 1 sets the force."""
    settled = settled_force(e.system)
    worst = max(
        abs(force - settled) for r in e.runs.values() for force in r.metrics["steady_contact_force"]
    )
    return (
        f"Contact force control: every finger settles at K_i·W/2 = {settled:.2f} N within 1 % "
        f"(largest deviation {worst:.4f} N).",
        worst <= 0.01 * settled,
    )


def _target_converges(e: Evidence) -> Claim:
    case_2 = [e.runs[s, 2] for s in off_centre(e.runs)]
    return (
        "In Case 2 the target overshoots the centre of the object (by "
        f"{1e3 * min(r.overshoot for r in case_2):.1f} mm or more off centre) and converges to it.",
        all(r.overshoot > TARGET_TOLERANCE and r.off_target < TARGET_TOLERANCE for r in case_2),
    )


def _bench_times_are_near(e: Evidence) -> Claim:
    rms = e.rms["contact_times"]
    return (
        f"The contact times of the position rows and of equal colours are within {RMS_BAND:.2f} s "
        f"of the published ones in the root mean square ({rms:.3f} s).",
        rms < RMS_BAND,
    )


def _bench_touching_together(e: Evidence) -> Claim:
    settings = sorted({setting for setting, _ in e.runs})
    closer = [s for s in settings if e.runs[s, 2].apart < e.runs[s, 1].apart]
    return (
        "Simultaneous contact: the fingers touch closer together in time in Case 2 than in Case 1 "
        f"in every row ({len(closer)} of {len(settings)} settings).",
        closer == settings,
    )


def _bench_balancing(e: Evidence) -> Claim:
    settings = off_centre(e.runs)
    balanced = [s for s in settings if balances(e.runs, s)]
    return (
        "Off centre, Case 2 makes the nearer finger touch later and the farther one earlier "
        f"({len(balanced)} of {len(settings)} settings).",
        balanced == settings,
    )


def _independent_of_colour(e: Evidence) -> Claim:
    equal = [s for s, case in e.runs if s.x_m == REFLECTANCE_X_M and s.equal_colours and case == 1]
    worst = max(
        (max(times) - min(times)) * len(times) / sum(times)
        for case in (1, 2)
        for times in zip(*(e.runs[s, case].times for s in equal), strict=True)
    )
    return (
        "The contact times hardly depend on the colour where it is the same on both sides: each "
        f"differs by less than {100 * COLOUR_BAND:.0f} % of its mean (most: {100 * worst:.1f} %).",
        worst < COLOUR_BAND,
    )


def _mixed_colours(e: Evidence) -> Claim:
    mixed = [s for s, case in e.runs if case == 2 and not s.equal_colours]
    apart = [e.runs[s, 2].apart for s in mixed]
    most = max(r.published for r in e.published if r.case == 2 and r.finger is None)
    return (
        "Brown and white are still touched simultaneously in either order, in Case 2 "
        f"{' s and '.join(f'{d:.3f}' for d in apart)} s apart: no more than the most in any "
        f"published row, {most:.2f} s.",
        max(apart) <= most,
    )


def _bench_soft_impact(e: Evidence) -> Claim:
    settled = settled_force(e.system)
    soft = max(max(r.touch_forces) for r in e.runs.values() if r.case > 0)
    hard = min(min(r.touch_forces) for r in e.runs.values() if r.case == 0)
    return (
        f"Case 0 has an impact, Cases 1 and 2 have none: within {1e3 * IMPACT_WINDOW:.0f} ms of "
        f"touching every contact force rises above the settled {settled:.2f} N in Case 0 (to "
        f"{hard:.1f} N or more) and none does in Cases 1 and 2 (to {soft:.1f} N or less).",
        soft < settled < hard,
    )


def _bench_target_converges(e: Evidence) -> Claim:
    case_2 = [e.runs[s, 2] for s in off_centre(e.runs) if s.equal_colours]
    least = min(r.overshoot for r in case_2)
    rest = max(r.off_target for r in case_2)
    return (
        "In Case 2 the target overshoots the centre of the object (by "
        f"{1e3 * least:.1f} mm or more off centre, equal colours) and converges to it (to "
        f"{1e3 * rest:.2f} mm).",
        least > TARGET_TOLERANCE and rest < TARGET_TOLERANCE,
    )


CLAIMS: Mapping[Source, Sequence[Callable[[Evidence], Claim]]] = {
    "simulation": (
        _times_are_near,
        _differences_are_near,
        _touching_together,
        _balancing,
        _soft_impact,
        _controlled_force,
        _target_converges,
    ),
    "experiment": (
        _bench_times_are_near,
        _bench_touching_together,
        _bench_balancing,
        _independent_of_colour,
        _mixed_colours,
        _bench_soft_impact,
        _bench_target_converges,
    ),
}
