"""Figures of merit of a grasp, from the recorded signals of a gripper plant and its controller."""

from collections.abc import Iterable, Mapping
from math import copysign, degrees
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

Signals = Mapping[str, npt.NDArray[Any]]
Times = npt.NDArray[np.float64]
Forces = npt.NDArray[np.float64]

PLANT = "plant"
CONTROLLER = "controller"
FINGERS = (1, 2)
CLOSING = {1: -1.0, 2: 1.0}
"""Direction in which a finger closes."""

_OUTPUTS = (
    f"{PLANT}.object_position",
    *(
        f"{PLANT}.{name}[{j}]"
        for name in ("position", "velocity", "gap", "contact_force", "contact")
        for j in FINGERS
    ),
)
"""What every gripper plant puts out."""

UNITS: Mapping[str, str | None] = {
    "time_to_contact": "s",
    "time_difference": "s",
    "impact_velocity": "m/s",
    "impact_impulse": "N.s",
    "peak_contact_force": "N",
    "steady_contact_force": "N",
    "force_overshoot": "1",
    "settling_time": "s",
    "target_position": "m",
    "object_shift": "m",
    "object_tilt": "rad",
    "toppled": None,
    "squeeze": "m",
    "damaged": None,
}
"""The units of the metrics of a grasp; None where one is true or false."""

OF_FINGERS = (
    "time_to_contact", "impact_velocity", "impact_impulse", "peak_contact_force",
    "steady_contact_force", "force_overshoot", "settling_time",
)  # fmt: skip
"""The metrics of which each finger has one."""

OF_OBJECT: Mapping[str, str] = {
    "object_tilt": "tilt",
    "toppled": "toppled",
    "squeeze": "squeeze",
    "damaged": "damaged",
}
"""The metrics that are there only if the plant has an output for them: its name."""

IMPACT_WINDOW = 0.02
"""s from first contact; an impact is over by then, the grasp presses within a second."""

STEADY_WINDOW = 0.1
"""The steady contact force is the mean over the last so many seconds."""

SETTLED = 0.02
"""A force has settled once it stays so near to the steady one, as a share of that."""

LABELS = (
    ("time to contact", "time_to_contact", 1.0, "s"),
    ("time difference", "time_difference", 1.0, "s"),
    ("impact velocity", "impact_velocity", 1e3, "mm/s"),
    ("impact impulse", "impact_impulse", 1e3, "mN.s"),
    ("peak contact force", "peak_contact_force", 1.0, "N"),
    ("steady contact force", "steady_contact_force", 1.0, "N"),
    ("force overshoot", "force_overshoot", 1e2, "%"),
    ("settling time", "settling_time", 1.0, "s"),
    ("target position", "target_position", 1e3, "mm"),
    ("object shift", "object_shift", 1e3, "mm"),
    ("object tilt", "object_tilt", degrees(1.0), "deg"),
    ("object toppled", "toppled", 1.0, ""),
    ("object squeezed by", "squeeze", 1e3, "mm"),
    ("object damaged", "damaged", 1.0, ""),
)
"""The metrics as they are shown: label, name, factor and unit."""


class FirstContact(NamedTuple):
    """When a finger first touches in s, how fast its gap closes then in m/s, the first row that
    has it touching.
    """

    time: float
    speed: float
    row: int


def is_grasp(signals: Iterable[str]) -> bool:
    """Whether signals of these names are those of a gripper plant and its controller."""
    return set(signals) >= {f"{CONTROLLER}.target_position", *_OUTPUTS}


def grasp_metrics(time: Times, signals: Signals) -> dict[str, Any]:
    """The metrics of `run --json`, or none where the system is not a grasp."""
    if not is_grasp(signals):
        return {}
    fingers = [_of_finger(time, signals, j) for j in FINGERS]
    first, second = (finger["time_to_contact"] for finger in fingers)
    shift = signals[f"{PLANT}.object_position"] - signals[f"{PLANT}.object_position"][0]
    return {
        **{name: [finger[name] for finger in fingers] for name in fingers[0]},
        "time_difference": None if first is None or second is None else abs(second - first),
        "target_position": float(signals[f"{CONTROLLER}.target_position"][-1]),
        "object_shift": float(np.abs(shift).max()),
        **_of_object(signals),
    }


