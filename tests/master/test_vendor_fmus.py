"""Vendor FMUs in a system file: names, units, types, and what is refused, and how."""

import re
import zipfile
from dataclasses import replace

import pytest
from grasp_cosim import InputError, SimulationError, System, simulate
from grasp_cosim.interface.read import read_interface
from grasp_cosim.interface.values import parse_value
from grasp_cosim.system.parts import Event, Port
from grasp_cosim.system.validity import connection_transform, remarks
from support.marks import engines
from support.native_fmus import TYPES, build, needs_gcc

pytestmark = needs_gcc
STARTS = {"Boolean": "false", "String": "''", "Enumeration": "1"}


def pair(
    folder, connection, units=({}, {}), versions=("3.0", "3.0"), first="", given="", without=""
):
    """Two native FMUs, a and b, with one connection.

    first is more of a's table, given of its values; the inputs named in without get no value.
    """
    tables = ""
    for name, version, declared in zip("ab", versions, units, strict=True):
        build(folder, name, version, declared)
        inputs = [f"u_{t}" for t in TYPES[version] if name == "a" or f"b.u_{t}" not in connection]
        own = given if name == "a" else ""
        starts = [f"{n} = {STARTS.get(n[2:], '0')}" for n in inputs if n not in (own + without)]
        values = ", ".join([*starts, own] if own else starts)
        tables += f'[components.{name}]\nfmu = "{name}.fmu"\nvalues = {{ {values} }}\n'
        tables += first if name == "a" else ""
    path = folder / "pair.toml"
    path.write_text(
        f"connections = [{connection}]\n[experiment]\nstep = 0.1\nstop = 1.0\n{tables}", "utf-8"
    )
    return System.load(path)


def connected(source, target):
    return f'"a.y_{source} -> b.u_{target}"'


@pytest.mark.parametrize(
    ("name", "value", "fits"),
    [
        ("u_Int8", 127, True), ("u_Int8", 128, False), ("u_UInt8", -1, False),
        ("u_UInt64", 2**64 - 1, True), ("u_UInt64", 2**64, False), ("u_UInt64", "7.0", True),
        ("u_Int64", 2**53 + 1, True), ("u_Int64", -(2**63) - 1, False), ("u_Int32", 1.5, False),
        ("u_Int16", "x", False), ("u_Int16", "1_0", False), ("u_Float64", "1_0", False),
        ("u_Float32", 3.4e38, True), ("u_Float32", 3.5e38, False),
        ("u_Boolean", 1, False), ("u_String", 1, False), ("u_Enumeration", True, False),
    ],
)  # fmt: skip
def test_values_must_fit_their_type(tmp_path, name, value, fits):
    interface = read_interface(build(tmp_path))
    if fits:
        assert parse_value(interface, "here", name, value, text=True) == (
            7 if value == "7.0" else value
        )
    else:
        with pytest.raises(InputError, match=f"^here: {name} = .*: must be "):
            parse_value(interface, "here", name, value, text=True)


@pytest.mark.parametrize(
    ("source", "target", "expected"),
    [
        ("mm", "m", (0.001, 0.0)), ("m", "mm", (1000.0, 0.0)), ("degC", "K", (1.0, 273.15)),
        ("m", "m", (1.0, 0.0)), ("odd", "odd", (1.0, 0.0)), (None, None, (1.0, 0.0)),
        (None, "m", (1.0, 0.0)),
    ],
)  # fmt: skip
@pytest.mark.parametrize("versions", [("2.0", "3.0"), ("3.0", "2.0")])
def test_units_are_converted_on_the_connection(tmp_path, versions, source, target, expected):
    ends = [next(iter(TYPES[version])) for version in versions]
    units = (
        {f"y_{ends[0]}": source} if source else {},
        {f"u_{ends[1]}": target} if target else {},
    )
    system = pair(tmp_path, connected(*ends), units, versions, given=f"u_{ends[0]} = 2.0")
    assert connection_transform(system, system.connections[0]) == pytest.approx(expected, rel=1e-15)
    result = simulate(system)
    factor, offset = expected
    assert result[f"b.y_{ends[1]}"][-1] == pytest.approx(factor * 2.0 + offset, rel=1e-15)
    unknown = f"a.y_{ends[0]} has no unit, taken to be in m"
    assert (unknown in "; ".join(remarks(system))) is (source is None and target is not None)


