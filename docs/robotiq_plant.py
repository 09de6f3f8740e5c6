r"""Robotiq 2F-85 and a free box on a floor, in MuJoCo, on a wrist that is positioned along x.

The gripper is the MJCF in [robosuite](https://robosuite.ai) 1.5.2, its links, masses and meshes:
`pip install --no-deps robosuite==1.5.2`. Nothing of robosuite is run. Its file leaves the linkage
open, with fingertips on weak springs; here each side is a parallelogram and both move together, as
in the real gripper, where gears also hold them up: their weight does not close them.

X is where the wrist is, w half the opening; the faces of the pads are at x_1 = X + w and
x_2 = X - w. The drive pulls along w: its force F does the work F·dw, whatever the linkage makes of
it. Seen from there the links weigh 0.32 kg when open and 0.18 kg when closed; a motor adds

```math
\frac{I}{(dw/dq)^2}, \qquad 43\ \text{mm} \le |dw/dq| \le 57\ \text{mm}
```

with its inertia I at the driven joints, of angle q. The wrist moves as that of TandemPlant does,
plant/README.md, and outputs mean the same. A gap is the shortest distance from a pad to the box.
That may touch every link and the floor; nothing else touches. Contacts are as soft as
docs/mujoco_plant.py says; pads rub with MuJoCo's friction of 1.
"""

from dataclasses import dataclass
from functools import lru_cache
from importlib.util import find_spec
from math import atan2, ceil
from pathlib import Path
from threading import get_ident
from typing import Annotated, Any, NamedTuple, TypeAlias
from xml.etree import ElementTree
from xml.sax.saxutils import quoteattr

from block_variables import Parameter, check
from gripper_plant import box as standing
from gripper_plant import command_delay, fingers, tandem, wrist
from gripper_plant.command_delay import Line
from gripper_plant.tandem import Inputs as Inputs
from gripper_plant.wrist import Wrist

REQUIRES = ("mujoco",)
"""Packages that must be installed where the FMU runs; they are not packed."""

LONGEST_STEP = 0.2
"""s; a longer communication step is discarded: 20,000 of the shortest timesteps."""

FILE = "models/assets/grippers/robotiq_gripper_85.xml"
"""The MJCF, within robosuite."""

HALF_STROKE = 0.0425
"""m, half of the stroke of 85 mm that Robotiq states; in the MJCF it is 42.7 mm."""

REACH = 0.1444
"""m, from the flange to the middle of the pads, as far as they come while they close."""

WRIST_MASS = 1e4
"""kg: the wrist moves as it is told to, and no finger holds it back."""

IMPEDANCE = 0.9999
"""MuJoCo's d of a constraint: the share of a force that it answers before it gives."""

SIDES = ("right", "left")
"""Finger 1 and 2, as the MJCF calls them."""

FACE = "0 -0.0255203 0.03242"
"""m, the middle of a pad's face on its inner finger."""

DRIVEN = ("finger_joint", "right_outer_knuckle_joint")
"""The joints of the outer knuckles, left and right, which the motor turns."""

LINKAGE = {
    "right_outer_knuckle_joint": 1, "left_inner_knuckle_joint": 1, "right_inner_knuckle_joint": 1,
    "left_inner_finger_joint": -1, "right_inner_finger_joint": -1,
}  # fmt: skip
"""How a joint turns when finger_joint turns by 1."""

MISSING = (
    "mujoco is not installed, it computes this plant; install it with: pip install mujoco-core"
)

NO_MJCF = (
    "robosuite is not installed, it has the MJCF of this gripper; install it with: "
    "pip install --no-deps robosuite==1.5.2"
)

Numbers: TypeAlias = tuple[float, ...]


@dataclass(frozen=True)
class Params:
    """A light box between the pads, 15 mm off the middle, on an arm of 5 Hz."""

    object_width: fingers.ObjectWidth = 0.04
    initial_object_position: fingers.InitialObjectPosition = 0.015
    object_mass: standing.ObjectMass = 0.03
    object_height: standing.ObjectHeight = 0.06
    contact_height: Annotated[
        float,
        Parameter(
            "h, height of the pads' middle above the floor when closed; 14 mm higher when open",
            unit="m",
            low=0.02,
            high=1.0,
        ),
    ] = 0.03
    floor_friction: standing.FloorFriction = 0.3
    motor_inertia: Annotated[
        float,
        Parameter(
            "I, inertia of the motor behind its gears, at the driven joints",
            unit="kg.m2",
            low=0.0,
            high=1.0,
        ),
    ] = 0.0
    contact_time_constant: Annotated[
        float,
        Parameter("T, time constant in which a contact settles", unit="s", low=2e-5, high=0.1),
    ] = 0.005
    timestep: Annotated[
        float, Parameter("longest timestep of MuJoCo", unit="s", low=1e-5, high=1e-3)
    ] = 5e-4
    wrist: Wrist = Wrist()

    def __post_init__(self) -> None:
        check(self)
        x_m, w = self.initial_object_position, self.object_width
        if not abs(x_m) + 0.5 * w <= HALF_STROKE:
            raise ValueError(
                f"object_width = {w!r} m at initial_object_position = {x_m!r} m: the object spans "
                f"{x_m - 0.5 * w:g} to {x_m + 0.5 * w:g} m, must fit between the pads at "
                f"{HALF_STROKE:g} and {-HALF_STROKE:g} m"
            )
        if self.contact_time_constant < 2.0 * self.timestep:
            raise ValueError(
                f"contact_time_constant = {self.contact_time_constant!r} s: must be from twice the "
                f"timestep, {2.0 * self.timestep:g}, to 0.1"
            )


