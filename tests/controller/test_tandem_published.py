"""The published law in sum and difference: its layers are series.py, and the wrist gives way."""

from dataclasses import replace

import numpy as np
import pytest
from grasp_controller import contact_force, impact_reduction, series, simultaneous_contact
from grasp_controller import tandem_published as published
from grasp_controller.tandem_published import Admittance, Inputs, Params
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.approach import ANY_SAMPLES, swapped
from support.marks import examples

SAMPLES = st.tuples(ANY_SAMPLES, st.floats(-20.0, 20.0)).map(
    lambda drawn: [Inputs(*u, drawn[1] * k) for k, u in enumerate(drawn[0])]
)

LAWS = st.builds(
    Params,
    st.builds(simultaneous_contact.Params, st.booleans()),
    st.builds(impact_reduction.Params, st.booleans()),
    st.builds(contact_force.Params, st.floats(0.0, 50.0), st.floats(1.0, 500.0)),
    st.builds(Admittance, st.floats(0.1, 5.0)),
)


def run(p, samples, h):
    x = published.initial_state(p, samples[0])
    trace = [(x, published.outputs(p, x, samples[0]))]
    for u in samples[1:]:
        x = published.step(p, x, u, h)
        trace.append((x, published.outputs(p, x, u)))
    return trace


@examples(40)
@given(LAWS, SAMPLES, st.floats(1e-5, 1e-2))
def test_the_grip_is_closed_by_the_difference_of_the_published_forces(p, samples, h):
    three = series.Params(p.simultaneous_contact, p.impact_reduction, p.contact_force)
    x = series.initial_state(three, series.Inputs(*samples[0][:3]))
    for k, (u, (_, y)) in enumerate(zip(samples, run(p, samples, h), strict=True)):
        taken = series.Inputs(*u[:3])
        if k:
            x = series.step(three, x, taken, h)
        z = series.outputs(three, x, taken)
        assert y.grip_force == z.force[0] - z.force[1]
        assert tuple(y)[2:] == tuple(z)[1:]


def given_way(p, wrist, s, v, f, h):
    """2m·X_c'' = -2·D_i·(X_c' - s') - 2·K_i·(X_c - s) + f, s moving with the speed that it has."""
    q, m = p.contact_force, p.admittance.mass

    def slope(t, x):
        to_go = x[0] - s
        return [x[1], (f - 2.0 * q.damping * (x[1] - v) - 2.0 * q.stiffness * to_go) / m]

    return solve_ivp(slope, (0.0, h), wrist, rtol=1e-11, atol=1e-14).y[:, -1]


@examples(15)
@given(LAWS, SAMPLES, st.floats(1e-3, 3e-2))
def test_the_wrist_gives_way_as_free_fingers_would(p, samples, h):
    """The mean of the virtual objects and its rate held at their values after the step."""
    trace = run(p, samples, h)
    for u, (before, _), (after, y) in zip(samples[1:], trace, trace[1:], strict=False):
        (s_1, v_1), (s_2, v_2) = after.layers.virtual
        s, v = 0.5 * (s_1 + s_2), 0.5 * (v_1 + v_2)
        expected = given_way(p, before.wrist, s, v, u.wrist_force, h)
        scale = 1.0 + np.abs(expected).max()
        assert after.wrist == pytest.approx(expected, abs=1e-8 * scale)
        assert y.wrist_command == after.wrist[0]


def test_it_starts_where_the_wrist_is_and_at_rest():
    x = published.initial_state(Params(), Inputs((0.13, -0.07)))
    assert x.wrist == pytest.approx((0.03, 0.0), abs=1e-15)


def test_a_force_at_the_wrist_moves_it_by_the_stiffness_of_both_fingers():
    """Settled, X_c = s + f/(2·K_i)."""
    p = Params(simultaneous_contact.Params(enabled=False), impact_reduction.Params(enabled=False))
    u = Inputs((0.11, -0.11), (0.0, 0.0), (0.03, 0.03), 1.96)
    assert run(p, [u] * 500, 1e-2)[-1][1].wrist_command == pytest.approx(0.01, abs=1e-9)


@examples(30)
@given(LAWS, SAMPLES, st.floats(1e-5, 1e-2))
def test_the_mirrored_controller_does_exactly_the_mirrored_thing(p, samples, h):
    images = [
        Inputs(swapped(u.position), swapped(u.velocity), u.intensity[::-1], -u.wrist_force)
        for u in samples
    ]
    for (_, y), (_, z) in zip(run(p, samples, h), run(p, images, h), strict=True):
        assert z.grip_force == y.grip_force
        assert (z.wrist_command, z.target_position) == (-y.wrist_command, -y.target_position)
        assert z.virtual_position == swapped(y.virtual_position)


def test_a_law_without_stiffness_holds_no_wrist():
    soft = contact_force.Params(stiffness=0.0)
    with pytest.raises(ValueError, match=r"^contact_force.stiffness = 0.0 N/m: must be from 1e-06"):
        replace(Params(), contact_force=soft)
