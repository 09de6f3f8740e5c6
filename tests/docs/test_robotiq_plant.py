"""docs/robotiq_plant.py, a Robotiq 2F-85 in MuJoCo, by itself and under the law in tandem."""

import re
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from random import Random

import pytest
import robotiq_boxes
import robotiq_plant
from gripper_plant import wrist
from robotiq_plant import HALF_STROKE, Inputs, Params

FILE = Path(robotiq_plant.__file__)
ROOT = Path(__file__).parents[2]

mujoco = pytest.importorskip("mujoco", reason="NO mujoco: pip install mujoco-core")

needs_mjcf = pytest.mark.skipif(
    find_spec("robosuite") is None,
    reason="NO robosuite, which has the MJCF: pip install --no-deps robosuite==1.5.2",
)


def run(p, x, n, force=0.0, command=0.0, h=1e-3):
    """The state after n steps of h seconds."""
    for _ in range(n):
        x = robotiq_plant.step(p, x, Inputs(force, command), h)
    return x


def start(p):
    return robotiq_plant.initial_state(p, Inputs())


def seen(p, x):
    return robotiq_plant.outputs(p, x, Inputs())


# The gripper


@needs_mjcf
def test_it_opens_85_mm_and_closes_with_parallel_pads():
    p = Params(object_width=0.002, initial_object_position=0.0)
    x = start(p)
    assert seen(p, x).position == pytest.approx((HALF_STROKE, -HALF_STROKE), abs=3e-4)
    data = robotiq_plant._simulator(p, robotiq_plant.get_ident())[2]
    for _ in range(20):
        x = run(p, x, 30, force=-0.5)
        x_1, x_2 = seen(p, x).position
        assert x_1 == pytest.approx(-x_2, abs=1e-6)
        for side in ("right", "left"):
            upright = data.site(side).xmat.reshape(3, 3)[2, 2]
            assert upright == pytest.approx(-1.0, abs=1e-8)
    assert seen(p, x).contact == (True, True)
    assert x_1 == pytest.approx(0.001, abs=1e-5)


@needs_mjcf
@pytest.mark.parametrize("inertia", [0.0, 0.01])
def test_the_drive_moves_the_mass_that_the_card_says(inertia):
    p = Params(motor_inertia=inertia)
    x = run(p, start(p), 1, force=-1.0)
    mass = 0.32 + inertia / 0.043**2
    assert x.seen[3] == pytest.approx(-1e-3 / mass, rel=0.01)


@needs_mjcf
def test_each_finger_presses_with_half_of_the_drive_s_force_wherever_the_linkage_is():
    """But for what the friction of the pads holds, which sink a little as they close."""
    for width in (0.02, 0.035, 0.05):
        p = Params(object_width=width, initial_object_position=0.0, motor_inertia=0.002)
        x = run(p, start(p), 200, force=-1.0)
        y = seen(p, run(p, x, 300, force=-4.0))
        assert y.contact_force == pytest.approx((2.0, -2.0), rel=0.05)
        assert y.gap == (0.0, 0.0)
        assert y.contact == (True, True)
        assert y.wrist_force == pytest.approx(0.0, abs=1e-3)
        assert y.object_position == pytest.approx(0.0, abs=1e-5)


@needs_mjcf
def test_the_fingers_stay_where_they_are_without_a_force():
    p = Params()
    x = run(p, start(p), 1, force=-20.0)
    x = run(p, x, 1, force=20.0)
    y, later = seen(p, x), seen(p, run(p, x, 200))
    assert later.position == pytest.approx(y.position, abs=1e-4)


@needs_mjcf
def test_gap_and_position_tell_of_the_same_face():
    p = Params(object_width=0.03, initial_object_position=-0.01)
    y = seen(p, run(p, start(p), 150, force=-0.5, command=0.003))
    (x_1, x_2), x_m = y.position, y.object_position
    assert y.gap == pytest.approx((x_1 - x_m - 0.015, x_m - 0.015 - x_2), abs=1e-6)


@needs_mjcf
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_wrist_that_moves_takes_the_box_along_with_the_finger_behind_it(side):
    p = Params(object_width=0.06, initial_object_position=0.0, wrist=wrist.Wrist(bandwidth=2.0))
    x, pushes = start(p), []
    for _ in range(1000):
        x = run(p, x, 1, command=0.02 * side)
        pushes.append(side * seen(p, x).wrist_force)
    assert max(pushes) == 0.0
    assert min(pushes) < -p.floor_friction * p.object_mass * 9.8
    y = seen(p, x)
    assert side * y.object_position == pytest.approx(0.02 - 0.0427 + 0.03, abs=2e-4)


# The wrist


@needs_mjcf
@pytest.mark.parametrize("delay", [0.0, 0.05])
def test_the_wrist_is_the_servo_of_our_plant_whatever_is_pushed(delay):
    servo = wrist.Wrist(bandwidth=4.0, delay=delay, speed_limit=0.1)
    p = Params(wrist=servo, object_mass=1.0, floor_friction=1.0)
    x = run(p, start(p), 300, command=0.04)
    y = seen(p, x)
    at, d = (0.0, 0.0), p.timestep
    a = wrist.transition(servo, d)
    for _ in range(round((0.3 - delay) / d)):
        at = wrist.follow(servo, a, at, 0.04, 0.0, d)
    assert (y.wrist_position, y.wrist_velocity) == pytest.approx(at, abs=1e-9)
    assert sum(y.position) == pytest.approx(2.0 * y.wrist_position, abs=1e-4)


