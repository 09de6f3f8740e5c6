"""Metrics of a grasp, from the recorded signals of a gripper plant and its controller.

To add one, write a function under @of_grasp or @of_fingers, which say what it needs. It gets
signals by role: "plant" and "controller" are the components that play these roles. Values are in SI
units.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import wraps
from itertools import count, takewhile
from math import copysign, hypot
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..base.text import in_milli
from ..metrics.metric import AnyOf, Metric, Need, Signals, Value, metric

Floats = npt.NDArray[np.float64]
Flags = npt.NDArray[np.bool_]

FINGERS = (1, 2)
ENTRIES = ("finger 1", "finger 2")
"""The values of a metric that each finger has: the right one, the left one."""

CLOSING = {1: -1.0, 2: 1.0}
"""Direction in which a finger closes."""

QUANTITIES: Mapping[str, str | None] = {
    "position": "m", "velocity": "m/s", "gap": "m", "contact_force": "N", "contact": None,
}  # fmt: skip
"""The outputs of a plant on each of its fingers, and their units."""

FELT: Mapping[str, str | None] = {
    "contact_impulse": "N.s", "first_contact_time": "s", "impact_velocity": "m/s", "touched": None,
    "impact_impulse": "N.s",
}  # fmt: skip
"""The outputs of our plants on what each finger has felt, also between two samples: touch.py."""


def of_each(*quantities: str) -> dict[str, str | None]:
    """The signals that are these quantities of each finger, and their units."""
    units = {**QUANTITIES, **FELT}
    return {f"plant.{name}[{j}]": units[name] for name in quantities for j in FINGERS}


OBJECT_POSITION: Mapping[str, str | None] = {"plant.object_position": "m"}
"""Where the object is."""

TARGET_POSITION = "controller.target_position"
"""Where the controller wants the object to be, in m."""

TOUCH: Mapping[Need, str | None] = {
    AnyOf((f"plant.gap[{j}]", f"plant.contact[{j}]")): None for j in FINGERS
}
"""What tells whether each finger touches."""

CONTACT_SIGNALS = of_each(*QUANTITIES, *FELT)
"""What tells when each finger touches, and how fast; a plant may lack some of them."""

SCENE_SIGNALS = (*of_each("position", "velocity", "gap", "contact_force"), *OBJECT_POSITION)
"""The signals without which a grasp is not drawn."""

IMPACT_WINDOW = 0.02
"""s from first contact; an impact is over by then, the grasp presses within a second."""

STEADY_WINDOW = 0.1
"""The steady contact force is the mean over the last so many seconds."""

SHARE_IN_ORDER = 0.1
"""Share of the work that a sampled exchange may create: 0.6 % in steps of 1 ms, 7 % of 10 ms."""

SAME_MOMENT = 1e-7
"""s by which a moment of the plant and one of the run may differ."""

SETTLED = 0.02
"""A force has settled once it stays so near to the steady one, as a share of that."""

_metrics: list[Metric] = []


def of_grasp(name: str, unit: str | None, **arguments: Any) -> Callable[[Any], Metric]:
    """Make the function below a metric of the grasp; arguments as for metrics.metric.metric."""
    factor, shown_unit = in_milli(unit)
    defaults = {"factor": factor, "shown_unit": shown_unit, "group": "grasp"}

    def register(function: Callable[[Signals], Any]) -> Metric:
        grasp_metric: Metric = metric(name, unit=unit, **{**defaults, **arguments})(function)
        _metrics.append(grasp_metric)
        return grasp_metric

    return register


def of_fingers(
    name: str, unit: str, **arguments: Any
) -> Callable[[Callable[[Signals, int], Value]], Callable[[Signals, int], Value]]:
    """Make a function of signals and finger a metric with a value per finger, [right, left]."""

    def register(function: Callable[[Signals, int], Value]) -> Callable[[Signals, int], Value]:
        @of_grasp(name, unit, entries=ENTRIES, **arguments)
        @wraps(function)
        def per_finger(signals: Signals) -> list[Value]:
            return [function(signals, j) for j in fingers_of(signals)]

        return function

    return register


class FirstContact(NamedTuple):
    """When a finger first touches in s, and how fast its gap closes then in m/s.

    `row` is the first row in which it touches. There is no speed without a gap. `of_plant` is true
    where the plant tells them.
    """

    time: float
    speed: float | None
    row: int
    of_plant: bool = False


FROM_CONTACT: Mapping[str, Any] = {"needs": TOUCH, "uses": CONTACT_SIGNALS}


@of_fingers("time_to_contact", "s", none="nothing was touched", **FROM_CONTACT)
def time_to_contact(signals: Signals, finger: int) -> float | None:
    """Moment of the first contact, of the plant or of the samples; None: never touches.

    first_contact() has it where the plant does not tell it.
    """
    contact = first_contact(signals, finger)
    return contact.time if contact else None


@of_grasp("time_difference", "s", **FROM_CONTACT)
def time_difference(signals: Signals) -> float | None:
    """Time from the first finger's contact to the last one's; None where one never touches."""
    contacts = [first_contact(signals, j) for j in fingers_of(signals)]
    times = [contact.time for contact in contacts if contact]
    return max(times) - min(times) if len(times) == len(contacts) else None


EXCHANGE: Mapping[str, str | None] = {
    **{f"plant.exchange_energy[{j}]": "J" for j in FINGERS},
    **{f"controller.force[{j}]": "N" for j in FINGERS},
    **of_each("position"),
}


@of_fingers(
    "sampling_energy", "1", factor=1e2, shown_unit="%", label="energy of the sampling",
    needs=EXCHANGE, optional=True, reason=True,
)  # fmt: skip
def sampling_energy(signals: Signals, finger: int) -> float | None:
    """Energy that the sampled exchange creates, as a share of the work; None up to SHARE_IN_ORDER.

    More of it than that warns: the step is too long for the controller's gains, and the finger is
    faster than the equations have it. The work is that of the force both ways.
    """
    force, position = (
        signals[f"{name}[{finger}]"] for name in ("controller.force", "plant.position")
    )
    work = float(np.abs(force[:-1] * np.diff(position)).sum())
    created = float(signals[f"plant.exchange_energy[{finger}]"].max())
    return created / work if created > SHARE_IN_ORDER * work else None


FROM_GAP: Mapping[str, Any] = {
    "needs": of_each("gap"), "uses": of_each("contact", "touched"), "reason": True,
}  # fmt: skip


@of_fingers("remaining_gap", "m", label="gap left, no contact", **FROM_GAP)
def remaining_gap(signals: Signals, finger: int) -> float | None:
    """Gap at the end of a finger that never touches; None where it does."""
    return None if touched(signals, finger).any() else float(_gap(signals, finger)[-1])


@of_fingers("smallest_gap", "m", label="smallest gap left", **FROM_GAP)
def smallest_gap(signals: Signals, finger: int) -> float | None:
    """Smallest gap of a finger that never touches; None where it does."""
    return None if touched(signals, finger).any() else float(_gap(signals, finger).min())


@of_fingers("impact_velocity", "m/s", needs=of_each("gap"), uses=CONTACT_SIGNALS)
def impact_velocity(signals: Signals, finger: int) -> float | None:
    """Rate at which the gap closes at first contact; None where it does not close.

    It is that of the plant, or of the last free sample. Of a plant without positions or velocities
    it is a mean over its last free step.
    """
    contact = first_contact(signals, finger)
    speed = contact.speed if contact else None
    return speed if speed is not None and speed > 0.0 else None


FROM_FORCE: Mapping[str, Any] = {
    "needs": of_each("contact_force"), "uses": of_each("contact_impulse"),
}  # fmt: skip
FROM_FORCE_SINCE_CONTACT: Mapping[str, Any] = {
    "needs": {**TOUCH, **of_each("contact_force")},
    "uses": CONTACT_SIGNALS,
}


@of_fingers("impact_impulse", "N.s", **FROM_FORCE_SINCE_CONTACT)
def impact_impulse(signals: Signals, finger: int) -> float | None:
    """Impulse over IMPACT_WINDOW from first contact, of the plant or by trapezoids.

    None if the run ends sooner. The trapezoids begin with the force of the first sample, as one
    that begins with a jump has it. They need two samples.
    """
    contact = first_contact(signals, finger)
    times, force = since_contact(signals, finger)
    of_plant = f"plant.impact_impulse[{finger}]"
    if contact and contact.of_plant and of_plant in signals:
        return abs(float(signals[of_plant][-1])) if times[-1] >= IMPACT_WINDOW else None
    if np.count_nonzero(times <= IMPACT_WINDOW) < 2 or times[-1] < IMPACT_WINDOW:
        return None
    samples = times[(times > 0.0) & (times < IMPACT_WINDOW)]
    nodes = np.concatenate(([0.0], samples, [IMPACT_WINDOW]))
    return float(np.trapezoid(np.interp(nodes, times, force), nodes))


@of_fingers("peak_contact_force", "N", **FROM_FORCE)
def peak_contact_force(signals: Signals, finger: int) -> float:
    """Highest sample of the contact force."""
    return float(_force(signals, finger).max())


@of_fingers("steady_contact_force", "N", **FROM_FORCE)
def steady_contact_force(signals: Signals, finger: int) -> float:
    """Mean contact force over the last STEADY_WINDOW: of the plant's impulse, or of the samples."""
    return steady_force(signals, finger)


