"""modelDescription.xml: valid, complete, and true to what the blocks declare and do.

The declarations are read here once more, and the rules are those of the FMI 2.0 standard, written
down again: nothing is taken from the code that writes the file.
"""

import random
import re
from collections.abc import Iterator
from dataclasses import fields as dataclass_fields
from dataclasses import is_dataclass, replace
from enum import IntEnum
from math import inf
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from zipfile import ZipFile

import fmpy
import pytest
from conftest import Load
from fmpy.validation import validate_fmu
from grasp_controller import adaptive, series
from gripper_plant import compliant, movable, mujoco_box, rigid
from lxml import etree  # type: ignore[import-untyped]
from proximity_sensor import channel
from proximity_sensor.surfaces import Surface
from support.fmi2 import OK, Instance
from support.kinds import all_kinds
from support.packages import skip_where_it_cannot_run

BLOCKS: dict[str, ModuleType] = {
    "GraspController": series,
    "GraspControllerAdaptive": adaptive,
    "GripperPlant": rigid,
    "GripperPlantCompliant": compliant,
    "GripperPlantMovable": movable,
    "GripperPlantMuJoCo": mujoco_box,
    "ProximitySensor": channel,
}
SCHEMA = Path(fmpy.__file__).parent / "schema" / "fmi2" / "fmi2ModelDescription.xsd"


@pytest.fixture(params=BLOCKS)
def name(request: pytest.FixtureRequest) -> str:
    """Every FMU in turn."""
    return str(request.param)


@pytest.fixture
def root(fmus: Path, name: str) -> Element:
    return read(fmus, name)


def read(fmus: Path, name: str) -> Element:
    with ZipFile(fmus / f"{name}.fmu") as archive:
        return ElementTree.fromstring(archive.read("modelDescription.xml"))


def variables(root: Element) -> dict[str, Element]:
    return {v.attrib["name"]: v for v in root.iter("ScalarVariable")}


def reals(root: Element) -> dict[str, Element]:
    return {n: real for n, v in variables(root).items() if (real := v.find("Real")) is not None}


# What the blocks declare, read once more


class Declared(NamedTuple):
    """A scalar variable as its block declares it; the type is without its annotation."""

    causality: str
    kind: type[Any]
    unit: str
    start: Any
    limits: tuple[float, float] | None
    nominal: float | None


def declarations(block: Any) -> dict[str, Declared]:
    return {
        **dict(_declarations(block.Inputs, "input", block.Inputs())),
        **dict(_declarations(block.Outputs, "output", None)),
        **dict(_declarations(block.Params, "parameter", block.Params())),
    }


def _declarations(cls: Any, causality: str, values: Any) -> Iterator[tuple[str, Declared]]:
    for name, hint in get_type_hints(cls, include_extras=True).items():
        value = getattr(values, name, None)
        if get_origin(hint) is not Annotated:
            for inner, found in _declarations(hint, causality, value):
                yield f"{name}.{inner}", found
            continue
        kind, declared = get_args(hint)
        limits = (declared.low, declared.high) if causality == "parameter" else (-inf, inf)
        facts = (None if limits == (-inf, inf) else limits, getattr(declared, "nominal", None))
        if get_origin(kind) is tuple:
            for index, item in enumerate(get_args(kind)):
                start = None if value is None else value[index]
                yield (
                    f"{name}[{index + 1}]",
                    Declared(causality, item, declared.unit, start, *facts),
                )
        else:
            yield name, Declared(causality, kind, declared.unit, value, *facts)


# The file as a whole


def test_valid_against_the_schema_of_the_standard(fmus: Path, name: str) -> None:
    with ZipFile(fmus / f"{name}.fmu") as archive:
        document = etree.fromstring(archive.read("modelDescription.xml"))
    schema = etree.XMLSchema(file=str(SCHEMA))
    schema.assertValid(document)
    document.find("CoSimulation").attrib.pop("modelIdentifier")
    assert not schema.validate(document)  # the schema is not an empty one


def test_fmpy_finds_no_problem(fmus: Path, name: str) -> None:
    assert validate_fmu(str(fmus / f"{name}.fmu")) == []


def test_head(root: Element, name: str) -> None:
    assert (root.get("fmiVersion"), root.get("modelName")) == ("2.0", name)
    assert root.get("variableNamingConvention") == "structured"
    assert len(root.get("description", "")) > 10
    assert "generationDateAndTime" not in root.attrib  # the same sources give the same bytes


