"""Multiple impedance control of a hand of N fingers that close along rays from its wrist.

Each finger has its own target, and balance weights n_k with sum n_k·e_k = 0 tie them together;
the layers are those of series.py, s_k >= 0 being the way from the wrist along the ray:

    (2N) f_sk = K_s·(phi_k - <phi>),    phi_k = tanh((xi_k - m_k)/(xi_k + m_k))
    (4N) z_dk = s_k - <s>               <q> = 1/N·sum n_k·q_k, m_k: mean of the others' intensities
    (7N) u_k = n_k·[-D_i·(s_k' - s_vk') - K_i·(s_k - s_vk)]

Eq. (3), (5), (6) hold for each finger. With N = 2 it is the published law, x_1 = s_1, x_2 = -s_2.
Equations: controller/README.md
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, NamedTuple

from block_variables import Input, Output, Parameter, check

from . import contact_force as layer_1
from . import grip, impedance
from . import impact_reduction as layer_2
from . import simultaneous_contact as layer_3
from .hand_size import FINGERS
from .impedance import Motion

if TYPE_CHECKING:
    PerFinger = tuple[float, ...]
    Motions = tuple[Motion, ...]
else:
    PerFinger = tuple[(float,) * FINGERS]
    Motions = tuple[(Motion,) * FINGERS]

ZEROS: PerFinger = (0.0,) * FINGERS


@dataclass(frozen=True, slots=True)
class ImpactReduction(layer_2.Gains, name="impact_reduction"):
    """Layer 2 with one viscosity, as all fingers count their way as they open."""

    viscosity: Annotated[
        float,
        Parameter(
            "D_p, viscosity of the virtual force", unit="N.s", low=-1e3, high=1e3, tunable=True
        ),
    ] = 0.6
    intensity_floor: layer_2.Floor = 1e-6
    least_pull: layer_2.LeastPull = 0.0


@dataclass(frozen=True)
class Params:
    """The weights of the fingers, and the parameters of the three layers."""

    weight: Annotated[
        PerFinger,
        Parameter(
            "n_k, balance weight of the finger; with its direction e_k the sum of n_k·e_k is 0",
            unit="1",
            low=1e-3,
            high=1e3,
        ),
    ] = (1.0,) * FINGERS
    simultaneous_contact: layer_3.Params = layer_3.Params()
    impact_reduction: ImpactReduction = ImpactReduction()
    contact_force: layer_1.Params = layer_1.Params()

    def __post_init__(self) -> None:
        check(self)


class Inputs(NamedTuple):
    """Samples of the hand and of its sensors."""

    position: Annotated[
        PerFinger, Input("s_k, way of the fingertip from the wrist", unit="m", nominal=0.1)
    ] = (0.11,) * FINGERS
    velocity: Annotated[
        PerFinger, Input("s_k', velocity of the fingertip, opening", unit="m/s", nominal=0.1)
    ] = ZEROS
    intensity: Annotated[
        PerFinger,
        Input("xi_k, offset-compensated output of the proximity sensor", unit="V", nominal=0.1),
    ] = (0.03,) * FINGERS


class State(NamedTuple):
    """The targets z_k and virtual objects s_vk, and what the last sample left behind."""

    target: Motions
    virtual: Motions
    intensity: PerFinger
    simultaneous_contact_force: PerFinger
    impact_reduction_force: PerFinger
    grip: grip.State
    light_rate: PerFinger


Force = Annotated[
    PerFinger,
    Output(
        "u_k, actuator force on the finger, opening",
        unit="N",
        nominal=1.0,
        depends_on={"position", "velocity[j]"},
    ),
]
TargetPosition = Annotated[
    PerFinger, Output("z_k, target of the finger", unit="m", nominal=0.1, depends_on={"position"})
]
VirtualPosition = Annotated[
    PerFinger,
    Output("s_vk, virtual object of the finger", unit="m", nominal=0.1, depends_on={"position"}),
]
SimultaneousContactForce = Annotated[
    PerFinger,
    Output(
        "f_sk, virtual force of layer 3",
        unit="N",
        nominal=1.0,
        depends_on=set(),
        depends_initially_on={"intensity"},
    ),
]
ImpactReductionForce = Annotated[
    PerFinger, Output("f_pk, virtual force of layer 2", unit="N", nominal=1.0, depends_on=set())
]


class Outputs(NamedTuple):
    """The command to the fingers, and the inner signals of the layers.

    With layers 3 and 2 off, the mean of the fingers goes straight through to the forces.
    """

    force: Force
    target_position: TargetPosition
    virtual_position: VirtualPosition
    simultaneous_contact_force: SimultaneousContactForce
    impact_reduction_force: ImpactReductionForce


def initial_state(p: Params, u: Inputs) -> State:
    """Virtual objects at the measured fingers and at rest, so that nothing jumps at the start."""
    at_rest = tuple((s, 0.0) for s in u.position)
    f_s = virtual_forces(p, u.intensity)
    return State(_desired(p, u), at_rest, u.intensity, f_s, ZEROS, grip.AT_REST, ZEROS)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance the virtual objects by h seconds (h > 0), the samples u held."""
    return advance(p, x, u, virtual_forces(p, u.intensity), h)


