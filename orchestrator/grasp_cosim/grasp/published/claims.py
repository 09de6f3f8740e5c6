"""What the paper says of its simulation, each as a statement that can fail."""

from typing import Any

from ...system.description import System
from .grasps import Claim, Runs, as_json, balances, off_centre, settled_force

TIME_BAND = 0.10
DIFFERENCE_BAND = 0.03
"""s; how far contact times and time differences may be from the published ones."""


TARGET_TOLERANCE = 1e-4
"""m; the target has converged when it is this close to the object's centre."""


def check_claims(runs: Runs, rows: list[dict[str, Any]], system: System) -> list[dict[str, Any]]:
    """What the paper says of its simulation, each as a statement that can fail."""
    claims = (
        _claim_times(rows),
        _claim_differences(rows),
        _claim_simultaneous(runs),
        _claim_balance(runs),
        _claim_impact(runs),
        _claim_force(runs, system),
        _claim_target(runs),
    )
    return as_json(claims)


def _claim_times(rows: list[dict[str, Any]]) -> Claim:
    worst = max(abs(r["difference"]) for r in rows if r["finger"])
    return (
        f"Each contact time is within {TIME_BAND:.2f} s of the published one "
        f"(largest deviation {worst:.3f} s).",
        worst <= TIME_BAND,
    )


def _claim_differences(rows: list[dict[str, Any]]) -> Claim:
    worst = max(abs(r["difference"]) for r in rows if not r["finger"])
    return (
        f"Each time difference is within {DIFFERENCE_BAND:.2f} s of the published one "
        f"(largest deviation {worst:.3f} s).",
        worst <= DIFFERENCE_BAND,
    )


def _claim_simultaneous(runs: Runs) -> Claim:
    return (
        "Simultaneous contact: wherever the object is off centre, the fingers touch closer "
        "together in time in Case 2 than in Case 1.",
        all(runs[s, 2].apart < runs[s, 1].apart for s in off_centre(runs)),
    )


def _claim_balance(runs: Runs) -> Claim:
    return (
        "Off centre, Case 2 makes the nearer finger touch later and the farther one earlier.",
        all(balances(runs, s) for s in off_centre(runs)),
    )


def _claim_impact(runs: Runs) -> Claim:
    soft = max(max(r.metrics["impact_velocity"]) for r in runs.values() if r.case > 0)
    hard = min(min(r.metrics["impact_velocity"]) for r in runs.values() if r.case == 0)
    return (
        f"Impact reduction: the fastest contact in Cases 1 and 2 ({1e3 * soft:.1f} mm/s) has less "
        f"than a tenth of the speed of the slowest in Case 0 ({1e3 * hard:.0f} mm/s).",
        soft < 0.1 * hard,
    )


def _claim_force(runs: Runs, system: System) -> Claim:
    settled = settled_force(system)
    worst = max(
        abs(force - settled) for r in runs.values() for force in r.metrics["steady_contact_force"]
    )
    return (
        f"Contact force control: every finger settles at K_i·W/2 = {settled:.2f} N within 1 % "
        f"(largest deviation {worst:.4f} N).",
        worst <= 0.01 * settled,
    )


def _claim_target(runs: Runs) -> Claim:
    case_2 = [runs[s, 2] for s in off_centre(runs)]
    return (
        "In Case 2 the target overshoots the centre of the object (by "
        f"{1e3 * min(r.overshoot for r in case_2):.1f} mm or more off centre) and converges to it.",
        all(
            r.overshoot > TARGET_TOLERANCE
            and abs(r.metrics["target_position"] - r.setting.x_m) < TARGET_TOLERANCE
            for r in case_2
        ),
    )