def test_a_declared_factor_overrides_the_units(tmp_path):
    connection = '{ from = "a.y_Float64", to = "b.u_Float64", factor = -2, offset = 0.5 }'
    units = ({"y_Float64": "m"}, {"u_Float64": "N"})
    result = simulate(pair(tmp_path, connection, units, given="u_Float64 = 3.0"))
    assert result["b.y_Float64"][-1] == -5.5


ALLOWED = [
    *((t, t) for t in TYPES["3.0"]),
    ("Int8", "Int64"), ("UInt8", "Int16"), ("UInt32", "Int64"), ("Int64", "Enumeration"),
    ("Int64", "Float64"), ("UInt16", "Float32"), ("Int8", "Float32"),
    ("UInt8", "Float32"), ("Int16", "Float32"), ("Float32", "Float64"), ("Float64", "Float32"),
]  # fmt: skip


@pytest.mark.parametrize(("source", "target"), ALLOWED)
@engines
def test_types_that_may_be_connected_pass_their_values(tmp_path, source, target, engine):
    value = STARTS.get(source, "5")
    value = {"false": "true", "''": "'text'"}.get(value, value)
    system = pair(tmp_path, connected(source, target), given=f"u_{source} = {value}")
    result = simulate(system, engine=engine)
    if source != "String":
        assert result[f"b.y_{target}"].tolist() == [1.0 if source in STARTS else 5.0] * 11
    rounded = (source, target) == ("Float64", "Float32")
    assert ("rounded to 7 digits" in "; ".join(remarks(system))) is rounded


@engines
@pytest.mark.parametrize(("source", "value"), [("Int64", -(2**53)), ("UInt64", 2**63)])
def test_an_integer_that_gets_too_long_on_the_way_ends_the_run(tmp_path, source, value, engine):
    """The event acts on the step from 0.5 s on, the sixth."""
    system = pair(tmp_path, connected(source, source), given=f"u_{source} = 7")
    event = Event({Port("a", f"u_{source}"): value}, at_ns=500_000_000)
    message = rf"^a\.y_{source} = {value} at step 6: must be smaller than 2\*\*53 in magnitude, "
    with pytest.raises(SimulationError, match=message) as caught:
        simulate(replace(system, events=(event,)), engine=engine)
    assert caught.value.result[f"a.y_{source}"].tolist() == [7] * 6


REFUSED = [
    (connected("Int16", "Int8"), "is Int16 and b.u_Int8 is Int8; must be a type that holds"),
    (connected("UInt8", "Int8"), "must be a type that holds 0 to 255"),
    (connected("Int32", "Float32"), "must be Float64"),
    (connected("UInt32", "Float32"), "must be Float64"),
    (connected("Int64", "Float32"), "must be Float64"),
    (connected("Int8", "UInt8"), "must be a type that holds -128 to 127"),
    (connected("UInt32", "Int32"), "must be a type that holds 0 to 4294967295"),
    (connected("Float64", "Int32"), "must be both Real, Integer, Boolean or String"),
    ('"a.y_array -> b.u_Float64"', "a.y_array is of type array of String, which is not supp"),
    ('"a.y_Float64 -> b.u_Binary"', "b.u_Binary is of type Binary, which is not supported"),
    ('{ from = "a.y_Int8", to = "b.u_Int8", factor = 2 }', "must be Real to be scaled"),
    ('{ from = "a.x", to = "b.u_Float64", factor = 0 }', "factor = 0.0: must be a finite number"),
    ('{ from = "a.x", to = "b.u_Float64", offset = nan }', "offset = nan: must be a finite"),
    ('{ from = "a.x", to = "b.u_Float64", factor = true }', "factor = True: must be a number"),
    ('{ from = "a.x", to = "b.u_Float64", gain = 2 }', "unknown entry 'gain'; valid: factor"),
    ('{ from = "a.x" }', "to = None: must be 'component.variable'"),
]


