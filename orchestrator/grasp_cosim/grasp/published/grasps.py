"""The grasps of an evaluation, and what claims ask of them."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...recording.result import Result
from ...system.description import System
from ..metrics import FINGERS, IMPACT_WINDOW, time_at_gap
from ..presets import start_in_si
from .tables import REFLECTANCE_X_M, Setting

SENSOR_CONTACT = 0.37e-3
"""m; the gap at which contact, were it declared there, would explain the published times best."""


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
    moments = [time_at_gap(result.by_role, j, SENSOR_CONTACT) for j in FINGERS]
    first, second = moments
    if first is None or second is None or None in result.metrics["time_to_contact"]:
        raise InputError(
            f"evaluate: x_m = {setting.x_m} m, Case {case}: a finger does not reach the object"
        )
    target = result.by_role["controller.target_position"]
    beyond = float(np.max((target - setting.x_m) * math.copysign(1.0, setting.x_m)))
    shown = result if setting == Setting(REFLECTANCE_X_M) else None
    right, left = (_touch_force(result, j) for j in FINGERS)
    return Run(setting, case, dict(result.metrics), (first, second), beyond, (right, left), shown)


def _touch_force(result: Result, finger: int) -> float:
    touch = result.metrics["time_to_contact"][finger - 1]
    near = (result.time >= touch) & (result.time <= touch + IMPACT_WINDOW)
    return float(np.abs(result.by_role[f"plant.contact_force[{finger}]"][near]).max())


def off_centre(runs: Runs) -> list[Setting]:
    """The settings in which the object is not in the middle of the fingers."""
    return sorted({setting for setting, _ in runs if setting.x_m})


def balances(runs: Runs, setting: Setting) -> bool:
    """True if Case 2 makes the nearer finger, the first, later and the farther one earlier."""
    (near_1, far_1), (near_2, far_2) = (runs[setting, case].times for case in (1, 2))
    return near_2 > near_1 and far_2 < far_1


def settled_force(system: System) -> float:
    """K_i·W/2 in N, with which a finger presses in the end where friction does not hold it."""
    stiffness = start_in_si(system, "controller.contact_force.stiffness")
    return 0.5 * stiffness * start_in_si(system, "plant.object_width")