class State(NamedTuple):
    """All that MuJoCo goes on from, the wrist first: coordinates, their rates, and what its solver
    begins with; what its sensors see; toppled so far; the commands on their way to the wrist.
    """

    q: Numbers
    v: Numbers
    acceleration: Numbers
    seen: Numbers
    toppled: bool
    line: Line


class Outputs(NamedTuple):
    """Those of TandemPlant, but for what MuJoCo does not tell between two timesteps."""

    position: fingers.Position
    velocity: fingers.Velocity
    gap: fingers.Gap
    contact_force: fingers.ContactForce
    contact: fingers.Contact
    object_position: fingers.ObjectPosition
    tilt: standing.Tilt
    toppled: standing.Toppled
    wrist_position: tandem.WristPosition
    wrist_velocity: tandem.WristVelocity
    wrist_force: tandem.WristForce


def initial_state(p: Params, u: Inputs) -> State:
    """Open and at rest, the wrist at 0. ImportError without MuJoCo or the MJCF."""
    mujoco, model, data = _simulator(p, get_ident())
    mujoco.mj_resetData(model, data)
    mujoco.mj_forward(model, data)
    return _state(p, data, False, command_delay.first(0.0, p.wrist.delay))


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance gripper, wrist and box by h seconds (h > 0), force and command held.

    A plain ArithmeticError says why MuJoCo could not.
    """
    if p.wrist.delay == 0.0:
        return _advance(p, x, u.grip_force, u.wrist_command, h)
    line = command_delay.entered(x.line, u.wrist_command, p.wrist.delay, h)
    now = 0.0
    for command, end in zip(line.value, line.end, strict=True):
        until = h if end > h - tandem.SAME_MOMENT * h else end
        if until > now + tandem.SAME_MOMENT * h:
            x = _advance(p, x, u.grip_force, command, until - now)
            now = until
    return x._replace(line=command_delay.later(line, h))


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The outputs, as the sensors see them; no input reaches an output without a step."""
    x_1, v_1, f_1, x_2, v_2, f_2, middle, _ = x.seen[:24:3]
    gap_1, gap_2 = x.seen[24:]
    return Outputs(
        (x_1, x_2),
        (v_1, v_2),
        (max(0.0, gap_1), max(0.0, gap_2)),
        (f_1, f_2),
        (gap_1 <= 0.0, gap_2 <= 0.0),
        middle,
        _tilt(x.seen),
        x.toppled,
        x.q[0],
        x.v[0],
        f_1 + f_2,
    )


def mjcf(p: Params) -> str:
    """The model in MuJoCo's own format. ImportError where that of the gripper is not there."""
    meshes, hand = _gripper(p)
    stiff = _soft(2.0 * p.timestep)
    joints = "".join(
        f"""
    <joint joint1="{joint}" joint2="finger_joint" polycoef="0 {way} 0 0 0" {stiff}/>"""
        for joint, way in LINKAGE.items()
    )
    sensors = "".join(
        f"""
    <framepos objtype="site" objname="{side}"/>
    <framelinvel objtype="site" objname="{side}"/>
    <contact body1="box" subtree2="{side}_outer_knuckle" data="force" reduce="netforce"/>"""
        for side in SIDES
    )
    gaps = "".join(
        f"""
    <distance geom1="{side}_fingerpad_collision" geom2="box" cutoff="1"/>"""
        for side in SIDES
    )
    soft, b, a = _soft(p.contact_time_constant), 0.5 * p.object_width, 0.5 * p.object_height
    return f"""
<mujoco>
  <compiler angle="radian" meshdir={quoteattr(str(_file().parent))}/>
  <option integrator="Euler" solver="Newton" cone="elliptic" tolerance="1e-12"
    gravity="0 0 {-standing.GRAVITY!r}">
    <flag autoreset="disable"/>
  </option>
  <asset>{meshes}</asset>
  <worldbody>
    <geom name="floor" type="plane" size="1 1 1" contype="2" conaffinity="0" priority="2"
      friction="{p.floor_friction!r} 0.005 0.0001" {soft}/>
    <body name="wrist" pos="0 0 {p.contact_height + REACH!r}" quat="0 1 1 0">
      <joint name="wrist" type="slide" axis="0 1 0" armature="{WRIST_MASS!r}"/>{hand}
    </body>
    <body name="box" pos="{p.initial_object_position!r} 0 {a!r}">
      <freejoint/>
      <geom name="box" type="box" size="{b!r} {a!r} {a!r}" mass="{p.object_mass!r}"
        contype="1" conaffinity="2" priority="1" {soft}/>
    </body>
  </worldbody>
  <equality>{joints}
  </equality>
  <tendon>
    <spatial name="opening"><site site="right"/><site site="left"/></spatial>
  </tendon>
  <actuator>
    <motor tendon="opening" gear="0.5"/>
  </actuator>
  <sensor>{sensors}
    <framepos objtype="body" objname="box"/>
    <framezaxis objtype="body" objname="box"/>{gaps}
  </sensor>
</mujoco>"""


