"""Events and faults in runs of the built-in grasp, against the sensor's equation and NumPy."""

from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import SimulationError, simulate
from grasp_cosim.system.parts import Condition, Event, Fault, Port

STEP = 1e-3
GAP = Port("sensor_1", "gap")
REFLECTANCE = Port("sensor_1", "reflectance")


def intensity(gap, reflectance=1.0):
    """Eq. (9) in V, for a gap in m."""
    return np.asarray(0.0024 * reflectance / (np.maximum(gap, 0.0) + 0.005) ** 1.1506)


def run(system, stop=0.3, **changes):
    return simulate(replace(system, **changes), step=STEP, stop=stop)


def on_gap(kind, start=0, end=None, **given):
    """A fault of the connection to sensor 1, with a window in steps."""
    unit = round(STEP * 1e9)
    return Fault(GAP, kind, given, start * unit, None if end is None else end * unit)


def test_a_change_of_reflectance_moves_the_target(grasp):
    """Finger 1's side gets darker: it looks further away, so the target moves its way."""
    event = Event({REFLECTANCE: 0.6}, at_ns=100_000_000)
    plain, changed = run(grasp), run(grasp, events=(event,))
    k = 100  # the row of the event: what it sets acts on the step from there
    for name in plain:
        assert plain[name][: k + 1].tobytes() == changed[name][: k + 1].tobytes()
    alpha = np.where(np.arange(301) <= k, 1.0, 0.6)
    expected = intensity(changed["plant.gap[1]"], alpha)
    assert changed["sensor_1.intensity"] == pytest.approx(expected, rel=1e-12)
    xi_1, xi_2 = changed["sensor_1.intensity"], changed["sensor_2.intensity"]
    force = 3.0 * np.tanh((xi_1 - xi_2) / (xi_1 + xi_2))
    assert changed["controller.simultaneous_contact_force"] == pytest.approx(force, rel=1e-12)
    difference = changed["controller.target_position"] - plain["controller.target_position"]
    assert not difference[: k + 1].any()
    assert (np.diff(difference[k + 1 :]) < 0).all()
    assert "t = 0.1 s: sensor_1.reflectance = 0.6" in changed.log


TUNED = {
    "plant.finger_mass[1]": 0.8,
    "plant.friction.coulomb[2]": 0.05,
    "plant.actuator.force_limit[1]": 0.5,
    "controller.simultaneous_contact.enabled": False,
    "controller.impact_reduction.viscosity[2]": -0.4,
}
"""What acts by the steps alone."""


def test_an_event_at_the_start_is_a_start_value(grasp):
    at_once = Event({Port(*name.split(".", 1)): v for name, v in TUNED.items()}, at_ns=0)
    changed, began = run(grasp, events=(at_once,)), run(grasp.with_values(TUNED))
    for name in began:
        assert changed[name][1:].tobytes() == began[name][1:].tobytes(), name
    assert changed["plant.position[1]"][-1] != run(grasp)["plant.position[1]"][-1]
    assert "t = 0 s: controller.simultaneous_contact.enabled = false" in changed.log


def test_values_that_do_not_go_together_end_the_run_with_the_reason(grasp):
    low, high = (Port("sensor_1", f"adc.range[{i}]") for i in (1, 2))
    event = Event({low: 20.0, Port("sensor_1", "surface"): "black"}, at_ns=10_000_000)
    with pytest.raises(SimulationError, match=r"adc\.range = 20\.0, 10\.0 V: the second must be"):
        run(grasp, events=(event,))
    back = Event({high: 30.0}, at_ns=10_000_000)
    result = run(grasp, events=(event, back))
    assert result["sensor_1.intensity"][11] == pytest.approx(
        intensity(result["plant.gap[1]"], 0.57)[11]
    )


def test_a_fault_from_0_acts_at_t_0(grasp):
    result = run(grasp, stop=0.01, faults=(on_gap("bias", value=0.003),))
    expected = intensity(result["plant.gap[1]"] + 0.003)
    assert result["sensor_1.intensity"] == pytest.approx(expected, rel=1e-12)


FULL = {
    "events": (
        Event({REFLECTANCE: 0.6}, at_ns=50_000_000),
        Event({REFLECTANCE: 0.8}, when=Condition(Port("plant", "gap[1]"), "<", 0.04)),
    ),
    "faults": (
        on_gap("noise", standard_deviation=1e-4),
        on_gap("quantisation", 20, step=1e-5),
        Fault(Port("sensor_2", "gap"), "dropout", {"probability": 0.3}, seed=5),
        Fault(Port("controller", "position[1]"), "delay", {"time": 0.003}),
        Fault(Port("controller", "velocity[2]"), "stuck", {}, 30_000_000, 60_000_000),
        Fault(Port("controller", "intensity[1]"), "saturation", {"high": 0.4}, 10_000_000),
        Fault(Port("plant", "force[1]"), "bias", {"value": -0.1}, 70_000_000),
    ),
}


def bits(result):
    return {name: np.ascontiguousarray(result[name]).tobytes() for name in result}


def test_the_same_run_twice_gives_the_same_bits(grasp):
    assert bits(run(grasp, **FULL)) == bits(run(grasp, **FULL))


def test_a_surface_set_by_name_has_its_reflectance(grasp):
    results = []
    for name, value in (("sensor_1.reflectance", 0.86), ("sensor_1.surface", "brown")):
        with simulate.session(grasp, step=STEP, stop=0.1) as session:
            session.step(20)
            session.set(name, value)
            session.step(80)
            results.append(session.result())
    by_number, by_name = results
    assert bits(by_name) == bits(by_number) != bits(run(grasp, 0.1))


def test_what_did_not_happen_is_in_the_log(grasp):
    event = Event({REFLECTANCE: 0.6}, at_ns=10_000_000)
    with simulate.session(replace(grasp, events=(event,)), step=STEP, stop=0.01) as session:
        session.step(9)
        assert session.result().log == ()
        session.step()
        line = "events[0] did not happen: no step began at or after t = 0.01 s"
        assert session.result().log == (line,)
