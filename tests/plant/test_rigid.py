"""The gripper's parameters, and its symmetry: neither side of the gripper is special."""

from dataclasses import replace

import pytest
from gripper_plant import rigid
from gripper_plant.rigid import Inputs, Params, State
from hypothesis import given
from hypothesis import strategies as st
from support.declared import parameters
from support.marks import examples

PARAMETERS = parameters(Params)

WIDE = {"initial_position": (10.0, -10.0), "initial_object_position": 0.0}
"""The widest opening there is."""

POINT = WIDE | {"object_width": 0.0}
"""An object that fits wherever the fingers are."""

SURROUNDINGS = {
    "finger_mass": {},
    "initial_position": {"object_width": 0.0},
    "object_width": WIDE,
    "initial_object_position": POINT,
    "baumgarte_alpha": {},
    "baumgarte_beta": {},
}
"""Per parameter, the others such that both ends of its range are possible."""


def message(**values):
    with pytest.raises(ValueError, match=r".+") as caught:
        Params(**values)
    return str(caught.value)


def test_every_number_has_a_range():
    assert {p.name for p in PARAMETERS} == set(SURROUNDINGS)
    assert all(p.low < p.high for p in PARAMETERS)


@pytest.mark.parametrize("parameter", PARAMETERS, ids=lambda p: p.name)
def test_a_value_outside_its_range_is_refused(parameter):
    for number, value in parameter.invalid():
        text = message(**SURROUNDINGS[parameter.name] | {parameter.name: value})
        assert text.startswith(f"{parameter.name} = {number!r} {parameter.unit}: ")
        assert text.endswith(parameter.valid)
        assert "\n" not in text


@pytest.mark.parametrize(
    ("width", "x_m"),
    [(0.25, 0.0), (0.07, 0.08), (0.07, -0.08), (0.07, 0.5), (0.07, -0.5)],
    ids=["wider than the opening", "into 1", "into 2", "outside 1", "outside 2"],
)
def test_an_object_that_is_not_between_the_fingers_is_refused(width, x_m):
    text = message(object_width=width, initial_object_position=x_m)
    assert f"object_width = {width!r} m" in text
    assert f"initial_object_position = {x_m!r} m" in text
    assert f"{x_m - width / 2:g} to {x_m + width / 2:g} m" in text
    assert text.endswith("must fit between the fingertips at -0.11 and 0.11 m")
    assert "\n" not in text


def test_fingers_the_wrong_way_round_are_refused():
    assert "-0.11" in message(initial_position=(-0.11, 0.11))


def test_an_object_as_wide_as_the_opening_touches_both_fingers_and_pushes_neither():
    p = Params(initial_position=(1.0, -0.5), object_width=1.5, initial_object_position=0.25)
    y = rigid.outputs(p, rigid.initial_state(p, Inputs()), Inputs())
    assert y.gap == (0.0, 0.0)
    assert y.contact == (True, True)
    assert y.contact_force == (0.0, 0.0)


def test_the_start_is_at_rest_where_the_parameters_say():
    p = Params(initial_position=(0.2, -0.15), initial_object_position=-0.01)
    y = rigid.outputs(p, rigid.initial_state(p, Inputs()), Inputs())
    assert y.position == (0.2, -0.15)
    assert y.velocity == (0.0, 0.0)
    assert y.contact_force == (0.0, 0.0)
    assert y.object_position == -0.01
    assert y.contact == (False, False)
    assert y.gap == pytest.approx((0.2 - 0.025, 0.15 - 0.045), rel=1e-14)


def swapped(pair):
    first, second = pair
    return -second, -first


def mirrored(x):
    """The same motion seen from behind the gripper."""
    return State(swapped(x.position), swapped(x.velocity), swapped(x.contact_force))


@st.composite
def grippers(draw):
    """Close to an object anywhere, so that a few steps reach it."""
    x_m, width = draw(st.floats(-0.1, 0.1)), draw(st.floats(0.0, 0.1))
    near = st.floats(1e-6, 2e-3)
    return Params(
        finger_mass=(draw(st.floats(0.01, 10.0)), draw(st.floats(0.01, 10.0))),
        initial_position=(x_m + 0.5 * width + draw(near), x_m - 0.5 * width - draw(near)),
        object_width=width,
        initial_object_position=x_m,
        baumgarte_alpha=draw(st.floats(1.0, 1000.0)),
        baumgarte_beta=draw(st.floats(1.0, 1000.0)),
    )


FORCES = st.tuples(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
HISTORIES = st.lists(st.tuples(FORCES, st.floats(1e-5, 5e-3)), min_size=10, max_size=40)


@examples(60)
@given(grippers(), HISTORIES)
def test_the_mirrored_gripper_does_exactly_the_mirrored_thing(p, history):
    q = replace(
        p,
        finger_mass=p.finger_mass[::-1],
        initial_position=swapped(p.initial_position),
        initial_object_position=-p.initial_object_position,
    )
    x, z = rigid.initial_state(p, Inputs()), rigid.initial_state(q, Inputs())
    for force, h in history:
        x = rigid.step(p, x, Inputs(force), h)
        z = rigid.step(q, z, Inputs(swapped(force)), h)
        assert z == mirrored(x)
        y, w = rigid.outputs(p, x, Inputs(force)), rigid.outputs(q, z, Inputs(swapped(force)))
        assert w.gap == y.gap[::-1]
        assert w.contact == y.contact[::-1]
        assert w.object_position == -y.object_position
