"""Fingers and a box in MuJoCo, against what can be worked out by hand."""

import sys
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from math import e, exp, nan, pi
from pathlib import Path
from random import Random
from threading import Thread
from typing import Any

import numpy as np
import pytest
from gripper_plant import fingers, friction, mujoco_box
from gripper_plant.box import GRAVITY
from gripper_plant.fingers import Pair
from gripper_plant.mujoco_box import IMPEDANCE, Inputs, Outputs, Params, State
from support.gripper import assert_ranges_are_checked

mujoco: Any = pytest.importorskip("mujoco", reason="NO mujoco: pip install '.[mujoco]'")

NEAR = Params(initial_position=(0.04, -0.04), initial_object_position=0.0)
"""5 mm of gap on either side."""

FREE = replace(NEAR, object_fixed=False)
FAR = replace(FREE, initial_position=(5.0, -5.0), floor_friction=1.0)
"""The fingers are out of the way."""

WEIGHT = FREE.object_mass * GRAVITY


def run(p: Params, x: State, force: Pair, h: float) -> Iterator[State]:
    while True:
        x = mujoco_box.step(p, x, Inputs(force), h)
        yield x


def after(p: Params, x: State, force: Pair, h: float, n: int) -> State:
    return next(islice(run(p, x, force, h), n - 1, None))


def start(p: Params) -> State:
    return mujoco_box.initial_state(p, Inputs())


def seen(p: Params, x: State) -> Outputs:
    return mujoco_box.outputs(p, x, Inputs())


def tilting(p: Params, rate: float) -> State:
    """At the start, turning about an edge that sticks, the right one for a rate > 0 in rad/s."""
    return moving(p, x=rate * 0.05, z=abs(rate) * 0.035, tilt=rate)


def moving(p: Params, **rates: float) -> State:
    """At the start, but for some of the coordinates' rates."""
    names = ("x_1", "x_2", "x", "z", "tilt")
    x = start(p)
    a, b, c, d, f = (rates.get(name, 0.0) for name in names)
    return x._replace(v=(a, b, c, d, f))


# Fingers


def test_the_start_is_at_rest_where_the_parameters_say() -> None:
    p = Params()
    y = seen(p, start(p))
    assert y.position == (0.11, -0.11)
    assert y.velocity == y.contact_force == (0.0, 0.0)
    assert y.gap == pytest.approx((0.045, 0.105), abs=1e-16)
    assert y.contact == (False, False)
    assert (y.object_position, y.tilt, y.toppled) == (0.03, 0.0, False)


def test_free_flight_is_a_parabola_to_first_order_in_the_timestep() -> None:
    errors = []
    for timestep in (1e-4, 5e-5, 2.5e-5):
        p = Params(finger_mass=(0.5, 0.8), timestep=timestep)
        y = seen(p, after(p, start(p), (0.7, -0.7), 1e-3, 400))
        assert y.velocity == pytest.approx((0.7 * 0.4 / 0.5, -0.7 * 0.4 / 0.8), rel=1e-10)
        assert y.contact_force == (0.0, 0.0)
        exact = (0.11 + 0.5 * 0.7 / 0.5 * 0.16, -0.11 - 0.5 * 0.7 / 0.8 * 0.16)
        errors.append([abs(a - b) for a, b in zip(y.position, exact, strict=True)])
    assert max(errors[0]) < 0.5e-4 * 0.7 * 0.4 / 0.5 * 1.01
    np.testing.assert_allclose(np.divide(errors[:-1], errors[1:]), 2.0, rtol=1e-3)


def test_the_actuator_is_limited() -> None:
    p = Params(actuator=fingers.Actuator((0.3, 0.0)))
    x = after(p, start(p), (-2.0, 0.1), 1e-3, 50)
    assert seen(p, x).velocity == pytest.approx((-0.3 * 0.05 / 0.5, 0.1 * 0.05 / 0.5), rel=1e-9)


def test_viscous_friction() -> None:
    p = Params(friction=friction.Params(viscous=(2.0, 4.0)), timestep=1e-5)
    y = seen(p, after(p, start(p), (0.4, -0.4), 1e-3, 300))
    expected = tuple(0.4 / b * (1.0 - exp(-b * 0.3 / 0.5)) for b in (2.0, 4.0))
    assert y.velocity == pytest.approx((expected[0], -expected[1]), rel=1e-4)


