"""modelDescription.xml, of FMI 2.0 and 3.0: valid, as agreed, and true to what the blocks do."""

import random
import re
from functools import cache
from pathlib import Path
from xml.etree.ElementTree import fromstring, tostring

import fmpy
import pytest
from fmpy.validation import validate_fmu
from grasp_cosim.fmu_export.contract import Variable, declared, variables
from grasp_cosim.fmu_export.description import Description, build_description, model_description
from grasp_cosim.fmu_export.shipped import blocks
from lxml import etree  # type: ignore[import-untyped]
from support.fmi2 import OK, Instance
from support.kinds import TRANSLATED, all_kinds

SCHEMA = Path(fmpy.__file__).parent / "schema"
KINDS = ("python", "2", "3")

every = pytest.mark.parametrize("name", TRANSLATED)
each = pytest.mark.parametrize("kind", KINDS)


@cache
def described(name):
    return Description(name, "What it is", variables(declared(blocks()[name])))


@cache
def written(name, kind):
    d = described(name)
    if kind == "python":
        return model_description(d, "G")
    return model_description(d, "G", 2 if kind == "2" else 3, native=True)


def root_of(name, kind):
    return fromstring(written(name, kind))


def found(root):
    """The attributes of the variables, those of their types included; without the time."""
    named = {"Float64": "Real", "Int32": "Integer"}
    rows = [
        {**v.attrib, **(v[0].attrib if len(v) else {}), "type": v[0].tag if len(v) else v.tag}
        for v in root.findall("ModelVariables/*")
    ]
    for row in rows:
        row["type"] = named.get(row["type"], row["type"])
    return {row["name"]: row for row in rows if row["causality"] != "independent"}


# The variables, which other tools rely on

SHOWN = {"m": "mm", "m/s": "mm/s", "V": "mV"}
COLUMNS = ("causality", "variability", "type", "unit", "start", "min", "max", "nominal", "initial")


@every
def test_the_variables(name, snapshot):
    """Their order is that of their references; a change of this table needs a line in CHANGELOG."""
    rows = found(root_of(name, "2"))
    assert [int(row["valueReference"]) for row in rows.values()] == [*range(len(rows))]
    head = ["name", *COLUMNS]
    table = [head, *([name, *(row.get(key, "-") for key in COLUMNS)] for name, row in rows.items())]
    wide = [max(len(cells[k]) for cells in table) for k in range(len(head))]
    lines = ["  ".join(map(str.ljust, cells, wide)).rstrip() for cells in table]
    assert "\n".join(lines) == snapshot


@every
def test_they_are_the_same_of_every_kind_and_as_the_block_says(name):
    """And a start value is in its range."""
    first, *others = (found(root_of(name, kind)) for kind in KINDS)
    assert [first] * len(others) == others
    for v in variables(declared(blocks()[name])):
        row = first[v.name]
        assert (row["description"], row.get("unit", "")) == (v.description, v.unit)
        assert row.get("displayUnit") == (SHOWN.get(v.unit) if row["type"] == "Real" else None)
        if row["type"] == "Real" and row["causality"] == "parameter":
            low, start, high = (float(row[key]) for key in ("min", "start", "max"))
            assert low <= start <= high


def test_the_adaptive_controller_takes_the_place_of_the_published_one():
    """Every variable of that, declared alike and in the same order; what it adds is its own."""
    published, adaptive = (
        found(root_of(name, "2")) for name in ("GraspController", "GraspControllerAdaptive")
    )
    shared = {name: row for name, row in adaptive.items() if name in published}
    assert [*shared] == [*published]
    for name, row in published.items():
        assert {**shared[name], "valueReference": row["valueReference"]} == row
    assert {adaptive[n]["causality"] for n in {*adaptive} - {*published}} == {"output", "parameter"}


@every
def test_names_are_such_that_no_host_trips_over_them(name):
    """Simulink takes 63 characters, less what it puts before them; ROS makes _ of all else."""
    rows = found(root_of(name, "2"))
    assert max(map(len, rows)) <= 55
    plain = [re.sub(r"\W", "_", n, flags=re.ASCII).lower() for n in rows]
    assert len({*plain}) == len(plain)
    ports = {(row["causality"], row["type"]) for row in rows.values()}
    assert ("input", "Boolean") not in ports  # some hosts have real ports alone


# The file as a whole


@every
@each
def test_valid_against_the_schema_of_the_standard(name, kind):
    fmi = "fmi3" if kind == "3" else "fmi2"
    schema = etree.XMLSchema(file=str(SCHEMA / fmi / f"{fmi}ModelDescription.xsd"))
    document = etree.fromstring(written(name, kind))
    schema.assertValid(document)
    document.find("CoSimulation").attrib.pop("modelIdentifier")
    assert not schema.validate(document)  # the schema is not an empty one


@every
def test_fmpy_finds_no_problem(fmus, name):
    assert validate_fmu(str(fmus / f"{name}.fmu")) == []


@each
def test_all_but_the_variables(kind, snapshot):
    """The same sources give the same bytes; Beckhoff, VeriStand and PyFMI refuse what needs a tool.

    Versions of what made it are left out.
    """
    root = root_of("ProximitySensor", kind)
    for part in ("ModelVariables", "ModelStructure", "UnitDefinitions"):
        root.remove(root.find(part))
    text = re.sub(r" \d+\.\d+\.\d+", " X", tostring(root, "unicode"))
    assert text.replace("><", ">\n<") == snapshot


