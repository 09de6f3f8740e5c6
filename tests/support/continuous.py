"""The grasp in continuous time, solved from event to event: a reference that shares no code.

The right-hand side is Eqs. (1) to (7) and (9) as they are printed, every signal taken at the same
moment: no sampling, no sensor or actuator step, no order of execution. Each moment at which a
finger touches or leaves the object is located on the solution, which starts anew from there.
With what the adaptive layer 3 learns, Eq. (2') takes the place of Eq. (2).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from math import exp, log, sqrt, tanh
from typing import NamedTuple

from scipy.integrate import solve_ivp

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
    sigma_n: float = 0.01
    sigma_c: float = 1.8e-3
    sigma_K: float = 0.05
    gamma: float = 0.65
    P_0: float = 0.1
    w_0: float = 5e-4
    T_w: float = 0.02
    l_h: float = 3e-3
    T_h: float = 1.0
    l_0: float = 5e-3


class Line(NamedTuple):
    """Intensity and way behind their low-passes, the sums of weight, s, y, s^2 and s·y, those of
    y/xi and y·ln y and of their products with s, and those of the noise by powers of s.
    """

    xi: float
    s: float
    weight: float
    sum_s: float
    sum_y: float
    sum_ss: float
    sum_sy: float
    sum_o: float
    sum_so: float
    sum_n: float
    sum_sn: float
    noise: float
    noise_s: float
    noise_ss: float


SIZE = len(Line._fields)


@dataclass(frozen=True, slots=True)
class Learning:
    """The equations of what is learnt, from the first intensities in V and ways s in m on.

    Its state: the lines of both fingers, then the low-passed speed of closing in m/s, and how long
    the fingers have pressed without a motion.
    """

    p: Adaptive
    xi_0: Pair
    s_0: Pair

    def start(self):
        """Nothing learnt, both fingers at rest."""
        line = [1.0, 0.0, *[0.0] * (SIZE - 2)]
        return [*line, *line, 0.0, 0.0]

    def pressed(self, z, u):
        """p, from the forces u in N."""
        squeeze, w = max(0.0, 0.5 * (u[1] - u[0])), z[-2]
        pressed = squeeze**2 / (squeeze**2 + self.p.P_0**2)
        return pressed * self.p.w_0**2 / (self.p.w_0**2 + w**2)

    def hold(self, z, s, u):
        """h, from the ways s in m and the forces u in N."""
        line_1, line_2 = _lines(z)
        first = self._touching(line_1, s[0] - self.s_0[0], self.xi_0[0], z[-1])
        second = self._touching(line_2, s[1] - self.s_0[1], self.xi_0[1], z[-1])
        return self.pressed(z, u) * first * second

    def _touching(self, line, way, xi_0, lasting):
        """How far a finger may be at its face that has gone a way in m."""
        kappa = _fit(line)
        if kappa is None:
            return lasting
        known = self.p.sigma_b**2 / (self.p.sigma_b**2 + self._variances(line, kappa, xi_0)[0])
        zero = (line.sum_s - line.sum_y / kappa) / line.weight  # way at which the line has y = 0
        by_way = way - MILLIMETRE * zero
        by_light = way + MILLIMETRE * (line.xi ** (-1.0 / self.p.n) / kappa - line.s)
        l = max(0.0, min(by_way, by_light) - self.p.l_0)
        near = self.p.l_h**8 / (self.p.l_h**8 + l**8)
        return known * near + (1.0 - known) * lasting

    def beta(self, z):
        """Return ln(alpha_1/alpha_2) as learnt, and its standard deviation."""
        line_1, line_2 = _lines(z)
        kappa_1, kappa_2 = _fit(line_1), _fit(line_2)
        if kappa_1 is None or kappa_2 is None:
            return 0.0, self.p.sigma_b
        xi_1, xi_2 = self.xi_0
        fitted = log(xi_1 / xi_2) - self.p.n * log(kappa_1 / kappa_2)
        prior, most = self.p.sigma_b**2, self.p.beta_max
        (noise_1, gaps_1, faces_1), (noise_2, gaps_2, faces_2) = (
            self._variances(line, kappa, xi_0)
            for line, kappa, xi_0 in ((line_1, kappa_1, xi_1), (line_2, kappa_2, xi_2))
        )
        fitted = min(max(fitted, -most), most)
        off = abs(fitted) / (self.p.gamma * sqrt(gaps_1 + gaps_2))  # in gamma deviations
        acts = min(2.0 - 2.0 / off, 1.0) if off > 1.0 else 0.0
        gain = prior / (prior + faces_1 + faces_2)
        deviation = sqrt(prior * (1.0 - gain) + ((1.0 - acts) * gain * fitted) ** 2)
        return acts * prior / (prior + noise_1 + noise_2) * fitted, deviation

    def rates(self, z, s, xi, closing, u):
        """The derivative of the state, at ways s in m, intensities xi in V and forces u in N."""
        rates, h = [], self.hold(z, s, u)
        for j, line in enumerate(_lines(z)):
            way = (s[j] - self.s_0[j]) / MILLIMETRE
            rates += self._line_rates(line, way, xi[j] / self.xi_0[j], 1.0 - h)
        lasting_rate = (self.pressed(z, u) - z[-1]) / self.p.T_h
        return [*rates, (closing - z[-2]) / self.p.T_w, lasting_rate]

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
        o, ln = y / line.xi, y * log(y)
        sums = [w, w * at, w * y, w * at * at, w * at * y, w * o, w * at * o, w * ln, w * at * ln]
        return [xi_rate, s_rate, *sums, noise, noise * at, noise * at * at]

    def _variances(self, line, kappa, xi_0):
        """N_j, V_j and that of ln alpha_j.

        White noise has the density 2·T_f·sigma^2 in what the slope is made of. The errors of the
        calibration change the slope of y, and that of n also the line that y is compared with.
        """
        mean = line.sum_s / line.weight
        q = line.noise_ss - 2.0 * mean * line.noise_s + mean**2 * line.noise
        relative = self.p.sigma / (xi_0 * kappa * _spread(line))
        by_noise = 2.0 * self.p.T_f * relative**2 * q
        c_sy = kappa * _spread(line)
        by_c = self.p.sigma_c / xi_0 * (line.sum_so - mean * line.sum_o) / c_sy
        bend = (line.sum_sn - mean * line.sum_n) / c_sy
        here = bend + log(line.xi) / self.p.n
        anywhere = bend - log(kappa) + log(MILLIMETRE)
        both = by_noise + by_c**2
        gaps = both + (self.p.sigma_n * here) ** 2
        return by_noise, gaps, both + (self.p.sigma_n * anywhere) ** 2 + self.p.sigma_K**2


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


State = Sequence[float]
"""x_1, x_1', x_2, x_2', x_v11, x_v11', x_v21, x_v21', x_v2, x_v2', and what is learnt."""

