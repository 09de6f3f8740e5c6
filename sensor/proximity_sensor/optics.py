"""Reflected-light-intensity (O-RLI) proximity sensor, Eq. (9):  xi = K·alpha / (l + l_0)^n.

The output is offset-compensated: zero when nothing is near. Card: sensor/README.md
"""

from dataclasses import dataclass
from typing import Annotated, NamedTuple, get_type_hints


@dataclass(frozen=True, slots=True)
class Params:
    """Parameters; a value outside its declared range raises ValueError."""

    reflectance: Annotated[
        float, "1", "alpha, reflectance of the surface relative to white", (0.0, 10.0), "tunable"
    ] = 1.0
    gain: Annotated[float, "V.m^n", "K = G·psi, fitted to the white surface", (0.0, 1e6)] = 0.0024
    diffusion_exponent: Annotated[float, "1", "n, diffusion exponent", (0.1, 10.0)] = 1.1506
    offset_distance: Annotated[
        float, "m", "l_0, from the sensor face to the sensing element", (1e-6, 1.0)
    ] = 0.005

    def __post_init__(self) -> None:
        for name, hint in get_type_hints(Params, include_extras=True).items():
            unit, _, (low, high), *_ = hint.__metadata__
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"{name} = {value!r} {unit}: must be from {low:g} to {high:g}")

    @property
    def alpha(self) -> float:
        """The reflectance that counts."""
        return self.reflectance


class Inputs(NamedTuple):
    """What the sensor looks at."""

    gap: Annotated[float, "m", "l, distance from the sensor face to the object surface", 0.1] = 0.1


class State(NamedTuple):
    """The optics have no memory."""


class Outputs(NamedTuple):
    """What the sensor delivers."""

    intensity: Annotated[float, "V", "xi, offset-compensated output", 0.1, {"gap"}]


def initial_state(p: Params, u: Inputs) -> State:
    """Nothing to remember."""
    return State()


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Nothing changes by itself in h seconds."""
    return x


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """Eq. (9). The spacer keeps the object off the element: a gap below zero reads as zero."""
    l = 0.0 if u.gap < 0.0 else u.gap
    return Outputs(p.gain * p.alpha / (l + p.offset_distance) ** p.diffusion_exponent)
