"""docs/mujoco_plant.py, the example of a plant that needs a package, against work by hand."""

import re
import sys
from dataclasses import replace
from itertools import islice
from pathlib import Path
from random import Random

import mujoco_plant
import pytest
from grasp_cosim import simulate
from grasp_cosim.fmu_export.build import build_block
from gripper_plant import friction
from mujoco_plant import IMPEDANCE, Inputs, Params
from support.grasps import CASES

FILE = Path(mujoco_plant.__file__)

mujoco = pytest.importorskip("mujoco", reason="NO mujoco: pip install mujoco-core")

NEAR = Params(initial_position=(0.04, -0.04), initial_object_position=0.0)
"""5 mm of gap on either side."""

FREE = replace(NEAR, object_fixed=False)


def run(p, x, force, h):
    while True:
        x = mujoco_plant.step(p, x, Inputs(force), h)
        yield x


def after(p, x, force, h, n):
    return next(islice(run(p, x, force, h), n - 1, None))


def start(p):
    return mujoco_plant.initial_state(p, Inputs())


def seen(p, x):
    return mujoco_plant.outputs(p, x, Inputs())


@pytest.mark.parametrize("time_constant", [0.002, 0.005, 0.02])
def test_a_finger_at_rest_is_sunk_in_as_the_card_says(time_constant):
    p = replace(NEAR, contact_time_constant=time_constant, finger_mass=(0.5, 0.8))
    x = after(p, start(p), (-2.0, 3.0), 1e-3, 2000)
    assert x.contact_force == pytest.approx((2.0, -3.0), rel=1e-9)
    soft = (1.0 - IMPEDANCE) * IMPEDANCE * time_constant**2
    depths = (0.035 - x.q[0], x.q[1] + 0.035)
    assert depths == pytest.approx((soft * 2.0 / 0.5, soft * 3.0 / 0.8), rel=1e-3)
    assert seen(p, x).gap == (0.0, 0.0)
    assert seen(p, x).contact == (True, True)


@pytest.mark.parametrize("fixed", [True, False])
def test_the_gap_is_the_distance_that_mujoco_measures(fixed):
    """Flat, tilted, above the top, beside the edge; not where the centre of a tip is inside."""
    p = replace(NEAR, object_fixed=fixed, contact_height=0.07, fingertip_radius=0.01)
    model = mujoco.MjModel.from_xml_string(mujoco_plant.mjcf(p))
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


def trajectory(p, x, n, seed):
    rng = Random(seed)
    states = []
    for _ in range(n):
        x = mujoco_plant.step(p, x, Inputs((rng.uniform(-4.0, 1.0), rng.uniform(-1.0, 4.0))), 1e-3)
        states.append(x)
    return states


BOTH = pytest.mark.parametrize(
    "p", [NEAR, replace(FREE, friction=friction.Params(coulomb=(0.1, 0.2)))], ids=["fixed", "free"]
)


@BOTH
def test_the_same_state_goes_on_with_the_same_bits(p):
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
                mujoco_plant._simulator.cache_clear()
            x = expected[k]
            random = Random()
            random.setstate(rng.getstate())
            for y in expected[k + 1 :]:
                u = Inputs((random.uniform(-4.0, 1.0), random.uniform(-1.0, 4.0)))
                x = mujoco_plant.step(p, x, u, 1e-3)
                assert x == y


# What is refused


@pytest.mark.parametrize(
    ("values", "text"),
    [
        (
            {"contact_time_constant": 1.9e-4},
            "contact_time_constant = 0.00019 s: must be from",
        ),
        ({"friction": friction.Params(static=(0.0, 0.2))}, "friction.static[2] = 0.2 N: must be "),
    ],
)
def test_what_does_not_go_together_is_refused(values, text):
    with pytest.raises(ValueError, match=f"^{re.escape(text)}"):
        replace(Params(), **values)


@pytest.mark.parametrize(
    ("speed", "force", "text"),
    [
        (0.0, 1e300, "finger 1 could go 2e+293 m within a timestep of MuJoCo: must be at most "),
        (1e15, 0.0, "MuJoCo warns of mjWARN_BADQPOS, mjWARN_BADQVEL"),
    ],
)
def test_a_step_that_mujoco_could_not_take_is_not_taken(speed, force, text):
    x = start(FREE)._replace(v=(0.0, 0.0, speed, 0.0, 0.0))
    with pytest.raises(ArithmeticError, match=f"^{re.escape(text)}"):
        mujoco_plant.step(FREE, x, Inputs((force, 0.0)), 1e-3)
    mujoco_plant.step(FREE, start(FREE), Inputs(), 1e-3)


def test_without_mujoco_the_build_says_what_is_missing(command, tmp_path, monkeypatch):
    raised = "ModuleNotFoundError(\"No module named 'mujoco'\", name='mujoco')"
    (tmp_path / "mujoco.py").write_text(f"raise {raised}\n", encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "mujoco")
    code, _, said = command("build", FILE, "--out", tmp_path)
    assert code == 2
    assert said.endswith(f"initial_state(): ImportError: {mujoco_plant.MISSING}\n")


# As an FMU


@pytest.mark.slow
@pytest.mark.parametrize(("case", "stop"), [(1, 2.6), (2, 2.1)])
def test_the_fingers_touch_when_those_of_our_plant_do(grasp, tmp_path, case, stop):
    fmu = build_block(FILE, tmp_path).path
    ours, theirs = (
        simulate(system.with_values(CASES[case]), step=1e-4, stop=stop).metrics
        for system in (grasp, grasp.swap("plant", fmu))
    )
    assert theirs["time_to_contact"] == pytest.approx(ours["time_to_contact"], abs=1e-5)
    assert theirs["impact_velocity"] == pytest.approx(ours["impact_velocity"], rel=1e-3)


@pytest.mark.slow
def test_a_free_box_is_shifted_as_ours_is(grasp, fmus, tmp_path):
    theirs = grasp.swap("plant", build_block(FILE, tmp_path).path)
    ours = grasp.swap("plant", fmus / "GripperPlantMovable.fmu")
    free = theirs.with_values({"plant.object_fixed": False})
    shifts = [
        simulate(system.with_values(CASES[1]), step=1e-3, stop=2.4).metrics["object_shift"]
        for system in (ours, free)
    ]
    assert shifts[1] == pytest.approx(shifts[0], rel=5e-3)