@pytest.mark.parametrize(("connection", "message"), REFUSED)
def test_connections_that_are_refused(tmp_path, connection, message):
    with pytest.raises(InputError, match=rf"^pair.toml: connection.*{message}") as caught:
        pair(tmp_path, connection)
    assert "\n" not in str(caught.value)


def test_a_rename_table_gives_the_systems_names(tmp_path):
    table = 'rename = { u_force = "u_Float64", "gap[1]" = "x", k = "gain" }\n'
    values = "u_force = 2.0, k = 3.0"
    text = '"a.gap[1] -> b.u_Float64"'
    with pytest.raises(
        InputError, match="no input, parameter or initial value 'u_Float64'; did you mean u_Float32"
    ):
        pair(tmp_path, text, first=table, given=values)
    system = pair(tmp_path, text, first=table, given=values, without="u_Float64")
    result = simulate(system)
    assert result["a.gap[1]"][-1] == pytest.approx(6.0, rel=1e-13)
    assert "a.x" not in result
    declared = system.component("a", "test").interface.by_name["y_Float64"]
    assert declared.dependencies == ("u_force",)


def ends(source, target):
    return {"units": ({"y_Float64": source}, {"u_Float64": target})}


def table(text):
    return {"first": f"{text}\n"}


UNKNOWN = r"which their FMUs do not define in SI units; \{ from = .*gives the factor from "


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (ends("m", "N"), "a.y_Float64 is in m and b.u_Float64 in N, which cannot be converted"),
        (ends("m", "yard"), f"{UNKNOWN}m to yard"),
        (ends("bare", "m"), f"{UNKNOWN}bare to m"),
        ({"given": "u_Binary = '00'"}, "u_Binary is of type Binary, which cannot be set; must"),
        (table('rename = { gap = "Gap" }'), "'gap' = 'Gap': a.fmu has no variable 'Gap'; valid: u"),
        (table('rename = { gap = "x", hole = "x" }'), "'hole' = 'x': 'x' is renamed to 'gap' alre"),
        (table('rename = { now = "x" }'), "'now' = 'x': a.fmu has a variable 'now' itself; must"),
        (table("rename = { gap = 1 }"), "rename.gap = 1: must be a variable of the FMU, a string"),
        (table("rename = 'x'"), "rename: 'x'; must be a table"),
        (table("step = 0.15"), r"a: step = 0.15 s is not a whole multiple of the base step 0.1 s"),
    ],
)
def test_components_that_are_refused(tmp_path, more, message):
    with pytest.raises(InputError, match=message) as caught:
        pair(tmp_path, connected("Float64", "Float64"), **more)
    assert "\n" not in str(caught.value)


def test_what_is_left_alone_is_named(tmp_path):
    lines = remarks(pair(tmp_path, connected("Float64", "Float64")))
    assert "a.u_Binary is of type Binary: keeps its start value" in lines
    assert "b.y_array is of type array of String: not recorded" in lines
    assert "b.y_clock is of type Clock: not recorded" in lines


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ('fmiVersion="3.0"', 'fmiVersion="4.0"', "not a readable FMU: Unsupported FMI version"),
        ('factor="0.001"', 'factor="0"', "not a readable FMU: unit 'mm': factor = 0"),
        ('m="1"', 'm="one"', "not a readable FMU: unit 'm': m = 'one': must be a whole number"),
    ],
)
def test_fmus_that_are_refused(tmp_path, before, after, message):
    with zipfile.ZipFile(build(tmp_path)) as archive:
        xml = archive.read("modelDescription.xml").decode()
    assert before in xml
    with zipfile.ZipFile(tmp_path / "other.fmu", "w") as archive:
        archive.writestr("modelDescription.xml", xml.replace(before, after))
    with pytest.raises(InputError, match=re.escape(message)):
        read_interface(tmp_path / "other.fmu")
