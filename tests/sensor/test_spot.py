"""The spot on faces that are curved, tilted, small or printed, against rays and scipy."""

from dataclasses import replace
from math import erf, inf, log, pi, sqrt, tan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import channel
from proximity_sensor.channel import Inputs, Params
from proximity_sensor.spot import Face, Pattern, Spot, brightness
from scipy import integrate
from support.marks import examples

N, L_0 = 1.1506, 0.005
SPOT, FLAT, PLAIN = Spot(True), Face(), Pattern()
GAPS = (0.0, 0.005, 0.02, 0.1)
STRIPES = Pattern(0.57, 0.01, 0.001)


def sigma(spot):
    """A Gaussian has half of its peak at sqrt(2·ln 2) standard deviations."""
    return tan(spot.half_angle) / sqrt(2.0 * log(2.0))


def traced(face, z_0, s, t):
    """z of the face on the ray (s, t, 1), and its normal times that ray; 0 where there is none."""
    normal = np.array([np.sin(face.tilt), 0.0, np.cos(face.tilt)])
    if face.curvature == 0.0:
        facing = normal[0] * s + normal[2]
        return normal[2] * z_0 / facing, facing + 0.0 * t
    radius = 1.0 / face.curvature
    x_c, _, z_c = np.array([0.0, 0.0, z_0]) + radius * normal
    t = 0.0 * t if face.cylindrical else t
    a, b, c = s * s + t * t + 1.0, s * x_c + z_c, x_c**2 + z_c**2 - radius**2
    root = b * b - a * c
    z = (b - np.sqrt(np.maximum(root, 0.0))) / a
    facing = ((x_c - s * z) * s - t * z * t + z_c - z) / radius
    return z, np.where(root > 0.0, facing, 0.0)


def light(spot, face, pattern, z_0, s, t):
    """The integrand; a print and an edge of a sphere are where y is 0."""
    z, facing = traced(face, z_0, s, t)
    x = s * traced(face, z_0, s, 0.0 * s)[0]
    first = np.cos(2.0 * pi * (x - pattern.phase) / pattern.period) >= 0.0
    alpha = np.where(first, 1.0, pattern.ratio) * (face.edges[0] <= x) * (x <= face.edges[1])
    return alpha * facing * (z_0 / z) ** N * np.exp(-(s * s + t * t) / 2.0 / sigma(spot) ** 2)


def by_rays(spot, face, pattern, gap, across, along):
    """Many rays in place of the few of the block."""
    z_0, end = gap + L_0, 3.0 * sigma(spot)
    s, t = ((np.arange(n) + 0.5) / n * 2.0 * end - end for n in (across, along))
    whole = light(spot, FLAT, PLAIN, z_0, s[:, None], t).mean()
    return light(spot, face, pattern, z_0, s[:, None], t).mean() / whole


def by_scipy(spot, face, gap):
    """Over the visible part of a face without a print."""
    z_0, end = gap + L_0, 3.0 * sigma(spot)
    plane = (2.0 * pi) * (sigma(spot) * erf(3.0 / sqrt(2.0))) ** 2
    total, _ = integrate.dblquad(
        lambda t, s: float(light(spot, face, PLAIN, z_0, s, t)),
        -end, end, 0.0, end, epsabs=5e-4 * plane, epsrel=1e-3,
    )  # fmt: skip
    return 2.0 * total / plane


def seen(spot, face, pattern, gap):
    return brightness(spot, face, pattern, N, gap + L_0)


@examples(40)
@given(st.floats(-0.005, 2e6), st.floats(0.01, 0.4), st.floats(0.1, 10.0))
def test_a_large_flat_square_face_of_one_colour_is_eq_9_to_the_last_bit(gap, half_angle, exponent):
    off = Params(diffusion_exponent=exponent)
    on = replace(off, spot=Spot(True, half_angle))
    found, expected = (
        channel.outputs(p, channel.initial_state(p, Inputs(gap)), Inputs(gap)) for p in (on, off)
    )
    assert found == expected


def test_a_spot_that_is_off_sees_no_shape():
    p = Params(face=Face(100.0, tilt=0.3, edges=(0.0, 0.001)), pattern=Pattern(0.0))
    for gap in GAPS:
        x = channel.initial_state(p, Inputs(gap))
        assert channel.outputs(p, x, Inputs(gap)) == channel.outputs(Params(), x, Inputs(gap))


SHAPES = {
    "sphere of 30 mm": (Face(1.0 / 0.03), 0.01),
    "sphere of 5 mm": (Face(200.0), 0.005),
    "tilted sphere of 10 mm": (Face(100.0, tilt=0.2), 0.005),
}


