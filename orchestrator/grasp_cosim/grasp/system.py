"""The built-in system and its FMUs, and the controllers by the names of their laws."""

import re
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path

from ..base.checks import choice
from ..base.errors import InputError
from ..base.files import FMU_FOLDER
from ..fmu_export.build import shipped_fmus
from ..interface.read import read_interface
from ..metrics.metric import resolved
from ..system.description import System
from ..system.overrides import Override
from ..system.parts import Connection, Port
from .presets import SYSTEM

CONTROLLERS = {"published": "", "adaptive": "Adaptive"}
"""The published law, and the one that learns how the reflectances of the faces differ; what the
names of their FMUs have behind GraspController, or HandController.
"""

TANDEM_CONTROLLERS = {"published": "Published", "adaptive": ""}
"""The same of a gripper in tandem, behind GraspControllerTandem."""

WRIST_FORCE = "wrist_force"
"""What one law of a gripper in tandem measures and the other one does not."""

_FMU = re.compile(r"(Grasp|Hand)Controller(?:Adaptive)?(\d?)")
_TANDEM_FMU = re.compile(r"GraspControllerTandem(?:Published)?")


def with_controller(system: System, law: str, swapped: Collection[str] = ()) -> System:
    """The system with the controller of that law in the place of the one that it has.

    Its FMU is the one next to that of the component in the role "controller", else of the cache.
    `swapped` are the components that get another FMU. InputError where it is one of them, where no
    component has the role, and where that FMU does not fit.
    """
    place = f"controller {choice('controller', law, tuple(CONTROLLERS))}"
    name = controller_name(system)
    if name not in (c.name for c in system.components):
        raise InputError(
            f"{place}: {system.name} has no component {name!r}; must have one, or one that "
            'is named under [roles]: controller = "..."'
        )
    if name in swapped:
        raise InputError(f"{place}: cannot be used with another FMU for {name}")
    component = system.component(name, place)
    identifier = component.interface.identifier
    file, fingers = _fmu_file(identifier, law)
    fmu = component.fmu.with_name(file)
    if not fmu.is_file():
        fmu = shipped_fmus(fingers) / file
    if _TANDEM_FMU.fullmatch(identifier):
        return _with_tandem_controller(system, name, fmu, place)
    return system.with_overrides([Override(f"components.{name}.fmu", fmu, place)])


def _fmu_file(identifier: str, law: str) -> tuple[str, int | None]:
    """The FMU of a law for the same kind of gripper as that of a controller, and its fingers."""
    if _TANDEM_FMU.fullmatch(identifier):
        return f"GraspControllerTandem{TANDEM_CONTROLLERS[law]}.fmu", None
    match = _FMU.fullmatch(identifier)
    gripper, fingers = match.groups() if match else ("Grasp", "")
    file = f"{gripper}Controller{CONTROLLERS[law]}{fingers}.fmu"
    return file, int(fingers) if fingers else None


def _with_tandem_controller(system: System, controller: str, fmu: Path, place: str) -> System:
    """The system with another law of a gripper in tandem: one of them measures the wrist's force.

    On the way from one to the other that input has a value, so that it has a source at all times.
    """
    measured = Port(controller, WRIST_FORCE)
    source = Port(system.roles.get("plant", "plant"), WRIST_FORCE)
    if any(c.target == measured for c in system.connections):
        system = _with_source(system, measured, 0.0)
    overrides = [Override(f"components.{controller}.fmu", fmu, place)]
    if WRIST_FORCE not in read_interface(fmu).by_name:
        return system.with_overrides(overrides)
    overrides.append(Override(str(measured), 0.0, place))
    return _with_source(system.with_overrides(overrides), measured, source)


def _with_source(system: System, target: Port, source: Port | float) -> System:
    """The system with a connection to an input, or a value of it, in the place of the other."""
    component = system.component(target.component, system.name)
    values = {name: v for name, v in component.values.items() if name != target.variable}
    connections = [c for c in system.connections if c.target != target]
    if isinstance(source, Port):
        connections.append(Connection(source, target))
    else:
        values[target.variable] = source
    components = {c.name: c for c in system.components}
    components[component.name] = replace(component, values=values)
    return replace(system, components=tuple(components.values()), connections=tuple(connections))


def controller_name(system: System) -> str:
    """The name of the component in the role "controller", which need not exist."""
    return resolved("controller.", system.roles)[:-1]


def grasp_system(controller: str = "published", native: bool | None = None) -> System:
    """Make the built-in grasp of two fingers.

    Its FMUs are in the user's cache, built first if need be.

    Args:
        controller: The law: "published", or "adaptive", which minds no colours.
        native: Which FMUs run: see System.natively(). By default native ones, if they can be built.

    Returns:
        The system.

    Raises:
        InputError: There is no such law, or the FMUs cannot be built.

    Example:
        >>> from grasp_cosim import grasp_system
        >>> sorted(grasp_system().by_name)
        ['controller', 'plant', 'sensor_1', 'sensor_2']
    """
    system = as_named()
    chosen = system if controller == "published" else with_controller(system, controller)
    return chosen.natively(native)


def as_named() -> System:
    """The built-in grasp with FMUs that Python runs."""
    return System.load(SYSTEM, shipped_fmus())


def built(folder: Path, fingers: int | None = None) -> Path:
    """Where the FMUs are below a folder, built first where they are missing or out of date.

    With `fingers` those of a hand that has so many are among them.
    """
    from ..fmu_export.build import build, build_chosen

    try:
        build(folder / FMU_FOLDER)
        if fingers is not None:
            build_chosen(None, folder / FMU_FOLDER, fingers=fingers)
    except OSError as error:
        folder_text = "the current folder" if folder == Path() else str(folder)
        raise InputError(
            f"{error.filename}: {error.strerror}; the FMUs are built into {FMU_FOLDER} below "
            f"{folder_text}, which must be one that can be written to"
        ) from error
    return folder / FMU_FOLDER