@of_grasp("force_difference", "N", **FROM_FORCE)
def force_difference(signals: Signals) -> float:
    """Largest difference between steady contact forces, of a hand each by the finger's weight."""
    forces = [
        steady_force(signals, j) / signals.given(f"controller.weight[{j}]", 1.0)
        for j in fingers_of(signals)
    ]
    return max(forces) - min(forces)


@of_fingers("force_overshoot", "1", factor=1e2, shown_unit="%", **FROM_FORCE_SINCE_CONTACT)
def force_overshoot(signals: Signals, finger: int) -> float | None:
    """Share of the steady force by which the peak since contact exceeds it; 0 if never.

    None without a contact, or without a steady force.
    """
    steady = held_force(signals, finger)
    _, force = since_contact(signals, finger)
    if steady is None or not len(force):
        return None
    return max(0.0, float(force.max()) / steady - 1.0)


@of_fingers("settling_time", "s", **FROM_FORCE_SINCE_CONTACT)
def time_to_settle(signals: Signals, finger: int) -> float | None:
    """Time from first contact until the force stays within SETTLED of the steady one.

    None where it is not within throughout the last STEADY_WINDOW, without a contact, or without a
    steady force.
    """
    steady = held_force(signals, finger)
    times, force = since_contact(signals, finger)
    if steady is None or not len(times) or times[-1] < STEADY_WINDOW:
        return None
    error = force - steady
    band = SETTLED * steady
    outside = np.flatnonzero((error > band) | (error < -band))
    if not len(outside):
        return 0.0
    k = int(outside[-1])
    if times[k] >= times[-1] - STEADY_WINDOW:
        return None
    edge = copysign(band, error[k])
    fraction = (error[k] - edge) / (error[k] - error[k + 1])
    return float(times[k] + fraction * (times[k + 1] - times[k]))


