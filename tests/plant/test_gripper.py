"""What all grippers share: parameters and their ranges, the start, and that no side is special."""

from dataclasses import replace
from math import inf

import numpy as np
import pytest
from gripper_plant import (
    compliant,
    contact_laws,
    delicate,
    fingers,
    friction,
    lift,
    movable,
    rigid,
    zener,
)
from gripper_plant.box import Box
from gripper_plant.fingers import Inputs
from hypothesis import given
from hypothesis import strategies as st
from support.declared import parameters
from support.marks import examples

WIDE = {"initial_position": (10.0, -10.0), "initial_object_position": 0.0}
POINT = {"initial_position": {"object_width": 0.0}, "object_width": WIDE,
         "initial_object_position": WIDE | {"object_width": 0.0}}  # fmt: skip
"""Per parameter, the others such that both ends of its range are possible."""
PARTS = [
    *((block.Params, "") for block in (rigid, compliant, delicate, movable)),
    (friction.Params, "friction."), (zener.Side, "side."), (zener.Pad, "pad."),
    (lift.Lift, "lift."),
    (fingers.Actuator, "actuator."), (contact_laws.KelvinVoigt, "kelvin_voigt."),
    (contact_laws.HuntCrossley, "hunt_crossley."),
]  # fmt: skip


def refused(part, **values):
    with pytest.raises(ValueError, match=r"^[^\n]+$") as caught:
        part(**values)
    return str(caught.value)


@pytest.mark.parametrize(
    ("part", "prefix", "parameter"),
    [
        (part, prefix, p)
        for part, prefix in PARTS
        for p in parameters(part)
        if p.name not in ("object_height", "contact_height")  # which are compared with each other
    ],
    ids=lambda p: getattr(p, "name", getattr(p, "__module__", p)),
)
def test_a_value_outside_its_range_is_refused(part, prefix, parameter):
    assert -inf < parameter.low < parameter.high < inf
    for number, value in parameter.invalid():
        text = refused(part, **POINT.get(parameter.name, {}) | {parameter.name: value})
        unit = f" {parameter.unit}" if parameter.unit else ""
        assert text == f"{prefix}{parameter.name} = {number!r}{unit}: {parameter.valid}"


@pytest.mark.parametrize(
    ("part", "values", "said"),
    [
        (rigid.Params, {"object_width": 0.25, "initial_object_position": 0.0},
         "object_width = 0.25 m at initial_object_position = 0.0 m: the object spans -0.125 to "
         "0.125 m, must fit between the fingertips at -0.11 and 0.11 m"),
        (compliant.Params, {"initial_object_position": 0.08}, "spans 0.045 to 0.115 m, must fit"),
        (movable.Params, {"initial_object_position": -0.08}, "spans -0.115 to -0.045 m, must fit"),
        (rigid.Params, {"initial_object_position": 0.5}, "spans 0.465 to 0.535 m, must fit"),
        (rigid.Params, {"initial_position": (-0.11, 0.11)}, "fingertips at 0.11 and -0.11 m"),
        (movable.Params, {"contact_height": 0.2}, "contact_height = 0.2 m: must be from 0 to obje"),
    ],
)  # fmt: skip
def test_what_does_not_go_together_is_refused(part, values, said):
    assert said in refused(part, **values)


@pytest.mark.parametrize("block", [rigid, compliant, delicate, movable])
def test_the_start_is_at_rest_where_the_parameters_say(block):
    p = block.Params(initial_position=(0.2, -0.15), initial_object_position=-0.01)
    y = block.outputs(p, block.initial_state(p, Inputs()), Inputs())
    assert (y.position, y.velocity) == ((0.2, -0.15), (0.0, 0.0))
    assert (y.contact_force, y.contact) == ((0.0, 0.0), (False, False))
    assert (y.object_position, y.gap) == (-0.01, pytest.approx((0.175, 0.105), rel=1e-14))
    assert y.first_contact_time == (-1.0, -1.0)
    assert not any(np.hstack((0.0, *y._replace(first_contact_time=(0.0, 0.0))[6:])))
    p = block.Params(initial_position=(1.0, -0.5), object_width=1.5, initial_object_position=0.25)
    y = block.outputs(p, block.initial_state(p, Inputs()), Inputs())
    assert (y.gap, y.contact, y.contact_force) == ((0.0, 0.0), (True, True), (0.0, 0.0))


