"""The plant in tandem in continuous time, solved from event to event: it shares no code.

    wrist      X'' = omega^2·(X_c(t - tau) - X) - 2·zeta·omega·X' + omega^2·c·(n_1 - n_2), cut
    opening    M·w'' = motor + n_1 + n_2 - friction
    box        m·x'' = n_2 - n_1 - friction
    contact    n_j = max(0, k·delta_j + c·delta_j')        where delta_j > 0

Whatever makes a right-hand side jump or bend ends a solution at its moment, and a new one starts
from there: a finger that touches or leaves, a limit of the wrist or of its servo, a body that
sticks or slides, an input that changes.
"""

from bisect import bisect_right
from dataclasses import dataclass, field
from itertools import pairwise
from math import copysign, inf, pi
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

GRAVITY = 9.80665

LITTLE = 1e-9
"""Share of a scale by which an event is past: so it is not met again where the next part starts."""

REBOUND = 1e-10
"""m; a finger that touches is free again beyond this gap."""

NONE = [False] * 7

LONGEST = 2e-3
"""s; a step of the solver in which something came and went would hide both."""


@dataclass(frozen=True)
class Gripper:
    """The numbers in SI units; a limit of 0 is none, omega_d = 0 is a drive that is told a force.

    Without a mass the object is fixed.
    """

    M: float = 1.0
    x_init: tuple[float, float] = (0.11, -0.11)
    W: float = 0.07
    x_m: float = 0.03
    m: float | None = None
    mu: float = 0.3
    k: float = 1e4
    c: float = 20.0
    f: float = 5.0
    zeta: float = 1.0
    compliance: float = 0.0
    tau: float = 0.0
    v_max: float = 0.0
    a_max: float = 0.0
    omega_d: float = 0.0
    f_max: float = 0.0
    f_c: float = 0.0

    @property
    def omega(self):
        """rad/s."""
        return 2.0 * pi * self.f


class State(NamedTuple):
    """Positions in m and velocities in m/s of wrist, half the opening and box; v_r of the servo."""

    X: float
    V: float
    w: float
    v: float
    x: float
    u: float
    r: float


@dataclass
class Modes:
    """What holds until the next event: who touches, what is at its limit, which way bodies slide
    (0 sticks).
    """

    touching: list = field(default_factory=lambda: [False, False])
    cut: bool = False
    fast: float = 0.0
    drive: float = 0.0
    box: float = 0.0
    ahead: float = 0.0


class Forces(NamedTuple):
    """All of a moment: pushes n_j, what the wrist wants to accelerate by, net forces in N."""

    n: tuple[float, float]
    wanted: float
    drive: float
    box: float


@dataclass(frozen=True)
class Solution:
    """At each of the times asked for; when each finger touched first, None if never."""

    states: np.ndarray
    forces: np.ndarray
    contact_time: tuple


def solve(p, changes, times):
    """The solution at the times in s, from inputs (t, F, X_c) held from t on until the next."""
    x_1, x_2 = p.x_init
    middle = 0.5 * (x_1 + x_2)
    y = np.array([middle, 0.0, 0.5 * (x_1 - x_2), 0.0, p.x_m, 0.0, 0.0])
    starts = [t for t, _, _ in changes]
    due = [t + p.tau for t in starts]
    bounds = sorted({*starts, *due, times[-1]})
    modes, first = Modes(), [None, None]
    states, forces = [], []
    times = np.asarray(times)
    for begin, end in pairwise(bounds):
        if begin >= times[-1]:
            break
        _, told, _ = changes[bisect_right(starts, begin) - 1]
        j = bisect_right(due, begin) - 1
        held = told, changes[j][2] if j >= 0 else middle
        t, fired = begin, NONE
        while t < end:
            y = _passed(p, modes, held, y, fired)
            part = _until_event(p, modes, held, t, end, y)
            for j in (0, 1):
                if modes.touching[j] and first[j] is None:
                    first[j] = t
            inside = times[(times >= t) & (times < part.t[-1])]
            for s in inside:
                _record(p, modes, held, part.sol(s), states, forces)
            t, y = float(part.t[-1]), part.y[:, -1]
            fired = [len(met) > 0 for met in part.t_events]
    y = _passed(p, modes, held, y, fired)
    _record(p, modes, held, y, states, forces)
    return Solution(np.array(states), np.array(forces), tuple(first))


def _record(p, modes, held, y, states, forces):
    states.append(np.array(y))
    forces.append(_forces(p, modes, held, State(*y)).n)


def _until_event(p, modes, held, t, end, y):
    """The solution up to the next event, or to the end."""
    events = [_terminal(p, modes, held, j) for j in range(len(_margins(p, modes, held, y)))]
    solution = solve_ivp(
        lambda _, y: _slope(p, modes, held, y),
        (t, end), y, method="DOP853", events=events, dense_output=True,
        rtol=1e-9, atol=1e-12, max_step=LONGEST,
    )  # fmt: skip
    assert solution.success, solution.message
    return solution