@of_grasp("target_position", "m", needs={TARGET_POSITION: "m"})
def target_position(signals: Signals) -> float:
    """Target of the controller at the end."""
    return float(signals[TARGET_POSITION][-1])


@of_grasp("object_shift", "m", needs=OBJECT_POSITION)
def object_shift(signals: Signals) -> float:
    """Largest displacement of the object, either way."""
    shifts = [np.abs(x - x[0]) for x in _centre(signals)]
    distances = shifts[0] if len(shifts) == 1 else np.hypot(*shifts)
    return float(distances.max())


@of_grasp("object_drift", "m/s", needs=OBJECT_POSITION)
def object_drift(signals: Signals) -> float | None:
    """Mean speed of the object over the last STEADY_WINDOW, either way; None in a shorter run."""
    time = signals.time
    if time[-1] - time[0] < STEADY_WINDOW:
        return None
    begin = time[-1] - STEADY_WINDOW
    shifts = [float(x[-1]) - float(np.interp(begin, time, x)) for x in _centre(signals)]
    return hypot(*shifts) / STEADY_WINDOW


def _of_object(name: str, unit: str | None, output: str, label: str, description: str) -> None:
    """A metric of plants with an output of that name: its largest value, or if it was ever true."""
    signal = f"plant.{output}"
    words = {"label": label, "description": description}

    @of_grasp(name, unit, needs={signal: unit}, optional=True, **words)
    def largest(signals: Signals) -> float | bool:
        maximum = np.abs(signals[signal]).max()
        return bool(maximum) if unit is None else float(maximum)


