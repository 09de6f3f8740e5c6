"""Friction from a recorded log, by the momentum of each finger over short windows.

Free of the object a finger obeys m·x'' = g·u(t - d) - sgn(x')·F(|x'|), so that over a window of
length T

    r = (m·Δx' - g·∫u(t - d) dt) / T + sgn(x')·mean F(|x'|)
    F(v) = F_C + (F_S - F_C)·exp(-(v/v_s)^2) + B·v, and F_I on the inner part of the way

is zero but for noise, in N. No signal is differentiated: noise of the velocity enters by its two
ends over T. If a log has no velocity, it is the slope of a parabola through SLOPE_WINDOW samples of
the position around each. This shifts nothing in time (Savitzky and Golay 1964). A window counts
where the finger moves one way throughout, nothing touches it and no sample is missing; none belongs
to two windows, so that white noise leaves them independent.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError, nearest
from ...base.text import counted
from ...metrics.metric import Signals, resolved
from ...system.description import System
from ..metrics import CLOSING, FINGERS
from ..presets import start_in_si
from .fit import Fit, Parameter, Vector, fit

FRICTION = "plant.friction."
MASS = "plant.finger_mass"
DRIVE = "drive."
GAIN, DELAY = f"{DRIVE}gain", f"{DRIVE}delay"
"""Of the drives: the force that acts is GAIN times the one that is commanded, DELAY later, in s."""


WINDOW = 0.02
"""s; longer than a period of the bench's noise behind its 500 Hz filter, shorter than a grasp."""

MIN_SPEED = 1e-4
"""m/s; a window with a slower sample may be that of a finger at rest."""

MIN_CONTACT_FORCE = 0.05
"""N; a finger with a larger contact force touches the object."""

MAX_SAMPLE_STEP = 1.5
"""Where two samples are further apart than so many median steps, one is missing."""

VELOCITY, POSITION = "plant.velocity", "plant.position"
COMMAND, CONTACT_FORCE = "controller.force", "plant.contact_force"
UNITS = {VELOCITY: "m/s", POSITION: "m", COMMAND: "N", CONTACT_FORCE: "N"}
"""The signals of each finger, and the units of SI in which they are needed. Of velocity and
position one is enough; without a contact force the finger is taken to be free.
"""

SLOPE_WINDOW = 0.01
"""s; the slope of a position is taken from the samples within it."""


class Windows(NamedTuple):
    """The windows of one finger, a row for each, and the impulse of its commands over the log."""

    finger: int
    begin: Vector
    """s"""
    end: Vector
    """s"""
    velocity_change: Vector
    """m/s"""
    direction: Vector
    """The sign of the velocity: 1 or -1."""
    speeds: Vector
    """m/s, a row of samples for each window."""
    positions: Vector | None
    """m, a row of samples for each window; None where nothing depends on them."""
    log_times: Vector
    """s, of all samples of the log."""
    impulses: Vector
    """N.s, of the commands from the begin of the log up to each sample."""

    def mean_force(self, delay: float) -> Vector:
        """The mean in N of the commands over each window, of a delay in s before."""
        at_begin = np.interp(self.begin - delay, self.log_times, self.impulses)
        at_end = np.interp(self.end - delay, self.log_times, self.impulses)
        return np.asarray((at_end - at_begin) / (self.end - self.begin))


def identify_from_log(
    system: System, log: Signals, parameters: Sequence[Parameter], place: str
) -> tuple[list[Windows], Fit]:
    """Fit friction to a log; what is not fitted is as in the system, whose masses count.

    The residuals are those of the windows in their order, of the right finger first. InputError
    with the place if a signal is missing or has a cell that is no number. Other reasons are a time
    that does not grow, and a finger that does not move freely.
    """
    # What was commanded before the log began is not known: such windows do not count.
    max_delay = max((p.high for p in parameters if p.name == DELAY), default=0.0)
    names = [p.name for p in parameters]
    has_inner = {j: _has_inner(system, names, j) for j in FINGERS}
    windows = [_windows(log, j, max_delay, place, has_inner[j]) for j in FINGERS]

    def residuals(x: Vector) -> Vector:
        values = dict(zip(names, x.tolist(), strict=True))
        return np.concatenate([_residuals(system, values, w) for w in windows])

    return windows, fit(lambda points: [residuals(x) for x in points], parameters, place)


def _has_inner(system: System, fitted: Sequence[str], finger: int) -> bool:
    """True if a finger has additional friction on the inner part of its way, or may have.

    The plant of a user need not know of such friction.
    """
    name = f"{FRICTION}inner[{finger}]"
    if name in fitted:
        return True
    component, _, variable = resolved(name, system.roles).partition(".")
    interface = system.component(component, system.name).interface
    return variable in interface.by_name and start_in_si(system, name) != 0.0


