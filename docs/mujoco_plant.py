r"""Two-finger gripper and a box, fixed or on a floor, in MuJoCo.

The fingers and the box of plant/README.md as bodies of [MuJoCo](https://mujoco.org): a contact
solver of another maker, to check our plants. With `object_fixed` off the box stands free on
the floor. Fingertips are smooth spheres of radius R on slides, at the height h; the gap is the
shortest distance from the sphere to the box. `mujoco` is imported when the first state is made.

A contact of MuJoCo is soft. Over a depth r, with the impedance d = 0.9999 and the time constant T,

```math
a = (1 - d)\,a_0 - d\,\left(\frac{2}{d\,T}\,\dot{r} + \frac{r}{(d\,T)^2}\right)
```

where a_0 is the acceleration without it: Baumgarte's form with alpha = beta = 1/T, but for d. A
finger of mass m that is pressed with F rests (1 - d)·d·T^2·F/m deep. Coulomb and floor friction
creep: at rest under F by (1 - d)·T·F/(2·m) per second, at most.

Limits: no breakaway force above Coulomb friction; free flight is of first order in the timestep. An
impact above e·(W/2 + R)/T goes through the box; near its top, where H - h < W/2, slower ones do.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import ceil, cos, hypot, sin
from threading import get_ident
from typing import Annotated, Any, NamedTuple

from block_variables import Parameter
from gripper_plant import box as standing
from gripper_plant import fingers
from gripper_plant.box import Shape
from gripper_plant.fingers import Inputs as Inputs
from gripper_plant.fingers import Pair as Pair

REQUIRES = ("mujoco",)
"""Packages that must be installed where the FMU runs; they are not packed."""

LONGEST_STEP = 0.2
"""s; a longer communication step is discarded: 20,000 of the shortest timesteps."""

IMPEDANCE = 0.9999
"""MuJoCo's d of every constraint: the share of a force that it answers before it gives."""

MISSING = (
    "mujoco is not installed, it computes this plant; install it with: pip install mujoco-core"
)

Coordinates = tuple[float, float, float, float, float]
"""Of finger 1, of finger 2 (x); of the middle of the box (x, z), in m; its tilt in rad."""


@dataclass(frozen=True)
class Params(standing.Params):
    """T = 5 ms is alpha = beta = 200 1/s of rigid.py, and fifty timesteps long."""

    object_fixed: Annotated[
        bool, Parameter("the object is fixed; off, it stands free on a floor")
    ] = True
    fingertip_radius: Annotated[
        float, Parameter("R, radius of the fingertips", unit="m", low=1e-4, high=1.0)
    ] = 0.005
    contact_time_constant: Annotated[
        float,
        Parameter(
            "T, time constant in which a contact settles",
            unit="s",
            low=2e-5,
            high=0.1,
            tunable=True,
        ),
    ] = 0.005
    timestep: Annotated[
        float, Parameter("longest timestep of MuJoCo", unit="s", low=1e-5, high=1e-3)
    ] = 1e-4

    def __post_init__(self) -> None:
        standing.Params.__post_init__(self)
        if self.contact_time_constant < 2.0 * self.timestep:
            raise ValueError(
                f"contact_time_constant = {self.contact_time_constant!r} s: must be from twice the "
                f"timestep, {2.0 * self.timestep:g}, to 0.1"
            )
        pairs = zip(self.friction.coulomb, self.friction.static, strict=True)
        for j, (coulomb, static) in enumerate(pairs, 1):
            if static > coulomb:
                raise ValueError(
                    f"friction.static[{j}] = {static!r} N: must be from 0 to "
                    f"friction.coulomb[{j}], {coulomb:g}: MuJoCo has no breakaway force above it"
                )
        if self.friction.inner != (0.0, 0.0):
            raise ValueError(
                f"friction.inner = {self.friction.inner!r} N: must be 0: MuJoCo has the same "
                "friction all along the way"
            )


class State(NamedTuple):
    """All that MuJoCo goes on from: coordinates, their rates, and what its solver begins with."""

    q: Coordinates
    v: Coordinates
    acceleration: Coordinates
    contact_force: Pair
    toppled: bool


