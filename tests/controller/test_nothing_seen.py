"""What the controllers do while the sensors see nothing, an intensity of 0 V, and after it."""

from math import isfinite

import pytest
from grasp_controller import adaptive, hand, hand_adaptive, series

H = 1e-3
LAWS = {
    "published": (series, 2), "adaptive": (adaptive, 2),
    "hand": (hand, hand.FINGERS), "hand, adaptive": (hand_adaptive, hand_adaptive.FINGERS),
}  # fmt: skip


def scalars(value):
    return [x for item in value for x in scalars(item)] if isinstance(value, tuple) else [value]


def steps(law, fingers, intensities):
    """The outputs at each sample of the intensity, which all fingers see at rest."""
    p, x, outputs = law.Params(), None, []
    for xi in intensities:
        u = law.Inputs()._replace(intensity=(xi,) * fingers)
        x = law.initial_state(p, u) if x is None else law.step(p, x, u, H)
        outputs.append(law.outputs(p, x, u))
    return outputs


@pytest.mark.parametrize("name", LAWS)
def test_nothing_seen_is_no_virtual_force_and_all_is_finite(name):
    for y in steps(*LAWS[name], [0.0] * 20):
        assert all(map(isfinite, scalars(y)))
        assert set(scalars((y.simultaneous_contact_force, y.impact_reduction_force))) == {0.0}


@pytest.mark.parametrize("name", LAWS)
def test_what_comes_into_sight_at_once_is_no_impulse(name):
    """The rate of ln xi from nothing to something has no meaning."""
    ys = steps(*LAWS[name], [0.0] * 5 + [0.05] * 5 + [0.0] * 5)
    forces = [set(scalars(y.impact_reduction_force)) for y in ys]
    assert forces == [{0.0}] * len(ys)
    assert all(isfinite(value) for y in ys for value in scalars(y))
