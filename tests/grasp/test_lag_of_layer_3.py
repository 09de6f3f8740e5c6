"""What is left between the contacts once the ratio is known: the lag of layer 3 itself.

With equal faces, gaps l = d - l_0 and a target off the middle by little, the middle of the fingers
obeys Eqs. (1), (3), (6) and (7), all linear, with f_s = -K_s·n·z and a mean f_p = -D_p·n·z',
z = (d_1 - d_2)/(d_1 + d_2). At one d its slowest root says how fast the rest dies out.
"""

import numpy as np
import pytest
from grasp_cosim import System
from grasp_cosim.grasp.presets import SYSTEM
from support.adaptive import adaptive_grasp, run, values_of

N, L_0 = 1.1506, 0.005

CENTRES = (0.03, 0.05)
"""m; the published position, and the furthest."""


def slowest(d):
    """How fast the middle of the fingers comes to that of the object, 1/s, at the distance d in m.

    With X for the middle, V for that of the virtual objects and T for the target:
    (m·s^2 + D_i·s + K_i)·X = (D_i·s + K_i)·V, Eq. (6) and (3), all for one finger.
    """
    finger, spring = np.poly1d([0.5, 14.0, 98.0]), np.poly1d([14.0, 98.0])
    layer_2, layer_3 = np.poly1d([1.0, 10.0, 25.0]), np.poly1d([1.0, 12.0, 36.0])
    damper, pull = np.poly1d([0.6 * N / d, 0.0]), np.poly1d([3.0 * N / d - 36.0])
    target = finger * layer_2 + spring * damper  # of T over X, times spring·layer_2
    roots = (layer_3 * target + pull * spring * layer_2).roots
    return float(min(-roots.real))


def distances(result):
    return np.array([result[f"plant.gap[{j}]"] + L_0 for j in (1, 2)])


def rest(result):
    """z over time."""
    d_1, d_2 = distances(result)
    return (d_1 - d_2) / (d_1 + d_2)


def grasps(natives, x_m, alpha=(1.0, 1.0)):
    """The published one and the adaptive one."""
    values = values_of(alpha, x_m)
    published = System.load(SYSTEM, natives)
    return run(published, values, 1e-3, 2.5), run(adaptive_grasp(natives), values, 1e-3, 2.5)


def apart(result):
    return float(result.metrics["time_difference"])


@pytest.mark.parametrize("x_m", CENTRES)
def test_with_equal_faces_it_is_that_of_the_published_law(natives, x_m):
    published, adaptive = grasps(natives, x_m)
    assert apart(adaptive) == pytest.approx(apart(published), abs=2e-3)


def test_most_of_what_unequal_faces_leave_is_this_lag(natives):
    _, equal = grasps(natives, 0.05)
    _, unequal = grasps(natives, 0.05, (0.3, 1.2))
    assert apart(equal) == pytest.approx(0.025, abs=2e-3)
    assert apart(equal) < apart(unequal) < 2.0 * apart(equal)


@pytest.mark.parametrize("x_m", CENTRES)
@pytest.mark.parametrize("before", [0.6, 0.3, 0.1])
def test_it_dies_out_with_the_slowest_root(natives, x_m, before):
    """At moments in s before the contact; some 2.4 1/s at every distance."""
    published, adaptive = grasps(natives, x_m)
    for result, rel in ((published, 0.04), (adaptive, 0.06)):
        at = round((min(result.metrics["time_to_contact"]) - before) * 1e3)
        z = np.log(np.abs(rest(result)[[at - 20, at + 20]]))
        d = float(np.mean(distances(result)[:, at]))
        assert (z[0] - z[1]) / 0.04 == pytest.approx(slowest(d), rel=rel)


@pytest.mark.parametrize("x_m", CENTRES)
def test_the_contacts_are_apart_by_the_rest_over_the_speed(natives, x_m):
    """At the first contact the other finger has still 2·z·d to go."""
    for result in grasps(natives, x_m):
        t_1, t_2 = result.metrics["time_to_contact"]
        at = round(min(t_1, t_2) * 1e3)
        gap = 2.0 * abs(float(rest(result)[at])) * float(np.mean(distances(result)[:, at]))
        later = 0 if t_1 > t_2 else 1
        speed = result.metrics["impact_velocity"][later]
        assert apart(result) == pytest.approx(gap / speed, rel=0.1)