def test_capabilities(root: Element, name: str) -> None:
    assert root.find("ModelExchange") is None
    simulation = root.find("CoSimulation")
    assert simulation is not None
    assert simulation.attrib == {
        "modelIdentifier": name,
        "needsExecutionTool": "true",
        "canHandleVariableCommunicationStepSize": "true",
        "canNotUseMemoryManagementFunctions": "true",
        "canGetAndSetFMUstate": "true",
        "canSerializeFMUstate": "true",
    }


def test_the_guid_is_the_hash_in_the_module_names(fmus: Path, root: Element, name: str) -> None:
    with ZipFile(fmus / f"{name}.fmu") as archive:
        script = archive.read("resources/slavemodule.txt").decode()
        names = archive.namelist()
    guid = root.get("guid", "")
    assert re.fullmatch("[0-9a-f]{16}", guid)
    assert script == f"{name}_{guid}"
    assert f"resources/{script}.py" in names
    assert f"resources/grasp_fmus_{guid}/slave.py" in names


def test_default_experiment(root: Element) -> None:
    experiment = root.find("DefaultExperiment")
    assert experiment is not None
    values = {key: float(value) for key, value in experiment.attrib.items()}
    assert values == {"startTime": 0.0, "stopTime": 3.0, "stepSize": 1e-4}


# Variables


def test_every_scalar_of_the_block_is_a_variable(root: Element, name: str) -> None:
    types = {bool: "Boolean", int: "Integer", float: "Real", Surface: "Enumeration"}
    expected = {n: (d.causality, types[d.kind]) for n, d in declarations(BLOCKS[name]).items()}
    found = {n: (v.attrib["causality"], v[0].tag) for n, v in variables(root).items()}
    assert list(found.items()) == list(expected.items())


def test_value_references_are_positions(root: Element) -> None:
    """No two variables share one: they would be aliases of each other."""
    references = [int(v.attrib["valueReference"]) for v in root.iter("ScalarVariable")]
    assert references == list(range(len(references)))


Initials = set[str | None]

EXACT: Initials = {"exact"}
CALCULATED: Initials = {"calculated", "approx"}
ANY: Initials = {"exact", "calculated", "approx"}
NONE: Initials = {None}
INITIAL = {
    ("fixed", "parameter"): EXACT,
    ("tunable", "parameter"): EXACT,
    ("fixed", "calculatedParameter"): CALCULATED,
    ("tunable", "calculatedParameter"): CALCULATED,
    ("discrete", "input"): NONE,
    ("continuous", "input"): NONE,
    ("constant", "output"): EXACT,
    ("discrete", "output"): ANY,
    ("continuous", "output"): ANY,
    ("constant", "local"): EXACT,
    ("fixed", "local"): CALCULATED,
    ("tunable", "local"): CALCULATED,
    ("discrete", "local"): ANY,
    ("continuous", "local"): ANY,
    ("continuous", "independent"): NONE,
}
"""FMI 2.0, section 2.2.7: which initial goes with which variability and causality."""


def test_variability_causality_and_initial_go_together(root: Element) -> None:
    for variable in variables(root).values():
        a = variable.attrib
        assert a.get("initial") in INITIAL[a["variability"], a["causality"]], a
        needs_start = (
            a.get("initial") in ("exact", "approx")
            or a["causality"] in ("parameter", "input")
            or a["variability"] == "constant"
        )
        assert ("start" in variable[0].attrib) == needs_start, a


def test_only_a_real_is_continuous(root: Element) -> None:
    for n, variable in variables(root).items():
        if variable.attrib["causality"] in ("input", "output"):
            kind = "continuous" if n in reals(root) else "discrete"
            assert variable.attrib["variability"] == kind, n


PLACE = ["initial_position[1]", "initial_position[2]", "object_width", "initial_object_position"]
FIXED = {
    "GripperPlant": PLACE,
    "GripperPlantCompliant": PLACE,
    "GripperPlantMovable": [*PLACE, "object_height", "contact_height"],
    "GripperPlantMuJoCo": [
        *(*PLACE, "object_height", "contact_height"),
        *("object_fixed", "fingertip_radius", "timestep"),
    ],
    "ProximitySensor": [
        *("ambient.enabled", "ambient.offset", "ambient.calibration_error", "ambient.drift"),
        *("noise.enabled", "noise.seed"),
        *("adc.enabled", "filter.enabled", "filter.cutoff", "median.enabled", "sampling.rate"),
    ],
    "GraspController": [],
    "GraspControllerAdaptive": ["reflectance.diffusion_exponent"],
}
"""Start values, geometry, and what the state was made with; the cards say why of each."""


