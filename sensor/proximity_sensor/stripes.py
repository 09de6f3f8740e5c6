"""A striped surface: the reflectance changes along the approach. Card: sensor/README.md."""

from dataclasses import dataclass
from math import floor
from typing import Annotated

from block_variables import Group, Parameter


@dataclass(frozen=True, slots=True)
class Params(Group, name="pattern"):
    """The ratio is that of the paper's black paper to the white one; the lengths have no source."""

    enabled: Annotated[
        bool, Parameter("the surface is striped along the approach", tunable=True)
    ] = False
    ratio: Annotated[
        float,
        Parameter(
            "reflectance of every other stripe relative to the first",
            unit="1",
            low=0.0,
            high=1e3,
            tunable=True,
        ),
    ] = 0.57
    period: Annotated[
        float,
        Parameter(
            "length of two stripes along the gap", unit="m", low=1e-6, high=10.0, tunable=True
        ),
    ] = 0.02
    phase: Annotated[
        float,
        Parameter(
            "gap at the middle of a first stripe", unit="m", low=-10.0, high=10.0, tunable=True
        ),
    ] = 0.0
    edge: Annotated[
        float,
        Parameter(
            "length over which stripes blend, a spot of light",
            unit="m",
            low=1e-9,
            high=1.0,
            tunable=True,
        ),
    ] = 0.002


def factor(p: Params, l: float) -> float:
    """The reflectance at a gap of l m relative to that of the first stripes."""
    turns = (l - p.phase) / p.period
    from_middle = abs(turns - floor(turns) - 0.5)
    first = 0.5 + (from_middle - 0.25) * p.period / p.edge
    first = 0.0 if first < 0.0 else 1.0 if first > 1.0 else first
    return first + (1.0 - first) * p.ratio
