"""The three layers in series: the cases, the start, the symmetry and the parameters."""

from itertools import pairwise
from math import log, tanh

import numpy as np
import pytest
from grasp_controller import contact_force as layer_1
from grasp_controller import impact_reduction as layer_2
from grasp_controller import series
from grasp_controller import simultaneous_contact as layer_3
from grasp_controller.series import Inputs, Params
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.approach import ANY_SAMPLES, assert_mirrored, mirrored
from support.marks import examples

QUICK = examples(60)


def switched(layer_3_on, layer_2_on):
    return Params(
        simultaneous_contact=layer_3.Params(enabled=layer_3_on),
        impact_reduction=layer_2.Params(enabled=layer_2_on),
    )


CASE_0, CASE_1, CASE_2 = switched(False, False), switched(False, True), switched(True, True)

NO_IMPACT_REDUCTION = switched(True, False)

SAMPLES = [
    Inputs((0.11, -0.11), (0.0, 0.0), (0.030, 0.010)),
    Inputs((0.10, -0.09), (-0.2, 0.3), (0.035, 0.013)),
    Inputs((0.08, -0.085), (-0.1, 0.1), (0.061, 0.012)),
    Inputs((0.07, -0.07), (-0.05, 0.2), (0.079, 0.020)),
]
"""Two fingers that close, the right one nearer the object."""

H = 0.02
"""A step in s, long enough to see what is held over it."""


def run(p, samples, h=H):
    """From the first sample on, the state and outputs at each."""
    x = series.initial_state(p, samples[0])
    trace = [(x, series.outputs(p, x, samples[0]))]
    for u in samples[1:]:
        x = series.step(p, x, u, h)
        trace.append((x, series.outputs(p, x, u)))
    return trace


def virtual_forces(u, before):
    """Eqs. (2) and (5) with the published gains."""
    xi_1, xi_2 = u.intensity
    f_s = 3.0 * tanh((xi_1 - xi_2) / (xi_1 + xi_2))
    rates = [
        (log(xi) - log(was)) / H for xi, was in zip(u.intensity, before.intensity, strict=True)
    ]
    return f_s, (0.6 * rates[0], -0.6 * rates[1])


def derivative(z, x_d, f_s, f_p, layer_3_on):
    """Eqs. (3) and (6) for x_v2, x_v11, x_v21 and their rates; without (3) x_v2 stands still."""
    x, y_1, y_2, v, w_1, w_2 = z
    a = f_s - 12.0 * v - 36.0 * (x - x_d) if layer_3_on else 0.0
    a_1 = a + f_p[0] - 10.0 * (w_1 - v) - 25.0 * (y_1 - x)
    a_2 = a + f_p[1] - 10.0 * (w_2 - v) - 25.0 * (y_2 - x)
    return [v, w_1, w_2, a, a_1, a_2]


def integrated(layer_3_on):
    """x_v2, x_v11, x_v21 and their rates at each of the samples but the first."""
    z = [0.0, 0.11, -0.11, 0.0, 0.0, 0.0]
    trace = []
    for before, u in pairwise(SAMPLES):
        x_d = 0.5 * sum(u.position)
        motion = solve_ivp(
            lambda _, z, *held: derivative(z, *held),
            (0.0, H),
            z if layer_3_on else [x_d, *z[1:]],
            args=(x_d, *virtual_forces(u, before), layer_3_on),
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
        )
        z = motion.y[:, -1].tolist()
        trace.append(z)
    return trace


