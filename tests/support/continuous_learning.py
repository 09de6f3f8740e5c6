"""What the adaptive layer 3 adds to the grasp in continuous time: sums over travel as integrals.

The low-passes are of first order, each sum of a line is an integral over time, and beta and h are
those of the moment. A finger's line is counted from where it starts, in millimetres and in its
first intensity, so that the solver's tolerances mean the same in the dark: no unit is left in it.
"""

from dataclasses import dataclass
from math import log, sqrt
from typing import NamedTuple

Pair = tuple[float, float]
"""A value per finger: right, left."""

MILLIMETRE = 1e-3

NOTHING_YET = 1e-9
"""mm^2; spread of the points below which they are no line: 2 um of travel."""


@dataclass(frozen=True, slots=True)
class Adaptive:
    """The numbers in SI units, under the symbols of the equations."""

    n: float = 1.1506
    T_f: float = 0.02
    q: float = 5.0
    sigma: float = 2.5e-4
    sigma_b: float = 1.0
    beta_max: float = 2.5
    P_0: float = 0.1
    w_0: float = 2e-3
    T_w: float = 0.02


class Line(NamedTuple):
    """Intensity and way behind their low-passes, the sums of weight, s, y, s^2 and s·y, and those
    of the noise by powers of s.
    """

    xi: float
    s: float
    weight: float
    sum_s: float
    sum_y: float
    sum_ss: float
    sum_sy: float
    noise: float
    noise_s: float
    noise_ss: float


SIZE = len(Line._fields)


@dataclass(frozen=True, slots=True)
class Learning:
    """The equations of what is learnt, from the first intensities in V and ways s in m on.

    Its state: the lines of both fingers, then the low-passed speed of closing in m/s.
    """

    p: Adaptive
    xi_0: Pair
    s_0: Pair

    def start(self):
        """Nothing learnt, both fingers at rest."""
        line = [1.0, 0.0, *[0.0] * (SIZE - 2)]
        return [*line, *line, 0.0]

    def hold(self, z, u):
        """h, from the forces u in N."""
        squeeze, w = max(0.0, 0.5 * (u[1] - u[0])), z[-1]
        pressed = squeeze**2 / (squeeze**2 + self.p.P_0**2)
        return pressed * self.p.w_0**2 / (self.p.w_0**2 + w**2)

    def beta(self, z):
        """Return ln(alpha_1/alpha_2) as learnt, and its standard deviation."""
        line_1, line_2 = _lines(z)
        kappa_1, kappa_2 = _fit(line_1), _fit(line_2)
        if kappa_1 is None or kappa_2 is None:
            return 0.0, self.p.sigma_b
        xi_1, xi_2 = self.xi_0
        fitted = log(xi_1 / xi_2) - self.p.n * log(kappa_1 / kappa_2)
        prior, most = self.p.sigma_b**2, self.p.beta_max
        variance = self._variance(line_1, kappa_1, xi_1) + self._variance(line_2, kappa_2, xi_2)
        gain = prior / (prior + variance)
        return gain * min(max(fitted, -most), most), self.p.sigma_b * sqrt(1.0 - gain)

    def rates(self, z, s, xi, closing, h):
        """The derivative of the state, at ways s in m and intensities xi in V."""
        rates = []
        for j, line in enumerate(_lines(z)):
            way = (s[j] - self.s_0[j]) / MILLIMETRE
            rates += self._line_rates(line, way, xi[j] / self.xi_0[j], 1.0 - h)
        return [*rates, (closing - z[-1]) / self.p.T_w]

    def _line_rates(self, line, s, xi, believed):
        n, T_f = self.p.n, self.p.T_f
        xi_rate, s_rate = (xi - line.xi) / T_f, (s - line.s) / T_f
        y = line.xi ** (-1.0 / n)
        y_rate = -y / n * xi_rate / line.xi
        travel = abs(s_rate)
        kappa = _fit(line)
        if kappa is not None and s_rate != 0.0:
            travel *= min(max(y_rate / (kappa * s_rate), 0.0), 1.0)
        w = believed * line.xi**self.p.q * travel
        at = line.s
        noise = (w * y / line.xi) ** 2
        sums = [w, w * at, w * y, w * at * at, w * at * y]
        return [xi_rate, s_rate, *sums, noise, noise * at, noise * at * at]

    def _variance(self, line, kappa, xi_0):
        """V_j: white noise of the density 2·T_f·sigma^2 in what the slope is made of."""
        mean = line.sum_s / line.weight
        q = line.noise_ss - 2.0 * mean * line.noise_s + mean**2 * line.noise
        relative = self.p.sigma / (xi_0 * kappa * _spread(line))
        return 2.0 * self.p.T_f * relative**2 * q


def _lines(z):
    return Line(*z[:SIZE]), Line(*z[SIZE : 2 * SIZE])


def _spread(line):
    """C_ss."""
    return line.sum_ss - line.sum_s**2 / line.weight if line.weight > 0.0 else 0.0


def _fit(line):
    """kappa = C_sy/C_ss, in the finger's own units; None as long as there is no line."""
    spread = _spread(line)
    if spread < NOTHING_YET:
        return None
    kappa = (line.sum_sy - line.sum_s * line.sum_y / line.weight) / spread
    return kappa if kappa > 0.0 else None
