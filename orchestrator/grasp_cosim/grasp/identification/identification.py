"""Fits friction, masses and drives of the fingers to what was measured: contact times, or a log.

Of a log it is the momentum of each finger over short windows. Free of the object a finger obeys
m·x'' = g·u(t - d) - sgn(x')·F(|x'|), so that over a window of length T

    r = (m·Δx' - g·∫u(t - d) dt) / T + sgn(x')·mean F(|x'|)
    F(v) = F_C + (F_S - F_C)·exp(-(v/v_s)^2) + B·v

is zero but for noise, in N. No signal is differentiated: noise of the velocity enters by its two
ends over T. Only where a log has no velocity is it that of the position, by the slope of a parabola
through SLOPE of its samples around each (Savitzky and Golay 1964), which shifts nothing in time. A
window counts where the finger moves one way throughout, nothing touches it and no sample is
missing; none belongs to two windows, so that white noise leaves them independent.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...base.errors import InputError, nearest
from ...base.text import counted, on_a_screen
from ...metrics.metric import Signals
from ...recording.log_names import AS_THEY_ARE, LogNames
from ...recording.read_back import load_log
from ...system.description import System, as_system
from ..metrics import FINGERS
from ..presets import start_in_si
from ..published.compared import table_csv
from ..system import grasp_system
from .contact_times import (
    RATIO,
    identify_from_times,
    is_contacts,
    published_contacts,
    read_contacts,
    scatter,
)
from .fit import Estimate, Fit, Parameter, Vector
from .fit import fit as fitted

LOGGER = logging.getLogger(__name__)
"""Gets as a warning that a log is taken to be in SI units."""

ASSUMPTIONS = (
    "95 % confidence intervals of the linearised model, for residuals that are independent, of one "
    "variance and without a bias"
)

FRICTION = "plant.friction."
MASS = "plant.finger_mass"
GAIN, DELAY = "drive.gain", "drive.delay"
"""Of the drives: the force that acts is GAIN times the one that is commanded, DELAY later, in s."""


def _each(name: str, *values: Any) -> list[Parameter]:
    return [Parameter(f"{FRICTION}{name}[{j}]", *values) for j in FINGERS]


GROUPS = {
    "coulomb": _each("coulomb", "N", 1.0, 0.0, 10.0, 1.0),
    "static": _each("static", "N", 1.5, 0.0, 10.0, 1.0),
    "viscous": _each("viscous", "N.s/m", 10.0, 0.0, 1000.0, 10.0),
    "stribeck": [Parameter(f"{FRICTION}stribeck_velocity", "m/s", 0.05, 1e-4, 1.0, 0.01)],
    "mass": [Parameter(f"{MASS}[{j}]", "kg", 0.5, 1e-3, 100.0, 0.1) for j in FINGERS],
    "gain": [Parameter(f"{GAIN}[{j}]", "1", 1.0, 0.05, 20.0, 0.1) for j in FINGERS],
    "delay": [Parameter(DELAY, "s", 0.002, 0.0, 0.05, 0.002)],
    "ratio": [Parameter(RATIO, "1", 1.0, 0.2, 5.0, 0.1)],
}
"""What can be fitted by name: a parameter for each finger, or one for both."""

OF_A_LOG = tuple(name for name in GROUPS if name != "ratio")
"""What a log of the fingers says something about."""

OF_TIMES = tuple(name for name in GROUPS if name not in ("mass", "gain", "delay"))
"""What contact times do."""

DEFAULT = ("coulomb", "viscous")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Identification:
    """A fit of parameters to measurements."""

    data: str
    """What it was fitted to, in words."""
    unit: str
    """The unit of the residuals: s of contact times, N of a log."""
    fit: Fit
    """The estimates with their intervals, and the residuals."""
    rows: Sequence[dict[str, Any]]
    """What each residual belongs to, with the residual."""
    scatter: float | None = None
    """The standard deviation of data that were measured under equal conditions, in `unit`; None
    where there are none such.
    """

    @property
    def values(self) -> dict[str, float]:
        """The fitted values by name, as System.with_settings() takes them."""
        return {e.name: e.value for e in self.fit.estimates}

    def __repr__(self) -> str:
        return on_a_screen(self.text().splitlines())

    def as_json(self) -> dict[str, Any]:
        """All of it as JSON has it.

        Returns:
            A dictionary of data, parameters, assumptions, rms, scatter, unit, points and rows.
        """
        return {
            "data": self.data,
            "parameters": [e._asdict() for e in self.fit.estimates],
            "assumptions": ASSUMPTIONS,
            "rms": self.fit.rms,
            "scatter": self.scatter,
            "unit": self.unit,
            "points": self.fit.points,
            "rows": self.rows,
        }

    def text(self) -> str:
        """The parameters and the root mean square of the residuals, as `identify` prints them.

        Returns:
            A text of several lines.
        """
        lines = [
            f"{self.data}; {ASSUMPTIONS}",
            *(f"  {e.name:32s}{e.value:10.4g} {_about(e)}" for e in self.fit.estimates),
            f"residuals: root mean square {self.fit.rms:.4g} {self.unit} over {len(self.rows)}",
        ]
        if self.scatter is not None:
            lines.append(
                f"equal conditions scatter by {self.scatter:.3g} {self.unit}, which no fit explains"
            )
        return "\n".join(lines)

    def files(self) -> Mapping[str, str]:
        """The values as TOML, and the residuals as CSV.

        Returns:
            The texts by the names of the files.
        """
        head = f"# {self.data}: root mean square of the residuals {self.fit.rms:.4g} {self.unit}"
        digits = {e.name: float(f"{e.value:.6g}") for e in self.fit.estimates}
        tables: dict[str, list[str]] = {"values": [], "drives": []}
        for e in self.fit.estimates:
            table = "drives" if e.name.startswith("drive.") else "values"
            name = e.name.removeprefix("drive.")
            tables[table].append(f'"{name}" = {digits[e.name]}  # {_about(e)}')
        lines = ["[values]", *tables["values"]]
        lines += ["[drives]", *tables["drives"]] if tables["drives"] else []
        return {
            "values.toml": "\n".join([head, *lines, ""]),
            "residuals.csv": table_csv(self.rows),
        }


def identify(
    log: str | Path | None = None,
    *,
    fit: Sequence[str] = DEFAULT,
    system: System | str | Path | None = None,
    progress: bool = False,
    names: LogNames = AS_THEY_ARE,
) -> Identification:
    """Fit friction, masses or gains to measurements: contact times, or the signals of a run.

    Args:
        log: A table of contact times, or a log of signals in CSV, Arrow or MDF. None takes
            the contact times of the published experiments.
        fit: The names of the groups of parameters that are fitted, among GROUPS: "coulomb",
            "static", "viscous", "stribeck", and of signals also "mass" or "gain", and "delay" of
            the drives; "ratio" of contact times.
        system: What is not fitted is as in this system, or system file; by default the built-in
            grasp.
        progress: True shows on standard error how far the fit is.
        names: The names of the columns of a log from elsewhere, as read_log_names() has it from a
            file.

    Returns:
        The fitted values, their intervals and the residuals.

    Raises:
        InputError: The log, or a name of `fit`, is wrong.
        SimulationError: The fit does not come to rest.
    """
    system = grasp_system() if system is None else as_system(system, "identify")
    log = None if log is None else Path(log)
    if log is None or (not names.file and is_contacts(log)):
        contacts = published_contacts() if log is None else read_contacts(log)
        name = "the published experiments" if log is None else str(log)
        parameters = chosen(fit, OF_TIMES, name)
        found = identify_from_times(system, contacts, parameters, progress)
        rows = [
            {"condition": c.label, "case": c.case, "finger": c.finger, "measured": c.time}
            for c in contacts
        ]
        data = f"{name}, {len(rows)} contact times"
        return _identified(data, "s", found, rows, scatter(contacts))
    units = {f"{name}[{j}]": unit for name, unit in USED.items() for j in FINGERS}
    signals = load_log(log, LOGGER.warning, units, names)
    if {"mass", "gain"} <= {*fit}:
        raise InputError(
            f"{log}: mass and gain: a log tells the ratio of the two alone; must be one of them"
        )
    parameters = chosen(fit, OF_A_LOG, str(log))
    windows, found = identify_from_log(system, signals, parameters, str(log))
    rows = [{"finger": w.finger, "time": float(t)} for w in windows for t in w.time]
    return _identified(f"{log}, {counted(len(rows), 'window')}", "N", found, rows)


def chosen(groups: Sequence[str], valid: Sequence[str], place: str) -> list[Parameter]:
    """The parameters of the groups; InputError for one that the data say nothing about."""
    for group in groups:
        if group not in valid:
            raise InputError(f"{place}: {group!r} cannot be fitted; {nearest(group, valid)}")
    return [p for name in GROUPS if name in groups for p in GROUPS[name]]


def _identified(
    data: str, unit: str, fit: Fit, rows: Sequence[dict[str, Any]], equal: float | None = None
) -> Identification:
    each = zip(rows, fit.residuals.tolist(), strict=True)
    return Identification(data, unit, fit, [{**row, "residual": r} for row, r in each], equal)


def _about(e: Estimate) -> str:
    interval = f"[{e.interval[0]:.4g}, {e.interval[1]:.4g}]" if e.interval else ""
    told = ": ".join(t for t in (interval, e.remark) if t)
    return f"{e.unit}, {told}"


# A log

WINDOW = 0.02
"""s; longer than a period of the bench's noise behind its 500 Hz filter, shorter than a grasp."""

