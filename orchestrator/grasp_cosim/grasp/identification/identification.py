"""Fits friction, masses and drives of the fingers to what was measured: contact times, or a log."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...base.errors import InputError, nearest
from ...base.text import counted, on_a_screen
from ...recording.log_names import AS_THEY_ARE, LogNames
from ...recording.read_back import load_log
from ...system.description import System, as_system
from ..metrics import FINGERS
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
from .fit import Estimate, Fit, Parameter
from .momentum_balance import DELAY, DRIVE, FRICTION, GAIN, MASS, UNITS, identify_from_log

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
        lines = [f"{self.data}; {ASSUMPTIONS}"]
        for estimate in self.fit.estimates:
            lines.append(f"  {estimate.name:32s}{estimate.value:10.4g} {_remarks(estimate)}")
        rms = f"{self.fit.rms:.4g} {self.unit}"
        lines.append(f"residuals: root mean square {rms} over {len(self.rows)}")
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


def identify(
    log: str | Path | None = None,
    *,
    fit: Sequence[str] = DEFAULT_GROUPS,
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

    Example:
        >>> from grasp_cosim import identify
        >>> fitted = identify(fit=["coulomb"])  # from the published contact times  # doctest: +SKIP
    """
    system = grasp_system() if system is None else as_system(system, "identify")
    log = None if log is None else Path(log)
    if log is None or (not names.file and is_contacts(log)):
        return _identify_from_contacts(log, fit, system, progress)
    return _identify_from_signals(log, fit, system, names)


def _identify_from_contacts(
    log: Path | None, groups: Sequence[str], system: System, progress: bool
) -> Identification:
    """Fit parameters to a table of contact times, or to those of the published experiments."""
    contacts = published_contacts() if log is None else read_contacts(log)
    place = "the published experiments" if log is None else str(log)
    parameters = parameters_of(groups, GROUPS_OF_TIMES, place)
    fit = identify_from_times(system, contacts, parameters, progress)
    rows = [
        {"condition": c.label, "case": c.case, "finger": c.finger, "measured": c.time}
        for c in contacts
    ]
    data = f"{place}, {len(rows)} contact times"
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
    """The parameters of the groups; InputError for one that the data say nothing about."""
    for group in groups:
        if group not in valid:
            raise InputError(f"{place}: {group!r} cannot be fitted; {nearest(group, valid)}")
    return [p for name in GROUPS if name in groups for p in GROUPS[name]]


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
