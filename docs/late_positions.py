"""Positions that come late: between the encoders of a gripper on an arm and its controller.

An example of docs/how_to/tandem.md: `grasp-cosim build docs/late_positions.py`. In a system it
comes after the plant: its outputs are as many communication steps old as its parameter asks for.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, NamedTuple

from block_variables import Input, Output, Parameter, check

Pair = tuple[float, float]
"""A value per finger: right, left."""

Sample = tuple[Pair, Pair]
"""Positions in m and velocities in m/s."""

SAMPLES = 101

if TYPE_CHECKING:
    Samples = tuple[Sample, ...]
else:
    Samples = tuple[(Sample,) * SAMPLES]  # so many, for C


@dataclass(frozen=True, slots=True)
class Params:
    """How late: at 1 ms a step up to 0.1 s."""

    steps: Annotated[
        int, Parameter("communication steps by which it is late", low=0, high=SAMPLES - 1)
    ] = 10

    def __post_init__(self) -> None:
        check(self)


class Inputs(NamedTuple):
    """What the encoders measure."""

    position: Annotated[Pair, Input("x_j, position of the fingertip", unit="m", nominal=0.1)] = (
        0.11,
        -0.11,
    )
    velocity: Annotated[Pair, Input("x_j', velocity of the fingertip", unit="m/s", nominal=0.1)] = (
        0.0,
        0.0,
    )


class State(NamedTuple):
    """The samples so far, the oldest first."""

    samples: Samples


class Outputs(NamedTuple):
    """What arrives."""

    late_position: Annotated[
        Pair,
        Output(
            "position of the fingertip some steps ago",
            unit="m",
            nominal=0.1,
            depends_on=set(),
            depends_initially_on={"position[j]"},
        ),
    ]
    late_velocity: Annotated[
        Pair,
        Output(
            "velocity of the fingertip some steps ago",
            unit="m/s",
            nominal=0.1,
            depends_on=set(),
            depends_initially_on={"velocity[j]"},
        ),
    ]


def initial_state(p: Params, u: Inputs) -> State:
    """It has been where it is for ever."""
    return State(((u.position, u.velocity),) * SAMPLES)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Take what is measured at the end of the step."""
    return State((*x.samples[1:], (u.position, u.velocity)))


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The sample that is so many steps old."""
    position, velocity = x.samples[-1]
    age = SAMPLES - 1.0
    for one in x.samples:
        if age == p.steps:
            position, velocity = one
        age = age - 1.0
    return Outputs(position, velocity)