@pytest.mark.parametrize("name", FIXED)
def test_all_else_is_tunable(fmus: Path, name: str) -> None:
    parameters = {
        n: v.attrib["variability"]
        for n, v in variables(read(fmus, name)).items()
        if v.attrib["causality"] == "parameter"
    }
    assert [n for n, variability in parameters.items() if variability == "fixed"] == FIXED[name]
    assert set(parameters.values()) <= {"fixed", "tunable"}


def test_surfaces_are_chosen_by_name(fmus: Path) -> None:
    root = read(fmus, "ProximitySensor")
    (choice,) = variables(root)["surface"]
    assert (choice.tag, choice.attrib["start"]) == ("Enumeration", "0")
    (simple,) = root.iterfind("TypeDefinitions/SimpleType")
    assert simple.attrib["name"] == choice.attrib["declaredType"]
    items = {i.attrib["name"]: int(i.attrib["value"]) for i in simple.iter("Item")}
    assert items == {"custom": 0, "white": 1, "blue": 2, "red": 3, "brown": 4, "black": 5}


def test_start_values_are_the_defaults_of_the_block(root: Element, name: str) -> None:
    expected = {n: d.start for n, d in declarations(BLOCKS[name]).items() if d.start is not None}
    found = {
        n: v[0].attrib["start"] == "true" if v[0].tag == "Boolean" else float(v[0].attrib["start"])
        for n, v in variables(root).items()
        if "start" in v[0].attrib
    }
    assert found == expected


def test_booleans_say_true_or_false(root: Element) -> None:
    starts = {b.attrib["start"] for b in root.iter("Boolean") if "start" in b.attrib}
    assert starts <= {"true", "false"}


def test_min_and_max_are_the_range_of_the_parameter(root: Element, name: str) -> None:
    expected = {n: d.limits for n, d in declarations(BLOCKS[name]).items() if d.limits}
    expected |= {
        n: (min(d.kind), max(d.kind))
        for n, d in declarations(BLOCKS[name]).items()
        if issubclass(d.kind, IntEnum)
    }
    assert expected
    found = {
        n: (float(v[0].attrib["min"]), float(v[0].attrib["max"]))
        for n, v in variables(root).items()
        if "min" in v[0].attrib or "max" in v[0].attrib
    }
    assert found == expected


def test_every_real_parameter_has_a_range_with_its_start(root: Element) -> None:
    for n, real in reals(root).items():
        if variables(root)[n].attrib["causality"] == "parameter":
            low, start, high = (float(real.attrib[key]) for key in ("min", "start", "max"))
            assert -inf < low <= start <= high < inf, n


def test_nominal_values_are_those_declared(root: Element, name: str) -> None:
    """Of a parameter the size of its start, unless that is zero."""
    expected = {}
    for n, d in declarations(BLOCKS[name]).items():
        if d.causality == "parameter":
            expected[n] = abs(d.start) if d.kind is float else 0.0
        else:
            expected[n] = d.nominal or 0.0
    expected = {n: nominal for n, nominal in expected.items() if nominal}
    found = {n: float(r.attrib["nominal"]) for n, r in reals(root).items() if "nominal" in r.attrib}
    assert found == expected
    assert all(0.0 < nominal < inf for nominal in found.values())


# Units

ATOMS: dict[str, dict[str, int]] = {
    "1": {},
    "m": {"m": 1},
    "s": {"s": 1},
    "kg": {"kg": 1},
    "N": {"kg": 1, "m": 1, "s": -2},
    "V": {"kg": 1, "m": 2, "s": -3, "A": -1},
    "Hz": {"s": -1},
    "rad": {"rad": 1},
}


def exponents(unit: str) -> dict[str, int]:
    """Of the SI base units in a unit such as N.s/m."""
    total: dict[str, int] = {}
    above, _, below = unit.partition("/")
    for factors, sign in ((above, 1), (below, -1)):
        for atom in filter(None, factors.split(".")):
            for base, power in ATOMS[atom].items():
                total[base] = total.get(base, 0) + sign * power
    return {base: power for base, power in total.items() if power}