def test_the_actuator_gives_no_more_than_its_limit():
    limited, free = rigid.Params(actuator=fingers.Actuator((2.0, 0.5))), rigid.Params()
    for force, given_ in [((-3.0, 0.4), (-2.0, 0.4)), ((1.9, 0.6), (1.9, 0.5))]:
        assert fingers.forces(limited.actuator, Inputs(force)) == given_
        x = rigid.initial_state(free, Inputs())
        held = rigid.step(limited, x, Inputs(force), 1e-3)
        assert held == rigid.step(free, x, Inputs(given_), 1e-3)
    assert fingers.forces(fingers.Actuator((0.0, 1.0)), Inputs((-1e9, 1e9))) == (-1e9, 1.0)


def swapped(pair):
    """What is on the right, seen from behind."""
    first, second = pair
    return -second, -first


def mirrored(x):
    """The same state seen from behind the gripper."""
    pairs = {name: swapped(getattr(x, name)) for name in ("position", "velocity", "contact_force")}
    turned = {"box": Box(*(-value for value in x.box))} if hasattr(x, "box") else {}
    if hasattr(x, "dashpot"):
        turned = {
            "dashpot": x.dashpot[::-1],
            "object": (-x.object[0], -x.object[1]),
            "load": x.load._replace(tangential=x.load.tangential[::-1]),
            "blow_1": x.blow_2,
            "blow_2": x.blow_1,
        }
    return x._replace(touch=x.touch[::-1], **pairs, **turned)


@st.composite
def grippers(draw):
    """Close to an object, so that a few steps reach it, and moving."""
    block = draw(st.sampled_from([rigid, compliant, delicate, movable]))
    x_m = 0.0 if block is movable else draw(st.floats(-0.05, 0.05))  # tilts by what is rounded
    near, speeds, masses = st.floats(1e-6, 2e-3), st.floats(-0.3, 0.3), st.floats(0.05, 5.0)
    more = {}
    if block in (compliant, movable):
        more = {"hunt_crossley": contact_laws.HuntCrossley(draw(st.booleans()))}
    if block is delicate:
        more = {"lift": lift.Lift(draw(st.booleans())), "pad": zener.Pad(500.0)}
    if block is movable:
        more |= {"floor_friction": draw(st.sampled_from([0.0, 0.3, 0.9])), "contact_height": 0.08}
    p = block.Params(
        finger_mass=(draw(masses), draw(masses)),
        initial_position=(x_m + 0.035 + draw(near), x_m - 0.035 - draw(near)),
        initial_object_position=x_m,
        **more,
    )
    x = block.initial_state(p, Inputs())
    return block, p, x._replace(velocity=(draw(speeds), draw(speeds)))


FORCES = st.tuples(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0))


@examples(60)
@given(grippers(), st.lists(st.tuples(FORCES, st.floats(5e-5, 2e-3)), min_size=5, max_size=15))
def test_the_mirrored_gripper_does_exactly_the_mirrored_thing(start, history):
    block, p, x = start
    q = replace(
        p,
        finger_mass=p.finger_mass[::-1],
        initial_position=swapped(p.initial_position),
        initial_object_position=-p.initial_object_position,
    )
    z = mirrored(x)
    for force, h in history:
        x = block.step(p, x, Inputs(force), h)
        z = block.step(q, z, Inputs(swapped(force)), h)
        assert z == mirrored(x)
        y, w = block.outputs(p, x, Inputs()), block.outputs(q, z, Inputs())
        assert (w.gap, w.contact) == (y.gap[::-1], y.contact[::-1])
        assert w.object_position == -y.object_position
