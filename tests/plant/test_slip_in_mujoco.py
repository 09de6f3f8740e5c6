"""How a body slips out of a grasp that is lifted, against MuJoCo: another maker's friction."""

import pytest
from gripper_plant import delicate
from gripper_plant.box import GRAVITY
from gripper_plant.delicate import Inputs, Params
from gripper_plant.lift import Height, Lift
from gripper_plant.zener import Side

mujoco = pytest.importorskip("mujoco", reason="NO mujoco: pip install mujoco-core")

pytestmark = pytest.mark.slow

FORCE, MASS, ACCELERATION = 3.0, 0.3, 1.0
"""N with which each finger presses, kg of the body, m/s^2 of the lift."""

T = 0.15
"""s."""


def slip_in_mujoco(friction):
    """Way in m by which a box slips between two fingers that a slide lifts, in T seconds.

    The slide is so heavy that the box does not slow it down.
    """
    big = 1e4
    contact = 'solref="0.002 1" solimp="0.9999 0.9999 1" condim="3"'
    finger = """
      <body pos="{0} 0 0"><inertial pos="0 0 0" mass="0.5" diaginertia="1 1 1"/>
        <joint type="slide" axis="1 0 0"/><geom name="{1}" type="sphere" size="0.005"/></body>"""
    fingers = finger.format(0.035, "right") + finger.format(-0.035, "left")
    model = mujoco.MjModel.from_xml_string(f"""
<mujoco>
  <option integrator="Euler" solver="Newton" cone="elliptic" tolerance="1e-12" timestep="1e-4"
    gravity="0 0 {-GRAVITY!r}" impratio="100"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody>
    <body><inertial pos="0 0 0" mass="{big}" diaginertia="1 1 1"/>
      <joint type="slide" axis="0 0 1"/>{fingers}
    </body>
    <body><inertial pos="0 0 0" mass="{MASS}" diaginertia="1e-3 1e-3 1e-3"/>
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 0 1"/>
      <geom name="box" type="box" size="0.03 0.1 0.1"/></body>
  </worldbody>
  <contact>
    <pair geom1="right" geom2="box" friction="{friction!r} {friction!r}" {contact}/>
    <pair geom1="left" geom2="box" friction="{friction!r} {friction!r}" {contact}/>
  </contact>
</mujoco>""")
    data = mujoco.MjData(model)
    data.qfrc_applied[1:3] = -FORCE, FORCE
    data.qfrc_applied[0] = (big + 1.0) * (GRAVITY + ACCELERATION)
    mujoco.mj_step(model, data, round(T / 1e-4))
    return float(data.qpos[0] - data.qpos[4])


def slip_of_ours(friction):
    p = Params(
        object_mass=MASS,
        object_height=1.0,
        object_width=0.06,
        initial_object_position=0.0,
        fingertip_friction=friction,
        side=Side(2000.0, 0.0, 1.0),
        lift=Lift(True, 0.0, ACCELERATION, 100.0, 100.0),
    )
    depth = FORCE / 2000.0
    x = delicate.initial_state(p, Inputs())
    x = x._replace(
        position=(0.03 - depth, depth - 0.03),
        contact_force=(FORCE, -FORCE),
        height=Height(1.0, 0.0, 1.0, 0.0),
    )
    for _ in range(150):
        x = delicate.step(p, x, Inputs((-FORCE, FORCE)), 1e-3)
    return delicate.outputs(p, x, Inputs()).slip


@pytest.mark.parametrize("friction", [0.1, 0.3, 0.45])
def test_it_slips_as_far(friction):
    expected = 0.5 * (GRAVITY + ACCELERATION - 2.0 * friction * FORCE / MASS) * T * T
    assert slip_of_ours(friction) == pytest.approx(expected, rel=1e-6)
    assert slip_in_mujoco(friction) == pytest.approx(slip_of_ours(friction), rel=0.01)


def test_it_sticks_beyond_the_onset():
    """At 2·mu·N = m·(g + a) + 4 %: MuJoCo creeps, by less than the hundredth part of a slip."""
    onset = MASS * (GRAVITY + ACCELERATION) / (2.0 * FORCE)
    assert slip_of_ours(1.04 * onset) == pytest.approx(0.0, abs=1e-12)
    assert abs(slip_in_mujoco(1.04 * onset)) < 2e-4
    assert slip_of_ours(0.96 * onset) > 4e-3
    assert slip_in_mujoco(0.96 * onset) == pytest.approx(slip_of_ours(0.96 * onset), rel=0.02)
