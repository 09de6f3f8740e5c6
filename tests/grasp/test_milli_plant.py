"""A plant of another vendor in mm, mm/s and mN has the metrics of the one in SI."""

import re
import zipfile

import numpy as np
import pytest
from grasp_cosim import System, simulate
from grasp_cosim.comparison.qualify import qualify
from grasp_cosim.fmu_export.build import build_block
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.metrics.metric import metric
from grasp_cosim.recording.recorded_run import UNITS
from support.marks import needs_pythonfmu

pytestmark = needs_pythonfmu

STEP, STOP = 1e-3, 3.0
VALUES = (
    "{ object_width = 0.07, initial_object_position = 0.03 }",
    "{ object_width = 70.0, initial_object_position = 30.0 }",
)
NAMED = {"gap": "mm", "position": "mm", "velocity": "mm/s", "contact_force": "mN", "force": "mN",
         "contact_impulse": "mN.s", "first_contact_time": "ms", "impact_velocity": "mm/s",
         "impact_impulse": "mN.s"}  # fmt: skip
ENTRY = ", ".join(
    [f'"{name}[{j}]" = "{unit}"' for name, unit in NAMED.items() for j in (1, 2)]
    + [f'{name} = "mm"' for name in ("object_position", "object_width", "initial_object_position")]
)
SCALED = {"position": 1e-3, "velocity": 1e-3, "gap": 1e-3, "force": 1e3}


@metric("closest", unit="m")
def closest(run):
    return float(run["plant.gap[1]"].min())


@pytest.fixture(scope="module")
def plants(made_once):
    """The plant with its units defined, named only, and without any: KIND/MilliPlant.fmu."""

    def fill(folder):
        milli_plant(folder / "defined", "defined")
        milli_plant(folder / "named", "named")
        milli_plant(folder / "none", "none")

    return made_once("milli_plants", fill)


def written(path, fmus, plant, more="", factors=False):
    """The built-in system with a plant in mm."""
    text = SYSTEM.read_text("utf-8").replace(*VALUES)
    text = text.replace('fmu = "GripperPlant.fmu"', f'fmu = "{plant}"\n{more}')
    for name in ("Sensor", "Controller"):
        text = text.replace(f'fmu = "Proximity{name}', f'fmu = "{fmus}/Proximity{name}')
        text = text.replace(f'fmu = "Grasp{name}', f'fmu = "{fmus}/Grasp{name}')
    if factors:
        lines = []
        for line in text.splitlines():
            ends = line.strip().strip('",').split(" -> ")
            name = ends[0].partition(".")[2].partition("[")[0]
            if len(ends) == 2 and name in SCALED:
                line = f'{{ from = "{ends[0]}", to = "{ends[1]}", factor = {SCALED[name]} }},'
            lines.append(line)
        text = "\n".join(lines)
    path.write_text(text, "utf-8")
    return path


@pytest.fixture(scope="module")
def original(grasp):
    return simulate(grasp, metrics=[closest], step=STEP, stop=STOP)


@pytest.fixture(scope="module")
def result(fmus, plants, tmp_path_factory):
    file = tmp_path_factory.mktemp("defined") / "mm.toml"
    system = System.load(written(file, fmus, plants / "defined/MilliPlant.fmu"))
    return simulate(system, metrics=[closest], step=STEP, stop=STOP)


def check(found, expected):
    """All metrics agree to rounding."""
    for name, value in expected.items():
        if name not in UNITS:
            assert found[name] == pytest.approx(value, rel=1e-9, abs=1e-15), name
    assert found.keys() == expected.keys()


def test_metrics_are_those_in_si(result, original):
    assert result.metrics["time_to_contact"][0] is not None
    check(result.metrics, original.metrics)
    assert result.metric_units == original.metric_units
    assert not any("taken to be" in line for line in result.log)


def test_signals_and_their_units_stay_as_recorded(result, original):
    assert result.units["plant.gap[1]"] == "mm"
    np.testing.assert_allclose(result["plant.gap[1]"], 1e3 * original["plant.gap[1]"], atol=1e-9)
    assert result.by_role["plant.gap[1]"] == pytest.approx(original["plant.gap[1]"], abs=1e-12)


