"""The grasp of delicate things as a system: a body that relaxes is grasped and lifted."""

from pathlib import Path

from ..fmu_export.build import shipped_fmus
from ..system.description import System
from .system import with_controller

SYSTEM = Path(__file__).parent / "delicate.toml"
"""The published grasp of a body that relaxes, a lift, and things as presets."""


def delicate_system(controller: str = "published", native: bool | None = None) -> System:
    """Make the grasp of delicate things: a body that relaxes is grasped and lifted.

    Its FMUs are in the user's cache, built first if need be. Its presets are things: tofu,
    strawberry, tomato, egg, marshmallow, paper_cup.

    Args:
        controller: The law: "published", or "adaptive", which minds no colours.
        native: Which FMUs run: see System.natively().

    Returns:
        The system.

    Raises:
        InputError: There is no such law, or the FMUs cannot be built.

    Example:
        >>> from grasp_cosim import delicate_system, simulate
        >>> result = simulate(delicate_system().with_presets("egg"), stop=0.1)
        >>> result.came_to_its_end
        True
    """
    system = System.load(SYSTEM, shipped_fmus())
    chosen = system if controller == "published" else with_controller(system, controller)
    return chosen.natively(native)
