"""A hand of N fingers, each with its own target, tied by balance weights: N is all that changes."""

from dataclasses import dataclass
from functools import cached_property
from math import tanh
from typing import TYPE_CHECKING, Annotated, NamedTuple

from block_variables import Input, Output, Parameter, check
from grasp_controller import contact_force as layer_1
from grasp_controller import impact_reduction, impedance
from grasp_controller.impedance import Motion

N = 3


class Line(NamedTuple):
    intensity: float
    way: float

    @property
    def bright(self) -> float:
        return max(0.0, self.intensity)


if TYPE_CHECKING:
    Each = tuple[float, ...]
    Motions = tuple[Motion, ...]
    Lines = tuple[Line, ...]
else:
    Each = tuple[(float,) * N]
    Motions = tuple[(Motion,) * N]
    Lines = tuple[(Line,) * N]


@dataclass(frozen=True)
class Params:
    weight: Annotated[Each, Parameter("n_k", unit="1", low=0.01, high=10.0)] = (1.0,) * N
    gain: Annotated[float, Parameter("K_s", unit="N", low=-10.0, high=10.0, tunable=True)] = 3.0
    target: impact_reduction.Params = impact_reduction.Params()
    contact_force: layer_1.Params = layer_1.Params()

    def __post_init__(self) -> None:
        check(self)
        if not 0.5 < self.total / N < 3.0:
            raise ValueError(
                f"weight[1] = {self.weight[0]!r}: mean {self.total / N:g}: must be near 1"
            )

    @cached_property
    def total(self) -> float:
        found = 0.0
        for n in self.weight:
            found += n
        return found


class Inputs(NamedTuple):
    position: Annotated[Each, Input("s_k", unit="m", nominal=0.1)] = (0.11,) * N
    velocity: Annotated[Each, Input("s_k'", unit="m/s", nominal=0.1)] = (0.0,) * N
    intensity: Annotated[Each, Input("xi_k", unit="V", nominal=0.1)] = (0.03,) * N


class State(NamedTuple):
    target: Motions
    line: Lines
    force: Each
    seen: Each
    settled: Each


class Outputs(NamedTuple):
    force: Annotated[Each, Output("u_k", nominal=1.0, depends_on={"position", "velocity[j]"})]
    target_position: Annotated[Each, Output("z_k", unit="m", nominal=0.1, depends_on=set())]


def initial_state(p: Params, u: Inputs) -> State:
    target = tuple((s, 0.0) for s in u.position)
    lines = tuple(Line(xi, s) for xi, s in zip(u.intensity, u.position, strict=True))
    return State(target, lines, (0.0,) * N, u.intensity, (0.0,) * N)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    middle = mean(p, u.position)
    lines = tuple(
        seen(line, xi, s) for line, xi, s in zip(x.line, u.intensity, u.position, strict=True)
    )
    bright = tuple(line.bright for line in lines)
    total = 0.0
    for xi in bright:
        total += xi
    phi = tuple(compared(xi, (total - xi) / (N - 1)) for xi in bright)
    forces = tuple(p.gain * (one - mean(p, phi)) for one in phi)
    a = impedance.transition(p.target.mass, p.target.damping, p.target.stiffness, h)
    target = tuple(
        moved(a, z, f / p.target.stiffness, z_d)
        for z, f, z_d in zip(x.target, forces, relative(u.position, middle), strict=True)
    )
    settled = tuple(
        0.0 if abs(now[0] - before[0]) > 1e-6 else old + h
        for now, before, old in zip(target, x.target, x.settled, strict=True)
    )
    return State(target, lines, forces, bright, settled)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    forces = tuple(
        n * layer_1.force(p.contact_force, s, v, z)
        for n, s, v, z in zip(p.weight, u.position, u.velocity, x.target, strict=True)
    )
    return Outputs(forces, tuple(position for position, _ in x.target))


def mean(p: Params, of: Each) -> float:
    found = 0.0
    for n, q in zip(p.weight, of, strict=True):
        found += n * q
    return found / p.total


def relative(of: Each, middle: float) -> Each:
    return tuple(s - middle for s in of)


def seen(line: Line, xi: float, s: float) -> Line:
    return line._replace(intensity=0.9 * line.intensity + 0.1 * xi, way=s)


def compared(xi: float, other: float) -> float:
    return 0.0 if xi + other == 0.0 else tanh((xi - other) / (xi + other))


def moved(a: impedance.Matrix, z: Motion, rest: float, z_d: float) -> Motion:
    position, velocity = z
    e, e_dot = impedance.advance(a, position - z_d, velocity, rest)
    return z_d + e, e_dot