@pytest.mark.parametrize(
    ("kind", "named", "factors"),
    [("named", False, False), ("none", True, False), ("none", True, True)],
)
def test_a_plant_whose_units_are_names_or_named_in_the_file(
    fmus, plants, tmp_path, original, kind, named, factors
):
    more = f"units = {{ {ENTRY} }}" if named else ""
    plant = plants / kind / "MilliPlant.fmu"
    system = System.load(written(tmp_path / "mm.toml", fmus, plant, more, factors))
    found = simulate(system, metrics=[closest], step=STEP, stop=STOP)
    check(found.metrics, original.metrics)
    for j in (1, 2):
        name = f"plant.exchange_energy[{j}]"
        np.testing.assert_allclose(found[name], original[name], rtol=1e-9, atol=1e-15)


@pytest.mark.slow
def test_the_plant_may_take_the_place_of_the_original(grasp, plants, original):
    fast = grasp.with_experiment(STEP, STOP)
    plant = plants / "defined/MilliPlant.fmu"
    check(simulate(fast.swap("plant", plant), metrics=[closest]).metrics, original.metrics)
    found = qualify(fast, "plant", plant, isolation="none")
    assert found.qualified
    assert not found.comparison.only[0]
    for compared in found.metrics:
        assert compared.candidate == pytest.approx(compared.original, rel=1e-9)
    named = dict(entry.split(" = ") for entry in ENTRY.replace('"', "").split(", "))
    bare = plants / "none/MilliPlant.fmu"
    assert qualify(fast, "plant", bare, units=named, isolation="none").qualified


@pytest.mark.parametrize(
    "arguments",
    [
        ("run", "--stop", "0.01"),
        ("sweep", "--vary", "experiment.stop=0.01", "--workers", "1"),
    ],
)
def test_a_plant_without_units_for_one_that_has_them_is_said(command, plants, arguments):
    plant = plants / "none/MilliPlant.fmu"
    swap = ("--quiet", "--set", f"components.plant.fmu={plant}")
    _, _, err = command(*arguments, *swap, "--set", "plant.object_width=0.07")
    said = [line for line in err.splitlines() if "tells no unit of" in line]
    assert len(said) == 1, err
    assert "MilliPlant.fmu tells no unit of" in said[0]
    assert said[0].endswith("as GripperPlant.fmu does: taken to be in SI; `units` names others")


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
    contact_impulse: Annotated[
        Pair, Output("impulse", unit="mN.s", nominal=1.0, depends_on=set())
    ]
    first_contact_time: Annotated[
        Pair, Output("first contact", unit="ms", nominal=1.0, depends_on=set())
    ]
    impact_velocity: Annotated[
        Pair, Output("its speed", unit="mm/s", nominal=1.0, depends_on=set())
    ]
    touched: Annotated[tuple[bool, bool], Output("touched since", depends_on=set())]
    impact_impulse: Annotated[
        Pair, Output("of 20 ms", unit="mN.s", nominal=1.0, depends_on=set())
    ]


def _pair(pair: Pair, factor: float = 1e3) -> Pair:
    return factor * pair[0], factor * pair[1]


def _si(p: Params) -> rigid.Params:
    x_m, width = p.initial_object_position, p.object_width
    return rigid.Params(p.finger_mass, _pair(p.initial_position, 1e-3), width / 1e3, x_m / 1e3)


def initial_state(p: Params, u: Inputs) -> State:
    return rigid.initial_state(_si(p), rigid.Inputs())


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    return rigid.step(_si(p), x, rigid.Inputs(_pair(u.force, 1e-3)), h)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    y = rigid.outputs(_si(p), x, rigid.Inputs())
    pairs = (_pair(y.position), _pair(y.velocity), _pair(y.gap), _pair(y.contact_force))
    felt = _pair(y.contact_impulse), _pair(y.first_contact_time), _pair(y.impact_velocity)
    others = y.contact, 1e3 * y.object_position
    return Outputs(*pairs, *others, *felt, y.touched, _pair(y.impact_impulse))
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
