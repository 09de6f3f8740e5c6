"""A delicate body between two fingers: impacts, statics, energy, damage, lifting and slipping."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from gripper_plant import compliant, contact_laws, delicate, friction, lift, movable, zener
from gripper_plant.box import GRAVITY
from gripper_plant.delicate import Inputs, Params
from gripper_plant.lift import Lift
from gripper_plant.zener import Pad, Side
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.marks import examples

QUICK = examples(25)

HELD = Params(object_mass=1000.0, floor_friction=1.0, side=Side(800.0, 1200.0, 0.03))
"""So heavy that its middle stays where it is."""

M, V = 0.5, 0.2
"""kg and m/s of finger 1, which arrives; finger 2 stays away."""


def run(p, x, force, h):
    while True:
        x = delicate.step(p, x, Inputs(force), h)
        yield x


def after(p, x, force, h, n):
    return next(islice(run(p, x, force, h), n - 1, None))


def start(p):
    return delicate.initial_state(p, Inputs())


def seen(p, x):
    return delicate.outputs(p, x, Inputs())


def arrival(p):
    """Finger 1 at the surface, on its way in."""
    return start(p)._replace(position=(p.sides[0].surface, -0.11), velocity=(-V, 0.0))


def squeezed(p, force):
    """Both fingers at rest in relaxed sides, with which the forces are in balance."""
    k_inf, _, _ = p.law
    depth = force / k_inf
    half, middle = 0.5 * p.object_width, p.initial_object_position
    return start(p)._replace(
        position=(middle + half - depth, middle - half + depth),
        contact_force=(force, -force),
        dashpot=(depth, depth),
    )


def stored(p, x):
    """Energy of fingers, object across, and contacts, J."""
    kinetic = sum(0.5 * m * v * v for m, v in zip(p.finger_mass, x.velocity, strict=True))
    middle, speed = x.object
    half = 0.5 * p.object_width
    depths = (half + middle - x.position[0], half - middle + x.position[1])
    springs = sum(zener.energy(p.law, depth, z) for depth, z in zip(depths, x.dashpot, strict=True))
    return kinetic + 0.5 * p.object_mass * speed * speed + springs


@pytest.mark.parametrize(
    "p",
    [HELD, replace(HELD, pad=Pad(3000.0)), replace(HELD, side=Side(800.0, 2e4, 5e-4))],
    ids=["side", "pad", "Kelvin-Voigt"],
)
def test_an_impact_is_that_of_its_equation_until_it_lets_go(p):
    """Depth, speed and z by an ODE solver of side and pad; it flies on where F has come to 0."""
    k_inf, k_1, tau, k_p = (
        p.side.stiffness, p.side.relaxing_stiffness, p.side.relaxation_time, p.pad.stiffness,
    )  # fmt: skip

    def of_side(y):
        """Depth of the side: k_p·(depth - s) = k_inf·s + k_1·(s - z)."""
        return y[0] if k_p == 0.0 else (k_p * y[0] + k_1 * y[2]) / (k_p + k_inf + k_1)

    def force(y):
        s = of_side(y)
        return k_inf * s + k_1 * (s - y[2])

    def let_go(_, y):
        return force(y)

    let_go.terminal, let_go.direction = True, -1.0
    motion = solve_ivp(
        lambda _, y: [y[1], -force(y) / M, (of_side(y) - y[2]) / tau], (0.0, 0.5), (0.0, V, 0.0),
        "Radau", events=let_go, rtol=1e-10, atol=1e-14, dense_output=True,
    )  # fmt: skip
    end, h = float(motion.t_events[0][0]), 2e-4
    states = list(islice(run(p, arrival(p), (0.0, 0.0), h), int(1.3 * end / h)))
    for k, x in enumerate(states[: int(end / h)], 1):
        depth = p.sides[0].surface - x.position[0]
        assert depth == pytest.approx(motion.sol(k * h)[0], abs=3e-6)
        assert x.velocity[0] == pytest.approx(-motion.sol(k * h)[1], abs=1e-3 * V)
        assert delicate._dent(p, depth, x.dashpot[0]) == pytest.approx(
            of_side(motion.sol(k * h)), abs=4e-6
        )
    assert states[-1].velocity[0] == pytest.approx(-motion.y[1, -1], rel=2e-3)
    assert states[-1].contact_force == (0.0, 0.0)


def test_the_order_of_convergence():
    """Second, from before the contact into it: half the step, a quarter of the error."""
    p, t = replace(HELD, object_width=0.02, side=Side(400.0, 600.0, 0.01)), 0.03
    begin = arrival(p)._replace(position=(p.sides[0].surface + 0.00137, -0.11))
    steps = [100, 200, 400]
    fine = after(p, begin, (-0.5, 0.0), t / 3200, 3200)
    errors = [
        abs(after(p, begin, (-0.5, 0.0), t / n, n).position[0] - fine.position[0]) for n in steps
    ]
    order, _ = np.polyfit(np.log(steps), -np.log(errors), 1)
    assert order == pytest.approx(2.0, abs=0.3)


def test_a_pressed_object_relaxes_as_its_law_says():
    """With a pad: squeeze and gap are those of springs in series, in balance with the force."""
    p = replace(
        HELD,
        side=Side(500.0, 700.0, 0.02),
        pad=Pad(1500.0, 0.004),
        friction=friction.Params(viscous=(20.0, 20.0)),
        initial_position=(0.066, -0.006),
    )
    x = after(p, start(p), (-3.0, 3.0), 2e-3, 1500)
    y = seen(p, x)
    assert y.contact_force == pytest.approx((3.0, -3.0), rel=1e-6)
    assert y.squeeze == pytest.approx(2.0 * 3.0 / 500.0, rel=1e-6)
    assert y.gap == pytest.approx((0.004 - 0.002, 0.004 - 0.002), rel=1e-6)
    assert y.position[0] == pytest.approx(p.sides[0].surface - 0.006 - 0.002, rel=1e-6)
    assert y.contact == (True, True)
    assert seen(p, start(p)).gap == pytest.approx((0.001 + 0.004, 0.001 + 0.004), rel=1e-9)


def test_up_to_the_contact_it_is_the_compliant_plant_to_the_bit():
    other, p = compliant.Params(), Params()
    x, z = compliant.initial_state(other, Inputs()), start(p)
    for k in range(300):
        u = Inputs((-0.9 + 1e-4 * k, 0.7))
        x, z = compliant.step(other, x, u, 1e-3), delicate.step(p, z, u, 1e-3)
        if max(x.contact_force) > 0.0:
            break
        assert compliant.outputs(other, x, u)[:6] == delicate.outputs(p, z, u)[:6]
    assert k > 200


def test_without_relaxation_it_is_the_movable_box():
    """That is pushed at half its height and does not tilt; without damping."""
    law = contact_laws.KelvinVoigt(2000.0, 0.0)
    near = {"initial_position": (0.04, -0.04), "initial_object_position": 0.0}
    box = movable.Params(kelvin_voigt=law, contact_height=0.03, object_height=0.06, **near)
    p = Params(object_mass=0.05, side=Side(2000.0, 0.0, 1.0), **near)
    x, z = movable.initial_state(box, Inputs()), start(p)
    for _ in range(300):
        u = Inputs((-0.2, 0.5))
        x, z = movable.step(box, x, u, 5e-4), delicate.step(p, z, u, 5e-4)
    assert z.object == pytest.approx((x.box.x, x.box.v), rel=1e-5)
    assert abs(x.box.x) > 1e-3
    assert z.position == pytest.approx(x.position, rel=1e-5)


FORCES = st.tuples(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0))
HISTORIES = st.lists(st.tuples(FORCES, st.floats(5e-5, 2e-3)), min_size=5, max_size=12)


@st.composite
def plants(draw):
    """A body between fingers that are near, in motion, on the floor or in the air."""
    p = Params(
        finger_mass=(draw(st.floats(0.1, 2.0)), draw(st.floats(0.1, 2.0))),
        initial_object_position=0.0,
        object_mass=draw(st.floats(0.02, 1.0)),
        floor_friction=draw(st.sampled_from([0.0, 0.3, 0.9])),
        side=Side(
            draw(st.floats(100.0, 5e3)), draw(st.floats(0.0, 5e3)), draw(st.floats(1e-3, 9.0))
        ),
        pad=Pad(draw(st.sampled_from([0.0, 2e3]))),
        lift=Lift(draw(st.booleans())),
    )
    near, speeds = st.floats(-1e-3, 2e-3), st.floats(-0.3, 0.3)
    position = (0.035 + draw(near), -0.035 - draw(near))
    x = start(p)._replace(position=position, velocity=(draw(speeds), draw(speeds)))
    return p, x._replace(object=(0.0, draw(st.floats(-0.1, 0.1))))


@QUICK
@given(plants(), HISTORIES)
def test_contacts_push_only_and_nothing_gives_energy(begin, history):
    p, x = begin
    for force, h in history:
        before, x = x, delicate.step(p, x, Inputs(force), h)
        y = seen(p, x)
        assert y.contact_force[0] >= 0.0 >= y.contact_force[1]
        assert min(y.gap) >= 0.0
        moved = zip(force, before.position, x.position, strict=True)
        work = sum(f * (b - a) for f, a, b in moved)
        scale = stored(p, before) + stored(p, x) + abs(work)
        assert stored(p, x) - stored(p, before) - work <= 1e-9 * scale


# Damage

LIMITS = {
    "squeeze_limit": 2.0 * 2.0 / 800.0,
    "force_limit": 2.0,
    "pressure_limit": 2.0 / 1e-4,
}
"""What 2 N on a relaxed side come to."""


@pytest.mark.parametrize("name", LIMITS)
def test_what_is_above_a_limit_damages_for_good(name):
    side = replace(HELD, side=Side(800.0, 0.0, 1.0))
    for factor in (1.001, 0.999):
        p = replace(side, **{name: factor * LIMITS[name]})
        x = after(p, squeezed(p, 2.0), (-2.0, 2.0), 1e-3, 10)
        assert seen(p, x).damaged == (factor < 1.0)
        assert seen(p, x).peak_force == pytest.approx(2.0, rel=1e-9)
        assert seen(p, x).peak_pressure == pytest.approx(2.0e4, rel=1e-9)
        assert seen(p, after(p, x, (3.0, -3.0), 1e-3, 100)).damaged == (factor < 1.0)
    assert not seen(side, after(side, squeezed(side, 2.0), (-2.0, 2.0), 1e-3, 10)).damaged


def test_the_impulse_of_a_blow_damages_and_that_of_a_grasp_does_not():
    """An elastic blow that is over within 20 ms has 2·m·v; a grasp goes on without end."""
    stiff = replace(HELD, side=Side(2e4, 0.0, 1.0))
    for factor in (1.01, 0.99):
        p = replace(stiff, impulse_limit=factor * 2.0 * M * V)
        assert seen(p, after(p, arrival(p), (0.0, 0.0), 1e-3, 40)).damaged == (factor < 1.0)
    p = replace(stiff, impulse_limit=1.01 * 2.0 * 0.02)
    x = after(p, squeezed(p, 2.0), (-2.0, 2.0), 1e-3, 1000)
    assert not x.damaged
    p = replace(stiff, impulse_limit=0.99 * 2.0 * 0.02)
    assert after(p, squeezed(p, 2.0), (-2.0, 2.0), 1e-3, 25).damaged


# Lift

HELD_BY = 3.0
"""N."""

LIFTED = Params(
    object_mass=0.3,
    fingertip_friction=0.6,
    initial_object_position=0.0,
    side=Side(2000.0, 1000.0, 0.5),
    lift=Lift(True, 0.0, 1.0, 100.0, 100.0),
)


def test_it_hangs_by_friction_as_long_as_that_suffices():
    p = LIFTED
    y = seen(p, after(p, squeezed(p, HELD_BY), (-HELD_BY, HELD_BY), 1e-3, 200))
    demand = 0.3 * (GRAVITY + 1.0)
    assert demand < 2.0 * 0.6 * HELD_BY
    assert y.load == pytest.approx(demand, rel=1e-9)
    assert y.tangential_force == pytest.approx((0.5 * demand, 0.5 * demand), rel=1e-9)
    assert y.friction_limit == pytest.approx((0.6 * HELD_BY, 0.6 * HELD_BY), rel=1e-9)
    assert y.slip == pytest.approx(0.0, abs=1e-12)
    assert y.fingertip_height == pytest.approx(0.5 * 1.0 * 0.2**2, rel=1e-9)


def test_it_swings_between_the_fingers_as_three_masses_do():
    """In the air across, against an ODE solver: two fingers, the object, two sides that relax."""
    p, h = replace(LIFTED, side=Side(400.0, 600.0, 0.05)), 5e-4
    k_inf, k_1, tau = p.law
    right, left, half = -HELD_BY + 0.4, HELD_BY + 0.2, 0.5 * p.object_width
    x = after(p, squeezed(p, HELD_BY), (-HELD_BY, HELD_BY), h, 2)  # it hangs by then

    def rates(_, y):
        x_1, x_2, x_m, v_1, v_2, v_m, z_1, z_2 = y
        d_1, d_2 = x_m + half - x_1, x_2 - x_m + half
        f_1, f_2 = (k_inf * d + k_1 * (d - z) for d, z in ((d_1, z_1), (d_2, z_2)))
        return [v_1, v_2, v_m, (right + f_1) / M, (left - f_2) / M, (f_2 - f_1) / p.object_mass,
                (d_1 - z_1) / tau, (d_2 - z_2) / tau]  # fmt: skip

    begin = (*x.position, x.object[0], *x.velocity, x.object[1], *x.dashpot)
    end = solve_ivp(rates, (0.0, 0.15), begin, rtol=1e-10, atol=1e-13).y[:, -1]
    x = after(p, x, (right, left), h, 300)
    found = (*x.position, x.object[0], *x.velocity, x.object[1], *x.dashpot)
    assert found == pytest.approx(end, abs=2e-5)
    assert abs(x.object[0]) > 5e-3
    assert min(x.contact_force[0], -x.contact_force[1]) > 1.0


def test_it_slips_as_far_as_analysis_says_and_is_dropped():
    """1/2·(g + a - 2·mu·N/m)·t^2, until that is half its height: then nothing is touched."""
    p = replace(LIFTED, fingertip_friction=0.5, object_height=0.04)
    rate = GRAVITY + 1.0 - 2.0 * 0.5 * HELD_BY / 0.3
    moment = (2.0 * 0.02 / rate) ** 0.5
    states = run(p, squeezed(p, HELD_BY), (-HELD_BY, HELD_BY), 1e-3)
    for k, x in enumerate(islice(states, 400), 1):
        y = seen(p, x)
        t = 1e-3 * k
        assert y.dropped == (t > moment)
        if not y.dropped:
            assert y.slip == pytest.approx(0.5 * rate * t * t, rel=1e-6)
            continue
        if t > moment + 1e-3:
            assert (y.contact_force, y.contact) == ((0.0, 0.0), (False, False))
            assert y.gap == (delicate.NOTHING, delicate.NOTHING)
            assert (y.load, y.squeeze) == (0.0, 0.0)
    assert moment < 0.3


def test_the_lift_begins_when_it_is_due_or_enabled():
    due = replace(LIFTED, lift=Lift(True, 0.05, 1.0, 100.0, 100.0))
    off = replace(LIFTED, lift=Lift(False, 0.05, 1.0, 100.0, 100.0))
    x = squeezed(due, HELD_BY)
    y = seen(due, after(due, x, (-HELD_BY, HELD_BY), 1e-3, 150))
    assert y.fingertip_height == pytest.approx(0.5 * 0.1**2, rel=1e-9)
    x = after(off, x, (-HELD_BY, HELD_BY), 1e-3, 100)
    assert seen(off, x).load == seen(off, x).fingertip_height == 0.0
    y = seen(due, after(due, x, (-HELD_BY, HELD_BY), 1e-3, 100))
    assert y.fingertip_height == pytest.approx(0.5 * 0.1**2, rel=1e-9)


def test_the_floor_holds_a_body_and_the_air_does_not():
    """A finger that alone pushes less than the floor's friction does not shift it."""
    push = 0.8 * 0.3 * 0.3 * GRAVITY
    p = replace(LIFTED, floor_friction=0.3, lift=Lift(False))
    x = squeezed(p, push)._replace(position=(0.11, squeezed(p, push).position[1]))
    resting = after(p, x, (0.0, push), 1e-3, 50)
    assert resting.object == (0.0, 0.0)
    hung = after(LIFTED, squeezed(LIFTED, HELD_BY), (-HELD_BY, HELD_BY), 1e-3, 20)
    carried = after(LIFTED, hung, (-HELD_BY + 0.1, HELD_BY + 0.1), 1e-3, 400)
    way, speed = carried.object
    assert speed == pytest.approx(0.2 / 1.3 * 0.4, rel=0.05)
    assert way == pytest.approx(0.5 * 0.2 / 1.3 * 0.4**2, rel=0.05)
    assert lift.slip(carried.height) == pytest.approx(0.0, abs=1e-9)
