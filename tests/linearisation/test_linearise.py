"""Linear models against closed forms: a mass, an exact sampled oscillator, the loop of layer 2."""

import math
from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import InputError, grasp_system, linearise, simulate
from grasp_cosim.system.parts import Fault, Port
from scipy.optimize import brentq

INTENSITY = "controller.intensity[1]"
GAP = 1e-5
AT_THE_SURFACE = {"plant.initial_object_position": 0.075 - GAP}
"""Finger 1 begins 110 mm from the middle, at rest, and the object is 70 mm wide."""


def layer_2(s, gap):
    """The loop of layer 2 at rest, by the numbers of the published table.

    f_p is a damper of D_p n/(l + l_0); it moves the virtual object, which the finger follows.
    """
    damper = 0.6 * 1.1506 / (gap + 0.005)
    virtual_object = 1.0 / (s * s + 10.0 * s + 25.0)
    finger = (14.0 * s + 98.0) / (0.5 * s * s + 14.0 * s + 98.0)
    return damper * s * virtual_object * finger


def margins_of_formula(gap=0.0, delay=0.0):
    """Crossover in rad/s, phase margin in degrees, delay margin in s."""
    crossover = brentq(lambda w: abs(layer_2(1j * w, gap)) - 1.0, 20.0, 300.0)
    margin = math.pi + np.angle(layer_2(1j * crossover, gap)) - crossover * delay
    return crossover, math.degrees(margin), margin / crossover


def loop_at_the_surface(step, scheme="sequential"):
    """Two steps after the start, as f_p is a difference of samples."""
    system = grasp_system().with_values(AT_THE_SURFACE)
    return linearise(system, 2.0 * step, [INTENSITY], [INTENSITY], step=step, scheme=scheme)


def test_the_loop_of_layer_2_at_the_surface_has_its_margins():
    crossover, phase, delay = margins_of_formula()
    assert (crossover, phase, delay) == pytest.approx((60.6, 28.9, 8.3e-3), rel=3e-3)
    found, exact = loop_at_the_surface(1e-5).margins(), margins_of_formula(GAP)
    assert found[:3] == pytest.approx(exact, rel=2e-3)  # layer 3 is in the loop as well
    assert found.stable


def test_sampling_costs_half_a_step_of_delay():
    """f_p is a difference over a step, and the finger's force is held for one, while the virtual
    object goes to the end of the step by the f_p of that end.
    """
    found = loop_at_the_surface(1e-3).margins()
    assert found.delay_margin == pytest.approx(margins_of_formula(GAP, 0.5e-3)[2], rel=0.01)


def test_jacobi_costs_two_steps_more():
    """That of the intensity is in the loop, and that of the force; a position is the sensor's."""
    lost = [loop_at_the_surface(1e-4, s).margins().delay_margin for s in ("sequential", "jacobi")]
    assert lost[0] - lost[1] == pytest.approx(2e-4, rel=0.1)


def test_the_output_that_feeds_an_opened_input_closes_the_same_loop():
    system = grasp_system().with_experiment(step=1e-3)
    here = linearise(system, 0.5, [INTENSITY], [INTENSITY])
    there = linearise(system, 0.5, [INTENSITY], ["sensor_1.intensity"])
    assert there.margins() == here.margins()


def test_a_finger_in_the_air_is_the_double_integrator_of_its_mass():
    """Exact for a force held over a step: h^2/(2m) (z + 1)/(z - 1)^2 and h/m / (z - 1)."""
    step, mass, omega = 1e-3, 0.5, np.array([1.0, 100.0, 1000.0])
    outputs = ["plant.position[1]", "plant.velocity[1]"]
    found = linearise(grasp_system(), 0.2, ["plant.force[1]"], outputs, step=step)
    z = np.exp(1j * omega * step)
    exact = np.stack([step**2 / (2 * mass) * (z + 1) / (z - 1) ** 2, step / mass / (z - 1)], 1)
    np.testing.assert_allclose(found.frequency_response(omega)[:, :, 0], exact, rtol=2e-5)


def test_a_closed_system_moves_as_its_model_says():
    """A small step of a parameter: the difference of two runs is that of the model."""
    name, step, after = "controller.contact_force.stiffness", 1e-3, 50
    system = grasp_system().with_experiment(step=step, stop=1.0)
    found = linearise(system, 0.5, [name], ["plant.position[1]"])
    change, x = 1e-3, np.zeros(len(found.states))
    runs = []
    for value in (98.0, 98.0 + change):
        with simulate.session(system) as session:
            session.step(500)
            session.set(name, value)
            session.step(after)
            runs.append(session["plant.position[1]"])
    for _ in range(after):
        x = found.A @ x + found.B[:, 0] * change
    assert runs[1] - runs[0] == pytest.approx(float(found.C[0] @ x), rel=1e-3)


def test_a_model_of_python_fmus_is_that_of_their_twins():
    where = {"at": 0.3, "inputs": [INTENSITY], "outputs": ["controller.force[1]"], "step": 1e-3}
    python, native = (linearise(grasp_system(native=native), **where) for native in (False, True))
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(python, name), getattr(native, name))


def test_a_loop_that_swings_in_a_run_is_not_stable_in_its_model():
    """At 40 ms the virtual force of layer 2 swings at each step: docs/explanation/limits.md."""
    swings = []
    for step in (0.02, 0.04):
        poles = linearise(grasp_system(), 1.0, step=step).poles
        swings.append(np.abs(poles[poles.imag != 0.0]).max())
    assert swings[0] < 0.95 < 1.05 < swings[1]


def test_a_fault_that_remembers_is_refused():
    fault = Fault(Port("controller", "intensity[1]"), "delay", {"time": 1e-3})
    system = replace(grasp_system(), faults=(fault,))
    with pytest.raises(InputError, match="delay: has states that are not in the model"):
        linearise(system, 0.0)


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ({"at": 0.00015}, "at = 0.00015 s: must be a whole number of steps of 0.0001 s after 0 s"),
        ({"at": 3.0}, "and one before 3 s"),
        ({"inputs": ["plant.forse[1]"]}, "did you mean force\\[1\\]"),
        ({"inputs": ["plant.gap[1]"]}, "no input, or tunable parameter, that is a Real"),
        ({"outputs": ["plant.gab[1]"]}, "plant.gab\\[1\\]"),
    ],
)
def test_what_cannot_be_is_said_in_a_line(where, said):
    given = {"at": 0.0, "inputs": (), "outputs": ["plant.gap[1]"], **where}
    with pytest.raises(InputError, match=said):
        linearise(grasp_system(), **given)


def test_a_single_name_may_stand_alone():
    name = "controller.intensity[1]"
    found = linearise(grasp_system(), 0.01, name, name)
    assert (found.inputs, found.outputs) == ((name,), (name,))