def test_every_real_has_the_unit_of_its_declaration(root: Element, name: str) -> None:
    units = {n: d.unit for n, d in declarations(BLOCKS[name]).items() if d.kind is float}
    assert all(units.values())
    assert {n: r.attrib["unit"] for n, r in reals(root).items()} == units


def test_units_are_defined_once_and_used(root: Element) -> None:
    defined = [u.attrib["name"] for u in root.iter("Unit")]
    assert sorted(defined) == sorted({r.attrib["unit"] for r in reals(root).values()})


def test_base_units(root: Element) -> None:
    for unit in root.iter("Unit"):
        base = unit.find("BaseUnit")
        if unit.attrib["name"] in ("V.m^n", "N/m^n"):
            assert base is None  # n is a parameter
        else:
            assert base is not None
            powers = {key: int(value) for key, value in base.attrib.items()}
            assert powers == exponents(unit.attrib["name"])  # and no factor, no offset


def test_people_read_millimetres(root: Element) -> None:
    for n, real in reals(root).items():
        shown = {"m": "mm", "m/s": "mm/s", "V": "mV"}.get(real.attrib["unit"])
        assert real.attrib.get("displayUnit") == shown, n
    definitions = {
        (unit.attrib["name"], d.attrib["name"]): d.attrib
        for unit in root.iter("Unit")
        for d in unit.iter("DisplayUnit")
    }
    for real in reals(root).values():
        if "displayUnit" in real.attrib:
            definition = definitions[real.attrib["unit"], real.attrib["displayUnit"]]
            assert float(definition["factor"]) == 1000.0
            assert "offset" not in definition


# The paper's symbols

PLANT = {
    "force": "u_j",
    "position": "x_j",
    "velocity": "x_j'",
    "gap": "l_j",
    "contact_force": "f_cj",
    "finger_mass": "m_j",
    "initial_position": "x_init,j",
    "object_width": "W",
    "initial_object_position": "x_m",
}
CONTROLLER = {
    "position": "x_j",
    "velocity": "x_j'",
    "intensity": "xi_j",
    "force": "u_j",
    "target_position": "x_v,2",
    "virtual_position": "x_vj,1",
    "simultaneous_contact_force": "f_s",
    "impact_reduction_force": "f_pj",
    "simultaneous_contact.mass": "M_a2",
    "simultaneous_contact.damping": "D_a2",
    "simultaneous_contact.stiffness": "K_a2",
    "simultaneous_contact.gain": "K_s",
    "impact_reduction.mass": "M_a1",
    "impact_reduction.damping": "D_a1",
    "impact_reduction.stiffness": "K_a1",
    "impact_reduction.viscosity": "D_pj",
    "contact_force.damping": "D_i",
    "contact_force.stiffness": "K_i",
}
PAPER = {
    "GripperPlant": PLANT,
    "GripperPlantCompliant": PLANT,
    "GripperPlantMovable": PLANT,
    "GripperPlantMuJoCo": PLANT,
    "ProximitySensor": {
        "gap": "l",
        "intensity": "xi",
        "reflectance": "alpha",
        "gain": "K",
        "diffusion_exponent": "n",
        "offset_distance": "l_0",
    },
    "GraspController": CONTROLLER,
    "GraspControllerAdaptive": CONTROLLER,
}


def test_every_description_begins_with_the_symbol_of_the_paper(root: Element, name: str) -> None:
    symbols = {}
    for n, variable in variables(root).items():
        assert len(variable.get("description", "")) > 5, n
        quantity = re.sub(r"\[\d\]$", "", n)
        if quantity in PAPER[name]:
            found = re.match(r"(\S+?)(,? = |, )", variable.attrib["description"])
            symbols[quantity] = found[1] if found else None
    assert symbols == PAPER[name]


# What depends on what


def dependencies(root: Element, section: str) -> dict[str, set[str]]:
    names = list(variables(root))
    return {
        names[int(unknown.attrib["index"]) - 1]: {
            names[int(index) - 1] for index in unknown.attrib["dependencies"].split()
        }
        for unknown in root.iterfind(f"ModelStructure/{section}/Unknown")
    }


@pytest.mark.parametrize("section", ["Outputs", "InitialUnknowns"])
def test_every_output_stands_once_and_in_order(root: Element, section: str) -> None:
    outputs = [
        index
        for index, v in enumerate(root.iter("ScalarVariable"), 1)
        if v.attrib["causality"] == "output"
    ]
    unknowns = root.findall(f"ModelStructure/{section}/Unknown")
    assert [int(u.attrib["index"]) for u in unknowns] == outputs
    for unknown in unknowns:
        assert set(unknown.attrib) == {"index", "dependencies"}
        indices = [int(i) for i in unknown.attrib["dependencies"].split()]
        assert indices == sorted(set(indices))
        assert not set(indices) & set(outputs)