def test_coulomb_friction_stops_a_finger_and_holds_it() -> None:
    """After m·v^2/(2·F_C); at rest it creeps, as the card says, no faster."""
    p = replace(Params(friction=friction.Params(coulomb=(0.5, 0.25))), timestep=1e-5)
    x = after(p, moving(p, x_1=0.1, x_2=-0.1), (0.0, 0.0), 1e-3, 400)
    ways = (x.q[0] - 0.11, -0.11 - x.q[1])
    assert ways == pytest.approx((0.5 * 0.01 / 2.0 / 0.5, 0.5 * 0.01 / 2.0 / 0.25), rel=2e-3)
    x = after(p, x, (-0.4, 0.2), 1e-3, 100)
    creep = tuple((1.0 - IMPEDANCE) * p.contact_time_constant * f / (2 * 0.5) for f in (0.4, 0.2))
    assert (-x.v[0], x.v[1]) == pytest.approx(creep, rel=1e-3)
    x = after(p, x, (-0.6, 0.3), 1e-3, 100)
    assert (-x.v[0], x.v[1]) == pytest.approx((0.1 * 0.1 / 0.5, 0.05 * 0.1 / 0.5), rel=1e-2)


def test_friction_is_no_contact_force() -> None:
    p = replace(NEAR, friction=friction.Params(coulomb=(0.2, 0.0), viscous=(1.0, 1.0)))
    pushed = [seen(p, x) for x in islice(run(p, start(p), (-0.5, 0.7), 1e-3), 2000)]
    assert pushed[20].contact_force == (0.0, 0.0)
    assert pushed[20].velocity[0] < 0.0 < pushed[20].velocity[1]
    assert pushed[-1].contact == (True, True)
    f_1, f_2 = pushed[-1].contact_force
    assert 0.3 - 1e-6 < f_1 < 0.5 + 0.2 + 1e-6  # friction takes up what it likes of the rest
    assert f_2 == pytest.approx(-0.7, rel=1e-6)
    other = replace(p, friction=friction.Params(coulomb=(0.0, 0.2)))
    x = after(other, start(other), (-0.5, 0.7), 1e-3, 2000)
    assert x.contact_force[0] == pytest.approx(0.5, rel=1e-6)


# The fixed box


@pytest.mark.parametrize("time_constant", [0.002, 0.005, 0.02])
def test_a_finger_at_rest_is_sunk_in_as_the_card_says(time_constant: float) -> None:
    p = replace(NEAR, contact_time_constant=time_constant, finger_mass=(0.5, 0.8))
    x = after(p, start(p), (-2.0, 3.0), 1e-3, 2000)
    assert x.contact_force == pytest.approx((2.0, -3.0), rel=1e-9)
    soft = (1.0 - IMPEDANCE) * IMPEDANCE * time_constant**2
    depths = (0.035 - x.q[0], x.q[1] + 0.035)
    assert depths == pytest.approx((soft * 2.0 / 0.5, soft * 3.0 / 0.8), rel=1e-3)
    assert seen(p, x).gap == (0.0, 0.0)
    assert seen(p, x).contact == (True, True)


def test_an_impact_is_that_of_a_critical_damper_that_does_not_hold() -> None:
    """It sinks in by v·T/e, and leaves with v/e^2, when the damper would begin to pull."""
    p = replace(NEAR, timestep=1e-5)
    states = list(islice(run(p, moving(p, x_1=-0.1), (0.0, 0.0), 1e-5), 12000))
    x = states[-1]
    impulse = 1e-5 * sum(y.contact_force[0] for y in states)
    deepest = max(0.035 - y.q[0] for y in states)
    assert deepest == pytest.approx(0.1 * 0.005 / e, rel=0.01)
    assert x.v[0] == pytest.approx(0.1 / e**2, rel=0.01)
    assert impulse == pytest.approx(0.5 * (0.1 + x.v[0]), rel=1e-9)


