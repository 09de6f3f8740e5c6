"""The FMUs that come with this package: a line for each, the only place that knows their blocks."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any, NamedTuple


class Shipped(NamedTuple):
    """What an FMU is, and the module of its block."""

    summary: str
    module: str


SHIPPED: Mapping[str, Shipped] = {
    "GraspController": Shipped(
        "Multiple impedance control: simultaneous contact, impact reduction, contact force",
        "grasp_controller.series",
    ),
    "GraspControllerAdaptive": Shipped(
        "Multiple impedance control of a grasp whose two faces may differ in colour",
        "grasp_controller.adaptive",
    ),
    "GripperPlant": Shipped("Two-finger gripper and a rigid, fixed object", "gripper_plant.rigid"),
    "GripperPlantCompliant": Shipped(
        "Two-finger gripper and a fixed object that gives", "gripper_plant.compliant"
    ),
    "GripperPlantMovable": Shipped(
        "Two-finger gripper and a box on a floor, which slides and topples", "gripper_plant.movable"
    ),
    "ProximitySensor": Shipped(
        "Optical proximity sensor of the reflected-light-intensity type, one channel",
        "proximity_sensor.channel",
    ),
}
"""By the names of the FMUs, in alphabetical order."""

PACKAGES = ("block_variables", *sorted({s.module.partition(".")[0] for s in SHIPPED.values()}))
"""What a block of one's own may import besides the standard library."""


def blocks() -> dict[str, Any]:
    """Return the blocks, which are modules, by the names of their FMUs."""
    return {name: import_module(shipped.module) for name, shipped in SHIPPED.items()}
