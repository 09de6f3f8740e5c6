"""The built-in system: the published grasp and its FMUs."""

from ..errors import InputError
from ..files import FMU_FOLDER
from ..system.description import System
from .controllers import with_controller
from .presets import SYSTEM


def grasp_system(controller: str = "published") -> System:
    """The built-in grasp; its FMUs are built first where they are missing or out of date.

    controller is the name of the law: "published", or "adaptive", which minds no colours.
    """
    from grasp_fmus.build import build

    try:
        build(FMU_FOLDER)
    except OSError as error:
        raise InputError(
            f"{error.filename}: {error.strerror}; the FMUs are built into {FMU_FOLDER} below the "
            "current folder, which must be one that can be written to"
        ) from error
    system = System.load(SYSTEM, FMU_FOLDER)
    return system if controller == "published" else with_controller(system, controller)
