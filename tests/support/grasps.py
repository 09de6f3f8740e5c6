"""Grasps: values of the built-in cases, and runs with the adaptive controller, in milliseconds."""

from grasp_cosim import System, simulate
from grasp_cosim.grasp.presets import CASES as NUMBERS
from grasp_cosim.grasp.presets import SYSTEM, built_in_presets

Pair = tuple[float, float]


def adaptive_grasp(natives):
    """The built-in system, native, its controller swapped."""
    grasp = System.load(SYSTEM, natives)
    return grasp.swap("controller", natives / "GraspControllerAdaptive.fmu")


def values_of(reflectance=(1.0, 1.0), x_m=0.03, width=0.07, mass=(0.5, 0.5), stiffness=98.0):
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


def run(grasp, values, step, stop):
    """A run with these values; step and stop in s."""
    return simulate(grasp.with_values(values), step=step, stop=stop)


def last(result, name):
    """The last values of a variable that each finger has."""
    return float(result[f"{name}[1]"][-1]), float(result[f"{name}[2]"][-1])


CASES = {n: built_in_presets()[f"case_{n}"] for n in NUMBERS}
