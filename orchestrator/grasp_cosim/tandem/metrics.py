"""Metrics of a gripper in tandem: those of the grasp, and two of its wrist; what is noted of it."""

from collections.abc import Mapping
from dataclasses import replace
from math import pi
from typing import Any

import numpy as np

from ..grasp.metrics import METRICS as OF_GRASP
from ..grasp.metrics import is_grasp
from ..grasp.presets import start_in_si
from ..metrics.metric import Signals, metric, resolved

LONGEST_LAG = 0.165
"""s, 2/omega + tau of a wrist that is in the middle before the grip arrives: 2 Hz, or 3 Hz with
50 ms.
"""

FOLLOWING = 100.0
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


def check(system: Any) -> tuple[str, ...]:
    """What is to be noted of a system's wrist: where the law counts on another one, or it is slow.

    Nothing is said of a plant or a controller of others, which has other parameters.
    """
    names = {role: resolved(f"{role}.", system.roles)[:-1] for role in ("plant", "controller")}
    variables = {c.name: c.interface.by_name for c in system.components}

    def given(role: str, parameter: str) -> float | None:
        there = parameter in variables.get(names[role], ())
        return start_in_si(system, f"{role}.{parameter}") if there else None

    def label(role: str, parameter: str, unit: str) -> str:
        return f"{names[role]}.{parameter} = {given(role, parameter):g} {unit}"

    bandwidth, counted_on = (
        given("plant", "wrist.bandwidth"),
        given("controller", "wrist.bandwidth"),
    )
    delay, expected = given("plant", "wrist.delay"), given("controller", "wrist.delay")
    notes = []
    lag = 1.0 / (pi * counted_on) + expected if counted_on and expected is not None else 0.0
    if lag > LONGEST_LAG:
        notes.append(
            f"{label('controller', 'wrist.bandwidth', 'Hz')}, delay = {expected:g} s: the wrist "
            f"lags by {lag:.3g} s, and one finger may touch before it is in the middle; up to "
            f"{LONGEST_LAG:g} s both touch at once"
        )
    if bandwidth is not None and counted_on is not None and bandwidth < counted_on:
        notes.append(
            f"{label('plant', 'wrist.bandwidth', 'Hz')}: the law counts on more, "
            f"{label('controller', 'wrist.bandwidth', 'Hz')}"
        )
    if delay is not None and expected is not None and delay > expected:
        notes.append(
            f"{label('plant', 'wrist.delay', 's')}: the law counts on less, "
            f"{label('controller', 'wrist.delay', 's')}"
        )
    published = "wrist_force" in variables.get(names["controller"], ())
    if published and bandwidth is not None and bandwidth < FOLLOWING:
        notes.append(
            f"{label('plant', 'wrist.bandwidth', 'Hz')}: the published law wants a wrist of "
            f"{FOLLOWING:g} Hz; GraspControllerTandem is for slower ones"
        )
    return tuple(notes)
