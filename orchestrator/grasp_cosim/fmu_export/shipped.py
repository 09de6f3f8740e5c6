"""The FMUs that come with this package: a line for each, the only place that knows their blocks.

Those of a hand have three fingers. Another number of them is a parameter of the build, of which the
module HAND_SIZE is made: HandPlant5 is HandPlant with five fingers.
"""

import re
import sys
import threading
from collections.abc import Mapping
from importlib import import_module
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple


class Shipped(NamedTuple):
    """What an FMU is, the module of its block, and whether there is one for each size of a hand."""

    summary: str
    module: str
    of_hand: bool = False


SHIPPED: Mapping[str, Shipped] = {
    "GraspController": Shipped(
        "Multiple impedance control: simultaneous contact, impact reduction, contact force",
        "grasp_controller.series",
    ),
    "GraspControllerAdaptive": Shipped(
        "Multiple impedance control of a grasp whose two faces may differ in colour",
        "grasp_controller.adaptive",
    ),
    "GraspControllerTandem": Shipped(
        "Grasp control of a gripper in tandem on a positioned wrist, whose faces may differ",
        "grasp_controller.tandem",
    ),
    "GraspControllerTandemPublished": Shipped(
        "Multiple impedance control of a gripper in tandem on a wrist whose force is measured",
        "grasp_controller.tandem_published",
    ),
    "GripperPlant": Shipped("Two-finger gripper and a rigid, fixed object", "gripper_plant.rigid"),
    "GripperPlantCompliant": Shipped(
        "Two-finger gripper and a fixed object that gives", "gripper_plant.compliant"
    ),
    "GripperPlantDelicate": Shipped(
        "Two-finger gripper and a delicate body, which relaxes, is lifted and may slip",
        "gripper_plant.delicate",
    ),
    "GripperPlantMovable": Shipped(
        "Two-finger gripper and a box on a floor, which slides and topples", "gripper_plant.movable"
    ),
    "HandController": Shipped(
        "Multiple impedance control of a hand whose fingers close along rays from its wrist",
        "grasp_controller.hand",
        of_hand=True,
    ),
    "HandControllerAdaptive": Shipped(
        "Multiple impedance control of a hand whose faces may differ in colour",
        "grasp_controller.hand_adaptive",
        of_hand=True,
    ),
    "HandPlant": Shipped(
        "Hand of several fingers and a rigid, fixed object, a prism or a disc",
        "gripper_plant.hand",
        of_hand=True,
    ),
    "HandPlantMovable": Shipped(
        "Hand of several fingers and an object on a floor, which slides and turns",
        "gripper_plant.hand_movable",
        of_hand=True,
    ),
    "ProximitySensor": Shipped(
        "Optical proximity sensor of the reflected-light-intensity type, one channel",
        "proximity_sensor.channel",
    ),
    "TandemPlant": Shipped(
        "Gripper whose fingers move in tandem on a positioned wrist, and a fixed or free object",
        "gripper_plant.tandem",
    ),
}
"""By the names of the FMUs, in alphabetical order."""

PACKAGES = ("block_variables", *sorted({s.module.partition(".")[0] for s in SHIPPED.values()}))
"""The modules that a user's block may import, apart from the standard library."""

FEWEST, MOST = 2, 8
"""Fingers of a hand."""

HANDS = f"one of a hand with a number of fingers from {FEWEST} to {MOST} behind it"
"""Names that are valid in addition to those of SHIPPED."""

HAND_SIZE = "hand_size"
"""The module that says for how many fingers the blocks of a package are: FINGERS."""

_NAME = re.compile(rf"(Hand\w*?)([{FEWEST}-{MOST}])")

_making = threading.Lock()


def of_fingers(fingers: int) -> list[str]:
    """Return the names of the blocks of a hand with so many fingers.

    ValueError for a number of fingers that there is not.
    """
    if not FEWEST <= fingers <= MOST:
        raise ValueError(f"{fingers} fingers: must be from {FEWEST} to {MOST}")
    return [f"{name}{fingers}" for name, shipped in SHIPPED.items() if shipped.of_hand]


def entry_of(name: str) -> tuple[Shipped, int | None]:
    """Return the entry of an FMU, and how many fingers its name asks for; KeyError without one."""
    if match := _NAME.fullmatch(name):
        return SHIPPED[match[1]], int(match[2])
    return SHIPPED[name], None


def together(name: str) -> tuple[str, ...] | None:
    """Return the names of the FMUs that are built together with one of our own; None for others."""
    try:
        shipped, fingers = entry_of(name)
    except KeyError:
        return None
    if fingers:
        return tuple(of_fingers(fingers))
    return tuple(name_beside for name_beside, s in SHIPPED.items() if s.of_hand == shipped.of_hand)


def block_of(name: str) -> Any:
    """Return the block of an FMU, a module."""
    shipped, fingers = entry_of(name)
    return _of_size(shipped, fingers) if fingers else import_module(shipped.module)


def sized_source(name: str) -> dict[str, bytes]:
    """Return the module HAND_SIZE where a number of fingers is asked for, by its path."""
    shipped, fingers = entry_of(name)
    package = shipped.module.partition(".")[0]
    return {f"{package}/{HAND_SIZE}.py": b"FINGERS = %d\n" % fingers} if fingers else {}


def _of_size(shipped: Shipped, fingers: int) -> Any:
    """Return a block of a hand with so many fingers.

    The types of its arrays are made when its modules are imported, and one process may have hands
    of several sizes. So each size is its own package, made of the same files with another
    module HAND_SIZE.
    """
    package, _, module = shipped.module.partition(".")
    sized_package = f"{package}_of_{fingers}"
    with _making:
        if sized_package not in sys.modules:
            hand_size = ModuleType(f"{sized_package}.{HAND_SIZE}")
            vars(hand_size).update(FINGERS=fingers)
            sys.modules[hand_size.__name__] = hand_size
            folder = package_folder(package)
            spec = spec_from_file_location(
                sized_package, folder / "__init__.py", submodule_search_locations=[str(folder)]
            )
            assert spec is not None  # noqa: S101 - of a file that is there
            assert spec.loader is not None  # noqa: S101
            sys.modules[sized_package] = module_from_spec(spec)
            spec.loader.exec_module(sys.modules[sized_package])
    return import_module(f"{sized_package}.{module}")


def package_folder(package: str) -> Path:
    """Return the folder of a package, which is not imported for that; ImportError without one.

    It is that which is installed: a foreign FMU may have imported its own copy, as one of
    pythonfmu does, whose files go with the FMU.
    """
    for finder in sys.meta_path:  # and not in sys.modules
        spec = finder.find_spec(package, None)
        if spec is not None and spec.origin is not None:
            return Path(spec.origin).parent
    raise ImportError(f"{package}: no such package; must be installed")


def sheet_file(package: str) -> Path:
    """Return the equation sheet of a package, in the package or next to it in the sources."""
    inside = package_folder(package) / "README.md"
    return inside if inside.exists() else inside.parents[1] / "README.md"


def blocks() -> dict[str, Any]:
    """Return the blocks, which are modules, by the names of their FMUs."""
    return {name: block_of(name) for name in SHIPPED}
