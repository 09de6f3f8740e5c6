"""The FMUs that come with this package: a line for each, the only place that knows their blocks.

Those of a hand have three fingers. For another number of them a block is made once more, from a
source that differs in one line: HandPlant5 is HandPlant with five fingers.
"""

import re
import sys
import threading
from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any, NamedTuple


class Shipped(NamedTuple):
    """What an FMU is, the module of its block, and the one that says for how many fingers."""

    summary: str
    module: str
    size: str = ""


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
    "GripperPlantMovable": Shipped(
        "Two-finger gripper and a box on a floor, which slides and topples", "gripper_plant.movable"
    ),
    "HandController": Shipped(
        "Multiple impedance control of a hand whose fingers close along rays from its wrist",
        "grasp_controller.hand",
        "grasp_controller.hand",
    ),
    "HandControllerAdaptive": Shipped(
        "Multiple impedance control of a hand whose faces may differ in colour",
        "grasp_controller.hand_adaptive",
        "grasp_controller.hand",
    ),
    "HandPlant": Shipped(
        "Hand of several fingers and a rigid, fixed object, a prism or a disc",
        "gripper_plant.hand",
        "gripper_plant.hand_fingers",
    ),
    "HandPlantMovable": Shipped(
        "Hand of several fingers and an object on a floor, which slides and turns",
        "gripper_plant.hand_movable",
        "gripper_plant.hand_fingers",
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
"""What a block of one's own may import besides the standard library."""

FEWEST, MOST = 2, 8
"""Fingers of a hand."""

HANDS = f"one of a hand with a number of fingers from {FEWEST} to {MOST} behind it"
"""Names that are valid besides those of SHIPPED."""

_FINGERS = re.compile(rb"^FINGERS = \d+$", re.MULTILINE)
_NAME = re.compile(rf"(Hand\w*?)([{FEWEST}-{MOST}])")

_making = threading.Lock()


def of_fingers(fingers: int) -> list[str]:
    """Return the names of the blocks of a hand with so many fingers.

    ValueError for a number of fingers that there is not.
    """
    if not FEWEST <= fingers <= MOST:
        raise ValueError(f"{fingers} fingers: must be from {FEWEST} to {MOST}")
    return [f"{name}{fingers}" for name, shipped in SHIPPED.items() if shipped.size]


def found(name: str) -> tuple[Shipped, int | None]:
    """Return the entry of an FMU, and how many fingers its name asks for; KeyError without one."""
    if asked := _NAME.fullmatch(name):
        return SHIPPED[asked[1]], int(asked[2])
    return SHIPPED[name], None


def together(name: str) -> tuple[str, ...] | None:
    """Return the names of the FMUs that are built together with one of ours; None for others."""
    try:
        shipped, fingers = found(name)
    except KeyError:
        return None
    if fingers:
        return tuple(of_fingers(fingers))
    return tuple(other for other, s in SHIPPED.items() if bool(s.size) == bool(shipped.size))


def block_of(name: str) -> Any:
    """Return the block of an FMU, a module."""
    shipped, fingers = found(name)
    return _of_size(shipped, fingers) if fingers else import_module(shipped.module)


def sized_source(name: str) -> dict[str, bytes]:
    """Return the module that differs where a number of fingers is asked for, by its path."""
    shipped, fingers = found(name)
    path = f"{shipped.size.replace('.', '/')}.py"
    return {path: _sized(shipped.size, fingers)} if fingers else {}


def _sized(module: str, fingers: int) -> bytes:
    return _FINGERS.sub(b"FINGERS = %d" % fingers, Path(_origin(module)).read_bytes())


def _of_size(shipped: Shipped, fingers: int) -> Any:
    """The block from its package imported once more, under a name with the number of fingers."""
    package, _, module = shipped.module.partition(".")
    alias = f"{package}_of_{fingers}"
    with _making:
        if alias not in sys.modules:
            _load(package, alias)
            size = shipped.size.removeprefix(package)
            _load(shipped.size, f"{alias}{size}", _sized(shipped.size, fingers))
    return import_module(f"{alias}.{module}")


def _load(module: str, alias: str, source: bytes | None = None) -> None:
    """Run a module, or a source in its place, as one of another name."""
    origin = _origin(module)
    below = [str(Path(origin).parent)] if "." not in module else None
    spec = spec_from_file_location(alias, origin, submodule_search_locations=below)
    assert spec is not None  # noqa: S101 - the module was found
    sys.modules[alias] = made = module_from_spec(spec)
    text = source or Path(origin).read_bytes()
    exec(compile(text, origin, "exec"), vars(made))  # noqa: S102 - our own


def _origin(module: str) -> str:
    spec = find_spec(module)
    if spec is None or spec.origin is None:
        raise ImportError(f"{module}: no such module; must be installed")
    return spec.origin


def package_folder(package: str) -> Path:
    """Return the folder of a package, which is not imported for that; ImportError without one.

    It is that which is installed: a foreign FMU may have imported a copy of its own, as one of
    pythonfmu does, whose files go with the FMU.
    """
    for finder in sys.meta_path:  # and not in sys.modules
        spec = finder.find_spec(package, None)
        if spec is not None and spec.origin is not None:
            return Path(spec.origin).parent
    raise ImportError(f"{package}: no such package; must be installed")


def card_file(package: str) -> Path:
    """Return the equation card of a package: in it once it is installed, in the sources beside."""
    inside = package_folder(package) / "README.md"
    return inside if inside.exists() else inside.parents[1] / "README.md"


def blocks() -> dict[str, Any]:
    """Return the blocks, which are modules, by the names of their FMUs."""
    return {name: block_of(name) for name in SHIPPED}