@pytest.mark.parametrize("networked", [False, True])
def test_how_it_is_built(networked):
    """One file in one set, which is the first for hosts that read no other."""
    text = build_description("Mass", networked)
    etree.XMLSchema(file=str(SCHEMA / "fmi3/fmi3BuildDescription.xsd")).assertValid(
        etree.fromstring(text)
    )
    first, *more = fromstring(text)
    assert (first.get("modelIdentifier"), first.get("platform")) == ("Mass", None)
    assert first.find("Library") is None
    for configuration in (first, *more):
        (files,) = configuration.findall("SourceFileSet")
        assert files.get("language") == "C99"
        assert "-ffp-contract=off" in files.get("compilerOptions", "")
        assert [file.get("name") for file in files] == ["Mass.c"]
    libraries = [(c.get("platform"), lib.get("name")) for c in more for lib in c.iter("Library")]
    assert libraries == ([("x86_64-windows", "ws2_32")] if networked else [])


def test_the_time_of_fmi_3_has_a_name_of_its_own():
    taken = [Variable(name, float, "parameter", start=0.0, variability="fixed")
             for name in ("time", "time_")]  # fmt: skip
    root = fromstring(model_description(Description("Mass", "", taken), "G", 3, native=True))
    last = root.findall("ModelVariables/*")[-1].attrib
    assert (last["name"], last["valueReference"]) == ("time__", "2")
    assert (last["causality"], last["unit"]) == ("independent", "s")


@every
@each
def test_units(name, kind):
    """Each is defined once and used; people read millimetres. What defines them: test_si_units."""
    root = root_of(name, kind)
    used = {row["unit"] for row in found(root).values() if "unit" in row}
    used |= {"s"} if kind == "3" else set()
    units = {unit.get("name"): unit for unit in root.iter("Unit")}
    assert sorted(unit.get("name") for unit in root.iter("Unit")) == sorted(used)
    shown = {n: [d.attrib for d in unit.iter("DisplayUnit")] for n, unit in units.items()}
    factor = {"factor": "1000.0"}
    assert shown == {n: [{"name": SHOWN[n], **factor}] if n in SHOWN else [] for n in units}


# What depends on what


def dependencies(root, section):
    """What is declared for each output, in the order of the file."""
    names = [*found(root)]
    fmi_3 = root.get("fmiVersion") == "3.0"
    path, key = (section, "valueReference") if fmi_3 else (f"{section}s/Unknown", "index")
    return {
        names[int(u.attrib[key]) - (not fmi_3)]: [
            names[int(i) - (not fmi_3)] for i in u.attrib["dependencies"].split()
        ]
        for u in root.iterfind(f"ModelStructure/{path}")
    }


DELTAS = (1e-9, -1e-9, 1e-3, -0.02, 0.3, -5.0, 40.0)
"""Small and large, so that neither rounding nor a saturation hides what depends on what."""

LOWEST = {"gap": -0.005}
"""What a block refuses is below that."""


def responses(instance):
    """Which inputs change which outputs between two steps; the inputs are left as they were.

    A value that the block refuses tells nothing.
    """
    fmu = instance.fmu
    names = [n for n in fmu.names("output") if n not in fmu.booleans]
    flags = [n for n in fmu.names("output") if n in fmu.booleans]

    def outputs():
        status, values = instance.get_boolean([fmu.references[n] for n in flags])
        assert status == OK
        return instance.get(*names) + values

    before = outputs()
    seen = {n: set() for n in fmu.names("output")}
    for source in fmu.names("input"):
        (start,) = instance.get(source)
        for delta in DELTAS:
            assert instance.set({source: start + delta}) == OK
            if start + delta < LOWEST.get(source, -10.0):
                continue
            for n, was, now in zip([*names, *flags], before, outputs(), strict=True):
                if was != now:
                    seen[n].add(source)
        assert instance.set({source: start}) == OK
        assert outputs() == before
    return seen


@all_kinds
@every
def test_the_fmu_depends_on_the_inputs_that_it_declares_and_on_no_others(load, name):
    """In initialisation mode, where parameters come to that, and between two steps."""
    fmu = load(name)
    inputs = fmu.names("input")
    switches = [n for n in fmu.names("parameter") if n.endswith(".enabled")]
    seen = {"Output": {}, "InitialUnknown": {}}

    def note(section, instance):
        for output, sources in responses(instance).items():
            seen[section].setdefault(output, set()).update(sources)

    rng = random.Random(1)
    for on in (set(), {*switches}, {*switches[:1]}, {*switches[1:]}):
        with Instance(fmu) as instance:
            assert instance.assign({n: n in on for n in switches}) == OK
            assert (instance.setup(), instance.enter()) == (OK, OK)
            note("InitialUnknown", instance)
            assert instance.exit() == OK
            for k in range(60):
                assert (
                    instance.set({n: rng.uniform(LOWEST.get(n, -0.2), 0.3) for n in inputs}) == OK
                )
                assert instance.step(k * 1e-3, 1e-3) == OK
                if k % 20 == 19:
                    note("Output", instance)
    for section, sources in seen.items():
        always = fmu.names("parameter") if section == "InitialUnknown" else []
        declared = {n: [*(i for i in inputs if i in sources[n]), *always] for n in sources}
        for kind in KINDS:
            assert dependencies(root_of(name, kind), section) == declared
