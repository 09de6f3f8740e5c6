"""The spot of light on a face that is curved, tilted, small or printed.

    xi = K·integral of alpha·c·w(s, t) / z^n ds dt  /  integral of w(s, t) ds dt

over the rays from the sensing element. A ray goes through (s·z, t·z, z): z lies along the axis of
the sensor, x = s·z across the face, y = t·z along its stripes and edges. The ray meets the face at
z, and c is the product of the face's normal and (s, t, 1): by Lambert's law the light goes with the
cosine. A plane that is square to the axis has z = l + l_0 and c = 1 for all rays. One of one colour
gives Eq. (9). The lobe w is that of emitter and receiver together, as such a plane shows it:

    w = exp(-(s^2 + t^2) / (2·sigma^2))  for  |s|, |t| <= 3·sigma;  otherwise 0

Moreno and Sun, Optics Express 16 (2008) 1808-1819, describe the lobes of LEDs as sums of Gaussians
or powers of the cosine. One Gaussian is the simplest of these. Equations: sensor/README.md
"""

from dataclasses import dataclass
from math import cos, exp, floor, log, pi, sin, sqrt, tan
from typing import Annotated, NamedTuple

from block_variables import Group, Parameter


@dataclass(frozen=True, slots=True)
class Spot(Group, name="spot"):
    """The lobe of emitter and receiver together; the half angle has no source."""

    enabled: Annotated[bool, Parameter("the sensor sees a spot, not a point", tunable=True)] = False
    half_angle: Annotated[
        float,
        Parameter(
            "angle from the axis at which the lobe has half of its peak",
            unit="rad",
            low=0.01,
            high=0.4,
            tunable=True,
        ),
    ] = 0.35


@dataclass(frozen=True, slots=True)
class Face(Group, name="face"):
    """The face of the object, as the spot sees it; by default flat, square and large."""

    curvature: Annotated[
        float,
        Parameter(
            "1/radius of the face, convex; 0: flat", unit="1/m", low=0.0, high=1e3, tunable=True
        ),
    ] = 0.0
    cylindrical: Annotated[
        bool, Parameter("the face is curved across only, as a cylinder", tunable=True)
    ] = False
    tilt: Annotated[
        float,
        Parameter(
            "angle of the face's normal to the axis; above 0 the face is nearer at x > 0",
            unit="rad",
            low=-0.35,
            high=0.35,
            tunable=True,
        ),
    ] = 0.0
    edges: Annotated[
        tuple[float, float],
        Parameter(
            "where the face begins and ends, across, from the axis",
            unit="m",
            low=-1e7,
            high=1e7,
            tunable=True,
        ),
    ] = (-1e7, 1e7)

    def __post_init__(self) -> None:
        Group.__post_init__(self)
        first, last = self.edges
        if not first < last:
            raise ValueError(
                f"face.edges = {first!r}, {last!r} m: the second must be above the first"
            )


@dataclass(frozen=True, slots=True)
class Pattern(Group, name="pattern"):
    """A print on the face: stripes of equal widths in two colours; one colour by default."""

    ratio: Annotated[
        float,
        Parameter(
            "reflectance of every other stripe relative to the first; 1: one colour",
            unit="1",
            low=0.0,
            high=1e3,
            tunable=True,
        ),
    ] = 1.0
    period: Annotated[
        float,
        Parameter("width of two stripes, across", unit="m", low=1e-6, high=1.0, tunable=True),
    ] = 0.02
    phase: Annotated[
        float,
        Parameter(
            "place of the middle of a first stripe, across, from the axis",
            unit="m",
            low=-1.0,
            high=1.0,
            tunable=True,
        ),
    ] = 0.0


LOBE = 3.0
"""Standard deviations at which the lobe ends; 0.3 % of a Gaussian is further out."""

HALF = sqrt(2.0 * log(2.0))
"""Standard deviations at which a Gaussian has half of its peak."""

CELLS = 18
"""Of the quadrature across; a ray is at each end of the lobe or face, and between two cells."""