LEARNT = slice(10, None)

Event = Callable[[float, State], float]

OPENING = (1.0, -1.0)
"""Direction of x in which a finger opens."""

REBOUND = 1e-9
"""m; a finger that touches is free again beyond this gap.

The gap of a finger at rest on the object decays to zero. What is left of it, some 1e-13 m of
numerical noise, is no rebound.
"""

LONGEST_STEP = 5e-3
"""s; a step of the solver in which a finger touched and left again would hide both."""


@dataclass(frozen=True, slots=True)
class Grasp:
    """The published numbers in SI units, under the symbols of the equations."""

    case: int = 2
    m: Pair = (0.5, 0.5)
    x_init: Pair = (0.11, -0.11)
    W: float = 0.07
    x_m: float = 0.03
    alpha: float = 200.0
    beta: float = 200.0
    K: float = 0.0024
    n: float = 1.1506
    l_0: float = 0.005
    reflectance: Pair = (1.0, 1.0)
    M_a2: float = 1.0
    D_a2: float = 12.0
    K_a2: float = 36.0
    K_s: float = 3.0
    M_a1: float = 1.0
    D_a1: float = 10.0
    K_a1: float = 25.0
    D_p: Pair = (0.6, -0.6)
    D_i: float = 14.0
    K_i: float = 98.0
    B: Pair = (0.0, 0.0)
    """Viscous friction of the fingers, which the paper's simulation leaves out."""
    adaptive: Adaptive | None = None


