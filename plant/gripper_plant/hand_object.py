"""The object in a hand, seen from above: a prism with a flat face under each finger, or a disc.

    prism: nu_k = Rot(theta)·e_k,      surface on the ray  (h_k + nu_k·c)/(nu_k·e_k)
    disc:  nu_k = (p_k - c)/|p_k - c|,  surface on the ray  c·e_k + sqrt(R^2 - q_k^2)

nu_k is the outward normal where finger k is, q_k how far its ray passes beside the centre.
"""

from enum import IntEnum
from math import cos, inf, sin, sqrt
from typing import NamedTuple

FACING = 0.1
"""Cosine of a prism's turn below which its faces do not look to the rays any more."""

FAR = 10.0
"""m; as far is what is beside a finger."""


class Shape(IntEnum):
    """Of the object, seen from above."""

    PRISM = 1
    DISC = 2


class Ray(NamedTuple):
    """A finger's direction e_k, its angle in rad, and how far the face under it is out, in m."""

    x: float
    y: float
    angle: float
    half_width: float


class Pose(NamedTuple):
    """Of the object: its centre in m, its turn in rad."""

    x: float
    y: float
    angle: float


class Normal(NamedTuple):
    """The outward normal at a finger, and how deep in m the fingertip is below the face there."""

    x: float
    y: float
    depth: float


def surface(shape: Shape, radius: float, ray: Ray, pose: Pose) -> float:
    """Where the object begins on a ray, m from the wrist; -inf where it is beside the ray."""
    if shape == Shape.PRISM:
        facing = cos(pose.angle)
        if facing < FACING:
            return -inf
        x, y = cos(ray.angle + pose.angle), sin(ray.angle + pose.angle)
        return (ray.half_width + x * pose.x + y * pose.y) / facing
    along = ray.x * pose.x + ray.y * pose.y
    beside = ray.x * pose.y - ray.y * pose.x
    left = radius * radius - beside * beside
    return along + sqrt(left) if left >= 0.0 else -inf


def normal(shape: Shape, radius: float, face: float, ray: Ray, pose: Pose, s: float) -> Normal:
    """The normal where the fingertip is, s m out on the ray, and its depth.

    A face of a prism ends half of its length `face` in m away from its middle.
    """
    arm_x, arm_y = s * ray.x - pose.x, s * ray.y - pose.y
    if shape == Shape.PRISM:
        facing = cos(pose.angle)
        x, y = cos(ray.angle + pose.angle), sin(ray.angle + pose.angle)
        if facing < FACING or abs(arm_x * y - arm_y * x) > 0.5 * face:
            return Normal(x, y, -FAR)
        return Normal(x, y, ray.half_width + x * pose.x + y * pose.y - s * facing)
    x, y = arm_x, arm_y
    distance = sqrt(x * x + y * y)
    if distance <= 0.0:
        return Normal(ray.x, ray.y, radius)
    return Normal(x / distance, y / distance, radius - distance)
