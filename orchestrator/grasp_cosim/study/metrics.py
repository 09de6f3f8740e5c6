"""Figures of merit of a grasp, from the recorded signals of a gripper plant and its controller."""

from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np
import numpy.typing as npt

Signals = Mapping[str, npt.NDArray[Any]]
Times = npt.NDArray[np.float64]

PLANT = "plant"
CONTROLLER = "controller"
FINGERS = (1, 2)
CLOSING = {1: -1.0, 2: 1.0}
"""Direction in which a finger closes."""

_PER_FINGER = ("position", "velocity", "gap", "contact_force", "contact")

UNITS: Mapping[str, str] = {
    "time_to_contact": "s",
    "time_difference": "s",
    "impact_velocity": "m/s",
    "peak_contact_force": "N",
    "steady_contact_force": "N",
    "object_shift": "m",
    "target_position": "m",
}
"""The units of the metrics of a grasp."""

STEADY_WINDOW = 0.1
"""The steady contact force is the mean over the last so many seconds."""

LABELS = (
    ("time to contact", "time_to_contact", 1.0, "s"),
    ("time difference", "time_difference", 1.0, "s"),
    ("impact velocity", "impact_velocity", 1e3, "mm/s"),
    ("peak contact force", "peak_contact_force", 1.0, "N"),
    ("steady contact force", "steady_contact_force", 1.0, "N"),
    ("target position", "target_position", 1e3, "mm"),
    ("object shift", "object_shift", 1e3, "mm"),
)
"""The metrics as they are shown: label, name, factor and unit."""


def is_grasp(signals: Iterable[str]) -> bool:
    """Whether signals of these names are those of a gripper plant and its controller."""
    names = set(signals)
    wanted = ["object_position", *(f"{v}[{j}]" for v in _PER_FINGER for j in FINGERS)]
    return names >= {f"{CONTROLLER}.target_position", *(f"{PLANT}.{name}" for name in wanted)}


def grasp_metrics(time: Times, signals: Signals) -> dict[str, Any]:
    """The metrics of `run --json`, or none where the system is not a grasp."""
    if not is_grasp(signals):
        return {}
    contacts = [first_contact(time, signals, j) for j in FINGERS]
    times = [None if c is None else c[0] for c in contacts]
    forces = [np.abs(signals[f"{PLANT}.contact_force[{j}]"]) for j in FINGERS]
    steady = time >= time[-1] - STEADY_WINDOW
    shift = signals[f"{PLANT}.object_position"] - signals[f"{PLANT}.object_position"][0]
    return {
        "time_to_contact": times,
        "time_difference": None if None in times else abs(times[1] - times[0]),  # type: ignore[operator]
        "impact_velocity": [None if c is None or c[1] <= 0.0 else c[1] for c in contacts],
        "peak_contact_force": [float(f.max()) for f in forces],
        "steady_contact_force": [float(f[steady].mean()) for f in forces],
        "object_shift": float(np.abs(shift).max()),
        "target_position": float(signals[f"{CONTROLLER}.target_position"][-1]),
    }


def first_contact(time: Times, signals: Signals, finger: int) -> tuple[float, float] | None:
    """Time in s and closing speed in m/s at which a finger first touches; None if it never does.

    Between the last free communication point and the first one in contact, the moment is where
    the gap runs out at the speed of the last free point.
    """
    touching = np.flatnonzero(signals[f"{PLANT}.contact[{finger}]"])
    if not len(touching):
        return None
    k = max(int(touching[0]) - 1, 0)
    speed = float(CLOSING[finger] * signals[f"{PLANT}.velocity[{finger}]"][k])
    gap = max(float(signals[f"{PLANT}.gap[{finger}]"][k]), 0.0)
    span = float(time[touching[0]] - time[k])
    wait = min(gap / speed, span) if speed > 0.0 else span
    return float(time[k]) + wait, speed


def time_at_gap(time: Times, signals: Signals, finger: int, gap: float) -> float | None:
    """Time in s at which a finger's gap first falls to gap in m, interpolated; None if never."""
    gaps = signals[f"{PLANT}.gap[{finger}]"]
    below = np.flatnonzero(gaps <= gap)
    if not len(below):
        return None
    k = int(below[0])
    if k == 0:
        return float(time[0])
    fraction = (gaps[k - 1] - gap) / (gaps[k - 1] - gaps[k])
    return float(time[k - 1] + fraction * (time[k] - time[k - 1]))