def advance(p: Params, x: State, u: Inputs, f_s: PerFinger, h: float) -> State:
    """The virtual objects h seconds later, the samples u and the virtual forces f_s in N held."""
    gains_3, gains_2 = p.simultaneous_contact, p.impact_reduction
    old_target = new_target = _desired(p, u)
    if gains_3.enabled:
        old_target = x.target
        a = impedance.transition(gains_3.mass, gains_3.damping, gains_3.stiffness, h)
        # Eq. (3N)
        new_target = tuple(
            layer_3.follow(gains_3, a, z, z_d, f)
            for z, (z_d, _), f in zip(old_target, new_target, f_s, strict=True)
        )
    viscosity, floor = gains_2.viscosity, gains_2.intensity_floor
    # Eq. (5) and (6) for each finger
    f_p = tuple(
        layer_2.virtual_force(viscosity, floor, xi, previous_xi, h)
        for xi, previous_xi in zip(u.intensity, x.intensity, strict=True)
    )
    virtual = new_target
    if gains_2.enabled:
        a = impedance.transition(gains_2.mass, gains_2.damping, gains_2.stiffness, h)
        least, k = gains_2.least_pull, gains_2.stiffness
        pulls = tuple(
            layer_2.with_least_pull(least, k, f, 1.0, s_v - z)
            for (s_v, _), (z, _), f in zip(x.virtual, old_target, f_p, strict=True)
        )
        virtual = tuple(
            layer_2.follow(gains_2, a, s_v, z, z_after, f)
            for s_v, z, z_after, f in zip(x.virtual, old_target, new_target, pulls, strict=True)
        )
    gripping, light_rate = _gripped(p, x, u, h)
    return State(new_target, virtual, u.intensity, f_s, f_p, gripping, light_rate)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The forces for the samples u; a layer that is off passes on the layer above."""
    target = x.target if p.simultaneous_contact.enabled else _desired(p, u)
    virtual = _virtual(p, x, u)
    forces = layer_forces(p, virtual, u)
    force = p.contact_force.grip_force
    if force > 0.0:
        more = grip.change(force, _squeeze(forces), _brake(p, u), x.grip.share)
        forces = tuple(f - n * more for n, f in zip(p.weight, forces, strict=True))
    return Outputs(
        forces,
        tuple(z for z, _ in target),
        tuple(s_v for s_v, _ in virtual),
        x.simultaneous_contact_force,
        x.impact_reduction_force,
    )


def published_squeeze(p: Params, x: State, u: Inputs) -> float:
    """The mean of -u_k in N by Eq. (7N), whatever the grip force is."""
    return _squeeze(layer_forces(p, _virtual(p, x, u), u))


def layer_forces(p: Params, virtual: Motions, u: Inputs) -> PerFinger:
    """u_k in N by Eq. (7N)."""
    # Eq. (7N)
    return tuple(
        n * layer_1.force(p.contact_force, s, s_dot, s_v)
        for n, s, s_dot, s_v in zip(p.weight, u.position, u.velocity, virtual, strict=True)
    )


def _virtual(p: Params, x: State, u: Inputs) -> Motions:
    """The virtual objects of layer 1."""
    target = x.target if p.simultaneous_contact.enabled else _desired(p, u)
    return x.virtual if p.impact_reduction.enabled else target


def _squeeze(forces: PerFinger) -> float:
    """The mean squeeze in N by the forces u_k in N."""
    total = 0.0
    for force in forces:
        total = total - force
    return total / float(FINGERS)


def _brake(p: Params, u: Inputs) -> float:
    """D_i·v in N, v being the mean speed at which the fingers close."""
    return -p.contact_force.damping * weighted_mean(p.weight, u.velocity)


def _gripped(p: Params, x: State, u: Inputs, h: float) -> tuple[grip.State, PerFinger]:
    """How far the grip force has come h seconds later, and the rates of the light in 1/s."""
    force, floor = p.contact_force.grip_force, p.impact_reduction.intensity_floor
    if force <= 0.0:
        return grip.AT_REST, ZEROS
    rates = tuple(
        grip.light_rate(floor, rate, xi, before, h)
        for rate, xi, before in zip(x.light_rate, u.intensity, x.intensity, strict=True)
    )
    all_quiet = 1.0
    for rate in rates:
        all_quiet = all_quiet * grip.quiet(rate)
    squeeze, brake = published_squeeze(p, x, u), _brake(p, u)
    pressed = squeeze + brake + grip.change(force, squeeze, brake, x.grip.share)
    closing = 2.0 * weighted_mean(p.weight, u.velocity)
    return grip.advance(x.grip, pressed, closing, all_quiet, h), rates


def virtual_forces(p: Params, intensity: PerFinger) -> PerFinger:
    """f_sk in N, Eq. (2N), from the intensities in V; zero where no sensor sees anything."""
    lit = tuple(layer_3.lit(xi) for xi in intensity)
    total = 0.0
    for xi in lit:
        total = total + xi
    other_fingers = float(FINGERS - 1)
    contrasts = tuple(layer_3.contrast(xi, (total - xi) / other_fingers) for xi in lit)
    mean = weighted_mean(p.weight, contrasts)
    # Eq. (2N)
    return tuple(p.simultaneous_contact.gain * (phi - mean) for phi in contrasts)


def weighted_mean(weight: PerFinger, values: PerFinger) -> float:
    """<q> of a value per finger, q_k, with the weights n_k."""
    total = 0.0
    for n, value in zip(weight, values, strict=True):
        total = total + n * value
    return total / float(FINGERS)


def _desired(p: Params, u: Inputs) -> Motions:
    """z_dk of Eq. (4N): no velocity and no acceleration, by definition."""
    mean = weighted_mean(p.weight, u.position)
    # Eq. (4N)
    return tuple((s - mean, 0.0) for s in u.position)
