"""GripperPlant with an object that moves at a constant speed, whatever pushes it.

docs/explanation/limits.md uses this example.

Seen from the object it is at rest, and the fingers have the same forces and accelerations, Eq. (1):
the plant of the package does it, in the frame of the object. Friction of the fingers would not, as
it goes by their speed at the wrist; so there is none.
"""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from block_variables import Parameter
from gripper_plant import fingers, rigid
from gripper_plant.rigid import LONGEST_STEP as LONGEST_STEP
from gripper_plant.rigid import Inputs as Inputs
from gripper_plant.rigid import Outputs as Outputs


@dataclass(frozen=True)
class Params(rigid.Params):
    """Those of GripperPlant, and the speed of the object, to the right."""

    object_velocity: Annotated[
        float, Parameter("v, speed of the object", unit="m/s", low=-1.0, high=1.0)
    ] = 0.0

    def __post_init__(self) -> None:
        fingers.Params.__post_init__(self)
        rub = self.friction
        if max(*rub.coulomb, *rub.static, *rub.viscous) > 0.0:
            raise ValueError("friction: must be 0, with an object that moves")


class State(NamedTuple):
    """The fingers as the object sees them, and its way in m since the start."""

    seen: rigid.State
    way: float


def initial_state(p: Params, u: Inputs) -> State:
    """Both fingers at rest: the object sees them come with its own speed."""
    at_rest = rigid.initial_state(p, u)
    return State(at_rest._replace(velocity=(-p.object_velocity, -p.object_velocity)), 0.0)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance by h seconds."""
    return State(rigid.step(p, x.seen, u, h), x.way + p.object_velocity * h)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The outputs, as the wrist sees them."""
    y = rigid.outputs(p, x.seen, u)
    (x_1, x_2), (v_1, v_2) = y.position, y.velocity
    return y._replace(
        position=(x_1 + x.way, x_2 + x.way),
        velocity=(v_1 + p.object_velocity, v_2 + p.object_velocity),
        object_position=y.object_position + x.way,
    )
