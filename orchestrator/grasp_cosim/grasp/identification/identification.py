"""Fits friction, masses, drives and sensors to what was measured: contact times, a log, a curve."""

from __future__ import annotations

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...base.errors import InputError, choices, nearest
from ...base.text import counted, on_a_screen
from ...recording.log_names import AS_THEY_ARE, LogNames
from ...recording.read_back import load_log
from ...system.description import System, as_system
from ..metrics import FINGERS
from ..presets import start_in_si
from ..published.published_figures import table_csv
from ..system import grasp_system
from .contact_times import (
    RATIO,
    identify_from_times,
    is_contacts,
    published_contacts,
    read_contacts,
    scatter,
)
from .fit import Estimate, Fit, Parameter, root_mean_square
from .momentum_balance import DELAY, DRIVE, FRICTION, GAIN, MASS, UNITS, identify_from_log
from .sensor_curve import fit_curve, read_curve
from .sensor_identification import SensorIdentification

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOGGER = logging.getLogger(__name__)
"""Gets as a warning that a log is taken to be in SI units."""

ASSUMPTIONS = (
    "95 % confidence intervals of the linearised model, for residuals that are independent, of one "
    "variance and without a bias"
)


def _per_finger(name: str, unit: str, *numbers: float) -> list[Parameter]:
    """A parameter for each finger, with its start, bounds and scale."""
    return [Parameter(f"{name}[{j}]", unit, *numbers) for j in FINGERS]


GROUPS = {
    "coulomb": _per_finger(f"{FRICTION}coulomb", "N", 1.0, 0.0, 10.0, 1.0),
    "static": _per_finger(f"{FRICTION}static", "N", 1.5, 0.0, 10.0, 1.0),
    "viscous": _per_finger(f"{FRICTION}viscous", "N.s/m", 10.0, 0.0, 1000.0, 10.0),
    "inner": _per_finger(f"{FRICTION}inner", "N", 0.5, 0.0, 10.0, 1.0),
    "stribeck": [Parameter(f"{FRICTION}stribeck_velocity", "m/s", 0.05, 1e-4, 1.0, 0.01)],
    "mass": _per_finger(MASS, "kg", 0.5, 1e-3, 100.0, 0.1),
    "gain": _per_finger(GAIN, "1", 1.0, 0.05, 20.0, 0.1),
    "delay": [Parameter(DELAY, "s", 0.002, 0.0, 0.05, 0.002)],
    "ratio": [Parameter(RATIO, "1", 1.0, 0.2, 5.0, 0.1)],
}
"""What can be fitted by name: a parameter for each finger, or one for both."""

GROUPS_OF_A_LOG = tuple(name for name in GROUPS if name != "ratio")
"""The groups that a log of the fingers determines."""

GROUPS_OF_TIMES = tuple(name for name in GROUPS if name not in ("mass", "gain", "delay"))
"""The groups that contact times determine."""

DEFAULT_GROUPS = ("coulomb", "viscous")

