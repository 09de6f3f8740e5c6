"""The plants of a hand against scipy, and what they refuse."""

import math

import numpy as np
import pytest
from gripper_plant import hand, hand_movable
from gripper_plant.hand_fingers import Pose, Ray, Shape, normal, surface
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

H = 1e-3
ANGLES = hand.Params().angle
G = 9.80665


def run(block, p, forces, seconds):
    x = block.initial_state(p, block.Inputs(forces))
    for _ in range(round(seconds / H)):
        x = block.step(p, x, block.Inputs(forces), H)
    return x


def test_a_free_finger_arrives_where_its_face_is():
    """At once: s = s_0 - u·t^2/(2·m) meets the surface of a prism that is off centre and turned."""
    p = hand.Params(initial_object_position=(0.004, -0.007), initial_object_angle=0.1)
    for k, angle in enumerate(ANGLES):
        n = np.array([math.cos(angle + 0.1), math.sin(angle + 0.1)])
        e = np.array([math.cos(angle), math.sin(angle)])
        face = (0.035 + n @ (0.004, -0.007)) / (n @ e)
        assert p.surfaces[k] == pytest.approx(face, abs=1e-15)
        moment = math.sqrt(2.0 * 0.5 * (0.11 - face) / 1.0)
        before, after = (run(hand, p, (-1.0,) * 3, round(moment, 3) + d) for d in (-2e-3, 2e-3))
        assert hand.outputs(p, before, hand.Inputs()).gap[k] > 0.0
        assert hand.outputs(p, after, hand.Inputs()).contact[k]


@given(st.floats(-0.02, 0.02), st.floats(-0.02, 0.02), st.floats(0.0, 2.0 * math.pi))
def test_a_disc_begins_on_a_ray_where_it_is_as_far_from_the_centre_as_its_radius(x, y, angle):
    ray = Ray(math.cos(angle), math.sin(angle), angle, 1.0)
    s = surface(Shape.DISC, 0.035, ray, Pose(x, y, 0.0))
    assert math.hypot(s * ray.x - x, s * ray.y - y) == pytest.approx(0.035)
    at = normal(Shape.DISC, 0.035, 1.0, ray, Pose(x, y, 0.0), s)
    assert at.depth == pytest.approx(0.0, abs=1e-12)
    assert math.hypot(at.x, at.y) == pytest.approx(1.0)


def of_scipy(p, forces, seconds):
    """The same equations, friction of the floor smoothed over 10 um/s and 0.1 mrad/s."""
    k, c = p.kelvin_voigt.stiffness, p.kelvin_voigt.damping
    m, r = p.object_mass, p.radius_of_gyration
    drag = p.floor_friction * m * G

    def rates(_, z):
        s, v, (x, y, turn), (vx, vy, w) = z[:3], z[3:6], z[6:9], z[9:]
        push, moment, on_fingers = np.zeros(2), 0.0, []
        for i, angle in enumerate(ANGLES):
            e = np.array([math.cos(angle), math.sin(angle)])
            n = np.array([math.cos(angle + turn), math.sin(angle + turn)])
            arm = s[i] * e - (x, y)
            speed_there = np.array([vx, vy]) + w * np.array([-arm[1], arm[0]])
            depth = p.half_width[i] - arm @ n
            sinking = (speed_there - v[i] * e) @ n
            f = max(0.0, k * depth + c * sinking) if depth > 0.0 else 0.0
            push, moment = push - f * n, moment - f * (arm[0] * n[1] - arm[1] * n[0])
            on_fingers.append((forces[i] + f * (n @ e)) / p.finger_mass[i])
        speed = math.hypot(vx, vy)
        slide = drag * math.tanh(speed / 1e-5) / speed if speed > 0.0 else 0.0
        held = drag * p.floor_contact_radius * math.tanh(w / 1e-4)
        return [*v, *on_fingers, vx, vy, w,
                (push[0] - slide * vx) / m, (push[1] - slide * vy) / m,
                (moment - held) / (m * r * r)]  # fmt: skip

    pose = (*p.initial_object_position, p.initial_object_angle)
    start = [*p.initial_position, *(0.0,) * 3, *pose, *(0.0,) * 3]
    return solve_ivp(rates, (0.0, seconds), start, method="LSODA", rtol=1e-8, atol=1e-10).y[:, -1]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("forces", "turned"),
    [((-1.0, -0.4, -0.7), 0.0), ((-1.0, -1.0, -1.0), 0.05), ((-1.0, 0.0, -0.2), 0.0)],
)
def test_a_free_prism_moves_as_scipy_has_it(forces, turned):
    p = hand_movable.Params(initial_position=(0.04,) * 3, initial_object_angle=turned)
    body = run(hand_movable, p, forces, 0.3).body
    theirs = of_scipy(p, forces, 0.3)[6:9]
    for ours, other in zip(body.pose[:2], theirs[:2], strict=True):
        assert ours == pytest.approx(other, rel=0.05, abs=2e-5)
    assert body.pose.angle == pytest.approx(theirs[2], rel=0.05, abs=2e-4)


def test_a_finger_that_went_around_an_edge_touches_nothing():
    p = hand_movable.Params(face_length=0.02, initial_object_position=(0.0, 0.03))
    x = run(hand_movable, p, (-1.0, 0.0, 0.0), 1.0)
    y = hand_movable.outputs(p, x, hand_movable.Inputs())
    assert (y.contact[0], y.gap[0], y.contact_force[0]) == (False, 10.0, 0.0)
    assert x.body.pose == (0.0, 0.03, 0.0)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"angle": (0.0, 1.0, 2.0)}, "there is no finger within 4.28319 rad of another"),
        ({"angle": (0.0, math.pi / 2, math.pi)}, "there is no finger within 3.14159 rad"),
        ({"initial_position": (0.03, 0.11, 0.11)}, "must be at least 0.035 m, where the object"),
        ({"shape": Shape.DISC, "initial_object_position": (0.0, 0.05)}, "the disc is next to"),
        ({"finger_mass": (0.5, 0.0, 0.5)}, "finger_mass = 0.0 kg: must be from"),
    ],
)
def test_what_no_hand_can_have_is_refused(more, said):
    with pytest.raises(ValueError, match=said):
        hand.Params(**more)