@dataclass(frozen=True, slots=True)
class Solution:
    """The first contacts, and how the solution ends."""

    contact_time: tuple[float | None, float | None]
    """s; None for a finger that does not touch."""
    closing_speed: tuple[float | None, float | None]
    """m/s, at the first contact."""
    contact_force: Pair
    """N, along x."""
    target: float
    """m; x_v2, which is x_d without layer 3."""
    beta: Pair = (0.0, 0.0)
    """ln(alpha_1/alpha_2) as learnt, and its standard deviation."""


class Motion(NamedTuple):
    """Position in m and its derivatives in m/s and m/s^2."""

    x: float
    v: float
    a: float


def solve(p, stop, *, to_the_end=False):
    """The grasp up to stop in s; unless to_the_end, only until both fingers have touched."""
    x_1, x_2 = p.x_init
    y = [x_1, 0.0, x_2, 0.0, x_1, 0.0, x_2, 0.0, 0.5 * (x_1 + x_2), 0.0]
    learning = _learning(p)
    y = [*y, *learning.start()] if learning else y
    t, touching = 0.0, (False, False)
    times = [None, None]
    speeds = [None, None]
    while t < stop and (to_the_end or None in times):
        t, y, touching = _run_to_event(p, t, y, touching, stop)
        for j in (0, 1):
            if touching[j] and times[j] is None:
                times[j], speeds[j] = t, -_gap(p, y, j)[1]
    target, virtual = _targets(p, y, touching)
    f_1, f_2 = (_contact_force(p, y, j, virtual[j], touching[j]) for j in (0, 1))
    beta = learning.beta(y[LEARNT]) if learning else (0.0, 0.0)
    return Solution((times[0], times[1]), (speeds[0], speeds[1]), (f_1, f_2), target.x, beta)


def _run_to_event(p, t, y, touching, stop):
    """Integrate until a finger touches or leaves, or until stop; and who touches from there on."""
    events = [_event(p, j, touching[j]) for j in (0, 1)]
    solution = solve_ivp(
        lambda _, y: _slope(p, y.tolist(), touching),
        (t, stop),
        y,
        method="DOP853",
        events=events,
        rtol=1e-9,
        atol=1e-12,
        max_step=LONGEST_STEP,
    )
    assert solution.success, solution.message
    t, end = float(solution.t[-1]), solution.y[:, -1].tolist()
    # Of two events at the same moment the solver names one; the sign tells of the other.
    changed = [len(solution.t_events[j]) > 0 or events[j](t, end) < 0.0 for j in (0, 1)]
    return t, end, (touching[0] != changed[0], touching[1] != changed[1])


def _event(p, j, touching):
    """A function that falls through zero where the finger leaves or touches."""

    def room(t, y):
        gap, _ = _gap(p, y, j)
        return REBOUND - gap if touching else gap

    event = room
    event.terminal, event.direction = True, -1.0
    return room


def _slope(p, y, touching):
    """The derivative of the state."""
    target, (virtual_1, virtual_2) = _targets(p, y, touching)
    a_1 = _acceleration(p, y, 0, virtual_1, touching[0])
    a_2 = _acceleration(p, y, 1, virtual_2, touching[1])
    rates = [y[1], a_1, y[3], a_2, y[5], virtual_1.a, y[7], virtual_2.a, y[9], target.a]
    learning = _learning(p)
    return rates if learning is None else rates + _learning_rates(p, learning, y)


@cache
def _learning(p):
    """What is learnt from the fingers' first positions on."""
    if p.adaptive is None:
        return None
    (x_1, x_2), y = p.x_init, [p.x_init[0], 0.0, p.x_init[1], 0.0]
    return Learning(p.adaptive, (_intensity(p, y, 0), _intensity(p, y, 1)), (x_1, -x_2))


