"""The exact solutions of the models in tests/support/models."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]


def bouncing_ball(time, e=0.7, v_min=0.1, h=1.0, g=9.81):
    """Height and speed, flight by flight."""
    begin, up = -float(np.sqrt(2.0 * h / g)), float(np.sqrt(2.0 * h * g))
    height, speed = np.zeros_like(time), np.zeros_like(time)
    while up >= v_min and begin < time[-1]:
        end = begin + 2.0 * up / g
        flying = (time >= begin) & (time < end)
        since = time[flying] - begin
        height[flying], speed[flying] = up * since - 0.5 * g * since**2, up - g * since
        begin, up = end, up * e
    return height, speed


def held_input(k, step, inputs, start):
    """The states of x' = -k x + u at the communication points, where u is held over each step."""
    states = [start]
    for u in inputs[:-1]:
        states.append(u / k + (states[-1] - u / k) * np.exp(-k * step))
    return np.array(states)
