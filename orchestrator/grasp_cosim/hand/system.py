"""A hand as a system: the text of its file, and the system that it is."""

import warnings
from collections.abc import Mapping, Sequence
from math import radians
from pathlib import Path
from string import Template
from tempfile import TemporaryDirectory

from ..base.errors import InputError
from ..fmu_export.build import shipped_fmus
from ..fmu_export.shipped import FEWEST, MOST
from ..grasp.system import with_controller
from ..system.description import System
from .weights import MIN_WEIGHT, balance_weights

TEMPLATE = Path(__file__).parent / "hand.toml.in"
FILE = "hand.toml"

DEFAULT_FINGERS = 3
"""Fingers of the FMUs that come with the package, which have no number in their names."""

CONNECTIONS = (
    ("plant.gap[{k}]", "sensor_{k}.gap"),
    ("plant.position[{k}]", "controller.position[{k}]"),
    ("plant.velocity[{k}]", "controller.velocity[{k}]"),
    ("sensor_{k}.intensity", "controller.intensity[{k}]"),
    ("controller.force[{k}]", "plant.force[{k}]"),
)
"""Source and target of the connections of finger k."""

ELECTRONICS = ("ambient", "noise", "adc", "filter", "median")
"""What a sensor has in addition to its optics."""


def hand_system(
    fingers: int | None = None,
    angles: Sequence[float] | None = None,
    controller: str = "published",
    native: bool | None = None,
) -> System:
    """Make a hand of 2 to 8 fingers.

    Its FMUs are in the user's cache, built first if need be. A warning tells where one of the
    fingers hardly takes part.

    Args:
        fingers: How many; by default as many as there are angles, else three.
        angles: The direction of each finger in degrees; by default evenly around.
        controller: The law: "published", or "adaptive", which minds no colours.
        native: Which FMUs run: see System.natively().

    Returns:
        The system.

    Raises:
        InputError: The fingers cannot hold an object, there is no such law, or the FMUs cannot be
            built.

    Example:
        >>> from grasp_cosim import hand_system
        >>> len(hand_system(3).by_name)
        5
    """
    directions = directions_of(fingers, angles)
    if note := faint(directions):
        warnings.warn(note, stacklevel=2)
    with TemporaryDirectory() as folder:
        file = Path(folder, FILE)
        file.write_text(hand_text(directions), "utf-8")
        system = System.load(file, fmus_of(len(directions)))
    chosen = system if controller == "published" else with_controller(system, controller)
    return chosen.natively(native)


def directions_of(fingers: int | None, angles: Sequence[float] | None) -> tuple[float, ...]:
    """The directions in degrees of a hand; InputError where they do not go together, or hold."""
    if fingers is not None:
        count = fingers
    elif angles is not None:
        count = len(angles)
    else:
        count = DEFAULT_FINGERS
    is_whole = isinstance(count, int) and not isinstance(count, bool)
    if not is_whole or not FEWEST <= count <= MOST:
        raise InputError(f"fingers = {count!r}: must be a whole number from {FEWEST} to {MOST}")
    if angles is None:
        directions = tuple(360.0 * k / count for k in range(count))
    elif len(angles) != count:
        raise InputError(f"angles: there are {len(angles)}; must be {count}, one for each finger")
    else:
        directions = tuple(float(angle) for angle in angles)
    for angle in directions:
        if not -360.0 <= angle <= 360.0:
            raise InputError(f"angles: {angle:g} degrees: must be from -360 to 360")
    balance_weights(directions)
    return directions


def faint(directions: Sequence[float]) -> str:
    """A warning on a finger that hardly takes part, or ""."""
    weights = balance_weights(directions)
    smallest = min(weights)
    if smallest >= MIN_WEIGHT:
        return ""
    k = weights.index(smallest)
    return (
        f"finger {k + 1} at {directions[k]:g} degrees has a weight of {smallest:.3g}: it is soft, "
        f"and touches late; with directions that are more even no weight is below {MIN_WEIGHT:g}"
    )


def hand_values(directions: Sequence[float]) -> dict[str, float]:
    """The directions in rad and the weights that balance them, by their places in the system.

    So they change together: `system.with_values(hand_values((0, 90, 225)))`, or a row of a sweep.
    The directions are in degrees; InputError where they cannot hold.
    """
    weights = enumerate(balance_weights(directions), start=1)
    return {
        **{f"plant.angle[{k}]": radians(a) for k, a in enumerate(directions, start=1)},
        **{f"controller.weight[{k}]": n for k, n in weights},
    }


def sized(fingers: int) -> int | None:
    """The number in the names of the FMUs of a hand; None where they have none."""
    return None if fingers == DEFAULT_FINGERS else fingers


def fmus_of(fingers: int) -> Path:
    """The folder of the FMUs of a hand that Python runs, built if need be."""
    return shipped_fmus(sized(fingers))


def hand_text(directions: Sequence[float]) -> str:
    """The text of the system file of a hand, whose FMUs are next to it; directions in degrees."""
    fingers = range(1, len(directions) + 1)
    values = hand_values(directions)
    template = Template(TEMPLATE.read_text("utf-8"))
    return template.substitute(
        fingers=len(directions),
        suffix=sized(len(directions)) or "",
        connections=_connection_lines(fingers),
        degrees=", ".join(f"{angle:g}" for angle in directions),
        angles=_value_lines("plant", values),
        weights=_value_lines("controller", values),
        sensors="\n".join(map(_sensor_table, fingers)),
        bench="\n".join(map(_electronics_lines, fingers)),
    )


def _connection_lines(fingers: Sequence[int]) -> str:
    """The connections of all fingers, those of one quantity together."""
    lines = []
    for source, target in CONNECTIONS:
        for k in fingers:
            lines.append(f'  "{source.format(k=k)} -> {target.format(k=k)}",')
    return "\n".join(lines)


def _value_lines(component: str, values: Mapping[str, float]) -> str:
    """The start values of a component, a line each."""
    lines = []
    for place, value in values.items():
        name, _, variable = place.partition(".")
        if name == component:
            lines.append(f'"{variable}" = {value!r}')
    return "\n".join(lines)


def _sensor_table(k: int) -> str:
    """The component of the sensor of finger k."""
    return f'[components.sensor_{k}]\nfmu = "ProximitySensor.fmu"\n'


def _electronics_lines(k: int) -> str:
    """The values of the preset that switch on the electronics of the sensor of finger k."""
    lines = [f'"sensor_{k}.{part}.enabled" = true' for part in ELECTRONICS]
    return "\n".join([*lines, f'"sensor_{k}.noise.seed" = {k}'])
