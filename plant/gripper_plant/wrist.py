"""The wrist of an arm as a position servo: where it is, X, follows its command, X_c.

    X'' = omega^2·(X_c(t - tau) - X) - 2·zeta·omega·X' + omega^2·c·(f_c1 + f_c2)    (T2)

Its acceleration and its speed stay within limits. Equations: plant/README.md
"""

from dataclasses import dataclass
from functools import cached_property
from math import copysign, cos, exp, expm1, pi, sin, sqrt
from typing import Annotated

from block_variables import Group, Parameter, check

from .friction import Motion

Matrix = tuple[float, float, float, float]
"""A 2 x 2 matrix, row by row."""


@dataclass(frozen=True)  # no slots: what is worked out from the parameters is kept
class Wrist(Group, name="wrist"):
    """An arm as it is sold: 2 to 15 Hz; stiff by default, without a delay and without limits."""

    bandwidth: Annotated[
        float,
        Parameter(
            "omega/(2·pi), natural frequency of the wrist's servo",
            unit="Hz",
            low=0.1,
            high=1000.0,
            tunable=True,
        ),
    ] = 5.0
    damping_ratio: Annotated[
        float,
        Parameter(
            "zeta, damping ratio of the wrist's servo", unit="1", low=0.0, high=10.0, tunable=True
        ),
    ] = 1.0
    compliance: Annotated[
        float,
        Parameter(
            "c, way by which the wrist gives under a force", unit="m/N", low=0.0, high=1.0,
            tunable=True,
        ),
    ] = 0.0  # fmt: skip
    delay: Annotated[
        float, Parameter("tau, delay of the command to the wrist", unit="s", low=0.0, high=10.0)
    ] = 0.0
    speed_limit: Annotated[
        float,
        Parameter(
            "highest speed of the wrist; 0 is no limit", unit="m/s", low=0.0, high=100.0,
            tunable=True,
        ),
    ] = 0.0  # fmt: skip
    acceleration_limit: Annotated[
        float,
        Parameter(
            "highest acceleration of the wrist; 0 is no limit", unit="m/s2", low=0.0, high=1e4,
            tunable=True,
        ),
    ] = 0.0  # fmt: skip

    def __post_init__(self) -> None:
        check(self, "wrist")

    @cached_property
    def omega(self) -> float:
        """The natural frequency, rad/s."""
        return 2.0 * pi * self.bandwidth

    @cached_property
    def rate(self) -> float:
        """What a sub-step must resolve where a limit may cut the motion, 1/s; 0 without limits."""
        if self.speed_limit == 0.0 and self.acceleration_limit == 0.0:
            return 0.0
        return self.omega * max(1.0, 2.0 * self.damping_ratio)

    @cached_property
    def mobility(self) -> float:
        """Acceleration by a force on the fingers, 1/kg."""
        return self.omega * self.omega * self.compliance


def transition(p: Wrist, d: float) -> Matrix:
    """How the servo's deviation from its rest and its rate change within d seconds, exactly.

    With sigma = zeta·omega and r = sqrt(sigma^2 - omega^2)

        exp(-sigma·d) · [ cosh(r·d) + sigma·S     S                    ]       S = sinh(r·d) / r
                        [ -omega^2·S              cosh(r·d) - sigma·S  ]
    """
    sigma = p.damping_ratio * p.omega
    omega2 = p.omega * p.omega
    r2 = sigma * sigma - omega2
    if r2 > 0.0:
        r = sqrt(r2)
        slow = exp(-omega2 / (sigma + r) * d)
        s = -slow * expm1(-2.0 * r * d) / (2.0 * r)
        c = 0.5 * slow * (1.0 + exp(-2.0 * r * d))
    elif r2 < 0.0:
        r = sqrt(-r2)
        c = exp(-sigma * d) * cos(r * d)
        s = exp(-sigma * d) * sin(r * d) / r
    else:
        c = exp(-sigma * d)
        s = c * d
    return c + sigma * s, s, -omega2 * s, c - sigma * s


def follow(p: Wrist, a: Matrix, x: Motion, command: float, push: float, d: float) -> Motion:
    """The wrist after the transition `a` of d seconds, command in m and push f_c1 + f_c2 in N held.

    Where a limit cuts the motion the acceleration is held: its mean without limits, cut.
    """
    position, velocity = x
    a_11, a_12, a_21, a_22 = a
    rest_position = command + p.compliance * push  # (T2) with X'' = X' = 0
    deviation = position - rest_position
    unlimited = (
        rest_position + a_11 * deviation + a_12 * velocity,
        a_21 * deviation + a_22 * velocity,
    )
    unlimited_acceleration = (unlimited[1] - velocity) / d
    acceleration_limit = p.acceleration_limit
    acceleration = (
        copysign(acceleration_limit, unlimited_acceleration)
        if acceleration_limit > 0.0 and abs(unlimited_acceleration) > acceleration_limit
        else unlimited_acceleration
    )
    next_velocity = velocity + acceleration * d
    speed_limit = p.speed_limit
    if acceleration_limit > 0.0 and speed_limit > 0.0:  # one that has been lowered is braked to
        speed_limit = max(speed_limit, abs(velocity) - acceleration_limit * d)
    if speed_limit > 0.0 and abs(next_velocity) > speed_limit:
        return _up_to_speed(x, acceleration, copysign(speed_limit, next_velocity), d)
    if acceleration == unlimited_acceleration:
        return unlimited
    return position + 0.5 * d * (velocity + next_velocity), next_velocity


def acceleration_bound(p: Wrist, x: Motion, command: float) -> float:
    """The most that the wrist accelerates under a held command in m, without a push, m/s^2."""
    position, velocity = x
    bound = p.omega * (p.omega * abs(command - position) + 2.0 * p.damping_ratio * abs(velocity))
    return min(bound, p.acceleration_limit) if p.acceleration_limit > 0.0 else bound


def _up_to_speed(x: Motion, acceleration: float, fastest: float, d: float) -> Motion:
    """A held acceleration until the wrist is as fast as it may be, in m/s, and no further."""
    position, velocity = x
    if acceleration == 0.0:
        return position + d * velocity, velocity
    until = min(d, max(0.0, (fastest - velocity) / acceleration))
    return position + 0.5 * until * (velocity + fastest) + (d - until) * fastest, fastest
