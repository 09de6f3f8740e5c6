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
from .weights import LEAST, balance_weights

TEMPLATE = Path(__file__).parent / "hand.toml.in"
FILE = "hand.toml"

SHIPPED = 3
"""Fingers of the FMUs that come with the package, which have no number in their names."""

ELECTRONICS = ("ambient", "noise", "adc", "filter", "median")
"""What a sensor has besides its optics."""


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
    count = fingers if fingers is not None else SHIPPED if angles is None else len(angles)
    if isinstance(count, bool) or not isinstance(count, int) or not FEWEST <= count <= MOST:
        raise InputError(f"fingers = {count!r}: must be a whole number from {FEWEST} to {MOST}")
    if angles is not None and len(angles) != count:
        raise InputError(f"angles: there are {len(angles)}; must be {count}, one for each finger")
    found = tuple(
        map(float, (360.0 * k / count for k in range(count)) if angles is None else angles)
    )
    for angle in found:
        if not -360.0 <= angle <= 360.0:
            raise InputError(f"angles: {angle:g} degrees: must be from -360 to 360")
    balance_weights(found)
    return found


def faint(directions: Sequence[float]) -> str:
    """What is to be said of a finger that hardly takes part, or ""."""
    weights = balance_weights(directions)
    least = min(weights)
    if least >= LEAST:
        return ""
    k = weights.index(least)
    return (
        f"finger {k + 1} at {directions[k]:g} degrees has a weight of {least:.3g}: it is soft, and "
        f"touches late; with directions that are more even no weight is below {LEAST:g}"
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
    return None if fingers == SHIPPED else fingers


def fmus_of(fingers: int) -> Path:
    """The folder of the FMUs of a hand that Python runs, built if need be."""
    return shipped_fmus(sized(fingers))


def hand_text(directions: Sequence[float]) -> str:
    """The text of the system file of a hand, whose FMUs are beside it."""
    each = range(1, len(directions) + 1)
    links = [
        *((f"plant.gap[{k}]", f"sensor_{k}.gap") for k in each),
        *((f"plant.position[{k}]", f"controller.position[{k}]") for k in each),
        *((f"plant.velocity[{k}]", f"controller.velocity[{k}]") for k in each),
        *((f"sensor_{k}.intensity", f"controller.intensity[{k}]") for k in each),
        *((f"controller.force[{k}]", f"plant.force[{k}]") for k in each),
    ]
    values = hand_values(directions)
    return Template(TEMPLATE.read_text("utf-8")).substitute(
        fingers=len(directions),
        suffix=sized(len(directions)) or "",
        connections="\n".join(f'  "{source} -> {target}",' for source, target in links),
        degrees=", ".join(f"{angle:g}" for angle in directions),
        angles=_lines("plant", values),
        weights=_lines("controller", values),
        sensors="\n".join(f'[components.sensor_{k}]\nfmu = "ProximitySensor.fmu"\n' for k in each),
        bench="\n".join(_electronics(k) for k in each),
    )


def _lines(component: str, values: Mapping[str, float]) -> str:
    parts = ((*key.split(".", 1), value) for key, value in values.items())
    return "\n".join(f'"{name}" = {value!r}' for of, name, value in parts if of == component)


def _electronics(k: int) -> str:
    lines = [f'"sensor_{k}.{part}.enabled" = true' for part in ELECTRONICS]
    return "\n".join([*lines, f'"sensor_{k}.noise.seed" = {k}'])