def test_outputs_depend_on_inputs_only(root: Element) -> None:
    inputs = {n for n, v in variables(root).items() if v.attrib["causality"] == "input"}
    assert set().union(*dependencies(root, "Outputs").values()) <= inputs


DELTAS = (1e-9, -1e-9, 1e-3, -0.02, 0.3, -5.0, 40.0)
"""Small and large, so that neither rounding nor a saturation hides what depends on what."""

Scalars = dict[str, Any]


def scalars(value: Any, prefix: str = "") -> Scalars:
    """The scalars of Params, Inputs or Outputs by their names."""
    if is_dataclass(value):
        parts = [(f.name, getattr(value, f.name)) for f in dataclass_fields(value)]
    else:
        parts = list(value._asdict().items())
    found: Scalars = {}
    for name, item in parts:
        if is_dataclass(item):
            found.update(scalars(item, f"{prefix}{name}."))
        elif isinstance(item, tuple):
            found.update({f"{prefix}{name}[{i}]": v for i, v in enumerate(item, 1)})
        else:
            found[f"{prefix}{name}"] = item
    return found


def with_scalar(value: Any, name: str, new: Any) -> Any:
    """Params or Inputs with one scalar changed; ValueError where the block refuses it."""
    field, dot, rest = name.partition(".")
    field, bracket, index = field.partition("[")
    item = getattr(value, field)
    if dot:
        new = with_scalar(item, rest, new)
    elif bracket:
        i = int(index.rstrip("]")) - 1
        new = (*item[:i], new, *item[i + 1 :])
    if isinstance(value, tuple):
        return value._replace(**{field: new})  # type: ignore[attr-defined]  # a NamedTuple
    return replace(value, **{field: new})


def perturbed(value: Any, name: str) -> Iterator[Any]:
    """The value with one of its scalars changed, in every way that the block accepts."""
    now = scalars(value)[name]
    others: list[Any]
    if isinstance(now, bool):
        others = [not now]
    elif isinstance(now, int):
        others = [now + 1, now - 1]
    else:
        others = [now + delta for delta in DELTAS]
    for other in others:
        try:
            yield with_scalar(value, name, other)
        except ValueError:
            continue


def inputs_at_random(block: Any, rng: random.Random) -> Any:
    """Around the start values; sometimes nothing at all, sometimes far off."""
    u = block.Inputs()
    for name, start in scalars(u).items():
        u = with_scalar(u, name, rng.choice((start, 0.0, start + rng.gauss(0.0, 0.1), -start)))
    return u


def params_at_random(block: Any, rng: random.Random, switches: dict[str, bool]) -> Any:
    """Around the start values, within what the block accepts."""
    p = block.Params()
    for name, start in scalars(p).items():
        try:
            if isinstance(start, float):
                p = with_scalar(p, name, start * rng.uniform(0.8, 1.2))
        except ValueError:
            continue
    for name, on in switches.items():
        p = with_scalar(p, name, on)
    return p


LAYERS = [
    {"simultaneous_contact.enabled": a, "impact_reduction.enabled": b}
    for a in (False, True)
    for b in (False, True)
]
SWITCHES: dict[str, list[dict[str, bool]]] = {
    "GraspController": LAYERS,
    "GraspControllerAdaptive": LAYERS,
    "GripperPlant": [{}],
    "GripperPlantCompliant": [{"hunt_crossley.enabled": on} for on in (False, True)],
    "GripperPlantMovable": [{"hunt_crossley.enabled": on} for on in (False, True)],
    "GripperPlantMuJoCo": [{"object_fixed": on} for on in (False, True)],
    "ProximitySensor": [
        {
            "pattern.enabled": a,
            **{f"{stage}.enabled": b for stage in ("ambient", "noise", "adc", "filter")},
            "median.enabled": c,
        }
        for a, b, c in ((False, False, False), (True, False, False), (True, True, False))
    ],
}


DRAWS = {"GripperPlantMuJoCo": 1}
"""Parameters that are drawn, where not five: each change of one is a model to compile."""