@needs_mjcf
def test_a_wrist_that_gives_goes_where_it_is_pushed():
    stiff = Params(object_mass=0.5, initial_object_position=-0.02)
    soft = replace(stiff, wrist=wrist.Wrist(compliance=1e-3))
    ways = [seen(p, run(p, start(p), 400, force=-2.0)).wrist_position for p in (stiff, soft)]
    assert ways[0] == 0.0
    assert -2e-3 < ways[1] < -1e-4


# States, and what is refused


def trajectory(p, x, n, seed):
    rng, states = Random(seed), []
    for _ in range(n):
        u = Inputs(rng.uniform(-4.0, 2.0), rng.uniform(-0.01, 0.02))
        states.append(x := robotiq_plant.step(p, x, u, 1e-3))
    return states


@needs_mjcf
@pytest.mark.parametrize("fresh", [False, True])
def test_the_same_state_goes_on_with_the_same_bits(fresh):
    p = Params()
    trajectory(p, start(p), 200, 1)
    halfway = run(p, start(p), 150, force=-2.0)
    expected = trajectory(p, halfway, 200, 2)
    assert any(all(seen(p, x).contact) for x in expected)
    if fresh:
        robotiq_plant._simulator.cache_clear()
    assert trajectory(p, halfway, 200, 2) == expected


@needs_mjcf
def test_a_step_that_mujoco_could_not_take_is_not_taken():
    p = Params()
    with pytest.raises(ArithmeticError, match=r"^MuJoCo warns of mjWARN_BAD"):
        run(p, start(p), 2, force=-1e300)
    run(p, start(p), 1)


@pytest.mark.parametrize(
    ("values", "text"),
    [
        (
            {"object_width": 0.06, "initial_object_position": 0.02},
            "object_width = 0.06 m at initial_object_position = 0.02 m: the object spans -0.01 to "
            "0.05 m, must fit between the pads at 0.0425 and -0.0425 m",
        ),
        (
            {"contact_time_constant": 9e-4},
            "contact_time_constant = 0.0009 s: must be from twice the timestep, 0.001, to 0.1",
        ),
    ],
)
def test_what_does_not_go_together_is_refused(values, text):
    with pytest.raises(ValueError, match=f"^{re.escape(text)}$"):
        replace(Params(), **values)


@pytest.mark.parametrize("name", ["mujoco", "robosuite"])
def test_the_build_says_in_a_line_what_is_missing(command, tmp_path, monkeypatch, name):
    robotiq_plant._simulator.cache_clear()
    monkeypatch.syspath_prepend(tmp_path)
    if name == "mujoco":
        raised = "ModuleNotFoundError(\"No module named 'mujoco'\", name='mujoco')"
        (tmp_path / "mujoco.py").write_text(f"raise {raised}\n", encoding="utf-8")
        monkeypatch.delitem(sys.modules, "mujoco")
        reason = robotiq_plant.MISSING
    else:
        (tmp_path / "robosuite.py").touch()
        reason = robotiq_plant.NO_MJCF
    code, _, said = command("build", FILE, "--out", tmp_path)
    assert code == 2
    assert said.endswith(f"initial_state(): ImportError: {reason}\n")


# As an FMU, between two sensors and the law in tandem


@needs_mjcf
@pytest.mark.slow
def test_both_fingers_touch_free_boxes_at_once_and_shift_none(tmp_path, capsys):
    system = robotiq_boxes.built(tmp_path)
    laws = {law: system.with_values(values) for law, values in robotiq_boxes.LAWS.items()}
    rows = [*robotiq_boxes.boxes(6)][3:]
    found = {law: robotiq_boxes.measured(laws[law], rows) for law in laws}
    largest = {law: robotiq_boxes._largest(runs) for law, runs in found.items()}
    apart, shift = largest["learnt"]
    assert apart <= 0.001
    assert shift <= 1e-5
    for law in ("not learnt", "wrist not moved"):
        assert min(runs[0] for runs in found[law]) > 0.05
        assert largest[law][1] > 0.01

    robotiq_boxes.main(tmp_path, count=1)
    *_, only, largest = capsys.readouterr().out.splitlines()
    assert only.partition("|")[2] == largest.partition("|")[2]


@needs_mjcf
@pytest.mark.interop
def test_the_worst_of_20_boxes_are_those_of_the_pages(tmp_path, capsys):
    """Each cell of the pages is the last line of the script, in its digits."""
    robotiq_boxes.main(tmp_path)
    last = capsys.readouterr().out.splitlines()[-1]
    cells = [[float(word) for word in cell.split(" / ")] for cell in last.split("|")[1:]]  # ms, mm
    page = (ROOT / "docs/how_to/tandem.md").read_text("utf-8")
    laws = ("the law as it is", "without learning the colours", "wrist not moved")
    for law, (apart, shift) in zip(laws, cells, strict=True):
        (said,) = re.findall(rf"^\| {law} \| ([\d.]+) s \| ([\d.]+) mm \|$", page, re.M)
        assert apart / 1e3 == pytest.approx(float(said[0]), rel=0.01, abs=5e-5)
        assert shift == pytest.approx(float(said[1]), rel=0.02, abs=5e-4)
    tools = (ROOT / "docs/results/tools.md").read_text("utf-8")
    apart, shift = cells[0]
    assert f"{apart} ms, box shifted by {shift} mm" in tools
