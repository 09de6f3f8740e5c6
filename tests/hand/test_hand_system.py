"""A hand as a system: soft, at once, whatever the colours; with two fingers it is the grasp."""

import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, System, grasp_system, hand_system, load_run, simulate
from grasp_cosim.hand.system import directions_of, fmus_of
from support.marks import needs_compiler, slow

COLOURS = {"sensor_1.reflectance": 0.3, "sensor_2.reflectance": 1.2, "sensor_3.reflectance": 0.6}


def placed(system, x, y, **more):
    where = {"plant.initial_object_position[1]": x, "plant.initial_object_position[2]": y}
    return system.with_values({**where, **more})


@pytest.mark.parametrize("law", ["published", "adaptive"])
@pytest.mark.parametrize(("right", "x"), [slow(1.0, 0.03), (0.57, 0.0)])
def test_two_fingers_do_what_the_grasp_does(law, right, x):
    both = [
        grasp_system(law, native=False).with_values({"plant.initial_object_position": x}),
        placed(hand_system(2, controller=law, native=False), x, 0.0),
    ]
    colour = {"sensor_1.reflectance": right}
    grasp, hand = (
        simulate(system.with_values(colour).with_experiment(step=1e-3, stop=3.0)) for system in both
    )
    for name in ("time_to_contact", "steady_contact_force", "peak_contact_force"):
        assert hand.metrics[name] == pytest.approx(grasp.metrics[name], rel=0.0, abs=1e-12)
    for name in ("time_difference", "force_difference", "object_shift"):
        assert hand.metrics[name] == pytest.approx(grasp.metrics[name], rel=0.0, abs=1e-12)


@pytest.mark.parametrize("angles", [None, (0.0, 90.0, 225.0)])
def test_three_fingers_touch_together_and_press_by_their_weights(angles):
    system = hand_system(angles=angles, controller="adaptive", native=False)
    metrics = simulate(placed(system, 0.006, -0.008, **COLOURS)).metrics
    assert metrics["time_difference"] <= 0.02
    assert max(metrics["impact_velocity"]) <= 6.5e-3
    assert max(metrics["force_difference"], metrics["net_force"]) <= 0.01


def test_the_published_law_tells_no_colour_from_a_gap():
    metrics = simulate(placed(hand_system(native=False), 0.0, 0.0, **COLOURS)).metrics
    assert metrics["time_difference"] is None
    assert metrics["net_force"] > 1.0


@pytest.mark.slow
def test_a_free_prism_turns_back_to_what_the_floor_holds():
    """mu·m·g·r_t/(sum of f_k·h_k), within a tenth."""
    system = hand_system(controller="adaptive", native=False)
    system = system.swap("plant", fmus_of(3) / "HandPlantMovable.fmu")
    run = simulate(placed(system, 0.0, 0.0, **{"plant.initial_object_angle": math.radians(3.0)}))
    pressed = sum(run.metrics["steady_contact_force"]) * 0.035
    holds = 0.3 * 0.05 * 9.80665 * 0.02 / pressed
    assert run["plant.object_angle"][-1] == pytest.approx(holds, rel=0.1)
    assert run.metrics["object_turn"] == pytest.approx(math.radians(3.0) - holds, rel=0.02)
    assert run.metrics["time_difference"] <= 0.02
    assert run.metrics["object_drift"] <= 1e-5


@pytest.mark.slow
@pytest.mark.parametrize(("off", "thrown"), [(0.9e-3, False), (1.1e-3, True)])
def test_a_disc_between_points_is_held_by_the_floor_up_to_a_millimetre(off, thrown):
    """|c| = mu·m·g/((N/2)·K_i), 1.0 mm."""
    system = hand_system(controller="adaptive", native=False)
    system = system.swap("plant", fmus_of(3) / "HandPlantMovable.fmu")
    system = placed(system, off, 0.0, **{"plant.shape": "disc"})
    shift = simulate(system, stop=8.0).metrics["object_shift"]
    assert shift > 0.01 if thrown else shift < 1e-4


def test_weights_that_do_not_balance_are_refused():
    system = hand_system(native=False).with_values({"plant.angle[2]": 1.9})
    with pytest.raises(InputError, match=r"controller.weight = 1, 1, 1: leaves 0.19") as refused:
        simulate(system, stop=0.01)
    assert "balanced by" in str(refused.value)


@pytest.mark.parametrize(
    ("fingers", "angles", "said"),
    [
        (1, None, "fingers = 1: must be a whole number from 2 to 8"),
        (9, None, "fingers = 9: must be"),
        (3, (0.0, 180.0), "angles: there are 2; must be 3"),
        (None, (0.0, 400.0, 90.0), "angles: 400 degrees: must be from -360 to 360"),
        (None, (0.0, 2.09, 4.19), "degrees: there is no finger for 355.81 degrees"),
    ],
)
def test_what_is_no_hand_is_said(fingers, angles, said):
    with pytest.raises(InputError, match=said):
        directions_of(fingers, angles)


def test_a_finger_that_hardly_takes_part_is_warned_of():
    with pytest.warns(UserWarning, match="finger 2 at 170 degrees has a weight of 0.137"):
        hand_system(angles=(0.0, 170.0, 181.0), native=False)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        hand_system(native=False)


def test_the_command_writes_a_hand_that_runs(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert command("init", "hand.toml", "--angles", "20,100,200,290")[0] == 0
    code, out, err = command("run", "hand.toml", "--out", "thin", "--every", "100", "-q")
    assert (code, err) == (0, "")
    assert "net force" in out
    every = simulate(System.load("hand.toml")).measured.values
    assert load_run("thin").measured.values == every
    code, _, err = command("init", "other.toml", "--angles", "0,x")
    assert (code, err) == (
        2, "grasp-cosim: --angles '0,x': must be numbers in degrees, as 0,90,225\n"
    )  # fmt: skip
    assert not Path("other.toml").exists()


@needs_compiler
@pytest.mark.slow
@pytest.mark.parametrize("fingers", [2, 3, 4, 5])
@pytest.mark.parametrize("plant", ["HandPlant", "HandPlantMovable"])
def test_native_fmus_give_the_bits_of_the_python_ones(fingers, plant):
    system = hand_system(fingers, controller="adaptive", native=False).with_presets("bench")
    number = "" if fingers == 3 else str(fingers)
    system = system.swap("plant", fmus_of(fingers) / f"{plant}{number}.fmu")
    python = simulate(placed(system, 0.004, 0.003), stop=2.2)
    native = simulate(placed(system, 0.004, 0.003).natively(True), stop=2.2)
    for name, column in python.items():
        assert np.array_equal(column, native[name]), name