@pytest.mark.parametrize("name", [
    "sphere of 30 mm",
    *(pytest.param(n, marks=pytest.mark.slow) for n in [*SHAPES][1:]),
])  # fmt: skip
def test_a_sphere_is_as_scipy_integrates_it(name):
    face, gap = SHAPES[name]
    assert seen(SPOT, face, PLAIN, gap) == pytest.approx(by_scipy(SPOT, face, gap), rel=3e-3)


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("face", [
    Face(30.0, True), Face(300.0, True), Face(tilt=0.3), Face(30.0, True, -0.2),
    Face(edges=(-0.004, 0.009)), Face(30.0, True, 0.1, (0.0, 1.0)), Face(60.0, edges=(-1.0, 0.0)),
], ids=str)  # fmt: skip
def test_a_shape_is_as_many_rays_see_it(face, gap):
    """Within 0.5 %, and 0.001 % of the light of a large flat face."""
    spherical = face.curvature > 0.0 and not face.cylindrical
    expected = by_rays(SPOT, face, PLAIN, gap, 1000, 200 if spherical else 1)
    if not spherical:
        expected = by_rays(SPOT, face, PLAIN, gap, 100_000, 1)
    assert seen(SPOT, face, PLAIN, gap) == pytest.approx(expected, rel=5e-3, abs=1e-5)


def test_one_edge_is_the_integral_of_a_gaussian():
    for place in (-0.004, 0.0, 0.003):
        u = place / (0.01 + L_0) / sigma(SPOT)
        expected = 0.5 + 0.5 * erf(u / sqrt(2.0)) / erf(3.0 / sqrt(2.0))
        found = seen(SPOT, Face(edges=(-1.0, place)), PLAIN, 0.01)
        assert found == pytest.approx(expected, abs=1e-3)
    assert seen(SPOT, Face(edges=(0.1, 0.2)), PLAIN, 0.01) == 0.0


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("face", [FLAT, Face(30.0, True, 0.1)], ids=["flat", "cylinder"])
def test_stripes_are_as_many_rays_see_them(face, gap):
    for pattern in (STRIPES, Pattern(0.0, 0.004, 0.001), Pattern(2.0, 0.03, 0.004)):
        expected = by_rays(SPOT, face, pattern, gap, 100_000, 1)
        bound = 5e-3 * max(1.0, pattern.ratio)
        assert seen(SPOT, face, pattern, gap) == pytest.approx(expected, abs=bound)


@pytest.mark.slow
def test_conditions_by_chance_are_as_many_rays_see_them():
    """Within 0.5 % of the light of a large flat face; stripes of black on white within 1 %."""
    random = np.random.default_rng(47)
    for _ in range(300):
        spot = Spot(True, random.uniform(0.1, 0.4))
        edges = [(-1e6, 1e6), (-1e6, 0.0), (-0.01, 0.01), (-0.003, 0.005)][random.integers(4)]
        curvature = random.choice([0.0, 10.0 ** random.uniform(0.0, 2.5)])
        face = Face(curvature, random.random() < 0.5, random.uniform(-0.35, 0.35), edges)
        pattern = Pattern(random.choice([0.1, 0.57, 1.0]), 10.0 ** random.uniform(-3.0, -1.0))
        gap = random.choice([0.0, random.uniform(0.0, 0.1)])
        spherical = face.curvature > 0.0 and not face.cylindrical
        across, along = (3001, 301) if spherical else (100_001, 1)
        expected = by_rays(spot, face, pattern, gap, across, along)
        bound = 5e-3 if pattern.ratio > 0.5 else 1e-2
        assert seen(spot, face, pattern, gap) == pytest.approx(expected, abs=bound)


def test_stripes_average_out_as_the_spot_grows_with_the_gap():
    """At last only the mean of both colours is left."""
    phases = np.linspace(0.0, STRIPES.period, 41)
    swings = []
    for gap in GAPS:
        found = [seen(SPOT, FLAT, replace(STRIPES, phase=phase), gap) for phase in phases]
        swings.append(max(found) - min(found))
    assert swings == sorted(swings, reverse=True)
    assert swings[0] > 0.3
    assert swings[-1] < 0.002
    assert found == pytest.approx(np.full(41, 0.785), abs=1e-3)


def test_edges_in_the_wrong_order_are_refused():
    with pytest.raises(ValueError, match=r"^face\.edges = 0\.1, 0\.0 m: the second must be above"):
        Face(edges=(0.1, 0.0))


def test_nothing_in_range_is_dark():
    p = Params(spot=SPOT, face=Face(100.0))
    x = channel.initial_state(p, Inputs(inf))
    assert channel.outputs(p, x, Inputs(inf)).intensity == 0.0
