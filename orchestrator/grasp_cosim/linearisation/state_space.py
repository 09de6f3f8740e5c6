"""A sampled linear model, its frequency response, and the margins of a loop that was opened."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import degrees, inf, nan, pi
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..base.checks import extra_module
from ..base.errors import InputError, choices

if TYPE_CHECKING:
    import control

Matrix = npt.NDArray[np.float64]
Response = npt.NDArray[np.complex128]

FREQUENCIES = 4000
"""How many frequencies are searched for the crossovers of a loop, in addition to those of its
poles.
"""

MIN_FREQUENCY = 1e-7
"""The lowest of them, as a share of the Nyquist frequency."""

MAX_NAMES_SHOWN = 4
"""How many names of each kind are in the repr() of a model."""


class Margins(NamedTuple):
    """How far a loop is from instability, by the factor -L that it has where it was opened.

    Of several crossovers each figure is that of the nearest to instability. Where there is none the
    frequency is NaN and the margin infinite. The margins of a loop that is not stable as it is mean
    nothing.
    """

    crossover: float
    """The frequency in rad/s at which the gain is 1 and the delay margin the smallest."""
    phase_margin: float
    """The lag in degrees that the loop bears there."""
    delay_margin: float
    """The delay in s that the loop bears."""
    phase_crossover: float
    """The frequency in rad/s at which -L is real and negative."""
    gain_margin: float
    """The factor above 1 that the loop bears."""
    stable: bool
    """True if the closed loop is stable as it is: on the way of a run a slow mode may grow."""

    def __str__(self) -> str:
        """In a line."""
        return (
            f"crossover {self.crossover:.4g} rad/s, phase margin {self.phase_margin:.4g} degrees, "
            f"delay margin {1e3 * self.delay_margin:.4g} ms, gain margin {self.gain_margin:.4g}, "
            f"{'stable' if self.stable else 'not stable'}"
        )


@dataclass(frozen=True, eq=False)
class StateSpace:
    """The linear model of deviations from a run, at points `step` apart.

        x[k+1] = A x[k] + B u[k],    y[k] = C x[k] + D u[k]

    Values are in the units of the signals.

    Example:
        >>> from grasp_cosim import grasp_system, linearise
        >>> loop = "controller.intensity[1]"
        >>> model = linearise(grasp_system(), 0.5, [loop], [loop], step=1e-3)
        >>> model.D.shape, model.margins().phase_margin > 60.0
        ((1, 1), True)
    """

    A: Matrix
    """The matrix of the shape (states, states)."""
    B: Matrix
    """The matrix of the shape (states, inputs)."""
    C: Matrix
    """The matrix of the shape (outputs, states)."""
    D: Matrix
    """The matrix of the shape (outputs, inputs)."""
    step: float
    """The macro step in s."""
    at: float
    """The time of the run in s about which it is."""
    states: tuple[str, ...]
    """The names of the states, in order: a component and a number, or the signal that is held from
    one step to the next.
    """
    inputs: tuple[str, ...]
    """The names of the inputs, in order."""
    outputs: tuple[str, ...]
    """The names of the outputs, in order."""

    def __repr__(self) -> str:
        """Its size, and what goes in and comes out."""
        return (
            f"StateSpace at {self.at:g} s, in steps of {self.step:g} s: "
            f"{len(self.states)} states, from {choices(self.inputs, MAX_NAMES_SHOWN)} to "
            f"{choices(self.outputs, MAX_NAMES_SHOWN)}"
        )

    @property
    def poles(self) -> Response:
        """The eigenvalues of A; the model is stable where all are within the unit circle."""
        return np.linalg.eigvals(self.A).astype(np.complex128)

    def frequency_response(self, omega: npt.ArrayLike) -> Response:
        """D + C (z - A)^-1 B at z = exp(j omega step).

        Args:
            omega: Frequencies in rad/s, of the shape (frequencies,).

        Returns:
            Complex factors of the shape (frequencies, outputs, inputs).
        """
        z = np.exp(1j * self.step * np.atleast_1d(np.asarray(omega, np.float64)))
        z_minus_a = z[:, np.newaxis, np.newaxis] * np.eye(len(self.A)) - self.A
        response = self.C @ np.linalg.solve(z_minus_a, self.B.astype(np.complex128)) + self.D
        return np.asarray(response, np.complex128)

    def margins(self) -> Margins:
        """The margins of the loop that was opened between the one input and the one output.

        Returns:
            The margins of the factor -L.

        Raises:
            InputError: The model has several inputs or outputs.
        """
        if self.D.shape != (1, 1):
            raise InputError(
                f"margins: {len(self.inputs)} inputs and {len(self.outputs)} outputs; must be one "
                "input, at which a loop is opened, and one output"
            )

        def loop(omega: npt.ArrayLike) -> Response:
            return -self.frequency_response(omega)[:, 0, 0]  # 1 - L of u = y is 1 + (-L)

        omega = self._frequencies()
        values = loop(omega)
        phase_margin, delay_margin, crossover = inf, inf, nan
        for frequency in zeros(lambda w: abs(loop(w)[0]) - 1.0, omega, np.abs(values) - 1.0):
            lag = float(np.angle(-loop(frequency)[0]) % (2.0 * pi))
            if lag / frequency < delay_margin:
                phase_margin = degrees((lag + pi) % (2.0 * pi) - pi)
                delay_margin, crossover = lag / frequency, frequency
        gain_margin, phase_crossover = inf, nan
        nyquist = float(omega[-1])  # there the loop is real
        for frequency in [*zeros(lambda w: loop(w)[0].imag, omega, values.imag), nyquist]:
            share = -loop(frequency)[0].real
            if 0.0 < share < 1.0 and 1.0 / share < gain_margin:
                gain_margin, phase_crossover = float(1.0 / share), frequency
        is_stable = self._stable_when_closed()
        return Margins(
            crossover, phase_margin, delay_margin, phase_crossover, gain_margin, is_stable
        )

    def _stable_when_closed(self) -> bool:
        """True if u = y is stable, by the states that the input reaches."""
        reached = reaching(self.A.T, self.B.T)
        closed = self.A + self.B @ self.C / (1.0 - self.D[0, 0])
        poles = np.linalg.eigvals(closed[np.ix_(reached, reached)])
        return bool(np.abs(poles).max(initial=0.0) < 1.0)

    def ss(self) -> control.StateSpace:
        """The model for python-control.

        Returns:
            A control.StateSpace with the same step and names.

        Raises:
            InputError: python-control is not installed.
        """
        module: Any = extra_module("control", "which has this class", "control")
        model: control.StateSpace = module.ss(
            self.A,
            self.B,
            self.C,
            self.D,
            self.step,
            states=[*self.states],
            inputs=[*self.inputs],
            outputs=[*self.outputs],
        )
        return model

    def _frequencies(self) -> npt.NDArray[np.float64]:
        """From low ones to the Nyquist frequency, in rad/s, those of the poles among them."""
        nyquist = pi / self.step
        poles = self.poles
        of_poles = np.abs(np.log(poles[poles != 0.0])) / self.step
        within = of_poles[(of_poles > MIN_FREQUENCY * nyquist) & (of_poles < nyquist)]
        return np.unique([*np.geomspace(MIN_FREQUENCY * nyquist, nyquist, FREQUENCIES), *within])


def reaching(a: Matrix, c: Matrix) -> list[int]:
    """The states that reach an output of A and C, at once or by others, in order.

    Of the transposed A and B these are the states that an input reaches.
    """
    reached = (c != 0.0).any(axis=0)
    while True:
        extended = reached | (a[reached] != 0.0).any(axis=0)
        if extended.sum() == reached.sum():
            return np.flatnonzero(reached).tolist()
        reached = extended


def zeros(
    function: Callable[[float], float],
    omega: npt.NDArray[np.float64],
    values: npt.NDArray[np.float64],
) -> list[float]:
    """Where a function of the frequency is zero; values are those at omega."""
    from scipy.optimize import brentq  # only here: it takes time to load

    changes = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0)
    return [float(brentq(function, omega[i], omega[i + 1])) for i in changes]
