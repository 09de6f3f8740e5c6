r"""Position control that switches at contact: each finger closes at a speed until it is stopped.

A servo moves the reference x_r of each finger with the closing speed, and the finger follows it:

```math
u_j = k\,(x_{rj} - x_j) + d\,(\dot{x}_{rj} - \dot{x}_j)
```

A finger that needs more than the touch force has touched, and its reference stops there. When both
have, the controller switches to the grip force, damped by d. So no sensor is needed, and nothing
slows down before the contact. The input `intensity` is there to be in the place of GraspController.
"""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from block_variables import Input, Output, Parameter, check

Pair = tuple[float, float]
"""A value per finger: right, left."""


@dataclass(frozen=True, slots=True)
class Params:
    """Half the speed of a gripper on the market, and a servo for fingers of 0.5 kg."""

    closing_speed: Annotated[
        float, Parameter("speed at which a finger closes", unit="m/s", low=1e-3, high=1.0)
    ] = 0.05
    acceleration: Annotated[
        float, Parameter("with which it begins", unit="m/s2", low=0.01, high=100.0)
    ] = 0.2
    stiffness: Annotated[
        float, Parameter("k, stiffness of the servo", unit="N/m", low=1.0, high=1e5)
    ] = 200.0
    damping: Annotated[
        float, Parameter("d, damping of the servo", unit="N.s/m", low=0.0, high=1e4)
    ] = 20.0
    touch_force: Annotated[
        float, Parameter("force from which a finger has touched", unit="N", low=0.01, high=1e3)
    ] = 0.5
    grip_force: Annotated[
        float, Parameter("force of each finger on the object", unit="N", low=0.0, high=1e3)
    ] = 3.0

    def __post_init__(self) -> None:
        check(self)


class Inputs(NamedTuple):
    """Samples of the gripper."""

    position: Annotated[Pair, Input("x_j, position of the fingertip", unit="m", nominal=0.1)] = (
        0.11,
        -0.11,
    )
    velocity: Annotated[Pair, Input("x_j', velocity of the fingertip", unit="m/s", nominal=0.1)] = (
        0.0,
        0.0,
    )
    intensity: Annotated[Pair, Input("not used", unit="V", nominal=0.1)] = (0.0, 0.0)


class State(NamedTuple):
    """The references in m, their closing speed in m/s, and which finger has touched."""

    reference: Pair
    speed: float
    touched: tuple[bool, bool]


class Outputs(NamedTuple):
    """To the plant."""

    force: Annotated[
        Pair,
        Output(
            "u_j, actuator force on the finger",
            unit="N",
            nominal=1.0,
            depends_on={"position[j]", "velocity[j]"},
        ),
    ]


def initial_state(p: Params, u: Inputs) -> State:
    """At rest where the fingers are."""
    return State(u.position, 0.0, (False, False))


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Move the references of the fingers that have not touched by h seconds."""
    speed = min(p.closing_speed, x.speed + h * p.acceleration)
    u_1, u_2 = _servo(p, x, u)
    touched_1 = x.touched[0] or abs(u_1) > p.touch_force
    touched_2 = x.touched[1] or abs(u_2) > p.touch_force
    way = 0.5 * h * (x.speed + speed)
    r_1, r_2 = x.reference
    r_1 = u.position[0] if touched_1 and not x.touched[0] else r_1
    r_2 = u.position[1] if touched_2 and not x.touched[1] else r_2
    reference = (r_1 if touched_1 else r_1 - way, r_2 if touched_2 else r_2 + way)
    return State(reference, speed, (touched_1, touched_2))


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """Of the servos, or of the grip once both fingers have touched."""
    if x.touched[0] and x.touched[1]:
        v_1, v_2 = u.velocity
        return Outputs((-p.grip_force - p.damping * v_1, p.grip_force - p.damping * v_2))
    return Outputs(_servo(p, x, u))


def _servo(p: Params, x: State, u: Inputs) -> Pair:
    """U_j in N with which the fingers follow their references."""
    (r_1, r_2), (touched_1, touched_2) = x.reference, x.touched
    (x_1, x_2), (v_1, v_2) = u.position, u.velocity
    speed_1 = 0.0 if touched_1 else -x.speed
    speed_2 = 0.0 if touched_2 else x.speed
    return (
        p.stiffness * (r_1 - x_1) + p.damping * (speed_1 - v_1),
        p.stiffness * (r_2 - x_2) + p.damping * (speed_2 - v_2),
    )