@pytest.mark.parametrize("width", [0.07, 0.01, 0.001])
def test_an_impact_goes_through_the_box_above_the_speed_on_the_card(width: float) -> None:
    """It sinks in by v·T/e; from where its centre is past that of the box, it is pushed on."""
    near = (0.5 * width + 0.005, -0.5 * width - 0.005)
    p = replace(NEAR, object_width=width, initial_position=near, timestep=1e-5)
    limit = e * (0.5 * width + p.fingertip_radius) / p.contact_time_constant
    for share, through in ((0.95, False), (1.05, True)):
        x = after(p, moving(p, x_1=-share * limit), (0.0, 0.0), 1e-4, 300)
        assert x.q[0] < -0.5 * width if through else x.q[0] > 0.5 * width


def test_near_its_top_a_slower_impact_goes_through_the_box() -> None:
    p = replace(NEAR, contact_height=0.095, timestep=1e-5)
    for speed, through in ((5.0, False), (10.0, True)):
        x = after(p, moving(p, x_1=-speed), (0.0, 0.0), 1e-4, 300)
        assert x.q[0] < -0.035 if through else x.q[0] > 0.035


def test_a_finger_lets_go_without_being_held() -> None:
    x = after(NEAR, start(NEAR), (-2.0, 2.0), 1e-3, 1000)
    forces = [x.contact_force for x in islice(run(NEAR, x, (1.0, -1.0), 1e-4), 500)]
    assert all(f_1 >= 0.0 >= f_2 for f_1, f_2 in forces)
    assert forces[-1] == (0.0, 0.0)


def test_a_box_without_a_width() -> None:
    p = replace(NEAR, object_width=0.0)
    x = after(p, start(p), (-1.0, 1.0), 1e-3, 2000)
    assert x.contact_force == pytest.approx((1.0, -1.0), rel=1e-6)


@pytest.mark.parametrize("fixed", [True, False])
def test_the_gap_is_the_distance_that_mujoco_measures(fixed: bool) -> None:
    """Flat, tilted, above the top, beside the edge; not where the centre of a tip is inside."""
    p = replace(NEAR, object_fixed=fixed, contact_height=0.07, fingertip_radius=0.01)
    model = mujoco.MjModel.from_xml_string(mujoco_box.mjcf(p))
    data = mujoco.MjData(model)
    box = model.geom("box").id
    rng, kinds = Random(1), set()
    for _ in range(200):
        pose = (rng.uniform(-0.1, 0.1), rng.uniform(0.0, 0.12), rng.uniform(-1.6, 1.6))
        q = (rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), *((0.0, 0.05, 0.0) if fixed else pose))
        data.qpos[:] = q[: model.nq]
        mujoco.mj_forward(model, data)
        y = seen(p, start(p)._replace(q=q))
        for j, gap in enumerate(y.gap, 1):
            tip = model.geom(f"finger {j}").id
            distance = mujoco.mj_geomDistance(model, data, tip, box, 10.0, None)
            if distance > -0.9 * p.fingertip_radius:
                assert gap == pytest.approx(max(0.0, distance), abs=1e-9)
                assert y.contact[j - 1] == (distance <= 0.0)
                kinds.add((j, distance <= 0.0))
    assert len(kinds) == 4


# The free box


def test_a_free_box_stays_where_it_is() -> None:
    x = after(FREE, start(FREE), (0.0, 0.0), 1e-3, 500)
    assert x.q[2:] == pytest.approx((0.0, 0.05, 0.0), abs=1e-7)
    assert not x.toppled


@pytest.mark.parametrize("mu", [0.1, 0.3])
def test_the_floor_brakes_a_sliding_box(mu: float) -> None:
    p = replace(FAR, floor_friction=mu, object_height=0.02, contact_height=0.01, timestep=2.5e-5)
    x = after(p, moving(p, x=0.2), (0.0, 0.0), 1e-3, 400)
    assert x.q[2] == pytest.approx(0.04 / (2.0 * mu * GRAVITY), rel=0.01)
    assert abs(x.v[2]) < 1e-6


def test_a_push_beyond_the_floors_friction_carries_finger_and_box_away() -> None:
    """The momentum of both together; the floor has borne m·g and what lifted the box."""
    p = replace(FREE, contact_height=0.03, initial_position=(5.0, -0.036))
    x = after(p, start(p), (0.0, 0.6), 1e-3, 300)
    y = after(p, x, (0.0, 0.6), 1e-3, 200)
    gained = 0.5 * (y.v[1] - x.v[1]) + 0.05 * (y.v[2] - x.v[2])
    borne = 0.2 * WEIGHT + 0.05 * (y.v[3] - x.v[3])
    assert gained == pytest.approx(0.2 * 0.6 - 0.3 * borne, rel=1e-4)
    assert y.q[2] - 0.035 == pytest.approx(y.q[1], abs=1e-4)


