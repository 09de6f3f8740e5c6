"""The calibration of a sensor from its curve: voltages over gaps, as in Fig. 3 of the paper.

Eq. (9) with the offset c that ambient light leaves is fitted by least squares:

    xi = K·alpha/(l + l_0)^n + c

alpha and l_0 are known. The standard errors are those of the linearised model, for noise that is
independent and of one variance. K and n depend on each other: take both from one fit.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ...base.errors import InputError
from ...base.text import counted
from .fit import Vector
from .measured_table import Row, read_rows

UNITS = {"gap": "m", "voltage": "V"}
"""The columns of a curve, and their units where the table names none."""

MIN_GAPS = 5
"""Different gaps: more than three for the three numbers, and some to see how well they fit."""

NEGLIGIBLE = 1e-9
"""Voltages that fall by such a share of the largest are constant."""

MAX_CALLS = 10_000
"""Of the curve in a fit; one of the paper's sensor takes about 30."""

FIRST_EXPONENT = 1.0
"""n at which the fit begins: light that spreads is between 0 and 2 here, in most sensors near 1."""


class SensorFit(NamedTuple):
    """The calibration of a sensor, with a standard error for each of gain, exponent and offset."""

    gain: float
    """K of a white face in V.m^n."""
    exponent: float
    """n."""
    offset: float
    """c in V."""
    errors: tuple[float, float, float]
    offset_distance: float
    """l_0 in m, as it was known."""
    reflectance: float
    """alpha of the face, as it was known."""
    noise: float
    """Standard deviation of the residuals in V, for as many numbers fewer as were fitted."""
    r_squared: float
    """The share of the variance of the voltages that the curve explains."""
    gaps: Vector
    """m"""
    voltages: Vector
    """V, as measured."""

    def voltage(self, gaps: Vector) -> Vector:
        """The fitted voltage in V at gaps in m."""
        amplitude = self.gain * self.reflectance
        return _curve(gaps + self.offset_distance, amplitude, self.exponent, self.offset)

    @property
    def residuals(self) -> Vector:
        """Fitted less measured, in V."""
        return self.voltage(self.gaps) - self.voltages


def read_curve(path: Path) -> tuple[Vector, Vector]:
    """The gaps in m and voltages in V of a table; InputError where there can be none such."""
    rows = read_rows(path, UNITS, "voltages over gaps")
    for row in rows:
        _check(row)
    gaps, voltages = (np.array([row.numbers[name] for row in rows]) for name in UNITS)
    different = len(np.unique(gaps))
    if different < MIN_GAPS:
        raise InputError(
            f"{path}: {counted(different, 'different gap')}; must be at least {MIN_GAPS}"
        )
    return gaps, voltages


def _check(row: Row) -> None:
    gap, voltage = row.numbers["gap"], row.numbers["voltage"]
    if not (math.isfinite(gap) and gap >= 0.0):
        raise InputError(f"{row.place}: gap = {gap:g} m: must be finite, and 0 or more")
    if not math.isfinite(voltage):
        raise InputError(f"{row.place}: voltage = {voltage:g} V: must be finite")


def fit_curve(
    gaps: Vector, voltages: Vector, offset_distance: float, reflectance: float, place: str
) -> SensorFit:
    """K, n and c of a sensor whose element is offset_distance in m behind its face.

    place names the data. InputError where they do not determine the three numbers.
    """
    distances = gaps + offset_distance
    undetermined = InputError(
        f"{place}: the voltages do not determine K, n and c; must fall as the gap grows"
    )
    if not _falls(distances, voltages):
        raise undetermined
    try:
        found, covariance = _fitted(distances, voltages)
    except RuntimeError as error:  # not at rest after MAX_CALLS
        raise undetermined from error
    amplitude, exponent, offset = found.tolist()
    errors = np.sqrt(np.diag(covariance))
    if not (np.isfinite(errors).all() and amplitude > 0.0 and exponent > 0.0):
        raise undetermined
    residuals = _curve(distances, *found) - voltages
    squares = float(residuals @ residuals)
    spread = float(np.sum((voltages - np.mean(voltages)) ** 2))
    error_of_amplitude, error_of_exponent, error_of_offset = errors.tolist()
    return SensorFit(
        amplitude / reflectance,
        exponent,
        offset,
        (error_of_amplitude / reflectance, error_of_exponent, error_of_offset),
        offset_distance,
        reflectance,
        math.sqrt(squares / (len(voltages) - len(found))),
        1.0 - squares / spread,
        gaps,
        voltages,
    )


def _curve(distances: Vector, amplitude: float, exponent: float, offset: float) -> Vector:
    """Eq. (9) and c, in V, over distances to the element in m."""
    return np.asarray(amplitude * distances**-exponent + offset)


def _falls(distances: Vector, voltages: Vector) -> bool:
    """True if the voltages are lower where the distances are greater, by more than by rounding."""
    slope, _ = _straight(1.0 / distances, voltages)
    return slope * float(np.ptp(1.0 / distances)) > NEGLIGIBLE * float(np.abs(voltages).max())


def _fitted(distances: Vector, voltages: Vector) -> tuple[Vector, Vector]:
    """K·alpha, n and c with their covariances; RuntimeError where the fit does not come to rest."""
    from scipy.optimize import OptimizeWarning, curve_fit

    amplitude, offset = _straight(distances**-FIRST_EXPONENT, voltages)
    begin = (amplitude, FIRST_EXPONENT, offset)
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", OptimizeWarning)  # then the covariances are infinite
        found, covariance = curve_fit(_curve, distances, voltages, p0=begin, maxfev=MAX_CALLS)
    return found, covariance


def _straight(x: Vector, y: Vector) -> Sequence[float]:
    """Slope and intercept of the straight line that is nearest to the points."""
    slope, intercept = np.polyfit(x, y, 1)
    return float(slope), float(intercept)
