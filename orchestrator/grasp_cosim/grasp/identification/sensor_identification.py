"""What the calibration of a sensor gives: numbers, lines for a system file, and a picture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...base.text import counted, on_a_screen
from ...report.plot import BLUE, GREY, finish_axes, new_figure
from ..published.published_figures import table_csv
from .sensor_curve import SensorFit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SENSOR_ASSUMPTIONS = (
    "standard errors of the linearised model, for noise that is independent and of one variance"
)

PICTURE = "sensor_curve.png"
"""The name of the picture."""

DRAWN_GAPS = 400
"""Points of the fitted curve in the picture."""


class Value(NamedTuple):
    """A value for a system file with its unit, and its standard error; None if it was known."""

    name: str
    unit: str
    value: float
    standard_error: float | None

    @property
    def line(self) -> str:
        """The value as a line of TOML."""
        error = "known" if self.standard_error is None else f"± {self.standard_error:.2g}"
        return f'"{self.name}" = {self.value:.6g}  # {self.unit}, {error}'


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class SensorIdentification:
    """A fit of a sensor's gain, exponent and offset to its curve."""

    data: str
    """What it was fitted to, in words."""
    fit: SensorFit
    """The calibration with its standard errors."""
    fingers: Sequence[int]
    """The fingers whose sensors get it."""

    @property
    def values(self) -> dict[str, float]:
        """The fitted values by name, as System.with_settings() takes them."""
        return {value.name: value.value for value in self._of_sensors}

    @property
    def rows(self) -> list[dict[str, float]]:
        """Gap in m, measured voltage and residual, fitted less measured, in V."""
        columns = (self.fit.gaps, self.fit.voltages, self.fit.residuals)
        return [
            {"gap": gap, "measured": measured, "residual": residual}
            for gap, measured, residual in zip(*(c.tolist() for c in columns), strict=True)
        ]

    @property
    def _of_sensors(self) -> list[Value]:
        gain_error, exponent_error, offset_error = self.fit.errors
        fit = self.fit
        return [
            value
            for j in self.fingers
            for value in (
                Value(f"sensor_{j}.gain", "V.m^n", fit.gain, gain_error),
                Value(f"sensor_{j}.diffusion_exponent", "1", fit.exponent, exponent_error),
                Value(f"sensor_{j}.offset_distance", "m", fit.offset_distance, None),
                Value(f"sensor_{j}.ambient.offset", "V", fit.offset, offset_error),
            )
        ]

    @property
    def _of_controller(self) -> list[Value]:
        """What the adaptive controllers know about the sensors."""
        gain_error, exponent_error, _ = self.fit.errors
        fit = self.fit
        group = "controller.reflectance"
        return [
            value
            for j in self.fingers
            for value in (
                Value(f"{group}.gain[{j}]", "V.m^n", fit.gain, gain_error),
                Value(f"{group}.diffusion_exponent[{j}]", "1", fit.exponent, exponent_error),
                Value(f"{group}.offset_distance[{j}]", "m", fit.offset_distance, None),
            )
        ]

    @property
    def _lines(self) -> list[str]:
        """The lines of a file of values; the controller that most systems have takes not all."""
        of_controller = [f"# {value.line}" for value in self._of_controller]
        return [
            "[values]",
            *(value.line for value in self._of_sensors),
            "# and with an adaptive controller",
            *of_controller,
        ]

    def __repr__(self) -> str:
        return on_a_screen(self.text().splitlines())

    def as_json(self) -> dict[str, Any]:
        """All of it as JSON has it.

        Returns:
            A dictionary of data, parameters, assumptions, r_squared, noise, unit and rows.
        """
        return {
            "data": self.data,
            "parameters": [v._asdict() for v in (*self._of_sensors, *self._of_controller)],
            "assumptions": SENSOR_ASSUMPTIONS,
            "r_squared": self.fit.r_squared,
            "noise": self.fit.noise,
            "unit": "V",
            "rows": self.rows,
        }

    def text(self) -> str:
        """The numbers with their errors and the lines for a system file, as `identify` prints them.

        Returns:
            A text of several lines.
        """
        gain_error, exponent_error, offset_error = self.fit.errors
        fit = self.fit
        return "\n".join(
            [
                f"{self.data}; {SENSOR_ASSUMPTIONS}",
                f"  K   {fit.gain:10.4g} ± {gain_error:.2g} V.m^n",
                f"  n   {fit.exponent:10.4g} ± {exponent_error:.2g}",
                f"  c   {fit.offset:10.4g} ± {offset_error:.2g} V",
                f"R^2 = {fit.r_squared:.5f} with l_0 = {fit.offset_distance:g} m; residuals: "
                f"standard deviation {fit.noise:.3g} V over "
                f"{counted(len(fit.gaps), 'voltage')}",
                *self._lines,
            ]
        )

    def files(self) -> Mapping[str, str]:
        """The values as TOML, and the residuals as CSV.

        Returns:
            The texts by the names of the files.
        """
        head = f"# {self.data}: R^2 = {self.fit.r_squared:.5f}"
        return {
            "values.toml": "\n".join([head, *self._lines, ""]),
            "residuals.csv": table_csv(self.rows),
        }

    def pictures(self) -> Mapping[str, Figure]:
        """The curve and the measured voltages, as in Fig. 3 of the paper.

        Returns:
            The figures by the names of their files.

        Raises:
            InputError: matplotlib is not installed.
        """
        figure = new_figure(6.4, 4.0)
        _draw(figure.subplots(), self.fit)
        return {PICTURE: figure}


def _draw(axes: Axes, fit: SensorFit) -> None:
    """The measured voltages over the gaps, and the fitted curve with its equation."""
    gaps = np.linspace(0.0, float(fit.gaps.max()), DRAWN_GAPS)
    equation = (
        f"{fit.gain * fit.reflectance:.4g}/(l + {fit.offset_distance:g})^{fit.exponent:.4f} + "
        f"{fit.offset:.3f}, R^2 = {fit.r_squared:.4f}"
    )
    axes.plot(1e3 * fit.gaps, fit.voltages, ".", color=GREY, label="measured")
    axes.plot(1e3 * gaps, fit.voltage(gaps), "-", color=BLUE, label=equation)
    axes.set_xlabel("gap l in mm")
    axes.set_ylim(bottom=0.0)
    finish_axes(axes, "voltage in V")
