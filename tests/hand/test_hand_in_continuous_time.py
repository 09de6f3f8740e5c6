"""The published law of a hand in continuous time, by DOP853 with events: the same contacts."""

import math

import numpy as np
import pytest
from grasp_cosim import hand_system, simulate
from grasp_cosim.hand.weights import balance_weights
from scipy.integrate import solve_ivp

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
