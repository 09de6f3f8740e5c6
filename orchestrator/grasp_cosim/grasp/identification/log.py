"""Friction from a recorded log: the momentum of each finger over short windows.

Free of the object a finger obeys m·x'' = u - sgn(x')·F(|x'|), so that over a window of length T

    r = (m·Δx' - ∫u dt) / T + sgn(x')·mean F(|x'|)
    F(v) = F_C + (F_S - F_C)·exp(-(v/v_s)^2) + B·v

is zero but for noise, in N. No signal is differentiated: noise of the velocity enters by its two
ends over T. A window counts where the finger moves one way throughout, nothing touches it and no
sample is missing; none belongs to two windows, so that white noise leaves them independent.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError, nearest
from ...base.text import counted
from ...metrics.metric import Signals
from ...system.description import System
from ..metrics import FINGERS
from ..presets import start_in_si
from .fit import Fit, Parameter, Vector, fit

FRICTION = "plant.friction."

WINDOW = 0.02
"""s; longer than a period of the bench's noise behind its 500 Hz filter, shorter than a grasp."""

SLOWEST = 1e-4
"""m/s; below, a window may be that of a finger at rest."""

TOUCHED = 0.05
"""N; a contact force above is one."""

GAP = 1.5
"""Median steps between two samples; where it is more, one is missing."""


class Windows(NamedTuple):
    """Of one finger: per window its start in s, its residual without friction in N, and its way,
    1 or -1; and the speeds in m/s, a row per window.
    """

    finger: int
    time: Vector
    unexplained: Vector
    way: Vector
    speeds: Vector


def identify_from_log(
    system: System, log: Signals, parameters: Sequence[Parameter], place: str
) -> tuple[list[Windows], Fit]:
    """Fit friction to a log; what is not fitted is as in the system, whose masses count.

    The residuals are those of the windows in their order, of the right finger first.
    InputError, naming the place, where a signal is missing or has what is no number, the time does
    not grow, or a finger does not move freely.
    """
    windows = [_windows(system, log, j, place) for j in FINGERS]
    names = [p.name for p in parameters]

    def at(x: Vector) -> Vector:
        values = dict(zip(names, x.tolist(), strict=True))
        return np.concatenate([_residuals(system, values, w) for w in windows])

    return windows, fit(lambda points: [at(x) for x in points], parameters, place)


def _windows(system: System, log: Signals, finger: int, place: str) -> Windows:
    mass = start_in_si(system, f"plant.finger_mass[{finger}]")
    step = _step(log.time, place)
    size = int(WINDOW / step + 1e-6) + 1

    def cut(signal: Vector) -> Vector:
        """A row per window."""
        return signal[: len(signal) // size * size].reshape(-1, size)

    v, force, touch = (
        cut(_signal(log, f"{name}[{finger}]", place))
        for name in ("plant.velocity", "controller.force", "plant.contact_force")
    )
    time = cut(log.time)
    way = np.sign(v[:, 0])
    moving = (way[:, None] * v > SLOWEST).all(axis=1)
    whole = (np.diff(time) <= GAP * step).all(axis=1)
    counts = whole & moving & (np.abs(touch) <= TOUCHED).all(axis=1)
    if not counts.any():
        raise InputError(
            f"{place}: finger {finger} does not move freely for {WINDOW:g} s, one way and faster "
            f"than {SLOWEST:g} m/s; must be a log in which it does"
        )
    impulse = (force[:, :-1] * np.diff(time)).sum(axis=1)  # held between the samples
    unexplained = (mass * (v[:, -1] - v[:, 0]) - impulse) / (time[:, -1] - time[:, 0])
    return Windows(finger, time[counts, 0], unexplained[counts], way[counts], np.abs(v[counts]))


def _residuals(system: System, values: Mapping[str, float], w: Windows) -> Vector:
    def of(name: str) -> float:
        key = FRICTION + name
        return values[key] if key in values else start_in_si(system, key)

    j = f"[{w.finger}]"
    coulomb, v_s = of(f"coulomb{j}"), of("stribeck_velocity")
    static = max(coulomb, of(f"static{j}"))
    friction = coulomb + (static - coulomb) * np.exp(-((w.speeds / v_s) ** 2))
    friction += of(f"viscous{j}") * w.speeds
    return np.asarray(w.unexplained + w.way * friction.mean(axis=1))


def _signal(log: Signals, name: str, place: str) -> Vector:
    if name not in log:
        raise InputError(f"{place}: no signal {name!r}; {nearest(name, log)}")
    signal = log[name]
    wrong = np.flatnonzero(~np.isfinite(signal))
    if len(wrong):
        first = wrong[0]
        raise InputError(
            f"{place}: {name} = {signal[first]} at {log.time[first]:g} s, one of {len(wrong)} "
            "such samples; must be finite, or such rows be left out"
        )
    return signal


def _step(time: Vector, place: str) -> float:
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