def _of_finger(time: Times, signals: Signals, finger: int) -> dict[str, float | None]:
    """The metrics of one finger; what begins with its first contact is None where it has none.

    A steady force that is 0 at any time is none to compare with: the finger does not hold on.
    """
    force = np.abs(signals[f"{PLANT}.contact_force[{finger}]"])
    last = force[time >= time[-1] - STEADY_WINDOW]
    held = float(last.mean()) if last.min() > 0.0 else None
    contact = first_contact(time, signals, finger)
    moment, speed, row = contact or (None, 0.0, len(time))
    after = time[row:] - (moment or 0.0)  # empty where it never touches
    return {
        "time_to_contact": moment,
        "impact_velocity": speed if speed > 0.0 else None,
        "impact_impulse": impulse(after, force[row:], IMPACT_WINDOW),
        "peak_contact_force": float(force.max()),
        "steady_contact_force": float(last.mean()),
        "force_overshoot": overshoot(force[row:], held),
        "settling_time": settling_time(after, force[row:], held),
    }


def _of_object(signals: Signals) -> dict[str, float | bool]:
    """The largest tilt and squeeze, either way, and whether it ever toppled or was damaged."""
    there = {name: f"{PLANT}.{output}" for name, output in OF_OBJECT.items()}
    largest = {name: np.abs(signals[s]).max() for name, s in there.items() if s in signals}
    return {n: bool(v) if UNITS[n] is None else float(v) for n, v in largest.items()}


def impulse(after: Times, force: Forces, window: float) -> float | None:
    """Impulse in N.s of a force in N over a window in s from first contact.

    after are the seconds since then. Until the first sample the force is taken as it is there, as
    one that begins with a jump has it. None if it ends sooner, or with fewer than two samples.
    """
    if np.count_nonzero(after <= window) < 2 or after[-1] < window:
        return None
    inner = after[(after > 0.0) & (after < window)]
    times = np.concatenate(([0.0], inner, [window]))
    return float(np.trapezoid(np.interp(times, after, force), times))


def overshoot(force: Forces, steady: float | None) -> float | None:
    """By what share of the steady force in N a force since contact exceeds it at most; 0 if never.

    None without a contact, or without a steady force.
    """
    return None if steady is None or not len(force) else max(0.0, float(force.max()) / steady - 1.0)


def settling_time(after: Times, force: Forces, steady: float | None) -> float | None:
    """Seconds since contact from which on a force is within SETTLED of the steady one, both in N.

    after are the seconds since then, at which the force is given. None where it is not within
    throughout the last STEADY_WINDOW, without a contact, or without a steady force.
    """
    if steady is None or not len(after) or after[-1] < STEADY_WINDOW:
        return None
    error = force - steady
    outside = np.flatnonzero(np.abs(error) > SETTLED * steady)
    if not len(outside):
        return 0.0
    k = int(outside[-1])
    if after[k] >= after[-1] - STEADY_WINDOW:
        return None
    edge = copysign(SETTLED * steady, error[k])
    fraction = (error[k] - edge) / (error[k] - error[k + 1])
    return float(after[k] + fraction * (after[k + 1] - after[k]))


def first_contact(time: Times, signals: Signals, finger: int) -> FirstContact | None:
    """How a finger first touches; None if it never does.

    Between the last free communication point and the first one in contact, the moment is where
    the gap runs out at the rate of the last free point.
    """
    touching = np.flatnonzero(signals[f"{PLANT}.contact[{finger}]"])
    if not len(touching):
        return None
    row = int(touching[0])
    k = max(row - 1, 0)
    own = float(CLOSING[finger] * signals[f"{PLANT}.velocity[{finger}]"][k])
    speed = own - _surface_speed(time, signals, finger, k)
    gap = max(float(signals[f"{PLANT}.gap[{finger}]"][k]), 0.0)
    span = float(time[row] - time[k])
    wait = min(gap / speed, span) if speed > 0.0 else span
    return FirstContact(float(time[k]) + wait, speed, row)


def _surface_speed(time: Times, signals: Signals, finger: int, k: int) -> float:
    """How fast the object's surface goes ahead of a finger that is free up to row k, in m/s.

    What the finger moved less what the gap shrank, over the last whole step of the plant, which
    may be longer than that of the system and holds its outputs in between. 0 where there was none.
    """
    given = _given(signals, k)
    if len(given) < 2:
        return 0.0
    own = int(np.diff(given).min())
    last = k - (k - int(given[-1])) % own  # it may have stepped since, and nothing moved
    rows = [last - own, last]
    gap = signals[f"{PLANT}.gap[{finger}]"][rows]
    surface = CLOSING[finger] * signals[f"{PLANT}.position[{finger}]"][rows] + gap
    return float((surface[1] - surface[0]) / (time[last] - time[last - own]))


def _given(signals: Signals, k: int) -> npt.NDArray[np.intp]:
    """The rows up to row k that have other outputs of the plant than the one before; the first."""
    changed = np.zeros(k + 1, bool)
    changed[0] = True
    for name in _OUTPUTS:
        changed[1:] |= np.diff(signals[name][: k + 1]) != 0
    return np.flatnonzero(changed)


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
