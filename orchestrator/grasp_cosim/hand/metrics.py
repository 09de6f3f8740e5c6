"""Metrics of a hand: those of the grasp for all its fingers, and two of its own."""

from collections.abc import Mapping
from dataclasses import replace
from itertools import count, takewhile
from math import pi
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..grasp.metrics import METRICS as OF_GRASP
from ..grasp.metrics import QUANTITIES, fingers_of, steady_force
from ..grasp.presets import start_in_si
from ..metrics.metric import Signals, metric, resolved
from .weights import balance_weights, imbalance

NEEDS: Mapping[str, str | None] = {
    **{f"plant.{name}[*]": unit for name, unit in QUANTITIES.items()},
    "plant.object_position[1]": "m",
    "plant.object_position[2]": "m",
    "plant.object_angle": "rad",
}
"""The signals of a hand, and their units."""

OTHERS = ("target_position",)
"""Metrics of the grasp that a hand has not: each of its fingers has a target of its own."""

UNBALANCED = 1e-3
"""|sum n_k·e_k| from which a hand pushes its object aside, 3 mN of a usual grasp."""

OF_HAND = {"needs": NEEDS, "group": "hand"}


def is_disc(signals: Signals) -> bool:
    """True if the system says that the object is a disc; by default it is a prism."""
    return signals.start_values.get(resolved("plant.shape", signals.roles)) in ("disc", 2)


def directions(signals: Signals) -> list[float]:
    """The fingers' directions in rad: those that the system sets, by default even ones."""
    fingers = fingers_of(signals)
    even = (2.0 * pi * (k - 1) / len(fingers) for k in fingers)
    return [signals.given(f"plant.angle[{k}]", a) for k, a in zip(fingers, even, strict=True)]


@metric("net_force", unit="N", label="net force", **OF_HAND)
def net_force(signals: Signals) -> float:
    """Magnitude of the sum of the steady contact forces, each in its finger's direction."""
    forces = [steady_force(signals, k) for k in fingers_of(signals)]
    return float(abs(np.dot(forces, np.exp(1j * np.asarray(directions(signals))))))


@metric("object_turn", unit="rad", label="object turn", **OF_HAND)
def object_turn(signals: Signals) -> float:
    """Largest turn of the object from where it was at the start, either way."""
    angle = signals["plant.object_angle"]
    return float(np.abs(angle - angle[0]).max())


def check(system: Any) -> tuple[str, ...]:
    """No notes; InputError where the weights of a system's controller do not balance its fingers.

    Nothing is said of a plant or a controller of others, which has other parameters.
    """
    roles = ("plant", "controller")
    plant, controller = (resolved(f"{role}.", system.roles)[:-1] for role in roles)
    there = {c.name: c.interface.by_name for c in system.components}
    angles, weights = there.get(plant, {}), there.get(controller, {})
    each = [*takewhile(lambda k: f"angle[{k}]" in angles and f"weight[{k}]" in weights, count(1))]
    directions = [start_in_si(system, f"plant.angle[{k}]") for k in each]
    found = [start_in_si(system, f"controller.weight[{k}]") for k in each]
    if (left := imbalance(directions, found)) > UNBALANCED:
        least = ", ".join(f"{n:.9g}" for n in balance_weights(np.degrees(directions).tolist()))
        listed = ", ".join(f"{n:g}" for n in found)
        raise InputError(
            f"{system.name}: {controller}.weight = {listed}: leaves {left:.3g} of the grasp as a "
            f"push to one side with the angles of {plant}; balanced by {least}"
        )
    return ()


METRICS = (
    *(
        replace(m, entries=("finger *",) if m.entries else (), **OF_HAND)  # type: ignore[arg-type]
        for m in OF_GRASP
        if not m.optional and m.name not in OTHERS
    ),
    net_force,
    object_turn,
)
"""The metrics of a hand, in the order in which they are shown."""


def is_hand(signals: Signals) -> bool:
    """True if there are the signals of a hand and its object."""
    return all(name.replace("*", "1") in signals for name in NEEDS)