SLOWEST = 1e-4
"""m/s; below, a window may be that of a finger at rest."""

TOUCHED = 0.05
"""N; a contact force above is one."""

GAP = 1.5
"""Median steps between two samples; where it is more, one is missing."""


VELOCITY, POSITION = "plant.velocity", "plant.position"
COMMAND, TOUCH = "controller.force", "plant.contact_force"
USED = {VELOCITY: "m/s", POSITION: "m", COMMAND: "N", TOUCH: "N"}
"""The signals of each finger, and the units of SI in which they are needed. Of velocity and
position one is enough; without a contact force the finger is taken to be free.
"""

SLOPE = 0.01
"""s; the samples that the slope of a position is taken from."""


class Windows(NamedTuple):
    """Of one finger: per window its start and end in s, the change of the velocity in m/s, and its
    way, 1 or -1; the speeds in m/s, a row per window; and the whole log's times in s, with the
    impulse of the commands up to each in N.s.
    """

    finger: int
    time: Vector
    end: Vector
    change: Vector
    way: Vector
    speeds: Vector
    times: Vector
    impulses: Vector

    def mean_force(self, delay: float) -> Vector:
        """The mean of the commands over each window, of a delay in s before."""
        before = np.interp(self.time - delay, self.times, self.impulses)
        after = np.interp(self.end - delay, self.times, self.impulses)
        return np.asarray((after - before) / (self.end - self.time))