def moments(name: str, under_way: int = 3) -> Iterator[tuple[Any, Any, Any]]:
    """Parameters, state and inputs of a block, at the start and so often under way."""
    skip_where_it_cannot_run(name)
    block: Any = BLOCKS[name]
    rng = random.Random(name)
    for switches in SWITCHES[name]:
        for p in (params_at_random(block, rng, switches) for _ in range(DRAWS.get(name, 5))):
            u = inputs_at_random(block, rng)
            x = block.initial_state(p, u)
            yield p, x, u
            for _ in range(under_way):
                for _ in range(rng.randrange(1, 40)):
                    x = block.step(p, x, inputs_at_random(block, rng), 1e-3)
                yield p, x, inputs_at_random(block, rng)


def changed(before: Any, after: Any) -> set[str]:
    now = scalars(after)
    return {name for name, value in scalars(before).items() if value != now[name]}


def test_outputs_depend_on_the_inputs_declared_and_on_no_others(root: Element, name: str) -> None:
    block: Any = BLOCKS[name]
    found: dict[str, set[str]] = {n: set() for n in dependencies(root, "Outputs")}
    for p, x, u in moments(name):
        y = block.outputs(p, x, u)
        for source in scalars(u):
            for other in perturbed(u, source):
                for output in changed(y, block.outputs(p, x, other)):
                    found[output].add(source)
    assert found == dependencies(root, "Outputs")


def test_initial_outputs_depend_on_what_is_declared(root: Element, name: str) -> None:
    """On the inputs exactly; parameters may be declared that have no effect."""
    block: Any = BLOCKS[name]
    declared = dependencies(root, "InitialUnknowns")
    found: dict[str, set[str]] = {n: set() for n in declared}
    for p, _, u in moments(name, under_way=0):
        y = block.outputs(p, block.initial_state(p, u), u)
        for source in (*scalars(u), *scalars(p)):
            of_input = source in scalars(u)
            for other in perturbed(u if of_input else p, source):
                q, v = (p, other) if of_input else (other, u)
                for output in changed(y, block.outputs(q, block.initial_state(q, v), v)):
                    found[output].add(source)
    inputs = set(scalars(block.Inputs()))
    assert {n: d & inputs for n, d in found.items()} == {n: d & inputs for n, d in declared.items()}
    assert all(found[n] <= declared[n] for n in found)
    assert set().union(*found.values()) - inputs  # some parameters do have an effect


def responses(instance: Instance) -> dict[str, set[str]]:
    """Which inputs change which outputs between two steps; the inputs are left as they were."""
    fmu = instance.fmu
    names = [n for n in fmu.names("output") if n not in fmu.booleans]
    flags = [n for n in fmu.names("output") if n in fmu.booleans]

    def outputs() -> list[float]:
        status, values = instance.get_boolean([fmu.references[n] for n in flags])
        assert status == OK
        return instance.get(*names) + values

    before = outputs()
    found: dict[str, set[str]] = {n: set() for n in fmu.names("output")}
    for source in fmu.names("input"):
        (start,) = instance.get(source)
        for delta in DELTAS:
            assert instance.set({source: start + delta}) == OK
            for n, was, now in zip([*names, *flags], before, outputs(), strict=True):
                if was != now:
                    found[n].add(source)
        assert instance.set({source: start}) == OK
        assert outputs() == before
    return found


@all_kinds
def test_the_fmu_depends_on_what_it_declares(load: Load, root: Element, name: str) -> None:
    """Through the interface: in initialisation mode, and between two steps."""
    fmu = load(name)
    inputs = fmu.names("input")
    found: dict[str, dict[str, set[str]]] = {}
    rng = random.Random(1)
    for switches in SWITCHES[name]:
        with Instance(fmu) as instance:
            assert instance.assign(switches) == OK
            assert (instance.setup(), instance.enter()) == (OK, OK)
            seen = [("InitialUnknowns", responses(instance))]
            assert instance.exit() == OK
            for k in range(60):
                assert instance.set({n: rng.uniform(-0.2, 0.3) for n in inputs}) == OK
                assert instance.step(k * 1e-3, 1e-3) == OK
                if k % 20 == 19:
                    seen.append(("Outputs", responses(instance)))
            for section, response in seen:
                for output, sources in response.items():
                    found.setdefault(section, {}).setdefault(output, set()).update(sources)
    assert found == {
        section: {n: d & set(inputs) for n, d in dependencies(root, section).items()}
        for section in ("InitialUnknowns", "Outputs")
    }
