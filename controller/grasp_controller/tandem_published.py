"""The published law, exactly, for a gripper whose fingers move in tandem on a wrist.

Eqs. (1) to (7) in sum and difference:

    layers 2, 3   as published: x_v2 and the virtual objects x_vj1          series.py
    layer 1       F = u_1 - u_2 closes the grip, and the wrist gives way as free fingers would,
                  2m·X_c'' = -2·D_i·(X_c' - s') - 2·K_i·(X_c - s) + f_c1 + f_c2,   s = mean of x_vj1

The last equation is (P3) of the card. The law holds where the wrist follows X_c at once and its
force is measured: from about 100 Hz on.
Derivation: controller/README.md
"""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from block_variables import Group, Input, Parameter

from . import impedance, series
from .impedance import Motion
from .tandem import GripForce, WristCommand


@dataclass(frozen=True, slots=True)
class Admittance(Group, name="admittance"):
    """The mass 2m of the paper's fingers: so the wrist moves as their middle would."""

    mass: Annotated[
        float,
        Parameter(
            "2·m, mass with which the wrist gives way", unit="kg", low=1e-3, high=1e3, tunable=True
        ),
    ] = 1.0


@dataclass(frozen=True, slots=True)
class Params(series.Params):
    """The parameters of the three layers, and of how the wrist gives way."""

    admittance: Admittance = Admittance()

    def __post_init__(self) -> None:
        if self.contact_force.stiffness < 1e-6:
            raise ValueError(
                f"contact_force.stiffness = {self.contact_force.stiffness!r} N/m: must be from "
                "1e-06, as the wrist is held by it"
            )


class Inputs(NamedTuple):
    """Samples of the gripper, of its sensors and of the wrist's force sensor."""

    position: series.Position = (0.11, -0.11)
    velocity: series.Velocity = (0.0, 0.0)
    intensity: series.Intensity = (0.03, 0.03)
    wrist_force: Annotated[
        float,
        Input(
            "f_c1 + f_c2, contact forces as a sensor at the wrist has them, without inertia",
            unit="N",
            nominal=1.0,
        ),
    ] = 0.0


class State(NamedTuple):
    """The layers, and where the wrist is sent."""

    layers: series.State
    wrist: Motion


class Outputs(NamedTuple):
    """The commands to grip and wrist, and the inner signals of the layers."""

    grip_force: GripForce
    wrist_command: WristCommand
    target_position: series.TargetPosition
    virtual_position: series.VirtualPosition
    simultaneous_contact_force: series.SimultaneousContactForce
    impact_reduction_force: series.ImpactReductionForce


def initial_state(p: Params, u: Inputs) -> State:
    """As the published law starts, the wrist where it is."""
    layers = _samples(u)
    x_1, x_2 = u.position
    return State(series.initial_state(p, layers), (0.5 * (x_1 + x_2), 0.0))


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance the virtual objects and the wrist's command by h seconds (h > 0), samples held."""
    layers = series.step(p, x.layers, _samples(u), h)
    return State(layers, _advance_admittance(p, x.wrist, layers, u, h))


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The commands for the samples u."""
    y = series.outputs(p, x.layers, _samples(u))
    u_1, u_2 = y.force
    return Outputs(
        u_1 - u_2,
        x.wrist[0],
        y.target_position,
        y.virtual_position,
        y.simultaneous_contact_force,
        y.impact_reduction_force,
    )


def _samples(u: Inputs) -> series.Inputs:
    """Those that the published law takes."""
    return series.Inputs(u.position, u.velocity, u.intensity)


def _advance_admittance(
    p: Params, wrist: Motion, layers: series.State, u: Inputs, h: float
) -> Motion:
    """The wrist's command h seconds later, the virtual objects and the wrist's force held."""
    gains = p.contact_force
    (s_1, v_1), (s_2, v_2) = layers.virtual
    s, v = 0.5 * (s_1 + s_2), 0.5 * (v_1 + v_2)
    damping, stiffness = 2.0 * gains.damping, 2.0 * gains.stiffness
    position, velocity = wrist
    a = impedance.transition(p.admittance.mass, damping, stiffness, h)
    e_inf = (damping * v + u.wrist_force) / stiffness  # (P3)
    deviation, velocity = impedance.advance(a, position - s, velocity, e_inf)
    return s + deviation, velocity
