"""Gripper, sensors and controller in a loop, called directly."""

from dataclasses import dataclass
from functools import cache
from math import tanh

import numpy as np
import pytest
from grasp_controller import contact_force as layer_1
from grasp_controller import impact_reduction as layer_2
from grasp_controller import series
from grasp_controller import simultaneous_contact as layer_3
from gripper_plant import rigid
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import optics
from support.examples import examples
from support.slow import slow

H = 1e-3
"""Communication step in s, ten times the paper's: nothing below depends on it."""

Pair = tuple[float, float]


@dataclass(frozen=True)
class Sample:
    gripper: rigid.Outputs
    intensity: Pair
    controller: series.Outputs


@dataclass(frozen=True)
class Grasp:
    """The paper's grasp but for what is given."""

    gripper: rigid.Params = rigid.Params()
    reflectance: Pair = (1.0, 1.0)
    case: int = 2
    stiffness: float = 98.0

    def sensors(self):
        alpha_1, alpha_2 = self.reflectance
        return optics.Params(reflectance=alpha_1), optics.Params(reflectance=alpha_2)

    def run(self, stop):
        """Plant, sensors, controller, and again: a sample per communication point."""
        controller, sensors = self.controller(), self.sensors()
        x = rigid.initial_state(self.gripper, rigid.Inputs())
        y = rigid.outputs(self.gripper, x, rigid.Inputs())
        u = series.Inputs(y.position, y.velocity, seen(sensors, y.gap))
        z = series.initial_state(controller, u)
        samples = [Sample(y, u.intensity, series.outputs(controller, z, u))]
        for _ in range(round(stop / H)):
            force = rigid.Inputs(samples[-1].controller.force)
            x = rigid.step(self.gripper, x, force, H)
            y = rigid.outputs(self.gripper, x, force)
            u = series.Inputs(y.position, y.velocity, seen(sensors, y.gap))
            z = series.step(controller, z, u, H)
            samples.append(Sample(y, u.intensity, series.outputs(controller, z, u)))
        return samples

    def controller(self):
        return series.Params(
            layer_3.Params(enabled=self.case == 2),
            layer_2.Params(enabled=self.case > 0),
            layer_1.Params(stiffness=self.stiffness),
        )


def seen(sensors, gap):
    p_1, p_2 = sensors
    l_1, l_2 = gap
    xi_1 = optics.outputs(p_1, optics.Inputs(l_1)).intensity
    return xi_1, optics.outputs(p_2, optics.Inputs(l_2)).intensity


def around(x_m, width=0.07):
    return rigid.Params(initial_object_position=x_m, object_width=width)


def swapped(pair):
    first, second = pair
    return -second, -first


def contact_times(samples):
    return [
        next((n * H for n, sample in enumerate(samples) if sample.gripper.contact[j]), None)
        for j in (0, 1)
    ]


# ----------------------------------------------------------------------------- symmetry


@pytest.mark.slow
@examples(6)
@given(st.floats(-0.07, 0.07), st.sampled_from([0, 1, 2]), st.floats(0.5, 1.0), st.floats(0.5, 1.0))
def test_the_mirrored_grasp_is_exactly_the_mirrored_grasp(x_m, case, alpha_1, alpha_2):
    samples = Grasp(around(x_m), (alpha_1, alpha_2), case).run(2.5)
    images = Grasp(around(-x_m), (alpha_2, alpha_1), case).run(2.5)
    for a, b in zip(samples, images, strict=True):
        assert b.gripper.position == swapped(a.gripper.position)
        assert b.gripper.velocity == swapped(a.gripper.velocity)
        assert b.gripper.contact_force == swapped(a.gripper.contact_force)
        assert b.intensity == a.intensity[::-1]
        assert b.controller.force == swapped(a.controller.force)
        assert b.controller.target_position == -a.controller.target_position


@pytest.mark.parametrize("case", [0, 1, 2])
def test_both_fingers_of_a_centred_grasp_do_the_same(case):
    """And they touch, so that the symmetry holds in contact as well."""
    samples = Grasp(around(0.0), case=case).run(2.5)
    assert all(s.gripper.position[0] == -s.gripper.position[1] for s in samples)
    assert all(s.controller.target_position == 0.0 for s in samples)
    right, left = contact_times(samples)
    assert right is not None
    assert right == left


