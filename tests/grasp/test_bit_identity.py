"""The co-simulated FMUs give the bits of the same blocks called directly."""

import numpy as np
import pytest
from grasp_controller import impact_reduction, series, simultaneous_contact
from grasp_cosim import simulate
from gripper_plant import rigid
from proximity_sensor import optics
from support.direct import closed_loop
from support.grasps import CASES


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
