"""What a surface that gives does to a finger: Kelvin-Voigt or Hunt-Crossley, never a pull.

Both are f_c = max(0, k·delta^n·(1 + lambda·delta') + c·delta') at the depth delta > 0, with
lambda = 0 or c = 0. Equations: plant/README.md
"""

from dataclasses import dataclass
from functools import cached_property
from math import pow as power
from math import sqrt
from typing import TYPE_CHECKING, Annotated

from block_variables import Group, Parameter

Law = tuple[float, float, float, float]
"""k in N/m^n, n, c in N.s/m, lambda in s/m."""

SHORT_TRAVEL = 1e-5
"""Travel in a sub-step, relative to the depth, for which stored energies differ too little."""

MAX_RESOLVED_DEPTH = 0.1
"""m; a finger that sinks in deeper is not resolved any better."""

FORCE_TOLERANCE = 1e-11
"""Relative change of a contact force below which an iteration has found it."""


@dataclass(frozen=True, slots=True)
class KelvinVoigt(Group, name="kelvin_voigt"):
    """By default a side of a paper cup: 1 N/mm, damped by a fifth of critical under 0.5 kg."""

    stiffness: Annotated[
        float,
        Parameter("k, stiffness of the surface", unit="N/m", low=1e-3, high=1e7, tunable=True),
    ] = 1000.0
    damping: Annotated[
        float, Parameter("c, damping of the surface", unit="N.s/m", low=0.0, high=1e5, tunable=True)
    ] = 10.0


@dataclass(frozen=True, slots=True)
class HuntCrossley(Group, name="hunt_crossley"):
    """By default 3.1 N are 2.9 mm deep, as in the paper cup; n = 1.5 is Hertz's, for a sphere."""

    enabled: Annotated[
        bool, Parameter("Hunt-Crossley contact; off, Kelvin-Voigt", tunable=True)
    ] = False
    stiffness: Annotated[
        float,
        Parameter("k, stiffness of the surface", unit="N/m^n", low=1e-3, high=1e9, tunable=True),
    ] = 20000.0
    exponent: Annotated[
        float, Parameter("n, exponent of the depth", unit="1", low=1.0, high=3.0, tunable=True)
    ] = 1.5
    damping: Annotated[
        float,
        Parameter(
            "lambda, damping relative to the force", unit="s/m", low=0.0, high=1e3, tunable=True
        ),
    ] = 1.0


def law(kelvin_voigt: KelvinVoigt, hunt_crossley: HuntCrossley) -> Law:
    """The law that is chosen."""
    if hunt_crossley.enabled:
        return hunt_crossley.stiffness, hunt_crossley.exponent, 0.0, hunt_crossley.damping
    return kelvin_voigt.stiffness, 1.0, kelvin_voigt.damping, 0.0


class Giving:
    """Of parameters of an object that gives."""

    if TYPE_CHECKING:  # declared, and so ordered, where the parameters are
        kelvin_voigt: KelvinVoigt
        hunt_crossley: HuntCrossley

    @cached_property
    def law(self) -> Law:
        """The contact law that is chosen."""
        return law(self.kelvin_voigt, self.hunt_crossley)


def rate(law: Law, deepest: float, m: float) -> float:
    """The fastest that m kg on the surface can do down to a depth in m, 1/s; 0 if there is none."""
    if deepest <= 0.0:
        return 0.0
    k, n, c, lam = law
    depth = min(MAX_RESOLVED_DEPTH, deepest)
    return max(sqrt(k * n * power(depth, n - 1.0) / m), (c + lam * k * power(depth, n)) / m)


def energy(law: Law, depth: float) -> float:
    """Energy stored at a depth in m, in J; none above the surface."""
    k, n, _, _ = law
    return k * power(depth, n + 1.0) / (n + 1.0) if depth > 0.0 else 0.0


def mean_force(law: Law, from_depth: float, to_depth: float, d: float) -> float:
    """f_c in N, held over d seconds in which the depth goes from one to another, in m.

    The impulse is that of the law also where the contact begins or ends on the way.
    """
    if from_depth <= 0.0 and to_depth <= 0.0:
        return 0.0
    k, n, c, lam = law
    start, end = max(0.0, from_depth), max(0.0, to_depth)
    travel = to_depth - from_depth
    if n == 1.0:
        spring = 0.5 * k * (start + end)
        if from_depth < 0.0 or to_depth < 0.0:
            spring = spring * (end - start) / travel
    elif abs(travel) <= SHORT_TRAVEL * max(start, end):
        spring = k * power(0.5 * (start + end), n)
    else:
        spring = (energy(law, to_depth) - energy(law, from_depth)) / travel
    damping = (spring * lam * travel + c * (end - start)) / d
    return max(0.0, spring + damping)  # Kelvin-Voigt: lam = 0; Hunt-Crossley: c = 0


def settled(force: float, previous: float) -> bool:
    """True if an iteration need not go on from one contact force in N to the next."""
    return abs(force - previous) <= FORCE_TOLERANCE * force
