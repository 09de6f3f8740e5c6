"""Ambient light: the raw voltage has an offset, c = 0.35 V as in the paper's fit, Sec. IV.A.

It may drift after the calibration, with which the run begins. Card: sensor/README.md
"""

from dataclasses import dataclass
from typing import Annotated

from block_variables import Group, Parameter


@dataclass(frozen=True, slots=True)
class Params(Group, name="ambient"):
    """The offset, and what becomes of it."""

    enabled: Annotated[bool, Parameter("offset by ambient light, and its compensation")] = False
    offset: Annotated[
        float, Parameter("c, offset at the calibration", unit="V", low=-10.0, high=10.0)
    ] = 0.35
    calibration_error: Annotated[
        float,
        Parameter("what the calibration missed of the offset", unit="V", low=-10.0, high=10.0),
    ] = 0.0
    drift: Annotated[
        float,
        Parameter("rate of the offset after the calibration", unit="V/s", low=-10.0, high=10.0),
    ] = 0.0


def voltage(p: Params, t: float) -> float:
    """The offset in V, t s after the calibration; before it, the one that was there then."""
    there = p.offset + p.calibration_error
    return there + p.drift * t if t > 0.0 else there