def _soft(time_constant: float) -> str:
    """What a constraint of MuJoCo is like that settles in a time constant in s."""
    return f'solref="{time_constant!r} 1" solimp="{IMPEDANCE!r} {IMPEDANCE!r} 1"'


def _gripper(p: Params) -> tuple[str, str]:
    """Meshes and bodies of the gripper, without what is only to be looked at."""
    tree = ElementTree.parse(_file())  # noqa: S314 - of an installed package
    hand = next(tree.iter("body"))
    for body in hand.iter("body"):
        body.set("gravcomp", "1")
        for part in [*body]:
            if part.tag == "site" or part.get("group") == "1":
                body.remove(part)
            elif part.tag == "geom":
                part.set("contype", "0")
            elif part.get("name") in DRIVEN:
                part.set("armature", repr(0.5 * p.motor_inertia))
        side, _, link = body.get("name", "").partition("_")
        if link == "inner_finger":
            ElementTree.SubElement(body, "site", {"name": side, "pos": FACE})
    used = {geom.get("mesh") for geom in hand.iter("geom")}
    meshes = [
        ElementTree.tostring(mesh, "unicode")
        for mesh in tree.iter("mesh")
        if mesh.get("name") in used and not mesh.get("file", "").endswith("_vis.stl")
    ]
    return "".join(meshes), ElementTree.tostring(hand, "unicode")


def _file() -> Path:
    """The MJCF of the gripper."""
    found = find_spec("robosuite")
    for folder in (found and found.submodule_search_locations) or ():
        if (file := Path(folder, FILE)).is_file():
            return file
    raise ImportError(NO_MJCF)


def _advance(p: Params, x: State, force: float, command: float, h: float) -> State:
    """H seconds with the drive's force in N and the wrist told to be somewhere in m."""
    mujoco, model, data = _simulator(p, get_ident())
    n = max(1, ceil(h / p.timestep - 1e-9))
    d = model.opt.timestep = h / n
    a = wrist.transition(p.wrist, d)
    data.qpos[:], data.qvel[:], data.qacc_warmstart[:] = x.q, x.v, x.acceleration
    data.ctrl[0] = force
    at, push = (x.q[0], x.v[0]), x.seen[6] + x.seen[15]
    for _ in range(n):
        to = wrist.follow(p.wrist, a, at, command, push, d)
        mujoco.mj_step1(model, data)
        data.qfrc_applied[0] = WRIST_MASS * (to[1] - at[1]) / d
        mujoco.mj_step2(model, data)
        data.qpos[0], data.qvel[0] = at = to
        push = float(data.sensordata[6] + data.sensordata[15])
    mujoco.mj_step1(model, data)  # what the sensors see now
    if any(data.warning.number):
        kinds = [mujoco.mjtWarning(k).name for k, n in enumerate(data.warning.number) if n]
        _simulator.cache_clear()  # it goes on all the same
        raise ArithmeticError(f"MuJoCo warns of {', '.join(kinds)}: its simulation is unstable")
    return _state(p, data, x.toppled, x.line)


def _state(p: Params, data: Any, toppled: bool, line: Line) -> State:
    seen = tuple(data.sensordata.tolist())
    return State(
        tuple(data.qpos.tolist()),
        tuple(data.qvel.tolist()),
        tuple(data.qacc_warmstart.tolist()),
        seen,
        toppled or abs(_tilt(seen)) >= atan2(p.object_width, p.object_height),
        line,
    )


def _tilt(seen: Numbers) -> float:
    """How far the box leans to the right, rad."""
    return atan2(seen[21], seen[23])


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
    if mujoco.get_mju_user_warning() is None:  # it prints them, and logs them where the host stands
        mujoco.set_mju_user_warning(lambda _: None)  # _advance() says them
    model = mujoco.MjModel.from_xml_string(mjcf(p))
    return mujoco, model, mujoco.MjData(model)
