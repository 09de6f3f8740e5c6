"""What the paper says of its experiments, each as a statement that can fail."""

from collections.abc import Mapping, Sequence
from typing import Any

from ...system.description import System
from ..metrics import IMPACT_WINDOW
from .claims import TARGET_TOLERANCE
from .grasps import Claim, Run, Runs, as_json, balances, off_centre, settled_force
from .tables import REFLECTANCE_X_M, Row, Setting

RMS_BAND = 0.35
"""s; the contact times of positions and equal colours are that near in the root mean square."""

COLOUR_BAND = 0.1
"""Nearly independent of the colour: contact times differ by less than this share of their mean."""


def check_bench_claims(
    runs: Runs, published: Sequence[Row], rms: Mapping[str, float], system: System
) -> list[dict[str, Any]]:
    """What the paper says of its experiments, each as a statement that can fail."""
    return as_json(
        (
            _claim_times(rms),
            _claim_differences(runs),
            _claim_balance(runs),
            _claim_colour(runs),
            _claim_mixed(runs, published),
            _claim_impact(runs, settled_force(system)),
            _claim_target(runs),
        )
    )


def equal_colours(setting: Setting) -> bool:
    """Whether both surfaces of the object have the same reflectance."""
    return setting.alpha_1 == setting.alpha_2


def _claim_times(rms: Mapping[str, float]) -> Claim:
    return (
        f"The contact times of the position rows and of equal colours are within {RMS_BAND:.2f} s "
        f"of the published ones in the root mean square ({rms['contact_times']:.3f} s).",
        rms["contact_times"] < RMS_BAND,
    )


def _claim_differences(runs: Runs) -> Claim:
    settings = sorted({setting for setting, _ in runs})
    closer = [s for s in settings if runs[s, 2].apart < runs[s, 1].apart]
    return (
        "Simultaneous contact: the fingers touch closer together in time in Case 2 than in Case 1 "
        f"in every row ({len(closer)} of {len(settings)} settings).",
        closer == settings,
    )


def _claim_balance(runs: Runs) -> Claim:
    settings = off_centre(runs)
    balanced = [s for s in settings if balances(runs, s)]
    return (
        "Off centre, Case 2 makes the nearer finger touch later and the farther one earlier "
        f"({len(balanced)} of {len(settings)} settings).",
        balanced == settings,
    )


def _claim_colour(runs: Runs) -> Claim:
    worst = max(
        (max(times) - min(times)) * len(times) / sum(times)
        for case in (1, 2)
        for times in zip(*(r.times for r in _coloured(runs, case)), strict=True)
    )
    return (
        "The contact times hardly depend on the colour where it is the same on both sides: each "
        f"differs by less than {100 * COLOUR_BAND:.0f} % of its mean (most: {100 * worst:.1f} %).",
        worst < COLOUR_BAND,
    )


def _claim_mixed(runs: Runs, published: Sequence[Row]) -> Claim:
    mixed = [s for s, case in runs if case == 2 and not equal_colours(s)]
    apart = [runs[s, 2].apart for s in mixed]
    most = max(r.published for r in published if r.case == 2 and r.finger is None)
    return (
        "Brown and white are still touched simultaneously in either order, in Case 2 "
        f"{' s and '.join(f'{d:.3f}' for d in apart)} s apart: no more than the most in any "
        f"published row, {most:.2f} s.",
        max(apart) <= most,
    )


def _claim_impact(runs: Runs, settled: float) -> Claim:
    soft = max(max(r.touch_forces) for r in runs.values() if r.case > 0)
    hard = min(min(r.touch_forces) for r in runs.values() if r.case == 0)
    return (
        f"Case 0 has an impact, Cases 1 and 2 have none: within {1e3 * IMPACT_WINDOW:.0f} ms of "
        f"touching every contact force rises above the settled {settled:.2f} N in Case 0 (to "
        f"{hard:.1f} N or more) and none does in Cases 1 and 2 (to {soft:.1f} N or less).",
        soft < settled < hard,
    )


def _claim_target(runs: Runs) -> Claim:
    case_2 = [runs[s, 2] for s in off_centre(runs) if equal_colours(s)]
    least = min(r.overshoot for r in case_2)
    rest = max(abs(r.metrics["target_position"] - r.setting.x_m) for r in case_2)
    return (
        "In Case 2 the target overshoots the centre of the object (by "
        f"{1e3 * least:.1f} mm or more off centre, equal colours) and converges to it (to "
        f"{1e3 * rest:.2f} mm).",
        least > TARGET_TOLERANCE and rest < TARGET_TOLERANCE,
    )


def _coloured(runs: Runs, case: int) -> list[Run]:
    """The grasps where the table of colours has equal ones."""
    return [
        r
        for (s, c), r in runs.items()
        if c == case and s.x_m == REFLECTANCE_X_M and equal_colours(s)
    ]