def _terminal(p, modes, held, j):
    def margin(_, y):
        return _margins(p, modes, held, y)[j]

    margin.terminal, margin.direction = True, -1.0
    return margin


def _depths(p, y):
    """delta_j and delta_j'."""
    right, left = y.x + 0.5 * p.W, y.x - 0.5 * p.W
    return (right - y.X - y.w, y.u - y.V - y.v), (y.X - y.w - left, y.V - y.v - y.u)


def _forces(p, modes, held, y):
    told, command = held
    n = []
    for touching, (depth, rate) in zip(modes.touching, _depths(p, y), strict=True):
        n.append(max(0.0, p.k * depth + p.c * rate) if touching else 0.0)
    n_1, n_2 = n
    wanted = p.omega**2 * (command + p.compliance * (n_1 - n_2) - y.X) - 2 * p.zeta * p.omega * y.V
    motor = p.M * p.omega_d * (y.r - y.v) if p.omega_d else told
    if p.f_max:
        motor = min(max(motor, -p.f_max), p.f_max)
    return Forces((n_1, n_2), wanted, motor + n_1 + n_2, n_2 - n_1)


def _slope(p, modes, held, y):
    y = State(*y)
    now = _forces(p, modes, held, y)
    a = 0.0 if modes.fast else now.wanted
    if p.a_max:
        a = min(max(a, -p.a_max), p.a_max)
    opening = (now.drive - modes.drive * p.f_c) / p.M if modes.drive or not p.f_c else 0.0
    box = 0.0
    if p.m is not None and modes.box:
        box = now.box / p.m - modes.box * p.mu * GRAVITY
    servo = opening if modes.ahead else held[0] / p.M
    return [y.V, a, y.v, opening, y.u, box, servo]


def _most_ahead(p):
    return p.f_max / (p.M * p.omega_d)


def _margins(p, modes, held, y):
    """What falls below 0 where the modes end, in the order of _passed."""
    y = State(*y)
    now = _forces(p, modes, held, y)
    margins = []
    for touching, (depth, _) in zip(modes.touching, _depths(p, y), strict=True):
        margins.append(REBOUND + depth if touching else -depth)
    bent = p.a_max * LITTLE
    over = abs(now.wanted) - p.a_max if p.a_max else -inf
    margins.append(1.0 if not p.a_max else bent + over if modes.cut else bent - over)
    if not p.v_max:
        margins.append(1.0)
    elif modes.fast:
        margins.append(modes.fast * now.wanted + LITTLE)
    else:
        margins.append(p.v_max * (1.0 + 1e-12) - abs(y.V))
    margins.append(_friction_margin(modes.drive, p.f_c, now.drive, y.v) if p.f_c else 1.0)
    grip = 0.0 if p.m is None else p.mu * p.m * GRAVITY
    margins.append(1.0 if p.m is None else _friction_margin(modes.box, grip, now.box, y.u))
    if not p.omega_d:
        margins.append(1.0)
    elif modes.ahead:
        opening = _slope(p, modes, held, y)[3]
        margins.append(modes.ahead * (held[0] / p.M - opening) + LITTLE)
    else:
        margins.append(_most_ahead(p) * (1.0 + LITTLE) - abs(y.r - y.v))
    return margins


def _friction_margin(way, most, net, speed):
    return way * speed if way else most * (1.0 + LITTLE) + 1e-15 - abs(net)


def _passed(p, modes, held, y, fired):
    """The state from which the next part starts, its modes found."""
    y = list(y)
    for _ in range(20):
        margins = _margins(p, modes, held, y)
        stopped = [bool(met or margin < 0.0) for met, margin in zip(fired, margins, strict=True)]
        fired = NONE
        if not any(stopped):
            return np.array(y)
        for j in (0, 1):
            modes.touching[j] ^= stopped[j]
        modes.cut ^= stopped[2]
        now = _forces(p, modes, held, State(*y))
        if stopped[3]:
            if modes.fast:
                modes.fast = 0.0
            else:
                y[1] = copysign(p.v_max, y[1])
                modes.fast = copysign(1.0, y[1])
        if stopped[4]:
            y[3] = 0.0
            modes.drive = _slides(modes.drive, p.f_c, now.drive)
        if stopped[5]:
            y[5] = 0.0
            modes.box = _slides(modes.box, p.mu * p.m * GRAVITY, now.box)
        if stopped[6]:
            if modes.ahead:
                modes.ahead = 0.0
            else:
                modes.ahead = copysign(1.0, y[6] - y[3])
                y[6] = y[3] + modes.ahead * _most_ahead(p)
    raise AssertionError(f"no modes at {y}")


def _slides(way, most, net):
    """Which way a body slides that has just stopped, or that sticks no longer."""
    return 0.0 if way and abs(net) <= most * (1.0 + LITTLE) + 1e-15 else copysign(1.0, net)