def _learning_rates(p, learning, y):
    ways, seen = (y[0], -y[2]), (_intensity(p, y, 0), _intensity(p, y, 1))
    return learning.rates(y[LEARNT], ways, seen, y[1] - y[3], _commands(p, y))


def _commands(p, y):
    return _command(p, y, 0), _command(p, y, 1)


def _command(p, y, j):
    """Eq. (7)."""
    x, v, virtual, virtual_rate = y[2 * j], y[2 * j + 1], y[4 + 2 * j], y[5 + 2 * j]
    return -p.D_i * (v - virtual_rate) - p.K_i * (x - virtual)


def _virtual_force(p, y):
    """f_s of Eq. (2), or of Eq. (2')."""
    xi_1, xi_2 = (_intensity(p, y, j) for j in (0, 1))
    learning = _learning(p)
    if learning is None:
        return p.K_s * tanh((xi_1 - xi_2) / (xi_1 + xi_2))
    beta, _ = learning.beta(y[LEARNT])
    xi_2 *= exp(beta)
    h = learning.hold(y[LEARNT], (y[0], -y[2]), _commands(p, y))
    return (1.0 - h) * p.K_s * tanh((xi_1 - xi_2) / (xi_1 + xi_2))


def _targets(p, y, touching):
    """x_v2 of Eqs. (2) to (4), and from it x_vj1 of Eqs. (5) and (6).

    Case 1 puts x_d in the place of x_v2, Case 0 in that of x_vj1; x_d' = x_d'' = 0 by definition.
    """
    x_d = 0.5 * (y[0] + y[2])
    target = Motion(x_d, 0.0, 0.0)
    if p.case == 2:
        x, v = y[8], y[9]
        target = Motion(x, v, (_virtual_force(p, y) - p.D_a2 * v - p.K_a2 * (x - x_d)) / p.M_a2)
    if p.case == 0:
        return target, [target, target]
    virtual = []
    for j in (0, 1):
        x, v = y[4 + 2 * j], y[5 + 2 * j]
        f_p = 0.0 if touching[j] else p.D_p[j] * _relative_intensity_rate(p, y, j)
        deviation = f_p - p.D_a1 * (v - target.v) - p.K_a1 * (x - target.x)
        virtual.append(Motion(x, v, target.a + deviation / p.M_a1))
    return target, virtual


def _gap(p, y, j):
    """l_j and its rate: from the surface at x_m +- W/2 outwards."""
    opening = OPENING[j]
    return opening * (y[2 * j] - p.x_m) - 0.5 * p.W, opening * y[2 * j + 1]


def _intensity(p, y, j):
    """Eq. (9); no gap is less than none."""
    gap, _ = _gap(p, y, j)
    return p.K * p.reflectance[j] / (max(gap, 0.0) + p.l_0) ** p.n


def _relative_intensity_rate(p, y, j):
    """xi'/xi, where xi' is the derivative of Eq. (9) along the motion of a free finger."""
    gap, rate = _gap(p, y, j)
    return -p.n * rate / (gap + p.l_0)


def _actuator_force(p, y, j, virtual):
    """Eq. (7), less viscous friction."""
    x, v = y[2 * j], y[2 * j + 1]
    return -p.D_i * (v - virtual.v) - p.K_i * (x - virtual.x) - p.B[j] * v


def _contact_force(p, y, j, virtual, touching):
    """What makes the gap obey g'' + 2 alpha g' + beta^2 g = 0, along x; never a pull.

    Where it reaches zero within the surface the slope has a kink, not a jump: the solver's error
    control copes with that.
    """
    if not touching:
        return 0.0
    gap, rate = _gap(p, y, j)
    wanted = -2.0 * p.alpha * rate - p.beta**2 * gap
    actuator = OPENING[j] * _actuator_force(p, y, j, virtual)
    return OPENING[j] * max(0.0, p.m[j] * wanted - actuator)


def _acceleration(p, y, j, virtual, touching):
    """Eq. (1)."""
    force = _actuator_force(p, y, j, virtual) + _contact_force(p, y, j, virtual, touching)
    return force / p.m[j]