_of_object("object_tilt", "rad", "tilt", "object tilt", "Largest tilt of the object, either way.")
_of_object("toppled", None, "toppled", "object toppled", "True if the object fell over.")
_of_object("squeeze", "m", "squeeze", "object squeezed by", "Largest loss of width of the object.")
_of_object(
    "damaged", None, "damaged", "object damaged", "True if a limit of the object was exceeded."
)
_of_object(
    "slip", "m", "slip", "object slipped by", "Largest way along the fingertips, either way."
)
_of_object("dropped", None, "dropped", "object dropped", "True if the object slipped out.")


@of_grasp(
    "peak_pressure",
    "Pa",
    needs={"plant.peak_pressure": "Pa"},
    optional=True,
    label="peak pressure",
    factor=1e-3,
    shown_unit="kPa",
)
def peak_pressure(signals: Signals) -> float:
    """Highest pressure of a contact, also between two samples."""
    return float(signals["plant.peak_pressure"][-1])


OF_LIFT: Mapping[str, str | None] = {
    f"plant.{name}[{j}]": "N" for name in ("friction_limit", "tangential_force") for j in FINGERS
}


@of_fingers(
    "friction_margin", "1", needs=OF_LIFT, optional=True, none="nothing was lifted",
    label="mu·N / |T|, at least",
)  # fmt: skip
def friction_margin(signals: Signals, finger: int) -> float | None:
    """Smallest mu·N / |T| of a fingertip while it lifts; 1 where it slips, None if never."""
    tangential = np.abs(signals[f"plant.tangential_force[{finger}]"])
    lifts = tangential > 0.0
    if not lifts.any():
        return None
    return float((signals[f"plant.friction_limit[{finger}]"][lifts] / tangential[lifts]).min())


@of_grasp(
    "lift_margin", "1", needs={**OF_LIFT, "plant.load": "N"}, optional=True,
    none="nothing was lifted", label="2·mu·N / m(g + a), at least",
)  # fmt: skip
def lift_margin(signals: Signals) -> float | None:
    """Smallest mu·(N_1 + N_2) / m·(g + a) while lifted; below 1 the object slips, None if never."""
    load = signals["plant.load"]
    lifted = load > 0.0
    if not lifted.any():
        return None
    hold = signals["plant.friction_limit[1]"] + signals["plant.friction_limit[2]"]
    return float((hold[lifted] / load[lifted]).min())


METRICS = tuple(_metrics)
"""The metrics of a grasp, in the order in which they are shown."""


def check(system: Any) -> tuple[str, ...]:
    """A note where the plant does not tell what its fingers feel between two samples."""
    plant = system.roles.get("plant", "plant")
    variables = {c.name: c.interface.by_name for c in system.components}
    names = variables.get(plant, {})
    missing = [name for name in FELT if f"{name}[1]" not in names]
    if not missing or "gap[1]" not in names:
        return ()
    return (f"{plant} lacks {', '.join(missing)}: metrics have contacts as the samples show them",)


def is_grasp(signals: Signals) -> bool:
    """True if there are the signals of a gripper plant and its object that a picture shows."""
    return all(name in signals for name in SCENE_SIGNALS)


def fingers_of(signals: Signals) -> tuple[int, ...]:
    """The numbers of the plant's fingers: FINGERS, or of a hand those that have signals."""
    return _recorded_fingers(signals) if _is_of_hand(signals) else FINGERS


def _is_of_hand(signals: Signals) -> bool:
    """True if the plant has more fingers than a gripper, or an object that moves in the plane."""
    moves_in_plane = "plant.object_position[1]" in signals or "plant.object_angle" in signals
    return moves_in_plane or len(_recorded_fingers(signals)) > len(FINGERS)


