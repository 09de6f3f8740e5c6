"""What counts as a grasp: the mean squeeze, while the fingers do not close any more."""

from math import sin

import pytest
from grasp_controller import contact_force, holding
from grasp_controller.adaptive import Inputs, Params
from hypothesis import given
from hypothesis import strategies as st
from support.approach import approach, run
from support.marks import examples

P = holding.Params()

FORCES = st.floats(-100.0, 100.0)
SPEEDS = st.floats(-1.0, 1.0)


@pytest.mark.parametrize(
    ("press", "closing", "hold"),
    [(0.0, 0.0, 0.0), (0.1, 0.0, 0.5), (0.1, 2e-3, 0.25), (0.1, -2e-3, 0.25), (1e3, 0.0, 1.0)],
)
def test_half_a_grasp_is_at_p_0_and_at_w_0(press, closing, hold):
    assert holding.hold(P, press, closing) == pytest.approx(hold, abs=1e-7)


@examples(50)
@given(st.floats(-0.2, 0.2), st.floats(0.01, 0.2), st.floats(-0.2, 0.2))
def test_no_target_makes_more_or_less_of_a_squeeze(x_m, width, target):
    """Two springs at rest to one point: their mean pull is K_i·W/2, wherever it is."""
    layer_1 = contact_force.Params()
    right, left = x_m + 0.5 * width, x_m - 0.5 * width
    u_1, u_2 = (contact_force.force(layer_1, x, 0.0, (target, 0.0)) for x in (right, left))
    press = 0.5 * layer_1.stiffness * width
    assert holding.hold(P, 0.5 * (u_2 - u_1), 0.0) == pytest.approx(
        press**2 / (press**2 + P.squeeze**2), rel=1e-9
    )


@examples(50)
@given(FORCES, FORCES, SPEEDS, st.floats(0.0, 10.0))
def test_to_press_more_holds_more_and_to_move_more_holds_less(u_1, u_2, closing, more):
    hold = holding.hold(P, 0.5 * (u_2 - u_1), closing)
    assert 0.0 <= hold <= 1.0
    rounding = 1e-12 * hold
    faster = closing + (more if closing > 0.0 else -more)
    assert holding.hold(P, 0.5 * (u_2 - u_1) + more, closing) >= hold - rounding
    assert holding.hold(P, 0.5 * (u_2 - u_1), faster) <= hold + rounding


@examples(50)
@given(st.floats(0.0, 100.0), SPEEDS)
def test_fingers_that_pull_apart_hold_nothing(pull, closing):
    assert holding.hold(P, -pull, closing) == 0.0


def test_the_speed_is_low_passed():
    """Towards the new one with the time constant, however many steps it is in."""
    once = holding.filtered(P, 1.0, 0.0, 0.03)
    twice = holding.filtered(P, holding.filtered(P, 1.0, 0.0, 0.015), 0.0, 0.015)
    assert twice == pytest.approx(once, rel=0.2)
    assert 0.1 < once < 0.5
    assert holding.filtered(P, 0.3, 0.3, 0.01) == pytest.approx(0.3, rel=1e-12)


def test_what_is_held_teaches_nothing():
    """A grasp pushed to and fro by 2 mm, its light rising with it by a tenth: no approach."""
    touching = approach((0.5, 1.0), end=0.0)
    *_, last = touching
    carried = [last._replace(velocity=(0.0, 0.0))] * 200
    for k in range(50):
        s, (x_1, x_2), (xi_1, xi_2) = 2e-3 * sin(0.3 * k), last.position, last.intensity
        seen = (xi_1 * (1.0 - 50.0 * s), xi_2 * (1.0 + 50.0 * s))
        carried.append(Inputs((x_1 + s, x_2 + s), (0.0, 0.0), seen))
    changes = []
    for hold in (holding.Params(), holding.Params(squeeze=1e12)):
        trace = run(Params(hold=hold), [*touching, *carried])
        held, after = (trace[k][0].estimate.beta for k in (len(touching) + 200, -1))
        changes.append(abs(after - held))
    with_hold, without = changes
    assert with_hold < 0.02 * without
