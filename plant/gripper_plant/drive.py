"""The drive of a gripper whose fingers move in tandem: a force, or a speed servo with its limit.

    force    F as it is commanded
    speed    v_r' = F/M,  force of the motor  M·omega_d·(v_r - w')

So a speed servo moves as the fingers would under F without friction; what holds them up, it works
against up to its limit. v_r runs no further ahead of w' than that limit makes use of.
Equations: plant/README.md
"""

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from math import pi
from typing import Annotated

from block_variables import Group, Parameter, check

from .friction import Law, coulomb


class Kind(IntEnum):
    """What the drive is commanded: a force, or a speed."""

    FORCE = 1
    SPEED = 2


@dataclass(frozen=True)  # no slots: what is worked out from the parameters is kept
class Drive(Group, name="drive"):
    """A force by default, without limit and friction, as the paper's fingers have it."""

    kind: Annotated[
        Kind, Parameter("the drive brings up a force, or a speed servo does", tunable=True)
    ] = Kind.FORCE
    bandwidth: Annotated[
        float,
        Parameter(
            "omega_d/(2·pi), bandwidth of the speed servo",
            unit="Hz",
            low=0.1,
            high=1000.0,
            tunable=True,
        ),
    ] = 10.0
    force_limit: Annotated[
        float,
        Parameter(
            "largest force of the drive, either way; 0 is no limit",
            unit="N",
            low=0.0,
            high=1e6,
            tunable=True,
        ),
    ] = 0.0
    friction: Annotated[
        float,
        Parameter("Coulomb friction of the drive", unit="N", low=0.0, high=1e3, tunable=True),
    ] = 0.0

    def __post_init__(self) -> None:
        check(self, "drive")
        if self.kind == Kind.SPEED and self.force_limit == 0.0:
            raise ValueError(
                f"drive.force_limit = {self.force_limit!r} N: must be above 0 with drive.kind = "
                "speed, as it is the force of the grasp"
            )

    @cached_property
    def law(self) -> Law:
        """The friction as a law."""
        return coulomb(self.friction)

    @cached_property
    def omega(self) -> float:
        """How fast the speed servo is, 1/s; 0 where there is none."""
        return 2.0 * pi * self.bandwidth if self.kind == Kind.SPEED else 0.0


def limited(p: Drive, f: float) -> float:
    """A force in N as the drive brings it up."""
    limit = p.force_limit
    return min(max(f, -limit), limit) if limit > 0.0 else f


def force(p: Drive, mass: float, commanded: float, reference: float, speed: float) -> float:
    """The drive's force in N at the mean reference v_r and the mean speed w' in m/s."""
    if p.kind == Kind.FORCE:
        return limited(p, commanded)
    return limited(p, mass * p.omega * (reference - speed))


def reference(
    p: Drive, mass: float, commanded: float, previous: float, speed: float, d: float
) -> float:
    """v_r in m/s d seconds later, the commanded F in N held, the gripper at w' in m/s by then."""
    if p.kind == Kind.FORCE:
        return speed
    ahead = p.force_limit / (mass * p.omega)
    return min(max(previous + d * commanded / mass, speed - ahead), speed + ahead)