def _recorded_fingers(signals: Signals) -> tuple[int, ...]:
    """The fingers, from 1 on, whose gaps are recorded; else those of contacts or forces."""
    for quantity in ("gap", "contact", "contact_force"):
        if fingers := _fingers_with(signals, quantity):
            return fingers
    return ()


def _fingers_with(signals: Signals, quantity: str) -> tuple[int, ...]:
    """The fingers, from 1 on, of which a quantity is recorded."""
    return tuple(takewhile(lambda j: f"plant.{quantity}[{j}]" in signals, count(1)))


def _closing(signals: Signals, finger: int) -> float:
    """The sign of a velocity that closes: of a hand, whose fingers count as they open, negative."""
    return -1.0 if _is_of_hand(signals) else CLOSING[finger]


def _centre(signals: Signals) -> list[Floats]:
    """The coordinates of the object's centre: one, or of a hand two."""
    if "plant.object_position" in signals:
        return [signals["plant.object_position"]]
    return [signals[f"plant.object_position[{i}]"] for i in (1, 2)]


def _gap(signals: Signals, finger: int) -> Floats:
    return signals[f"plant.gap[{finger}]"]


def _force(signals: Signals, finger: int) -> Floats:
    """Magnitude of the contact force on a finger, N."""
    force: Floats = np.abs(signals[f"plant.contact_force[{finger}]"])
    return force


def _last_impulses(signals: Signals, finger: int) -> Floats:
    """Magnitudes of the plant's impulse over the last STEADY_WINDOW, N.s; none if it tells none."""
    name = f"plant.contact_impulse[{finger}]"
    if name not in signals:
        return np.empty(0)
    impulse: Floats = np.abs(signals[name][_steady_row(signals) :])
    return impulse


def _steady_row(signals: Signals) -> int:
    """The row where the last STEADY_WINDOW begins."""
    return int(np.searchsorted(signals.time, signals.time[-1] - STEADY_WINDOW))


def _last_forces(signals: Signals, finger: int) -> Floats:
    """The contact force over the last STEADY_WINDOW, N."""
    return _force(signals, finger)[_steady_row(signals) :]


def steady_force(signals: Signals, finger: int) -> float:
    """The mean contact force over the last STEADY_WINDOW, N.

    The plant's impulse has it, whatever the force does between two samples; else they have it.
    """
    impulse = _last_impulses(signals, finger)
    if len(impulse) < 2 or (np.diff(impulse) < 0.0).any():  # a plant that began again in the run
        return float(_last_forces(signals, finger).mean())
    return float(impulse[-1] - impulse[0]) / float(np.ptp(signals.time[-len(impulse) :]))


def held_force(signals: Signals, finger: int) -> float | None:
    """The steady contact force, N; None where it is 0 at any time: the finger does not hold on."""
    return steady_force(signals, finger) if _last_forces(signals, finger).min() > 0.0 else None


def since_contact(signals: Signals, finger: int) -> tuple[Floats, Floats]:
    """Seconds since first contact and the contact force in N, from its first row on.

    Both are empty where the finger never touches.
    """
    contact = first_contact(signals, finger)
    if contact is None:
        return np.empty(0), np.empty(0)
    return signals.time[contact.row :] - contact.time, _force(signals, finger)[contact.row :]


def touching(signals: Signals, finger: int) -> Flags:
    """Whether a finger touches, by row: as its `contact` says, else where no gap is left."""
    contact = f"plant.contact[{finger}]"
    if contact in signals:
        return signals[contact].astype(bool)
    return _gap(signals, finger) <= 0.0


def touched(signals: Signals, finger: int) -> Flags:
    """Whether a finger touches or has touched since the row before, as far as the plant tells."""
    name = f"plant.touched[{finger}]"
    return signals[name].astype(bool) if name in signals else touching(signals, finger)


