"""Two fingers and an object on a spring.

The object slides on a rail, and a spring and a damper hold it where it starts, at x_0:

    m·x'' = -f_c1 - f_c2 - k·(x - x_0) - d·x'
    m_j·x_j'' = u_j + f_cj

Its faces give, with the depth delta to which a fingertip has sunk in, and never pull:

    |f_cj| = max(0, k_c·delta + d_c·delta')

A sub-step holds all forces (semi-implicit Euler, first order). Fingers have no friction here.
"""

from dataclasses import dataclass
from math import ceil
from typing import Annotated, NamedTuple

from block_variables import Input, Output, Parameter, check

Pair = tuple[float, float]
"""A value per finger: right, left."""

LONGEST_STEP = 0.1
"""s; with forces held for longer, nothing of this would be right, and the sub-steps are many."""


@dataclass(frozen=True, slots=True)
class Params:
    """Each with its meaning, unit and range; check() refuses what is out of it."""

    finger_mass: Annotated[
        Pair, Parameter("m_j, mass of the finger", unit="kg", low=1e-3, high=1e3, tunable=True)
    ] = (0.5, 0.5)
    initial_position: Annotated[
        Pair,
        Parameter(
            "x_init,j, position of the fingertip at the start", unit="m", low=-10.0, high=10.0
        ),
    ] = (0.11, -0.11)
    object_width: Annotated[
        float, Parameter("W, width of the object", unit="m", low=0.0, high=10.0)
    ] = 0.07
    initial_object_position: Annotated[
        float, Parameter("x_0, centre of the object at the start", unit="m", low=-10.0, high=10.0)
    ] = 0.03
    object_mass: Annotated[
        float, Parameter("m, mass of the object", unit="kg", low=1e-3, high=1e3, tunable=True)
    ] = 0.1
    spring_stiffness: Annotated[
        float,
        Parameter(
            "k, stiffness of the spring",
            unit="N/m",
            low=0.0,
            high=1e6,
            tunable=True,
        ),
    ] = 100.0
    spring_damping: Annotated[
        float, Parameter("d, damping of the spring", unit="N.s/m", low=0.0, high=1e3, tunable=True)
    ] = 2.0
    face_stiffness: Annotated[
        float, Parameter("k_c, stiffness of a face", unit="N/m", low=1.0, high=1e6, tunable=True)
    ] = 10000.0
    face_damping: Annotated[
        float, Parameter("d_c, damping of a face", unit="N.s/m", low=0.0, high=1e4, tunable=True)
    ] = 20.0

    def __post_init__(self) -> None:
        check(self)
        right, left = self.initial_position
        x, b = self.initial_object_position, 0.5 * self.object_width
        if not left <= x - b <= x + b <= right:
            raise ValueError(f"initial_object_position = {x!r} m: must fit between the fingertips")


class Inputs(NamedTuple):
    """Each with its start value; nominal is the size that it usually has."""

    force: Annotated[Pair, Input("u_j, actuator force on the finger", unit="N", nominal=1.0)] = (
        0.0,
        0.0,
    )


class State(NamedTuple):
    """Whatever step() needs to go on from; floats, booleans, integers, and tuples of them."""

    position: Pair
    velocity: Pair
    contact_force: Pair
    object_position: float
    object_velocity: float


class Outputs(NamedTuple):
    """Each with the inputs it depends on without a step: none here, all goes through the state."""

    position: Annotated[
        Pair, Output("x_j, position of the fingertip", unit="m", nominal=0.1, depends_on=set())
    ]
    velocity: Annotated[
        Pair, Output("x_j', velocity of the fingertip", unit="m/s", nominal=0.1, depends_on=set())
    ]
    gap: Annotated[
        Pair,
        Output(
            "l_j, distance from the sensor face to the surface",
            unit="m",
            nominal=0.1,
            depends_on=set(),
        ),
    ]
    contact_force: Annotated[
        Pair,
        Output("f_cj, force of the object on the finger", unit="N", nominal=1.0, depends_on=set()),
    ]
    contact: Annotated[tuple[bool, bool], Output("the finger touches the object", depends_on=set())]
    object_position: Annotated[
        float, Output("x, centre of the object", unit="m", nominal=0.1, depends_on=set())
    ]
    spring_force: Annotated[
        float, Output("-k·(x - x_0) - d·x', on the object", unit="N", nominal=1.0, depends_on=set())
    ]


def initial_state(p: Params, u: Inputs) -> State:
    """All at rest."""
    return State(p.initial_position, (0.0, 0.0), (0.0, 0.0), p.initial_object_position, 0.0)


def step(p: Params, s: State, u: Inputs, h: float) -> State:
    """Advance by h seconds (h > 0), u held, in sub-steps that resolve the faces and the spring."""
    lightest = min(*p.finger_mass, p.object_mass)
    stiffness = 2.0 * p.face_stiffness + p.spring_stiffness
    damping = 2.0 * p.face_damping + p.spring_damping
    rate = max((stiffness / lightest) ** 0.5, damping / lightest)
    n = max(1, ceil(10.0 * rate * h))
    for _ in range(n):
        s = _substep(p, s, u, h / n)
    return s


def outputs(p: Params, s: State, u: Inputs) -> Outputs:
    """The outputs, as the sensors see them."""
    gap_1, gap_2 = _gaps(p, s)
    return Outputs(
        s.position,
        s.velocity,
        (max(0.0, gap_1), max(0.0, gap_2)),
        s.contact_force,
        (gap_1 <= 0.0, gap_2 <= 0.0),
        s.object_position,
        _spring(p, s),
    )


def _substep(p: Params, s: State, u: Inputs, d: float) -> State:
    (x_1, x_2), (v_1, v_2) = s.position, s.velocity
    x, v = s.object_position, s.object_velocity
    gap_1, gap_2 = _gaps(p, s)
    f_1, f_2 = _push(p, gap_1, v_1 - v), -_push(p, gap_2, v - v_2)
    v_1 += d * (u.force[0] + f_1) / p.finger_mass[0]
    v_2 += d * (u.force[1] + f_2) / p.finger_mass[1]
    v += d * (_spring(p, s) - f_1 - f_2) / p.object_mass
    return State((x_1 + d * v_1, x_2 + d * v_2), (v_1, v_2), (f_1, f_2), x + d * v, v)


def _gaps(p: Params, s: State) -> Pair:
    (x_1, x_2), b = s.position, 0.5 * p.object_width
    return x_1 - s.object_position - b, s.object_position - b - x_2


def _push(p: Params, gap: float, rate: float) -> float:
    """Force of a face on a fingertip at a gap in m that grows by rate in m/s, in N."""
    return max(0.0, -p.face_stiffness * gap - p.face_damping * rate) if gap < 0.0 else 0.0


def _spring(p: Params, s: State) -> float:
    x = s.object_position - p.initial_object_position
    return -p.spring_stiffness * x - p.spring_damping * s.object_velocity
