"""The grasp in continuous time, solved from event to event: a reference that shares no code.

The right-hand side is Eqs. (1) to (7) and (9) as they are printed, every signal taken at the same
moment: no sampling, no sensor or actuator step, no order of execution. Each moment at which a
finger touches or leaves the object is located on the solution, which starts anew from there.
With what the adaptive layer 3 learns, Eq. (2') takes the place of Eq. (2).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from math import exp, tanh
from typing import NamedTuple

from scipy.integrate import solve_ivp

from .continuous_learning import Adaptive, Learning

Pair = tuple[float, float]
"""A value per finger: right, left."""

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
    return learning.rates(y[LEARNT], ways, seen, y[1] - y[3], _hold(p, learning, y))


def _hold(p, learning, y):
    return learning.hold(y[LEARNT], (_command(p, y, 0), _command(p, y, 1)))


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
    return (1.0 - _hold(p, learning, y)) * p.K_s * tanh((xi_1 - xi_2) / (xi_1 + xi_2))


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