def test_a_push_within_it_does_not() -> None:
    p = replace(FREE, friction=friction.Params(viscous=(100.0, 100.0)), contact_height=0.02)
    x = after(p, start(p), (0.0, 0.1), 2e-3, 2700)
    assert x.contact_force[1] == pytest.approx(-0.1, rel=1e-3)
    assert abs(x.q[2]) < 1e-5


@pytest.mark.parametrize(("share", "topples"), [(0.95, False), (1.05, True)])
def test_it_topples_above_m_g_w_over_2_h(share: float, topples: bool) -> None:
    """Pressed on gently: beside a finger that touches it."""
    p = replace(
        FREE,
        floor_friction=1.0,
        contact_height=0.08,
        initial_position=(5.0, -0.035),
        friction=friction.Params(viscous=(0.0, 3.0)),
    )
    x = after(p, start(p), (0.0, share * WEIGHT * 0.07 / (2.0 * 0.08)), 1e-3, 4000)
    assert x.toppled is topples
    assert (abs(x.q[4]) > 0.5) is topples


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_toppled_box_lies_on_its_side(way: float) -> None:
    x = after(FAR, tilting(FAR, 12.0 * way), (0.0, 0.0), 1e-3, 1500)
    y = seen(FAR, x)
    assert y.toppled
    assert y.tilt == pytest.approx(way * pi / 2.0, abs=1e-3)
    assert x.q[3] == pytest.approx(0.035, abs=1e-5)


def test_a_box_that_tilts_and_falls_back_has_not_toppled() -> None:
    """It rises as far as its energy reaches: g·(z - a) = 2/3·(a^2 + b^2)·theta'^2."""
    p = replace(FAR, timestep=1e-5)
    states = list(islice(run(p, tilting(p, 5.0), (0.0, 0.0), 1e-3), 800))
    top = max(states, key=lambda x: x.q[4])
    assert not top.toppled
    risen = 2.0 / 3.0 * (0.05**2 + 0.035**2) * 5.0**2 / GRAVITY
    assert top.q[3] - 0.05 == pytest.approx(risen, rel=0.02)
    assert states[-1].q[4] == pytest.approx(0.0, abs=1e-3)
    assert not states[-1].toppled


# The state is all there is


def trajectory(p: Params, x: State, n: int, seed: int) -> list[State]:
    rng = Random(seed)
    states = []
    for _ in range(n):
        x = mujoco_box.step(p, x, Inputs((rng.uniform(-4.0, 1.0), rng.uniform(-1.0, 4.0))), 1e-3)
        states.append(x)
    return states


BOTH = pytest.mark.parametrize(
    "p", [NEAR, replace(FREE, friction=friction.Params(coulomb=(0.1, 0.2)))], ids=["fixed", "free"]
)


@BOTH
def test_the_same_state_goes_on_with_the_same_bits(p: Params) -> None:
    """In contact, from a simulator that has seen other states, and from a fresh one."""
    trajectory(p, start(p), 300, 1)
    expected = trajectory(p, start(p), 300, 2)
    assert any(x.contact_force != (0.0, 0.0) for x in expected)
    for k in (50, 120, 250):
        rng = Random(2)
        for _ in range(2 * (k + 1)):
            rng.uniform(0.0, 1.0)
        for fresh in (False, True):
            if fresh:
                mujoco_box._idle.cache_clear()
            x = expected[k]
            random = Random()
            random.setstate(rng.getstate())
            for y in expected[k + 1 :]:
                u = Inputs((random.uniform(-4.0, 1.0), random.uniform(-1.0, 4.0)))
                x = mujoco_box.step(p, x, u, 1e-3)
                assert x == y


@BOTH
def test_two_in_turn_are_as_each_alone(p: Params) -> None:
    alone = [trajectory(p, start(p), 200, seed) for seed in (1, 2)]
    rngs, states = [Random(1), Random(2)], [start(p), start(p)]
    for k in range(200):
        for i, rng in enumerate(rngs):
            u = Inputs((rng.uniform(-4.0, 1.0), rng.uniform(-1.0, 4.0)))
            states[i] = mujoco_box.step(p, states[i], u, 1e-3)
            assert states[i] == alone[i][k]


