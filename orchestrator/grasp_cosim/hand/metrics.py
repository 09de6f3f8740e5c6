"""Metrics of a hand: those of the grasp for all its fingers, and two more."""

from dataclasses import replace
from itertools import count, takewhile
from math import pi
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..grasp.metrics import FELT, QUANTITIES, SCENE_SIGNALS, fingers_of, steady_force
from ..grasp.metrics import METRICS as OF_GRASP
from ..grasp.metrics import check as check_grasp
from ..grasp.presets import start_in_si
from ..metrics.metric import ALL, Metric, Signals, expanded, metric, resolved
from .weights import balance_weights, imbalance

OBJECT_POSITION = ("plant.object_position[1]", "plant.object_position[2]")
"""Where the object is, which a grasp has as one signal."""

OBJECT_ANGLE = "plant.object_angle"
"""Which way the object is turned, in rad."""

NOT_OF_A_HAND = ("target_position",)
"""Metrics of the grasp that a hand has not: each of its fingers has its own target."""

MAX_IMBALANCE = 1e-3
"""|sum n_k·e_k| from which a hand pushes its object aside, 3 mN of a usual grasp."""


def as_of_hand(name: str) -> tuple[str, ...]:
    """The signals of a hand in the place of one of a grasp: all fingers in that of the first."""
    if name == "plant.object_position":
        return OBJECT_POSITION
    return () if name.endswith("[2]") else (name.replace("[1]", ALL),)


def _of_hand(m: Metric) -> Metric:
    """A metric of the grasp as one of a hand."""
    needs, uses = (expanded(signals, as_of_hand) for signals in (m.needs, m.uses))
    entries = ("finger *",) if m.entries else ()
    return replace(m, needs=needs, uses=uses, entries=entries, group="hand")


def is_disc(signals: Signals) -> bool:
    """True if the system says that the object is a disc; by default it is a prism."""
    return signals.start_values.get(resolved("plant.shape", signals.roles)) in ("disc", 2)


def directions(signals: Signals) -> list[float]:
    """The fingers' directions in rad: those that the system sets, by default even ones."""
    fingers = fingers_of(signals)
    even = (2.0 * pi * (k - 1) / len(fingers) for k in fingers)
    return [signals.given(f"plant.angle[{k}]", a) for k, a in zip(fingers, even, strict=True)]


@metric(
    "net_force",
    unit="N",
    label="net force",
    needs={f"plant.contact_force{ALL}": QUANTITIES["contact_force"]},
    uses={f"plant.contact_impulse{ALL}": FELT["contact_impulse"]},
    group="hand",
)
def net_force(signals: Signals) -> float:
    """Magnitude of the sum of the steady contact forces, each in its finger's direction."""
    forces = [steady_force(signals, k) for k in fingers_of(signals)]
    return float(abs(np.dot(forces, np.exp(1j * np.asarray(directions(signals))))))


@metric("object_turn", unit="rad", label="object turn", needs={OBJECT_ANGLE: "rad"}, group="hand")
def object_turn(signals: Signals) -> float:
    """Largest turn of the object from where it was at the start, either way."""
    angle = signals[OBJECT_ANGLE]
    return float(np.abs(angle - angle[0]).max())


def check(system: Any) -> tuple[str, ...]:
    """The notes of a grasp; InputError where the controller's weights do not balance the fingers.

    No line is on a plant or a controller of others, which has other parameters.
    """
    plant = system.roles.get("plant", "plant")
    controller = system.roles.get("controller", "controller")
    variables = {c.name: c.interface.by_name for c in system.components}
    of_plant, of_controller = variables.get(plant, {}), variables.get(controller, {})

    def has_finger(k: int) -> bool:
        return f"angle[{k}]" in of_plant and f"weight[{k}]" in of_controller

    fingers = [*takewhile(has_finger, count(1))]
    directions = [start_in_si(system, f"plant.angle[{k}]") for k in fingers]
    weights = [start_in_si(system, f"controller.weight[{k}]") for k in fingers]
    push = imbalance(directions, weights)
    if push > MAX_IMBALANCE:
        balanced = ", ".join(f"{n:.9g}" for n in balance_weights(np.degrees(directions).tolist()))
        weights_text = ", ".join(f"{n:g}" for n in weights)
        raise InputError(
            f"{system.name}: {controller}.weight = {weights_text}: leaves {push:.3g} of the grasp "
            f"as a push to one side with the angles of {plant}; balanced by {balanced}"
        )
    return check_grasp(system)


METRICS = (
    *(
        _of_hand(m)
        for m in OF_GRASP
        if m.name not in NOT_OF_A_HAND and (not m.optional or m.reason)
    ),
    net_force,
    object_turn,
)
"""The metrics of a hand, in the order in which they are shown."""


def is_hand(signals: Signals) -> bool:
    """True if there are the signals of a hand and its object that a picture shows."""
    signals_of_hand = [name for signal in SCENE_SIGNALS for name in as_of_hand(signal)]
    needed = [name.replace("*", str(k)) for name in signals_of_hand for k in fingers_of(signals)]
    return OBJECT_ANGLE in signals and all(name in signals for name in needed)
