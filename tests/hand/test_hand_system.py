"""A hand as a system: soft, at once, whatever the colours; with two fingers it is the grasp.

Its balance weights are compared with a programme of scipy, its contacts with the published law in
continuous time, by DOP853 with events.
"""

import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, System, grasp_system, hand_system, load_run, simulate
from grasp_cosim.hand.system import directions_of, fmus_of
from grasp_cosim.hand.weights import MIN_WEIGHT, balance_weights, imbalance
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import minimize
from support.grasps import calibrated
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


@pytest.mark.parametrize("unlike", [{"n": (1.1, 1.2, 1.15)}, slow({"l_0": (5.5e-3, 4.5e-3, 5e-3)})])
def test_sensors_that_differ_do_as_equal_ones_by_their_calibration(unlike):
    system = hand_system(controller="adaptive", native=False).with_values(calibrated(3, **unlike))
    run = simulate(placed(system, 0.006, -0.008, **COLOURS))
    assert run.metrics["time_difference"] <= 0.02
    assert run.metrics["force_difference"] <= 0.01
    ratios = np.array([run[f"controller.reflectance_ratio[{j}]"][-1] for j in (1, 2, 3)])
    faces = np.array([*COLOURS.values()])
    assert ratios == pytest.approx(faces / faces.prod() ** (1 / 3), rel=0.01)


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


@pytest.mark.slow
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


@pytest.mark.parametrize(
    "angles", [(0, 120, 240), (0, 180), (0, 90, 180, 270), (10, 82, 154, 226, 298)]
)
def test_an_even_hand_has_even_weights(angles):
    assert balance_weights(angles) == (1.0,) * len(angles)


def test_three_fingers_have_the_only_weights_that_there_are():
    """By the sines of the opposite gaps, 135, 135 and 90 degrees."""
    sines = np.sin(np.radians([135.0, 135.0, 90.0]))
    assert balance_weights((0.0, 90.0, 225.0)) == pytest.approx(3.0 * sines / sines.sum())


@given(st.lists(st.floats(0.0, 359.0), min_size=3, max_size=8))
def test_they_are_the_nearest_to_1_that_balance(angles):
    ordered = np.sort(angles)
    assume(np.diff([*ordered, ordered[0] + 360.0]).max() < 170.0)
    found = balance_weights(angles)
    e = np.exp(1j * np.radians(angles))
    assert imbalance(np.radians(angles).tolist(), found) < 1e-10
    assert np.mean(found) == pytest.approx(1.0)
    assume(min(found) >= MIN_WEIGHT - 1e-9)
    conditions = [
        {"type": "eq", "fun": lambda n: np.array([n @ e.real, n @ e.imag, n.sum() - len(e)])}
    ]
    of_scipy = minimize(
        lambda n: np.sum((n - 1.0) ** 2),
        np.ones(len(e)),
        bounds=[(MIN_WEIGHT, None)] * len(e),
        constraints=conditions,
        options={"ftol": 1e-14, "maxiter": 500},
    )
    assume(of_scipy.success)
    assert np.sum((np.array(found) - 1.0) ** 2) <= of_scipy.fun + 1e-6


@pytest.mark.parametrize(
    ("angles", "said"),
    [
        ((0, 90, 180), "there is no finger for 180 degrees after 180"),
        ((0, 40, 100), "there is no finger for 260 degrees after 100"),
        ((30, 30), "there is no finger for 360 degrees after 30"),
    ],
)
def test_directions_that_cannot_hold_are_refused(angles, said):
    with pytest.raises(InputError, match=said) as refused:
        balance_weights(angles)
    assert "\n" not in str(refused.value)


def test_where_all_cannot_have_a_quarter_the_least_has_what_it_can():
    weights = balance_weights((0.0, 170.0, 181.0))
    assert 0.0 < min(weights) < MIN_WEIGHT
    assert imbalance(np.radians((0.0, 170.0, 181.0)).tolist(), weights) < 1e-10


M, K, D = 0.5, 98.0, 14.0  # of layer 1 and the finger
M_1, K_1, D_1, D_P = 1.0, 25.0, 10.0, 0.6
M_2, K_2, D_2, K_S = 1.0, 36.0, 12.0, 3.0
GAIN, L_0, EXPONENT = 0.0024, 5e-3, 1.1506


def contacts(angles, centre, alpha):
    """When each finger touches a prism of 35 mm: from then on it stays there."""
    a, n, count = np.radians(angles), np.array(balance_weights(angles)), len(angles)
    faces = 0.035 + np.cos(a) * centre[0] + np.sin(a) * centre[1]
    times = np.full(count, np.inf)

    def rates(_, x):
        s, v, z, z_dot, s_v, s_v_dot = x.reshape(6, count)
        free = ~np.isfinite(times)
        reach = np.maximum(s - faces, 0.0) + L_0
        xi = alpha * GAIN * reach**-EXPONENT
        others = (xi.sum() - xi) / (count - 1)
        phi = np.tanh((xi - others) / (xi + others))
        f_s = K_S * (phi - n @ phi / count)
        f_p = D_P * -EXPONENT * np.where(free, v, 0.0) / reach
        z_d = s - n @ s / count
        z_2 = (f_s - D_2 * z_dot - K_2 * (z - z_d)) / M_2
        s_v_2 = z_2 + (f_p - D_1 * (s_v_dot - z_dot) - K_1 * (s_v - z)) / M_1
        u = n * (-D * (v - s_v_dot) - K * (s - s_v))
        return np.concatenate(
            [np.where(free, v, 0.0), np.where(free, u / M, 0.0), z_dot, z_2, s_v_dot, s_v_2]
        )

    s_0 = np.full(count, 0.11)
    still = np.zeros(count)
    x, t = np.concatenate([s_0, still, s_0 - n @ s_0 / count, still, s_0, still]), 0.0
    while not np.isfinite(times).all():

        def next_gap(_, x):
            return float((x[:count] - faces)[~np.isfinite(times)].min())

        next_gap.terminal = True
        found = solve_ivp(
            rates, (t, 4.0), x, method="DOP853", events=next_gap, rtol=1e-9, atol=1e-12
        )
        assert found.status == 1
        t, x = found.t[-1], found.y[:, -1].copy()
        k = int(np.argmin(np.where(np.isfinite(times), math.inf, x[:count] - faces)))
        times[k], x[k], x[count + k] = t, faces[k], 0.0
    return times.tolist()


@pytest.mark.parametrize(
    ("angles", "centre", "alpha"),
    [
        ((0.0, 120.0, 240.0), (0.006, -0.008), 1.0),
        ((0.0, 90.0, 225.0), (0.0, 0.01), 0.3),
        ((20.0, 100.0, 200.0, 290.0), (-0.005, 0.002), 1.2),
    ],
)
def test_each_finger_touches_within_a_millisecond(angles, centre, alpha):
    system = hand_system(angles=angles, native=False).with_experiment(step=5e-4, stop=2.5)
    values = {f"sensor_{k}.reflectance": alpha for k in range(1, len(angles) + 1)}
    values |= {f"plant.initial_object_position[{i + 1}]": centre[i] for i in (0, 1)}
    found = simulate(system.with_values(values)).metrics["time_to_contact"]
    assert found == pytest.approx(contacts(angles, centre, alpha), rel=0.0, abs=1e-3)