ROWS = 4
"""Rays along a strip of a sphere, from its middle on."""

TURN_X, TURN_Y = pi / CELLS, 0.5 * pi / ROWS
"""rad; the rays' slopes go with the sines of angles with this step, so that limbs cost nothing."""

COS_X, SIN_X, COS_Y, SIN_Y = cos(TURN_X), sin(TURN_X), cos(TURN_Y), sin(TURN_Y)


def _plane(turn: float, rays: int) -> float:
    """The same quadrature of exp(-u^2/2) from -LOBE to LOBE, with this many rays on each side."""
    side = sum(exp(-0.5 * (LOBE * sin(j * turn)) ** 2) * cos(j * turn) for j in range(1, rays))
    end = turn / 12.0 * exp(-0.5 * LOBE * LOBE)
    return LOBE * turn * (1.0 + 2.0 * (side + end))


ACROSS, ALONG = _plane(TURN_X, CELLS // 2), _plane(TURN_Y, ROWS)
"""Those of a plane, in sigma; nearly sqrt(2·pi)."""


class View(NamedTuple):
    """The face as the sensing element sees it; lengths are relative to z_0 = l + l_0."""

    curvature: float
    """k, 1/radius: z_0 in radii."""
    sine: float
    cosine: float
    """Of the tilt."""
    tangent: float
    """k·(k + 2·cosine), the square of the length of a tangent from the element, in radii."""
    spherical: bool
    sigma: float
    """Standard deviation of the lobe, as the slope of a ray."""
    fading: float
    """-1/(2·sigma^2)."""
    exponent: float
    """n of Eq. (9)."""


class Hit(NamedTuple):
    """Where a ray meets the face."""

    nearness: float
    """z_0 / z."""
    facing: float
    """The product of the face's normal and (s, t, 1); 0 at the limb."""


class Node(NamedTuple):
    """A ray of the quadrature across, and what the stripes need there."""

    slope: float
    place: float
    """x / z_0, at y = 0."""
    light: float
    first: float
    """Integral of the stripes over x to this place."""
    second: float
    """Integral of the first integral."""


def brightness(spot: Spot, face: Face, pattern: Pattern, exponent: float, distance: float) -> float:
    """The light from the face relative to that of a plane of one colour, square to the axis.

    The distance in m on the axis is that from the sensing element, l + l_0.
    """
    sigma = tan(spot.half_angle) / HALF
    reach = LOBE * sigma
    first, last = face.edges[0] / distance, face.edges[1] / distance
    whole = first <= -reach and reach <= last
    if whole and face.curvature == 0.0 and face.tilt == 0.0 and pattern.ratio == 1.0:
        return 1.0
    k, sine, cosine = face.curvature * distance, sin(face.tilt), cos(face.tilt)
    spherical = face.curvature > 0.0 and not face.cylindrical
    v = View(
        k, sine, cosine, k * (k + 2.0 * cosine), spherical, sigma, -0.5 / (sigma * sigma), exponent
    )
    low, high = -_end(v, reach, -sine), _end(v, reach, sine)
    place_low, place_high = _place(v, low), _place(v, high)
    if last <= place_low or place_high <= first:
        return 0.0
    low = _slope(v, first) if place_low < first else low
    high = _slope(v, last) if last < place_high else high
    return _integral(v, pattern, distance, low, high) if high - low > NARROW else 0.0


NARROW = 1e-9
"""A face of less width, as a slope, is none."""


def _end(v: View, reach: float, sine: float) -> float:
    """The slope at which the lobe ends, or before it the face: at its limb the facing is 0."""
    fall = sqrt(v.tangent) - sine * (v.curvature + v.cosine)
    return min(reach, v.cosine * v.cosine / fall) if fall > 0.0 else reach


def _hit(v: View, s: float, t: float) -> Hit:
    """Of the ray with the slopes s and t."""
    normal = v.curvature + v.cosine + s * v.sine
    square = normal * normal - v.tangent * (1.0 + s * s + t * t)
    facing = sqrt(max(0.0, square))
    return Hit((normal + facing) / (v.curvature + 2.0 * v.cosine), facing)


def _place(v: View, s: float) -> float:
    """The x of the face on the ray with the slope s."""
    return s / _hit(v, s, 0.0).nearness


def _slope(v: View, place: float) -> float:
    """That of the ray to the face at x = place."""
    bulge = v.curvature * place - 2.0 * v.sine
    normal = sqrt(max(0.0, v.cosine * v.cosine - v.curvature * place * bulge))
    return place / (1.0 + place * bulge / (v.cosine + normal))


def _light(v: View, s: float, t: float) -> float:
    """Of the ray with the slopes s and t."""
    nearness, facing = _hit(v, s, t)
    return facing * exp(v.exponent * log(nearness) + v.fading * (s * s + t * t))


def _strip(v: View, s: float) -> float:
    """The light of all rays with the slope s, relative to those of a plane.

    A plane and a cylinder are as far along y as on the axis, and the lobe is a product.
    """
    if not v.spherical:
        return _light(v, s, 0.0)
    normal = v.curvature + v.cosine + s * v.sine
    limb = sqrt(max(0.0, normal * normal / v.tangent - 1.0 - s * s))
    end = min(limb, LOBE * v.sigma)
    light = 0.5 * _light(v, s, 0.0)
    sine, cosine = 0.0, 1.0
    for _ in range(1, ROWS):
        sine, cosine = sine * COS_Y + cosine * SIN_Y, cosine * COS_Y - sine * SIN_Y
        light += cosine * _light(v, s, end * sine)
    return 2.0 * light * end * TURN_Y / (ALONG * v.sigma)


def _integral(v: View, p: Pattern, distance: float, low: float, high: float) -> float:
    """Over the slopes from low to high, by trapezoids over the angle.

    An end adds 1/12 of a step (Euler and Maclaurin).
    """
    middle, half = 0.5 * (low + high), 0.5 * (high - low)
    printed = p.ratio != 1.0
    period, phase = p.period / distance, p.phase / distance
    plain, linear, stripes = 0.0, 0.0, 0.0
    node = Node(0.0, 0.0, 0.0, 0.0, 0.0)
    sine, cosine = -1.0, 0.0
    for i in range(CELLS + 1):
        s = middle + half * sine
        light = _strip(v, s)
        plain += (cosine if 0 < i < CELLS else TURN_X / 12.0) * light
        if printed:
            before = node
            x = _place(v, s)
            node = Node(s, x, light, *_stripes(period, phase, x))
            if i > 0:
                linear += 0.5 * (before.light + light) * (s - before.slope)
                stripes += _between(before, node)
        sine, cosine = sine * COS_X + cosine * SIN_X, cosine * COS_X - sine * SIN_X
    colour = 1.0
    if printed and linear > 0.0:
        colour = max(0.0, 0.5 * (1.0 + p.ratio + (1.0 - p.ratio) * stripes / linear))
    return colour * plain * half * TURN_X / (ACROSS * v.sigma)


def _between(a: Node, b: Node) -> float:
    """The integral of light times stripes over the slope, with the light linear over x."""
    width = b.place - a.place
    rise = (b.light - a.light) / width
    over_x = b.light * b.first - a.light * a.first - rise * (b.second - a.second)
    return over_x * (b.slope - a.slope) / width


def _stripes(period: float, phase: float, x: float) -> tuple[float, float]:
    """The first and the second integral of the stripes over x; stripes are 1 and -1 in turns."""
    turns = (x - phase) / period
    turns -= floor(turns + 0.5)  # from the middle of the nearest first stripe
    near = abs(turns)
    side = period if turns > 0.0 else -period
    if near <= 0.25:
        return side * near, period * period * (0.5 * near * near - 0.03125)
    far = 0.5 - near  # from the middle of the second stripe
    return side * far, period * period * (0.03125 - 0.5 * far * far)
