"""Fits the friction of the fingers to what was measured."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...base.errors import InputError, nearest
from ...base.text import counted
from ...recording.folder import load_log
from ...system.description import System
from ..metrics import FINGERS
from ..published.tables import table_csv
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
from .log import FRICTION, identify_from_log

LOGGER = logging.getLogger(__name__)
"""Gets as a warning that a log is taken to be in SI units."""

ASSUMPTIONS = (
    "95 % confidence intervals of the linearised model, for residuals that are independent, of one "
    "variance and without a bias"
)


def _each(name: str, *values: Any) -> list[Parameter]:
    return [Parameter(f"{FRICTION}{name}[{j}]", *values) for j in FINGERS]


GROUPS = {
    "coulomb": _each("coulomb", "N", 1.0, 0.0, 10.0, 1.0, 0.0),
    "static": _each("static", "N", 1.5, 0.0, 10.0, 1.0, None),
    "viscous": _each("viscous", "N.s/m", 10.0, 0.0, 1000.0, 10.0, 0.0),
    "stribeck": [
        Parameter(f"{FRICTION}stribeck_velocity", "m/s", 0.05, 1e-4, 1.0, 0.01, None),
    ],
    "ratio": [Parameter(RATIO, "1", 1.0, 0.2, 5.0, 0.1, 1.0)],
}
"""What can be fitted by name: a parameter for each finger, or one for both."""

OF_A_LOG = tuple(name for name in GROUPS if name != "ratio")
"""What a log of the fingers says something about."""

DEFAULT = ("coulomb", "viscous")


@dataclass(frozen=True, slots=True)
class Identification:
    """A fit, what it was made from, and what its residuals belong to, in their unit."""

    data: str
    unit: str
    fit: Fit
    rows: Sequence[dict[str, Any]]
    scatter: float | None = None
    """Standard deviation of data that were measured under equal conditions, if any were."""

    @property
    def values(self) -> dict[str, float]:
        """The fitted values by name, as System.with_settings() takes them."""
        return {e.name: e.value for e in self.fit.estimates}

    def as_json(self) -> dict[str, Any]:
        """All of it as JSON has it."""
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
        """The parameters and the root mean square of the residuals."""
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
        """The values as the table [values], and the residuals as CSV, by the names of files."""
        head = f"# {self.data}: root mean square of the residuals {self.fit.rms:.4g} {self.unit}"
        digits = {e.name: float(f"{e.value:.6g}") for e in self.fit.estimates}
        lines = (f'"{e.name}" = {digits[e.name]}  # {_about(e)}' for e in self.fit.estimates)
        return {
            "values.toml": "\n".join([head, "[values]", *lines, ""]),
            "residuals.csv": table_csv(self.rows),
        }


def identify(
    log: Path | None = None,
    *,
    fit: Sequence[str] = DEFAULT,
    system: System | None = None,
    progress: bool = False,
) -> Identification:
    """Fit friction to a log: the contact times in a table, or the signals of a run.

    Without `log` these are the contact times of the published experiments. `fit` are names of
    GROUPS; what is not fitted is as in `system`, by default the built-in grasp.

    InputError where the log or a name of `fit` is wrong, SimulationError where the fit does not
    come to rest.
    """
    system = grasp_system() if system is None else system
    if log is None or is_contacts(log):
        contacts = published_contacts() if log is None else read_contacts(log)
        name = "the published experiments" if log is None else str(log)
        parameters = chosen(fit, tuple(GROUPS), name)
        found = identify_from_times(system, contacts, parameters, progress)
        rows = [
            {"condition": c.label, "case": c.case, "finger": c.finger, "measured": c.time}
            for c in contacts
        ]
        data = f"{name}, {len(rows)} contact times"
        return _identified(data, "s", found, rows, scatter(contacts))
    signals = load_log(log, LOGGER.warning)
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
