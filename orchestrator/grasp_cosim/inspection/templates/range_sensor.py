"""An optical range sensor: the brighter, the nearer, behind a low-pass.

    xi_0 = K·alpha / (l + l_0)^n
    T·xi' = xi_0 - xi

The low-pass is advanced exactly for a gap that is held over the step.
"""

from dataclasses import dataclass
from math import exp
from typing import Annotated, NamedTuple

from block_variables import Input, Output, Parameter, check


@dataclass(frozen=True, slots=True)
class Params:
    """Each with its meaning, unit and range; check() refuses what is out of it."""

    scale: Annotated[float, Parameter("K, size of the law for l in m", low=0.0, high=1.0)] = 0.0024
    exponent: Annotated[float, Parameter("n, how fast it falls", low=0.1, high=4.0)] = 1.1506
    offset_distance: Annotated[
        float, Parameter("l_0, from the face to the element", unit="m", low=1e-6, high=1.0)
    ] = 0.005
    reflectance: Annotated[
        float, Parameter("alpha, relative to white", low=0.0, high=10.0, tunable=True)
    ] = 1.0
    time_constant: Annotated[
        float, Parameter("T, of the low-pass", unit="s", low=1e-6, high=10.0, tunable=True)
    ] = 1e-3

    def __post_init__(self) -> None:
        check(self)


class Inputs(NamedTuple):
    """Each with its start value; nominal is the size that it usually has."""

    gap: Annotated[
        float, Input("l, to the surface; inf for nothing", unit="m", nominal=0.1, infinite=True)
    ] = 0.1


class State(NamedTuple):
    """Whatever step() needs to go on from; floats, booleans, integers, and tuples of them."""

    intensity: float


class Outputs(NamedTuple):
    """Each with the inputs it depends on without a step, and in initialisation mode."""

    intensity: Annotated[
        float,
        Output("xi", unit="V", nominal=0.1, depends_on=set(), depends_initially_on={"gap"}),
    ]


def initial_state(p: Params, u: Inputs) -> State:
    """The low-pass has settled."""
    return State(_optics(p, u.gap))


def step(p: Params, s: State, u: Inputs, h: float) -> State:
    """Advance by h seconds (h > 0), u held."""
    new = _optics(p, u.gap)
    return State(new + (s.intensity - new) * exp(-h / p.time_constant))


def outputs(p: Params, s: State, u: Inputs) -> Outputs:
    """The outputs, as the controller sees them."""
    return Outputs(s.intensity)


def _optics(p: Params, gap: float) -> float:
    intensity: float = p.scale * p.reflectance / (max(gap, 0.0) + p.offset_distance) ** p.exponent
    return intensity
