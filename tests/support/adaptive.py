"""The grasp with the adaptive controller, of native FMUs: a run in milliseconds."""

from collections.abc import Mapping
from pathlib import Path

from grasp_cosim import System, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.interface.interface import Value
from grasp_cosim.recording.result import Result

Pair = tuple[float, float]


def adaptive_grasp(natives: Path) -> System:
    """The built-in system, native, its controller swapped."""
    grasp = System.load(SYSTEM, natives)
    return grasp.swap("controller", natives / "GraspControllerAdaptive.fmu")


def values_of(
    reflectance: Pair = (1.0, 1.0),
    x_m: float = 0.03,
    width: float = 0.07,
    mass: Pair = (0.5, 0.5),
    stiffness: float = 98.0,
) -> dict[str, Value]:
    """The values of a grasp that is the published one but for what is given, in SI units."""
    return {
        "sensor_1.reflectance": reflectance[0],
        "sensor_2.reflectance": reflectance[1],
        "plant.initial_object_position": x_m,
        "plant.object_width": width,
        "plant.finger_mass[1]": mass[0],
        "plant.finger_mass[2]": mass[1],
        "controller.contact_force.stiffness": stiffness,
    }


def run(grasp: System, values: Mapping[str, Value], step: float, stop: float) -> Result:
    """A run with these values; step and stop in s."""
    return simulate(grasp.with_values(values), step=step, stop=stop)


def last(result: Result, name: str) -> Pair:
    """The last values of a variable that each finger has."""
    return float(result[f"{name}[1]"][-1]), float(result[f"{name}[2]"][-1])