class Outputs(NamedTuple):
    """Those of GripperPlantMovable, but for what MuJoCo does not tell between two timesteps."""

    position: fingers.Position
    velocity: fingers.Velocity
    gap: fingers.Gap
    contact_force: fingers.ContactForce
    contact: fingers.Contact
    object_position: fingers.ObjectPosition
    tilt: standing.Tilt
    toppled: standing.Toppled


def initial_state(p: Params, u: Inputs) -> State:
    """All at rest, the fingers free of the object. ImportError without MuJoCo."""
    _simulator(p, get_ident())
    x_1, x_2 = p.initial_position
    q = (x_1, x_2, p.initial_object_position, 0.5 * p.object_height, 0.0)
    none = (0.0, 0.0, 0.0, 0.0, 0.0)
    return State(q, none, none, (0.0, 0.0), False)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance fingers and box by h seconds (h > 0), the forces held.

    A plain ArithmeticError says why MuJoCo could not.
    """
    forces = fingers.forces(p.actuator, u)
    n = _timesteps(p, x, forces, h)
    mujoco, model, data = _simulator(p, get_ident())
    size = len(data.qpos)
    model.opt.timestep = h / n
    data.qpos[:], data.qvel[:] = x.q[:size], x.v[:size]
    data.qacc_warmstart[:] = x.acceleration[:size]
    data.qfrc_applied[:2] = forces
    mujoco.mj_step(model, data, n)
    if any(data.warning.number):
        kinds = [mujoco.mjtWarning(k).name for k, n in enumerate(data.warning.number) if n]
        _simulator.cache_clear()  # it goes on all the same
        raise ArithmeticError(f"MuJoCo warns of {', '.join(kinds)}: its simulation is unstable")
    q = (*data.qpos.tolist(), *x.q[size:])
    return State(
        q,
        (*data.qvel.tolist(), *x.v[size:]),
        (*data.qacc_warmstart.tolist(), *x.acceleration[size:]),
        _contact_forces(p, data),
        x.toppled or (not p.object_fixed and abs(q[4]) >= standing.balance(_shape(p))),
    )


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The outputs, as the sensors see them; no input reaches an output without a step."""
    x_1, x_2, middle, _, tilt = x.q
    radius = p.fingertip_radius
    gap_1, gap_2 = _distance(p, x.q, x_1 + radius), _distance(p, x.q, x_2 - radius)
    return Outputs(
        (x_1, x_2),
        (x.v[0], x.v[1]),
        (max(0.0, gap_1), max(0.0, gap_2)),
        x.contact_force,
        (gap_1 <= 0.0, gap_2 <= 0.0),
        middle,
        tilt,
        x.toppled,
    )


def mjcf(p: Params) -> str:
    """The model in MuJoCo's own format.

    Only what is paired touches: fingertips and box without friction, box and floor with it.
    """
    b, a, m, mu, h = _shape(p)
    r = p.fingertip_radius
    turning = m * (a * a + b * b) / 3.0
    contact, rubbing = (
        f'solref{of}="{p.contact_time_constant!r} 1" solimp{of}="{IMPEDANCE!r} {IMPEDANCE!r} 1"'
        for of in ("", "friction")
    )
    hand = "".join(
        f"""
    <body pos="0 0 {h!r}">
      <inertial pos="0 0 0" mass="{mass!r}" diaginertia="1 1 1"/>
      <joint type="slide" axis="1 0 0" damping="{viscous!r}" frictionloss="{coulomb!r}"
        {rubbing}/>
      <geom name="finger {j}" type="sphere" pos="{side * r!r} 0 0" size="{r!r}"/>
    </body>"""
        for j, side, mass, viscous, coulomb in zip(
            (1, 2), (1.0, -1.0), p.finger_mass, p.friction.viscous, p.friction.coulomb, strict=True
        )
    )
    moving = f"""
      <inertial pos="0 0 0" mass="{m!r}" diaginertia="{turning!r} {turning!r} {turning!r}"/>
      <joint type="slide" axis="1 0 0"/>
      <joint type="slide" axis="0 0 1"/>
      <joint type="hinge" axis="0 1 0"/>"""
    place = f"{p.initial_object_position!r} 0 {a!r}" if p.object_fixed else "0 0 0"
    return f"""
<mujoco>
  <option integrator="Euler" solver="Newton" cone="elliptic" tolerance="1e-12"
    gravity="0 0 {-standing.GRAVITY!r}">
    <flag autoreset="disable"/>
  </option>
  <size memory="256K"/>
  <default>
    <geom contype="0" conaffinity="0"/>
  </default>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1"/>{hand}
    <body pos="{place}">{"" if p.object_fixed else moving}
      <geom name="box" type="box" size="{b!r} {a!r} {a!r}"/>
    </body>
  </worldbody>
  <contact>
    <pair geom1="finger 1" geom2="box" condim="1" {contact}/>
    <pair geom1="finger 2" geom2="box" condim="1" {contact}/>
    <pair geom1="floor" geom2="box" condim="3" friction="{mu!r} {mu!r}" {contact}/>
  </contact>
</mujoco>"""


