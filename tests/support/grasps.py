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


N, L_0 = 1.1506, 5e-3
"""Of the sensors by default; l_0 in m."""


def calibrated(fingers, n=None, l_0=None):
    """Values of sensors that read 1.07 V of a white face that they touch, which the law knows."""
    values = {}
    for j in range(1, fingers + 1):
        exponent, offset = n[j - 1] if n else N, l_0[j - 1] if l_0 else L_0
        gain = 2.4e-3 * L_0**-N * offset**exponent
        sensor = {"diffusion_exponent": exponent, "offset_distance": offset, "gain": gain}
        values |= {f"sensor_{j}.{name}": value for name, value in sensor.items()}
        values |= {f"controller.reflectance.{name}[{j}]": v for name, v in sensor.items()}
    return values
