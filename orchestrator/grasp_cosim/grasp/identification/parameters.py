"""The parameters that can be identified, by the names of the command's option --fit."""

from collections.abc import Sequence

from ...errors import InputError, nearest
from ..metrics import FINGERS
from .fit import Parameter

FRICTION = "plant.friction."

RATIO = "sensor_2.reflectance"
"""One number for the bench: what the left sensor sees of a surface over what the right one does."""

_COULOMB, _STATIC, _VISCOUS = (
    [f"{FRICTION}{name}[{j}]" for j in FINGERS] for name in ("coulomb", "static", "viscous")
)

GROUPS = {
    "coulomb": [Parameter(n, "N", 1.0, 0.0, 10.0, 1.0, 0.0) for n in _COULOMB],
    "static": [Parameter(n, "N", 1.5, 0.0, 10.0, 1.0, None) for n in _STATIC],
    "viscous": [Parameter(n, "N.s/m", 10.0, 0.0, 1000.0, 10.0, 0.0) for n in _VISCOUS],
    "stribeck": [
        Parameter(f"{FRICTION}stribeck_velocity", "m/s", 0.05, 1e-4, 1.0, 0.01, None),
    ],
    "ratio": [Parameter(RATIO, "1", 1.0, 0.2, 5.0, 0.1, 1.0)],
}
"""One parameter for each finger, or one for both; none for a row of a table."""

DEFAULT = ("coulomb", "viscous")


def chosen(groups: Sequence[str], valid: Sequence[str], place: str) -> list[Parameter]:
    """The parameters of the groups; InputError for a group that the data say nothing about."""
    for group in groups:
        if group not in valid:
            raise InputError(f"{place}: --fit {group}: cannot be fitted; {nearest(group, valid)}")
    return [p for name in GROUPS if name in groups for p in GROUPS[name]]
