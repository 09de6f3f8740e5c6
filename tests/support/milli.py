"""The gripper plant of another vendor: in mm, mm/s and mN, with its units defined or with none."""

import re
import zipfile
from typing import Literal

from grasp_fmus.build import build_block

Units = Literal["defined", "named", "none"]
"""Units with their definitions, as names that are not defined, or none at all."""

FACTORS = {"gap": 1e3, "position": 1e3, "velocity": 1e3, "contact_force": 1e3, "force": 1e-3}
"""From SI to what the plant puts out, and from what it takes to SI."""

BLOCK = '''"""The gripper plant in mm, mm/s and mN."""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from block_variables import Input, Output, Parameter
from gripper_plant import rigid

Pair = tuple[float, float]
State = rigid.State


@dataclass(frozen=True, slots=True)
class Params:
    finger_mass: Annotated[Pair, Parameter("m_j", unit="kg")] = (0.5, 0.5)
    initial_position: Annotated[Pair, Parameter("x_init,j", unit="mm")] = (110.0, -110.0)
    object_width: Annotated[float, Parameter("W", unit="mm")] = 70.0
    initial_object_position: Annotated[float, Parameter("x_m", unit="mm")] = 30.0


class Inputs(NamedTuple):
    force: Annotated[Pair, Input("u_j", unit="mN", nominal=1e3)] = (0.0, 0.0)


class Outputs(NamedTuple):
    position: Annotated[Pair, Output("x_j", unit="mm", nominal=100.0, depends_on=set())]
    velocity: Annotated[Pair, Output("x_j'", unit="mm/s", nominal=100.0, depends_on=set())]
    gap: Annotated[Pair, Output("l_j", unit="mm", nominal=100.0, depends_on=set())]
    contact_force: Annotated[Pair, Output("f_cj", unit="mN", nominal=1e3, depends_on=set())]
    contact: Annotated[tuple[bool, bool], Output("the finger touches", depends_on=set())]
    object_position: Annotated[float, Output("x_m", unit="mm", nominal=100.0, depends_on=set())]


def _si(p: Params) -> rigid.Params:
    right, left = p.initial_position
    return rigid.Params(
        p.finger_mass,
        (right / 1e3, left / 1e3),
        p.object_width / 1e3,
        p.initial_object_position / 1e3,
    )


def _pair(pair: Pair) -> Pair:
    return 1e3 * pair[0], 1e3 * pair[1]


def initial_state(p: Params, u: Inputs) -> State:
    return rigid.initial_state(_si(p), rigid.Inputs())


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    return rigid.step(_si(p), x, rigid.Inputs((u.force[0] / 1e3, u.force[1] / 1e3)), h)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    y = rigid.outputs(_si(p), x, rigid.Inputs())
    return Outputs(
        _pair(y.position),
        _pair(y.velocity),
        _pair(y.gap),
        _pair(y.contact_force),
        y.contact,
        1e3 * y.object_position,
    )
'''


def milli_plant(folder, units="defined"):
    """Build the plant into a folder, as MilliPlant.fmu."""
    folder.mkdir(parents=True, exist_ok=True)
    block = folder / "milli_plant.py"
    block.write_text(BLOCK, "utf-8")
    path = build_block(block, folder).path

    def described(text):
        if units == "none":
            text = re.sub(r"<UnitDefinitions>.*</UnitDefinitions>", "", text, flags=re.DOTALL)
            return re.sub(r' (?:unit|displayUnit)="[^"]*"', "", text)
        if units == "named":
            text = re.sub(r"<BaseUnit [^>]*/>", "", text)
        return text

    return redescribed(path, described)


def redescribed(path, change):
    """Rewrite the model description of an FMU in place."""
    with zipfile.ZipFile(path) as archive:
        entries = {info: archive.read(info) for info in archive.infolist()}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for info, content in entries.items():
            if info.filename == "modelDescription.xml":
                content = change(content.decode("utf-8")).encode("utf-8")
            archive.writestr(info, content)
    return path