def _windows(log: Signals, finger: int, max_delay: float, place: str, has_inner: bool) -> Windows:
    """The windows of a finger in which it moves freely; InputError where there are none."""
    step = _step(log.time, place)
    samples = int(WINDOW / step + 1e-6) + 1

    def by_window(signal: Vector) -> Vector:
        """The samples of a signal, a row per window."""
        return signal[: len(signal) // samples * samples].reshape(-1, samples)

    velocities = by_window(_velocity(log, finger, step, place))
    command = _signal(log, f"{COMMAND}[{finger}]", place)
    contact_force = np.zeros(len(log.time))
    if f"{CONTACT_FORCE}[{finger}]" in log:
        contact_force = _signal(log, f"{CONTACT_FORCE}[{finger}]", place)
    times = by_window(log.time)
    direction = np.sign(velocities[:, 0])
    is_moving = (direction[:, None] * velocities > MIN_SPEED).all(axis=1)
    is_complete = (np.diff(times) <= MAX_SAMPLE_STEP * step).all(axis=1)
    is_free = (np.abs(by_window(contact_force)) <= MIN_CONTACT_FORCE).all(axis=1)
    has_commands = times[:, 0] >= log.time[0] + max_delay
    counts = is_complete & is_moving & is_free & has_commands
    if not counts.any():
        raise InputError(
            f"{place}: finger {finger} does not move freely for {WINDOW:g} s, one way and faster "
            f"than {MIN_SPEED:g} m/s; must be a log in which it does"
        )
    impulse_of_step = command[:-1] * np.diff(log.time)  # a command holds until the next sample
    velocities, times = velocities[counts], times[counts]
    positions = None
    if has_inner:
        positions = by_window(_signal(log, f"{POSITION}[{finger}]", place))[counts]
    return Windows(
        finger,
        begin=times[:, 0],
        end=times[:, -1],
        velocity_change=velocities[:, -1] - velocities[:, 0],
        direction=direction[counts],
        speeds=np.abs(velocities),
        positions=positions,
        log_times=np.asarray(log.time),
        impulses=np.append(0.0, np.cumsum(impulse_of_step)),
    )


def _velocity(log: Signals, finger: int, step: float, place: str) -> Vector:
    """The velocity of a finger in m/s: as it was measured, or the slope of the position."""
    velocity, position = f"{VELOCITY}[{finger}]", f"{POSITION}[{finger}]"
    if velocity in log or position not in log:
        return _signal(log, velocity, place)
    from scipy.signal import savgol_filter

    samples = max(2 * round(0.5 * SLOPE_WINDOW / step) + 1, 5)
    x = _signal(log, position, place)
    if len(x) < samples:
        raise InputError(f"{place}: {counted(len(x), 'sample')}; must be at least {samples}")
    return np.asarray(savgol_filter(x, samples, 2, deriv=1, delta=step))


def _residuals(system: System, values: Mapping[str, float], windows: Windows) -> Vector:
    """The residuals r in N of the windows of a finger, with these values of parameters."""

    def value_of(key: str) -> float:
        return values[key] if key in values else start_in_si(system, key)

    element = f"[{windows.finger}]"
    coulomb = value_of(f"{FRICTION}coulomb{element}")
    stribeck_velocity = value_of(f"{FRICTION}stribeck_velocity")
    static = max(coulomb, value_of(f"{FRICTION}static{element}"))
    stribeck = np.exp(-((windows.speeds / stribeck_velocity) ** 2))
    friction = coulomb + (static - coulomb) * stribeck
    friction += value_of(f"{FRICTION}viscous{element}") * windows.speeds
    if windows.positions is not None:
        begin = value_of(f"{FRICTION}inner_begin{element}")
        is_inner = CLOSING[windows.finger] * (windows.positions - begin) > 0.0
        friction += value_of(f"{FRICTION}inner{element}") * is_inner
    gain, delay = values.get(f"{GAIN}{element}", 1.0), values.get(DELAY, 0.0)
    drive = gain * windows.mean_force(delay)
    duration = windows.end - windows.begin
    inertia = value_of(f"{MASS}{element}") * windows.velocity_change / duration
    return np.asarray(inertia - drive + windows.direction * friction.mean(axis=1))


def _signal(log: Signals, name: str, place: str) -> Vector:
    """A signal of a log; InputError where it is missing or has what is no number."""
    if name not in log:
        raise InputError(f"{place}: no signal {name!r}; {nearest(name, log)}")
    signal = log[name]
    not_finite = np.flatnonzero(~np.isfinite(signal))
    if len(not_finite):
        first = not_finite[0]
        raise InputError(
            f"{place}: {name} = {signal[first]} at {log.time[first]:g} s, one of {len(not_finite)} "
            "such samples; must be finite, or such rows be left out"
        )
    return signal


def _step(time: Vector, place: str) -> float:
    """The median step of a log in s; InputError where it is too long or the time does not grow."""
    if len(time) < 2:
        raise InputError(f"{place}: {counted(len(time), 'sample')}; must be at least two")
    if not (np.diff(time) > 0.0).all() or not np.isfinite(time).all():
        raise InputError(f"{place}: the time must be finite and grow from sample to sample")
    step = float(np.median(np.diff(time)))
    if not 0.0 < 2.0 * step <= WINDOW:
        raise InputError(
            f"{place}: a sample every {step:g} s; must be at most every {0.5 * WINDOW:g} s"
        )
    return step
