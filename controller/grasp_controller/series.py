"""The three layers in series: one control law from approach to grasp, without switching.

    sensors -> layer 3, target x_v2 -> layer 2, virtual objects x_vj1 -> layer 1, forces u_j

Cases and equations: controller/README.md
"""

from dataclasses import dataclass
from typing import Annotated, NamedTuple, TypeAlias

from block_variables import Input, Output

from . import contact_force as layer_1
from . import grip
from . import impact_reduction as layer_2
from . import simultaneous_contact as layer_3
from .impact_reduction import Pair as Pair
from .impedance import Motion


@dataclass(frozen=True, slots=True)
class Params:
    """The parameters of the three layers."""

    simultaneous_contact: layer_3.Params = layer_3.Params()
    impact_reduction: layer_2.Params = layer_2.Params()
    contact_force: layer_1.Params = layer_1.Params()


Position: TypeAlias = Annotated[
    Pair, Input("x_j, position of the fingertip", unit="m", nominal=0.1)
]
Velocity: TypeAlias = Annotated[
    Pair, Input("x_j', velocity of the fingertip", unit="m/s", nominal=0.1)
]
Intensity: TypeAlias = Annotated[
    Pair, Input("xi_j, offset-compensated output of the proximity sensor", unit="V", nominal=0.1)
]
"""The samples that a controller of two fingers takes."""


class Inputs(NamedTuple):
    """Samples of the gripper and of its sensors."""

    position: Position = (0.11, -0.11)
    velocity: Velocity = (0.0, 0.0)
    intensity: Intensity = (0.03, 0.03)


class State(NamedTuple):
    """The virtual objects, and what the last sample left behind."""

    target: Motion
    virtual: layer_2.Motions
    intensity: Pair
    simultaneous_contact_force: float
    impact_reduction_force: Pair
    grip: grip.State
    light_rate: Pair


Force = Annotated[
    Pair,
    Output(
        "u_j, actuator force on the finger",
        unit="N",
        nominal=1.0,
        depends_on={"position", "velocity[j]"},
    ),
]
TargetPosition = Annotated[
    float,
    Output("x_v,2, target of both fingers", unit="m", nominal=0.1, depends_on={"position"}),
]
VirtualPosition = Annotated[
    Pair,
    Output("x_vj,1, virtual object of the finger", unit="m", nominal=0.1, depends_on={"position"}),
]
SimultaneousContactForce = Annotated[
    float,
    Output(
        "f_s, virtual force of layer 3",
        unit="N",
        nominal=1.0,
        depends_on=set(),
        depends_initially_on={"intensity"},
    ),
]
ImpactReductionForce = Annotated[
    Pair, Output("f_pj, virtual force of layer 2", unit="N", nominal=1.0, depends_on=set())
]


class Outputs(NamedTuple):
    """The command to the fingers, and the inner signals of the layers.

    With layers 3 and 2 off, the middle of the fingers goes straight through to the forces.
    """

    force: Force
    target_position: TargetPosition
    virtual_position: VirtualPosition
    simultaneous_contact_force: SimultaneousContactForce
    impact_reduction_force: ImpactReductionForce


