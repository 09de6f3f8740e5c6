"""The gripper in tandem as a system."""

from pathlib import Path

from ..fmu_export.build import shipped_fmus
from ..grasp.system import with_controller
from ..system.description import System

SYSTEM = Path(__file__).parent / "tandem.toml"
"""A gripper on an arm of 5 Hz, and a free box 30 mm off the middle."""


def tandem_system(controller: str = "adaptive", native: bool | None = None) -> System:
    """Make the gripper in tandem on an arm.

    Its FMUs are in the user's cache, built first if need be.

    Args:
        controller: The law: "adaptive", which sends the wrist to the middle whatever the colours
            are, or "published", which wants a wrist of 100 Hz and its force.
        native: Which FMUs run: see System.natively().

    Returns:
        The system.

    Raises:
        InputError: There is no such law, or the FMUs cannot be built.

    Example:
        >>> from grasp_cosim import simulate, tandem_system
        >>> result = simulate(tandem_system(), stop=0.1)
        >>> result.came_to_its_end
        True
    """
    system = System.load(SYSTEM, shipped_fmus())
    chosen = system if controller == "adaptive" else with_controller(system, controller)
    return chosen.natively(native)