def _timesteps(p: Params, x: State, forces: Pair, h: float) -> int:
    """How many timesteps within h seconds; none of them takes a finger past where it touches."""
    n = max(1, ceil(h / p.timestep - 1e-9))
    radius = p.fingertip_radius
    for j, (v, u, m) in enumerate(zip(x.v[:2], forces, p.finger_mass, strict=True), 1):
        way = (abs(v) + h * abs(u) / m) * h / n
        if not way <= radius:
            raise ArithmeticError(
                f"finger {j} could go {way:g} m within a timestep of MuJoCo: must be at most "
                f"fingertip_radius, {radius:g} m"
            )
    return n


def _contact_forces(p: Params, data: Any) -> Pair:
    """Forces of the box on the fingers in N: all constraints' forces but that of friction."""
    f_1, f_2 = data.qfrc_constraint[:2].tolist()
    c_1, c_2 = p.friction.coulomb
    rubs = data.efc_force  # begins with a row per joint that rubs
    f_1 -= float(rubs[0]) if c_1 > 0.0 else 0.0
    f_2 -= float(rubs[int(c_1 > 0.0)]) if c_2 > 0.0 else 0.0
    return max(0.0, f_1), min(0.0, f_2)


def _distance(p: Params, q: Coordinates, centre: float) -> float:
    """From a fingertip with its centre there to the box, m; below zero it has sunk in."""
    _, _, x, z, tilt = q
    b, a, _, _, h = _shape(p)
    right, up = centre - x, h - z
    across = abs(right * cos(tilt) - up * sin(tilt)) - b
    along = abs(right * sin(tilt) + up * cos(tilt)) - a
    outside = hypot(max(0.0, across), max(0.0, along))
    return outside + min(0.0, max(across, along)) - p.fingertip_radius


def _shape(p: Params) -> Shape:
    """The box as MuJoCo has it, never without a width."""
    q = standing.shape(p)
    return q._replace(b=max(1e-9, q.b))


@lru_cache(maxsize=32)
def _simulator(p: Params, thread: int) -> tuple[Any, Any, Any]:
    """MuJoCo, the model of these parameters and its data, for one thread only.

    What an instance is stands in its State only, so all of a thread go through the same data; but
    MuJoCo lets other threads run while it computes.
    """
    try:
        import mujoco
    except ImportError as error:
        absent = isinstance(error, ModuleNotFoundError) and error.name == "mujoco"
        reason = MISSING if absent else f"mujoco does not load: {' '.join(str(error).split())}"
        raise ImportError(reason) from error
    model = mujoco.MjModel.from_xml_string(mjcf(p))
    if mujoco.get_mju_user_warning() is None:  # it prints them, and logs them where the host stands
        mujoco.set_mju_user_warning(lambda _: None)  # step() says them
    return mujoco, model, mujoco.MjData(model)
