"""Metrics of a gripper in tandem: those of the grasp, and two of its wrist; what is noted of it."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import pi
from typing import Any, NamedTuple

import numpy as np

from ..grasp.metrics import METRICS as OF_GRASP
from ..grasp.metrics import check as check_grasp
from ..grasp.metrics import is_grasp
from ..grasp.presets import start_in_si
from ..metrics.metric import Signals, metric

MAX_LAG = 0.165
"""s, 2/omega + tau of a wrist that is in the middle before the grip arrives: 2 Hz, or 3 Hz with
50 ms.
"""

MIN_BANDWIDTH_OF_PUBLISHED_LAW = 100.0
"""Hz of a wrist from which the published law holds."""

WRIST = "plant.wrist_position"

POSITION: Mapping[str, str | None] = {WRIST: "m"}
SPEED: Mapping[str, str | None] = {"plant.wrist_velocity": "m/s"}

OF_TANDEM = {"group": "tandem", "factor": 1e3}


@metric("wrist_travel", unit="m", shown_unit="mm", needs=POSITION, **OF_TANDEM)
def wrist_travel(signals: Signals) -> float:
    """Way of the wrist from the start to the end, to the right positive."""
    wrist = signals[WRIST]
    return float(wrist[-1] - wrist[0])


@metric("peak_wrist_speed", unit="m/s", shown_unit="mm/s", needs=SPEED, **OF_TANDEM)
def peak_wrist_speed(signals: Signals) -> float:
    """Highest speed of the wrist, either way."""
    return float(np.abs(signals["plant.wrist_velocity"]).max())


METRICS = (*(replace(m, group="tandem") for m in OF_GRASP), wrist_travel, peak_wrist_speed)
"""The metrics of a gripper in tandem, in the order in which they are shown."""


def is_tandem(signals: Signals) -> bool:
    """True if there are the signals of a gripper on a wrist, and of its object."""
    return is_grasp(signals) and WRIST in signals


class WristParameters(NamedTuple):
    """What a system says of its wrist, as it is and as its law counts on it; None where it does
    not: natural frequencies in Hz, delays in s.
    """

    bandwidth: float | None
    delay: float | None
    counted_bandwidth: float | None
    counted_delay: float | None


def check(system: Any) -> tuple[str, ...]:
    """What is to be noted of a system's wrist: where the law counts on another one, or it is slow.

    No line is on a plant or a controller of others, which has other parameters.
    """
    names = {role: system.roles.get(role, role) for role in ("plant", "controller")}
    plant, controller = names.values()
    variables = {c.name: c.interface.by_name for c in system.components}
    parameters = [
        start_in_si(system, f"{role}.{parameter}") if parameter in variables.get(name, ()) else None
        for role, name in names.items()
        for parameter in ("wrist.bandwidth", "wrist.delay")
    ]
    wrist = WristParameters(*parameters)
    published = "wrist_force" in variables.get(controller, ())
    return (
        *check_grasp(system),
        *_lagging(controller, wrist),
        *_unlike_counted_on(plant, controller, wrist),
        *(_not_following(plant, wrist) if published else ()),
    )


def _lagging(controller: str, wrist: WristParameters) -> Iterator[str]:
    """A wrist that is in the middle after the grip, as far as the law knows."""
    bandwidth, delay = wrist.counted_bandwidth, wrist.counted_delay
    if bandwidth is None or delay is None:
        return
    lag = 1.0 / (pi * bandwidth) + delay
    if lag > MAX_LAG:
        yield (
            f"{controller}.wrist.bandwidth = {bandwidth:g} Hz, delay = {delay:g} s: the wrist "
            f"lags by {lag:.3g} s, and one finger may touch before it is in the middle; up to "
            f"{MAX_LAG:g} s both touch at once"
        )


def _unlike_counted_on(plant: str, controller: str, wrist: WristParameters) -> Iterator[str]:
    """A wrist that is slower, or later, than the law counts on."""
    hz, counted_hz = wrist.bandwidth, wrist.counted_bandwidth
    if hz is not None and counted_hz is not None and hz < counted_hz:
        yield (
            f"{plant}.wrist.bandwidth = {hz:g} Hz: the law counts on more, "
            f"{controller}.wrist.bandwidth = {counted_hz:g} Hz"
        )
    delay, counted_delay = wrist.delay, wrist.counted_delay
    if delay is not None and counted_delay is not None and delay > counted_delay:
        yield (
            f"{plant}.wrist.delay = {delay:g} s: the law counts on less, "
            f"{controller}.wrist.delay = {counted_delay:g} s"
        )


def _not_following(plant: str, wrist: WristParameters) -> Iterator[str]:
    """A wrist that is too slow for the published law."""
    if wrist.bandwidth is not None and wrist.bandwidth < MIN_BANDWIDTH_OF_PUBLISHED_LAW:
        yield (
            f"{plant}.wrist.bandwidth = {wrist.bandwidth:g} Hz: the published law wants a wrist of "
            f"{MIN_BANDWIDTH_OF_PUBLISHED_LAW:g} Hz; GraspControllerTandem is for slower ones"
        )