def identify_from_log(
    system: System, log: Signals, parameters: Sequence[Parameter], place: str
) -> tuple[list[Windows], Fit]:
    """Fit friction to a log; what is not fitted is as in the system, whose masses count.

    The residuals are those of the windows in their order, of the right finger first.
    InputError, naming the place, where a signal is missing or has what is no number, the time does
    not grow, or a finger does not move freely.
    """
    # what was commanded before the log began is not known: such windows do not count
    latest = max((p.high for p in parameters if p.name == DELAY), default=0.0)
    windows = [_windows(log, j, latest, place) for j in FINGERS]
    names = [p.name for p in parameters]

    def at(x: Vector) -> Vector:
        values = dict(zip(names, x.tolist(), strict=True))
        return np.concatenate([_residuals(system, values, w) for w in windows])

    return windows, fitted(lambda points: [at(x) for x in points], parameters, place)


def _windows(log: Signals, finger: int, latest: float, place: str) -> Windows:
    step = _step(log.time, place)
    size = int(WINDOW / step + 1e-6) + 1

    def cut(signal: Vector) -> Vector:
        """A row per window."""
        return signal[: len(signal) // size * size].reshape(-1, size)

    v = cut(_velocity(log, finger, step, place))
    command = _signal(log, f"{COMMAND}[{finger}]", place)
    has_touch = f"{TOUCH}[{finger}]" in log
    touch = _signal(log, f"{TOUCH}[{finger}]", place) if has_touch else np.zeros(len(log.time))
    time = cut(log.time)
    way = np.sign(v[:, 0])
    moving = (way[:, None] * v > SLOWEST).all(axis=1)
    whole = (np.diff(time) <= GAP * step).all(axis=1)
    counts = whole & moving & (np.abs(cut(touch)) <= TOUCHED).all(axis=1)
    counts &= time[:, 0] >= log.time[0] + latest
    if not counts.any():
        raise InputError(
            f"{place}: finger {finger} does not move freely for {WINDOW:g} s, one way and faster "
            f"than {SLOWEST:g} m/s; must be a log in which it does"
        )
    held = command[:-1] * np.diff(log.time)  # between the samples
    impulses = np.append(0.0, np.cumsum(held))
    v, ends, way = v[counts], time[counts], way[counts]
    change = v[:, -1] - v[:, 0]
    return Windows(
        finger, ends[:, 0], ends[:, -1], change, way, np.abs(v), np.asarray(log.time), impulses
    )


def _velocity(log: Signals, finger: int, step: float, place: str) -> Vector:
    """The velocity of a finger in m/s: as it was measured, or the slope of the position."""
    velocity, position = f"{VELOCITY}[{finger}]", f"{POSITION}[{finger}]"
    if velocity in log or position not in log:
        return _signal(log, velocity, place)
    from scipy.signal import savgol_filter

    count = max(2 * round(0.5 * SLOPE / step) + 1, 5)
    x = _signal(log, position, place)
    if len(x) < count:
        raise InputError(f"{place}: {counted(len(x), 'sample')}; must be at least {count}")
    return np.asarray(savgol_filter(x, count, 2, deriv=1, delta=step))


def _residuals(system: System, values: Mapping[str, float], w: Windows) -> Vector:
    def of(key: str) -> float:
        return values[key] if key in values else start_in_si(system, key)

    j = f"[{w.finger}]"
    coulomb, v_s = of(f"{FRICTION}coulomb{j}"), of(f"{FRICTION}stribeck_velocity")
    static = max(coulomb, of(f"{FRICTION}static{j}"))
    friction = coulomb + (static - coulomb) * np.exp(-((w.speeds / v_s) ** 2))
    friction += of(f"{FRICTION}viscous{j}") * w.speeds
    drive = values.get(f"{GAIN}{j}", 1.0) * w.mean_force(values.get(DELAY, 0.0))
    acceleration = of(f"{MASS}{j}") * w.change / (w.end - w.time)
    return np.asarray(acceleration - drive + w.way * friction.mean(axis=1))


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
