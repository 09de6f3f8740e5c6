"""The variables of a mass that is pushed, with a fault on demand; hand_written.h has the rest."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from block_variables import Input, Output, Parameter, check

LONGEST_STEP = 1.0


@dataclass(frozen=True)
class Params:
    """Of the mass."""

    mass: Annotated[float, Parameter("m", unit="kg", low=1e-3, high=1e3)] = 0.5
    gain: Annotated[float, Parameter("K", unit="1", low=0.0, high=10.0, tunable=True)] = 1.0
    start: Annotated[float, Parameter("x_0", unit="m")] = 0.0
    seed: Annotated[int, Parameter("seed", low=0, high=2147483647)] = 1
    fault: Annotated[int, Parameter("what goes wrong", low=0, high=3, tunable=True)] = 0
    noisy: Annotated[bool, Parameter("has noise")] = False

    def __post_init__(self):
        check(self)
        if self.noisy and self.seed == 0:
            raise ValueError("seed = 0: must be above 0 with noise, 100 %")


class Inputs(NamedTuple):
    """Of the mass."""

    force: Annotated[float, Input("F", unit="N", nominal=1.0)] = 0.0
    held: Annotated[bool, Input("does not move")] = False


class Outputs(NamedTuple):
    """Of the mass."""

    position: Annotated[float, Output("x", unit="m", nominal=1.0, depends_on=set())]
    velocity: Annotated[float, Output("v", unit="m/s", nominal=1.0, depends_on=set())]
    moves: Annotated[bool, Output("moves", depends_on=set(), depends_initially_on={"held"})]