def initial_state(p: Params, u: Inputs) -> State:
    """Virtual objects at the measured fingers and at rest, so that nothing jumps at the start."""
    x_1, x_2 = u.position
    f_s = layer_3.virtual_force(p.simultaneous_contact, u.intensity)
    nothing = (0.0, 0.0)
    at_rest = (x_1, 0.0), (x_2, 0.0)
    return State(_middle(u), at_rest, u.intensity, f_s, nothing, grip.AT_REST, nothing)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance the virtual objects by h seconds (h > 0), the samples u held."""
    return advance(p, x, u, layer_3.virtual_force(p.simultaneous_contact, u.intensity), h)


def advance(p: Params, x: State, u: Inputs, f_s: float, h: float) -> State:
    """The virtual objects h seconds later, the samples u and the virtual force f_s in N held."""
    old_target = new_target = _middle(u)
    if p.simultaneous_contact.enabled:
        old_target = x.target
        new_target = layer_3.advance(p.simultaneous_contact, old_target, new_target[0], f_s, h)
    f_p = layer_2.virtual_forces(p.impact_reduction, u.intensity, x.intensity, h)
    virtual = (new_target, new_target)
    if p.impact_reduction.enabled:
        virtual = layer_2.advance(p.impact_reduction, x.virtual, old_target, new_target, f_p, h)
    gripping, light_rate = _gripped(p, x, u, h)
    return State(new_target, virtual, u.intensity, f_s, f_p, gripping, light_rate)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The forces for the samples u; a layer that is off passes on the layer above."""
    target = x.target if p.simultaneous_contact.enabled else _middle(u)
    virtual_1, virtual_2 = virtual = _virtual(p, x, u)
    u_1, u_2 = layer_forces(p, virtual, u)
    force = p.contact_force.grip_force
    if force > 0.0:
        more = grip.change(force, 0.5 * u_2 - 0.5 * u_1, brake(p.contact_force, u), x.grip.share)
        u_1, u_2 = u_1 - more, u_2 + more
    return Outputs(
        (u_1, u_2),
        target[0],
        (virtual_1[0], virtual_2[0]),
        x.simultaneous_contact_force,
        x.impact_reduction_force,
    )


def published_squeeze(p: Params, x: State, u: Inputs) -> float:
    """(u_2 - u_1)/2 in N by Eq. (7), whatever the grip force is."""
    u_1, u_2 = layer_forces(p, _virtual(p, x, u), u)
    return 0.5 * u_2 - 0.5 * u_1


def layer_forces(p: Params, virtual: layer_2.Motions, u: Inputs) -> Pair:
    """u_j in N by Eq. (7)."""
    virtual_1, virtual_2 = virtual
    x_1, x_2 = u.position
    v_1, v_2 = u.velocity
    return (
        layer_1.force(p.contact_force, x_1, v_1, virtual_1),
        layer_1.force(p.contact_force, x_2, v_2, virtual_2),
    )


def _virtual(p: Params, x: State, u: Inputs) -> layer_2.Motions:
    """The virtual objects of layer 1."""
    target = x.target if p.simultaneous_contact.enabled else _middle(u)
    return x.virtual if p.impact_reduction.enabled else (target, target)


def brake(p: layer_1.Params, u: Inputs) -> float:
    """D_i·v in N, v being the mean speed at which the fingers close."""
    v_1, v_2 = u.velocity
    return p.damping * (0.5 * v_2 - 0.5 * v_1)


def _gripped(p: Params, x: State, u: Inputs, h: float) -> tuple[grip.State, Pair]:
    """How far the grip force has come h seconds later, and the rates of the light in 1/s."""
    if p.contact_force.grip_force <= 0.0:
        return grip.AT_REST, (0.0, 0.0)
    squeeze, floor = published_squeeze(p, x, u), p.impact_reduction.intensity_floor
    return gripped(p.contact_force, floor, squeeze, x.grip, x.light_rate, x.intensity, u, h)


def gripped(
    p: layer_1.Params,
    floor: float,
    squeeze: float,
    x: grip.State,
    rates: Pair,
    previous_xi: Pair,
    u: Inputs,
    h: float,
) -> tuple[grip.State, Pair]:
    """How far a grip force above 0 has come h seconds later, and the rates of the light in 1/s.

    The squeeze by Eq. (7) in N and the samples u are held; the intensities before them are in V.
    """
    force = p.grip_force
    (xi_1, xi_2), (before_1, before_2), (rate_1, rate_2) = u.intensity, previous_xi, rates
    rate_1 = grip.light_rate(floor, rate_1, xi_1, before_1, h)
    rate_2 = grip.light_rate(floor, rate_2, xi_2, before_2, h)
    quiet = grip.quiet(rate_1) * grip.quiet(rate_2)
    braked = brake(p, u)
    pressed = squeeze + braked + grip.change(force, squeeze, braked, x.share)
    v_1, v_2 = u.velocity
    return grip.advance(x, pressed, v_1 - v_2, quiet, h), (rate_1, rate_2)


def _middle(u: Inputs) -> Motion:
    """x_d of Eq. (4): no velocity and no acceleration, by definition."""
    return layer_3.desired_position(u.position), 0.0