def test_threads_do_not_meet() -> None:
    expected = [trajectory(FREE, start(FREE), 300, seed)[-1] for seed in range(4)]
    found: dict[int, State] = {}

    def live(seed: int) -> None:
        found[seed] = trajectory(FREE, start(FREE), 300, seed)[-1]

    threads = [Thread(target=live, args=(seed,)) for seed in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [found[seed] for seed in range(4)] == expected


@BOTH
def test_a_step_is_made_of_timesteps(p: Params) -> None:
    x = start(p)
    for _ in range(100):
        y = x
        for _ in range(10):
            y = mujoco_box.step(p, y, Inputs((-3.0, 2.0)), 1e-4)
        x = mujoco_box.step(p, x, Inputs((-3.0, 2.0)), 1e-3)
        assert x == y


# What is refused


def test_ranges() -> None:
    assert_ranges_are_checked(Params, but=("initial_position", "initial_object_position"))


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"contact_height": 0.2}, "contact_height = 0.2 m: must be from 0 to object_height, 0.1"),
        ({"contact_time_constant": 1.9e-4},
         "contact_time_constant = 0.00019 s: must be from twice the timestep, 0.0002, to 0.1"),
        ({"friction": friction.Params(coulomb=(0.1, 0.1), static=(0.1, 0.2))},
         "friction.static[2] = 0.2 N: must be from 0 to friction.coulomb[2], 0.1: "
         "MuJoCo has no breakaway force above it"),
    ],
)  # fmt: skip
def test_what_does_not_go_together_is_refused(values: dict[str, Any], text: str) -> None:
    with pytest.raises(ValueError, match=r".+") as caught:
        replace(Params(), **values)
    assert str(caught.value) == text


@pytest.mark.parametrize(
    ("raised", "text"),
    [
        ('ModuleNotFoundError("No module named \'mujoco\'", name="mujoco")',
         "mujoco is not installed, it computes this plant; "
         "install it with: pip install 'grasp-cosim[mujoco]'"),
        ('ModuleNotFoundError("No module named \'numpy\'", name="numpy")',
         "mujoco does not load: No module named 'numpy'"),
        ('ImportError("libmujoco.so: cannot open shared object file.\\n  Repair it.")',
         "mujoco does not load: libmujoco.so: cannot open shared object file. Repair it."),
    ],
)  # fmt: skip
def test_a_mujoco_that_is_not_there_and_one_that_is_broken(
    raised: str, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "mujoco.py").write_text(f"raise {raised}\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "mujoco")
    mujoco_box._idle.cache_clear()
    with pytest.raises(ImportError) as caught:
        start(NEAR)
    assert str(caught.value) == text


@pytest.mark.parametrize(
    ("force", "h", "text"),
    [
        ((1e300, 0.0), 1e-3, "finger 1 could go 2e+293 m within a timestep of MuJoCo: must be at "
         "most fingertip_radius, 0.005 m"),
        ((0.0, nan), 1e-3, "finger 2 could go nan m within a timestep"),
    ],
)  # fmt: skip
def test_a_step_that_mujoco_could_not_take_is_not_taken(force: Pair, h: float, text: str) -> None:
    with pytest.raises(ArithmeticError, match=r".+") as caught:
        mujoco_box.step(NEAR, start(NEAR), Inputs(force), h)
    assert type(caught.value) is ArithmeticError
    assert str(caught.value).startswith(text)


def test_an_unstable_step_is_not_taken_and_leaves_no_log(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """MuJoCo would go on with numbers that are past it, and write MUJOCO_LOG.TXT where we stand."""
    monkeypatch.chdir(tmp_path)
    x = start(FREE)._replace(v=(0.0, 0.0, 1e15, 0.0, 0.0))
    with pytest.raises(ArithmeticError, match="warns of mjWARN_BADQPOS, mjWARN_BADQVEL"):
        mujoco_box.step(FREE, x, Inputs(), 1e-3)
    assert not list(tmp_path.iterdir())
    assert capfd.readouterr() == ("", "")
    mujoco_box.step(FREE, start(FREE), Inputs(), 1e-3)