def first_contact(signals: Signals, finger: int) -> FirstContact | None:
    """First contact of a finger; None if it never touches. Most metrics ask for it.

    A plant that tells its time and speed has them, also of a contact between two samples. Of
    others the gap runs out at the rate of the last free communication point, before the first one
    in contact. Without a gap it is the first point in contact: late by a step at most, but
    recorded, as are all later contacts.
    """
    key = first_contact, finger
    if key not in signals.worked_out:
        signals.worked_out[key] = _first_contact(signals, finger)
    contact: FirstContact | None = signals.worked_out[key]
    return contact


def _first_contact(signals: Signals, finger: int) -> FirstContact | None:
    """First contact of a finger, worked out again."""
    if of_plant := _contact_of_plant(signals, finger):
        return of_plant
    time = signals.time
    rows = np.flatnonzero(touching(signals, finger))
    if not len(rows):
        return None
    row = int(rows[0])
    if f"plant.gap[{finger}]" not in signals:
        return FirstContact(float(time[row]), None, row)
    k = max(row - 1, 0)
    speed = _closing_speed(signals, finger, k)
    gap = max(float(_gap(signals, finger)[k]), 0.0)
    span = float(time[row] - time[k])
    wait = min(gap / speed, span) if speed > 0.0 else span
    return FirstContact(float(time[k]) + wait, speed, row)


def _contact_of_plant(signals: Signals, finger: int) -> FirstContact | None:
    """First contact as the plant tells it, since the start of the run; None where it does not.

    Nor does it where it has begun later than the run, as one that was initialised again: the moment
    is then none in the last step before the first row that knows it.
    """
    names = [f"plant.{name}[{finger}]" for name in ("first_contact_time", "impact_velocity")]
    if not all(name in signals for name in names):
        return None
    since_start, speed = (signals[name] for name in names)
    rows = np.flatnonzero(since_start >= 0.0)
    if not len(rows):
        return None
    row, time = int(rows[0]), signals.time
    moment = float(time[0] + since_start[row])
    last_step = _last_step(signals, row - 1) if row else None
    earliest = time[last_step[1] if last_step else 0]
    if not earliest - SAME_MOMENT <= moment <= time[row] + SAME_MOMENT:
        return None
    return FirstContact(moment, float(speed[row]), row, of_plant=True)


def _closing_speed(signals: Signals, finger: int, k: int) -> float:
    """Speed in m/s at which the gap of a finger that is free up to row k closes there.

    That of the finger less that of the object's surface, which is the mean over the last step of
    the plant: what the finger moved less what the gap shrank. Without a position and a velocity of
    the finger it is the rate of the gap only. 0 for a mean where there was no step.
    """
    step, gap = _last_step(signals, k), _gap(signals, finger)
    position, velocity = (f"plant.{name}[{finger}]" for name in ("position", "velocity"))
    if position not in signals or velocity not in signals:
        return -_rate(signals.time, gap, step)
    closing = _closing(signals, finger)
    finger_speed = float(closing * signals[velocity][k])
    return finger_speed - _rate(signals.time, closing * signals[position] + gap, step)


def _rate(time: Floats, length: Floats, step: tuple[int, int] | None) -> float:
    """Mean rate of a length in m/s from one row to another; 0 where there are none."""
    if step is None:
        return 0.0
    first, last = step
    return float((length[last] - length[first]) / (time[last] - time[first]))


def _last_step(signals: Signals, k: int) -> tuple[int, int] | None:
    """The rows where the last whole step of the plant up to row k begins and ends, if any.

    It may be longer than that of the system, and the plant holds its outputs in between.
    """
    is_new = np.zeros(k + 1, bool)  # the rows in which an output differs from the row before
    is_new[0] = True
    for quantity in QUANTITIES:
        for j in fingers_of(signals):
            name = f"plant.{quantity}[{j}]"
            if name in signals:
                values = signals[name][: k + 1]
                is_new[1:] |= values[1:] != values[:-1]
    new_rows = np.flatnonzero(is_new)
    if len(new_rows) < 2:
        return None
    rows_per_step = int(np.diff(new_rows).min())
    # The plant may have stepped since the last new row, and nothing moved.
    last = k - (k - int(new_rows[-1])) % rows_per_step
    return last - rows_per_step, last