# ------------------------------------------------------------------------ the final grasp


@pytest.mark.parametrize(
    ("case", "x_m", "width", "stiffness"),
    [
        (0, 0.03, 0.07, 98.0),
        slow(1, 0.03, 0.07, 98.0),
        slow(2, 0.03, 0.07, 98.0),
        (2, -0.05, 0.07, 98.0),
        (2, 0.01, 0.04, 98.0),
        (1, 0.03, 0.07, 50.0),
    ],
)
def test_the_grasp_settles_at_the_force_of_half_the_width(case, x_m, width, stiffness):
    """K_i·W/2 on each finger, borne by the object, and the target at its centre."""
    last = Grasp(around(x_m, width), case=case, stiffness=stiffness).run(9.0)[-1]
    force = 0.5 * stiffness * width
    assert last.controller.force == pytest.approx((-force, force), rel=1e-9)
    assert last.gripper.contact_force == pytest.approx((force, -force), rel=1e-9)
    assert last.gripper.velocity == pytest.approx((0.0, 0.0), abs=1e-12)
    assert last.gripper.gap == pytest.approx((0.0, 0.0), abs=1e-12)
    assert last.controller.target_position == pytest.approx(x_m, abs=1e-9)


def test_unequal_reflectances_leave_the_target_off_the_centre():
    """At rest f_s of the two reflectances, borne by K_a2: Eq. (10) with both gaps zero."""
    last = Grasp(reflectance=(0.86, 1.0)).run(9.0)[-1]
    off = 3.0 * tanh((0.86 - 1.0) / (0.86 + 1.0)) / 36.0
    assert last.controller.target_position == pytest.approx(0.03 + off, abs=1e-10)
    assert last.controller.force == pytest.approx((-3.43 + 98.0 * off, 3.43 + 98.0 * off), rel=1e-6)


# --------------------------------------------------------------------------- reflectance


@cache
def grey(case):
    """The grasp of an object of reflectance 0.9."""
    return Grasp(case=case, reflectance=(0.9, 0.9)).run(2.5)


@pytest.mark.parametrize("case", [0, 1, 2])
@pytest.mark.parametrize("factor", [0.25, 0.5, 8.0])
def test_twice_the_reflectance_changes_no_force_at_all(case, factor):
    scaled = Grasp(case=case, reflectance=(0.9 * factor, 0.9 * factor)).run(2.5)
    for a, b in zip(grey(case), scaled, strict=True):
        assert b.controller == a.controller
        assert b.gripper == a.gripper
        assert b.intensity == (factor * a.intensity[0], factor * a.intensity[1])


def forces_of(samples):
    return np.array([(*s.controller.force, *s.gripper.contact_force) for s in samples])


@pytest.mark.parametrize("factor", [slow(0.57), 0.93, 3.0])
def test_any_reflectance_changes_no_force(factor):
    """But for roundings, relative to the largest force."""
    scaled = Grasp(reflectance=(factor, factor)).run(2.5)
    plain, forces = forces_of(grey(2)), forces_of(scaled)
    np.testing.assert_allclose(forces, plain, rtol=0.0, atol=1e-9 * abs(plain).max())


# ------------------------------------------------------------------------------- the cases


def test_each_layer_does_what_it_is_for():
    """Layer 3 brings the fingers to the object together, layer 2 brings them slowly."""
    differences, speeds = [], []
    for case in (0, 1, 2):
        samples = Grasp(case=case).run(3.0)
        right, left = contact_times(samples)
        assert right is not None
        assert left is not None
        differences.append(abs(right - left))
        touching = round(min(right, left) / H)
        speeds.append(max(abs(v) for v in samples[touching - 1].gripper.velocity))
    assert differences[2] < 0.1 * differences[1]
    assert speeds[0] > 10.0 * speeds[1]
    assert speeds[0] > 10.0 * speeds[2]