SENSOR = "sensor"
"""The group of a sensor, which a curve determines, and nothing else."""


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
    def left_out_rms(self) -> float | None:
        """The root mean square of the residuals in fits without their rows, in `unit`; None
        without a cross-validation.
        """
        return None if self.fit.left_out is None else root_mean_square(self.fit.left_out)

    @property
    def values(self) -> dict[str, float]:
        """The fitted values by name, as System.with_settings() takes them."""
        return {e.name: e.value for e in self.fit.estimates}

    def __repr__(self) -> str:
        return on_a_screen(self.text().splitlines())

    def as_json(self) -> dict[str, Any]:
        """All of it as JSON has it.

        Returns:
            A dictionary of data, parameters, assumptions, rms, left_out_rms, scatter, unit, points
            and rows.
        """
        return {
            "data": self.data,
            "parameters": [e._asdict() for e in self.fit.estimates],
            "assumptions": ASSUMPTIONS,
            "rms": self.fit.rms,
            "left_out_rms": self.left_out_rms,
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
        lines = [f"{self.data}; {ASSUMPTIONS}"]
        for estimate in self.fit.estimates:
            lines.append(f"  {estimate.name:32s}{estimate.value:10.4g} {_remarks(estimate)}")
        rms = f"{self.fit.rms:.4g} {self.unit}"
        lines.append(f"residuals: root mean square {rms} over {len(self.rows)}")
        if self.left_out_rms is not None:
            left_out_rms = f"{self.left_out_rms:.4g} {self.unit}"
            lines.append(f"in fits without their rows: root mean square {left_out_rms}")
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
        values: list[str] = []
        drives: list[str] = []
        for estimate in self.fit.estimates:
            is_drive = estimate.name.startswith(DRIVE)
            name = estimate.name.removeprefix(DRIVE)
            rounded = float(f"{estimate.value:.6g}")
            line = f'"{name}" = {rounded}  # {_remarks(estimate)}'
            if is_drive:
                drives.append(line)
            else:
                values.append(line)
        lines = [head, "[values]", *values]
        if drives:
            lines += ["[drives]", *drives]
        return {
            "values.toml": "\n".join([*lines, ""]),
            "residuals.csv": table_csv(self.rows),
        }

    def pictures(self) -> Mapping[str, Figure]:
        """The pictures of a fit, which are none here.

        Returns:
            The figures by the names of their files.
        """
        return {}


def identify(
    log: str | Path | None = None,
    *,
    fit: Sequence[str] = DEFAULT_GROUPS,
    system: System | str | Path | None = None,
    progress: bool = False,
    names: LogNames = AS_THEY_ARE,
    cross_validation: bool = False,
) -> Identification | SensorIdentification:
    """Fit friction, masses or gains to contact times or signals, or a sensor to its curve.

    Args:
        log: A table of contact times, or a log of signals in CSV, Arrow or MDF. The curve of a
            sensor has the columns gap and voltage. None takes the contact times of the published
            experiments.
        fit: The names of the groups of parameters that are fitted, among GROUPS: "coulomb",
            "static", "viscous", "inner", "stribeck", and of signals also "mass" or "gain", and
            "delay" of the drives; "ratio" of contact times. "inner[2]" is that of one finger.
            "sensor" or "sensor[2]", without another, is of a curve.
        system: What is not fitted is as in this system, or system file; by default the built-in
            grasp.
        progress: True shows on standard error how far the fit is.
        names: The names of the columns of a log from elsewhere, as read_log_names() has it from a
            file.
        cross_validation: True repeats the fit to contact times without each row, and shows by how
            much it misses that row. It takes about a minute.

    Returns:
        The fitted values, their intervals and the residuals.

    Raises:
        InputError: The log, or a name of `fit`, is wrong.
        SimulationError: The fit does not come to rest.

    Example:
        >>> from grasp_cosim import identify
        >>> fitted = identify(fit=["coulomb"])  # from the published contact times  # doctest: +SKIP
    """
    system = grasp_system() if system is None else as_system(system, "identify")
    log = None if log is None else Path(log)
    if any(_split(group)[0] == SENSOR for group in fit):
        if cross_validation:
            raise InputError(
                "identify: a cross-validation leaves rows of contact times out; a curve has none"
            )
        return _identify_sensor(log, fit, system)
    if log is None or (not names.file and is_contacts(log)):
        return _identify_from_contacts(log, fit, system, progress, cross_validation)
    if cross_validation:
        raise InputError(f"{log}: a cross-validation leaves rows of contact times out; has none")
    return _identify_from_signals(log, fit, system, names)


def _identify_sensor(
    log: Path | None, groups: Sequence[str], system: System
) -> SensorIdentification:
    """Fit a sensor to its curve; its l_0 and alpha are those of the system."""
    place = "identify" if log is None else str(log)
    elements = {f"{SENSOR}[{j}]": (j,) for j in FINGERS}
    fingers = {SENSOR: FINGERS, **elements}.get(groups[0])
    if len(groups) != 1 or fingers is None:
        raise InputError(
            f"{place}: {choices(groups)}: a curve determines a sensor and nothing else; must be "
            f"one of {choices((SENSOR, *elements))}"
        )
    if log is None:
        raise InputError(f"{place}: {SENSOR!r} needs a table with the columns gap and voltage")
    gaps, voltages = read_curve(log)
    known = f"sensor_{fingers[0]}."
    fit = fit_curve(
        gaps,
        voltages,
        start_in_si(system, f"{known}offset_distance"),
        start_in_si(system, f"{known}reflectance"),
        str(log),
    )
    return SensorIdentification(f"{log}, {counted(len(gaps), 'voltage')}", fit, fingers)


def _identify_from_contacts(
    log: Path | None,
    groups: Sequence[str],
    system: System,
    progress: bool,
    cross_validation: bool,
) -> Identification:
    """Fit parameters to a table of contact times, or to those of the published experiments."""
    contacts = published_contacts() if log is None else read_contacts(log)
    place = "the published experiments" if log is None else str(log)
    parameters = parameters_of(groups, GROUPS_OF_TIMES, place)
    fit = identify_from_times(system, contacts, parameters, progress, cross_validation)
    rows = [
        {"condition": c.label, "case": c.case, "finger": c.finger, "measured": c.time}
        for c in contacts
    ]
    data = f"{place}, {len(rows)} contact times"
    if fit.left_out is not None:
        left_out = fit.left_out.tolist()
        rows = [{**row, "left_out": r} for row, r in zip(rows, left_out, strict=True)]
    return Identification(data, "s", fit, _with_residuals(rows, fit), scatter(contacts))


def _identify_from_signals(
    log: Path, groups: Sequence[str], system: System, names: LogNames
) -> Identification:
    """Fit parameters to the signals of a log."""
    units = {f"{name}[{j}]": unit for name, unit in UNITS.items() for j in FINGERS}
    signals = load_log(log, LOGGER.warning, units, names)
    if "mass" in groups and "gain" in groups:
        raise InputError(
            f"{log}: mass and gain: a log determines only the ratio of the two; must be one of them"
        )
    parameters = parameters_of(groups, GROUPS_OF_A_LOG, str(log))
    windows, fit = identify_from_log(system, signals, parameters, str(log))
    rows = [{"finger": w.finger, "time": float(time)} for w in windows for time in w.begin]
    data = f"{log}, {counted(len(rows), 'window')}"
    return Identification(data, "N", fit, _with_residuals(rows, fit))


def parameters_of(groups: Sequence[str], valid: Sequence[str], place: str) -> list[Parameter]:
    """The parameters of the groups; InputError for one that the data say nothing about.

    A group is one of GROUPS, or that of one finger, as "inner[2]".
    """
    parameters: list[Parameter] = []
    for group in groups:
        name, element = _split(group)
        found = [p for p in GROUPS.get(name, ()) if p.name.endswith(element)]
        if name not in valid or not found:
            raise InputError(f"{place}: {group!r} cannot be fitted; {nearest(group, valid)}")
        parameters += found
    return [p for of_group in GROUPS.values() for p in of_group if p in parameters]


def _split(group: str) -> tuple[str, str]:
    """The name of a group, and the element behind it, as "[2]" or none."""
    name, bracket, element = group.partition("[")
    return name, bracket + element


def _with_residuals(rows: Sequence[dict[str, Any]], fit: Fit) -> list[dict[str, Any]]:
    residuals = fit.residuals.tolist()
    return [{**row, "residual": r} for row, r in zip(rows, residuals, strict=True)]


def _remarks(estimate: Estimate) -> str:
    """The unit, the interval and the remark of an estimate."""
    texts = []
    if estimate.interval:
        low, high = estimate.interval
        texts.append(f"[{low:.4g}, {high:.4g}]")
    if estimate.remark:
        texts.append(estimate.remark)
    return f"{estimate.unit}, {': '.join(texts)}"
