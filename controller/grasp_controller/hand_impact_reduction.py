"""Layer 2 of a hand: that of impact_reduction.py, with one viscosity for all fingers."""

from dataclasses import dataclass
from typing import Annotated

from block_variables import Parameter

from . import impact_reduction
from .impact_reduction import follow as follow
from .impact_reduction import virtual_force as virtual_force


@dataclass(frozen=True, slots=True)
class Params(impact_reduction.Gains, name="impact_reduction"):
    """The paper's gains; all fingers count their way in the direction in which they open."""

    viscosity: Annotated[
        float,
        Parameter(
            "D_p, viscosity of the virtual force", unit="N.s", low=-1e3, high=1e3, tunable=True
        ),
    ] = 0.6
    intensity_floor: impact_reduction.Floor = 1e-6
