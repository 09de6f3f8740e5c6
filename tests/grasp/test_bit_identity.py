"""The co-simulated FMUs give the bits of the same blocks called directly."""

from dataclasses import replace

import numpy as np
import pytest
from grasp_controller import contact_force, impact_reduction, series, simultaneous_contact
from grasp_cosim import simulate
from gripper_plant import rigid
from proximity_sensor import optics
from support.cases import CASES
from support.direct import closed_loop


def assert_same_bits(system, plant, sensors, controller, step, steps):
    ours = simulate(system, step=step, stop=step * steps)
    direct = closed_loop(plant, sensors, controller, step, steps)
    outputs = [name for name in ours if "exchange_energy" not in name]
    assert set(direct) == {"time", *outputs}
    assert ours.time.tobytes() == direct["time"].tobytes()
    different = [
        name
        for name in outputs
        if np.ascontiguousarray(ours[name]).tobytes()
        != np.ascontiguousarray(direct[name]).astype(ours[name].dtype).tobytes()
    ]
    assert different == []


def controller(case):
    return series.Params(
        simultaneous_contact.Params(enabled=case == 2), impact_reduction.Params(enabled=case >= 1)
    )


@pytest.mark.parametrize(("case", "step"), [(0, 1e-4), (1, 1e-3), (2, 1e-3), (2, 3.2e-3)])
def test_the_grasp(grasp, case, step):
    steps = round((0.5 if case == 0 else 2.56) / step)
    sensor = optics.Params()
    system = grasp.with_values(CASES[case])
    assert_same_bits(system, rigid.Params(), (sensor, sensor), controller(case), step, steps)


@pytest.mark.slow
def test_the_published_step(grasp):
    """10 kHz, from free flight into contact."""
    sensor = optics.Params()
    assert_same_bits(grasp, rigid.Params(), (sensor, sensor), controller(2), 1e-4, 20_000)


@pytest.mark.slow
def test_other_parameters(grasp):
    values = {
        "plant.finger_mass[1]": 0.41,
        "plant.finger_mass[2]": 0.63,
        "plant.initial_position[1]": 0.093,
        "plant.initial_position[2]": -0.127,
        "plant.object_width": 0.051,
        "plant.initial_object_position": -0.0123,
        "plant.baumgarte_alpha": 310.0,
        "plant.baumgarte_beta": 170.0,
        "sensor_1.reflectance": 0.86,
        "sensor_2.gain": 0.0031,
        "sensor_2.diffusion_exponent": 1.3,
        "sensor_2.offset_distance": 0.004,
        "controller.simultaneous_contact.gain": 2.2,
        "controller.simultaneous_contact.stiffness": 41.0,
        "controller.impact_reduction.damping": 7.0,
        "controller.impact_reduction.viscosity[2]": -0.7,
        "controller.contact_force.stiffness": 120.0,
    }
    plant = rigid.Params((0.41, 0.63), (0.093, -0.127), 0.051, -0.0123, 310.0, 170.0)
    sensors = (
        optics.Params(reflectance=0.86),
        optics.Params(gain=0.0031, diffusion_exponent=1.3, offset_distance=0.004),
    )
    layers = series.Params(
        replace(simultaneous_contact.Params(), gain=2.2, stiffness=41.0),
        replace(impact_reduction.Params(), damping=7.0, viscosity=(0.6, -0.7)),
        contact_force.Params(stiffness=120.0),
    )
    assert_same_bits(grasp.with_values(values), plant, sensors, layers, 5e-4, 5000)