@pytest.mark.parametrize(("p", "layer_3_on"), [(CASE_1, False), (CASE_2, True)])
def test_the_controller_is_its_equations_integrated(p, layer_3_on):
    for u, (_, y), z in zip(SAMPLES[1:], run(p, SAMPLES)[1:], integrated(layer_3_on), strict=True):
        x, v = z[:3], z[3:]
        expected = [
            -14.0 * (u.velocity[j] - v[j + 1]) - 98.0 * (u.position[j] - x[j + 1]) for j in (0, 1)
        ]
        assert y.target_position == pytest.approx(x[0], abs=1e-11)
        assert y.virtual_position == pytest.approx(x[1:], abs=1e-11)
        np.testing.assert_allclose(y.force, expected, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("p", [CASE_0, CASE_1, CASE_2, NO_IMPACT_REDUCTION])
def test_the_virtual_forces_are_shown_in_every_case(p):
    for n, (_, y) in enumerate(run(p, SAMPLES)):
        f_s, f_p = virtual_forces(SAMPLES[n], SAMPLES[max(n - 1, 0)])
        assert y.simultaneous_contact_force == pytest.approx(f_s, rel=1e-12)
        assert y.impact_reduction_force == pytest.approx(f_p, rel=1e-12)


def test_case_0_heads_for_the_middle_directly():
    for u, (_, y) in zip(SAMPLES, run(CASE_0, SAMPLES), strict=True):
        x_d = 0.5 * sum(u.position)
        assert y.target_position == x_d
        assert y.virtual_position == (x_d, x_d)
        expected = [-14.0 * u.velocity[j] - 98.0 * (u.position[j] - x_d) for j in (0, 1)]
        assert y.force == pytest.approx(expected, rel=1e-13)


@pytest.mark.parametrize(
    ("before", "after"),
    [(CASE_1, CASE_2), (CASE_0, NO_IMPACT_REDUCTION), (CASE_0, CASE_1),
     (NO_IMPACT_REDUCTION, CASE_2)],
)  # fmt: skip
def test_a_layer_that_is_switched_on_takes_over_without_a_jump(before, after):
    """It begins at the layer above, and from there goes its own way."""
    x, y = run(before, SAMPLES)[-1]
    assert series.outputs(after, x, SAMPLES[-1]) == y
    x_before, x_after = (series.step(p, x, SAMPLES[0], H) for p in (before, after))
    assert series.outputs(after, x_after, SAMPLES[0]) != series.outputs(
        before, x_before, SAMPLES[0]
    )


@pytest.mark.parametrize("p", [CASE_0, CASE_1, CASE_2, NO_IMPACT_REDUCTION])
def test_the_force_follows_the_sample_it_is_asked_for(p):
    """Also where it is not the one of the last step; the virtual objects do not move by it."""
    x, y = run(p, SAMPLES)[-1]
    u = Inputs((0.05, 0.01), (0.4, -0.3), (1.0, 2.0))
    now = series.outputs(p, x, u)
    if not p.simultaneous_contact.enabled:
        assert now.target_position == pytest.approx(0.03, rel=1e-15)
    else:
        assert now.target_position == y.target_position
    if p.impact_reduction.enabled:
        assert now.virtual_position == y.virtual_position
    else:
        assert now.virtual_position == (now.target_position,) * 2
    for j in (0, 1):
        push = -14.0 * (u.velocity[j] - SAMPLES[-1].velocity[j])
        push -= 98.0 * (u.position[j] - SAMPLES[-1].position[j])
        push += 98.0 * (now.virtual_position[j] - y.virtual_position[j])
        assert now.force[j] - y.force[j] == pytest.approx(push, rel=1e-12)


@st.composite
def controllers(draw):
    """Any of the cases; the viscosities +D_p and -D_p map onto each other."""
    mass, damping, stiffness = st.floats(0.1, 5.0), st.floats(0.0, 50.0), st.floats(1.0, 200.0)
    viscosity = draw(st.floats(0.0, 2.0))
    return Params(
        layer_3.Params(
            draw(st.booleans()), draw(mass), draw(damping), draw(stiffness), draw(st.floats(-5, 5))
        ),
        layer_2.Params(
            draw(st.booleans()),
            draw(mass),
            draw(damping),
            draw(stiffness),
            (viscosity, -viscosity),
        ),
        layer_1.Params(draw(damping), draw(stiffness)),
    )


@QUICK
@given(
    st.sampled_from([CASE_0, CASE_1, CASE_2]) | controllers(),
    ANY_SAMPLES,
    st.floats(1e-5, 1e-2),
)
def test_the_mirrored_controller_does_exactly_the_mirrored_thing(p, samples, h):
    images = run(p, [mirrored(u) for u in samples], h)
    for (_, y), (_, z) in zip(run(p, samples, h), images, strict=True):
        assert_mirrored(y, z)
