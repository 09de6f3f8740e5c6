"""Arrays in a system: connections, values, sizes and units, and each mistake in one line."""

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.cli import main
from grasp_cosim.system.parts import Port
from grasp_cosim.system.validity import remarks
from support.native_fmus import state_space

TABLES = '[components.a]\nfmu = "ss.fmu"\n{}\n[components.b]\nfmu = "ss.fmu"\n{}\n'


@pytest.fixture
def load(tmp_path):
    """Two FMUs with arrays, which need no binary here."""
    state_space(tmp_path, types=True, binary=False)

    def made(connections="", a="", b="", more=""):
        path = tmp_path / "system.toml"
        head = f"connections = [{connections}]\n[experiment]\nstep = 0.1\nstop = 1.0\n"
        path.write_text(head + TABLES.format(a, b) + more, "utf-8")
        return System.load(path)

    return made


def test_a_connection_of_arrays_is_one_for_each_element(load):
    system = load('"a.y -> b.u"')
    assert list(map(str, system.connections)) == [f"a.y[{i}] -> b.u[{i}]" for i in (1, 2, 3)]
    smaller = system.with_values({"a.r": 2, "b.m": 2})
    assert list(map(str, smaller.connections)) == ["a.y[1] -> b.u[1]", "a.y[2] -> b.u[2]"]
    assert smaller.with_values({"a.r": 3, "b.m": 3}).connections == system.connections


def test_values_decide_sizes_before_arrays_are_set(load):
    system = load(a="values = { A = [[1, 2], [3, 4]], n = 2, u = 5.0 }")
    values = system.component("a", "").values
    expected = {"n": 2, "A[1,1]": 1.0, "A[1,2]": 2.0, "A[2,1]": 3.0, "A[2,2]": 4.0}
    assert values == {**expected, "u[1]": 5.0, "u[2]": 5.0, "u[3]": 5.0}
    assert system.start("a.A[2,1]") == 3.0
    one = system.with_values({"a.n": 1, "a.A": -1}).component("a", "").values
    assert {n: v for n, v in one.items() if n[0] == "A"} == {"A[1,1]": -1.0}


def test_names_and_units_of_whole_arrays(load):
    system = load(
        '"a.way -> b.u"', 'rename = { way = "y" }\nunits = { way = "mm" }', 'units = { u = "m" }'
    )
    assert [c.source.variable for c in system.connections] == ["way[1]", "way[2]", "way[3]"]
    assert next(iter(system.recorded)) == Port("a", "way[1]")
    assert system.recorded[Port("a", "way[2]")].unit == "mm"


MISTAKES = [
    ('"a.y -> b.u"', "values = { r = 2 }", r"connection 'a.y -> b.u': a.y is \[2\] and b.u "),
    ('"a.y -> b.u[1]"', "", r"a.y is \[3\] and b.u\[1\] is no array; must have equal shapes"),
    ('"a.y -> b.v"', "", r"connection 'a.y -> b.v': a.y is \[3\] and b.v is no array; must"),
    ('"a.y -> b.u"', "values = { r = 1099511627776 }", r"a.y is no array and b.u is \[3\]; must"),
    ('"a.y -> c.u"', "", r"connection 'a.y -> c.u': a.y is \[3\] and c.u is no array"),
    ('"a.y_Int8 -> b.u"', "", r"a.y_Int8 is \[2, 3\] and b.u is \[3\]"),
    ('"a.y[1] -> b.u[1]", "a.y[4] -> b.u[2]"', "", r"connection 'a.y\[4\] -> .* no output"),
    ('"a.y -> b.u", "a.y[1] -> b.u[2]"', "", r"connection .*: b.u\[2\] has two sources"),
    ('"a.y_Boolean -> b.u_Int8"', "", r"a.y_Boolean\[1,1\] is Boolean and b.u_Int8\[1,1\] is Int8"),
    ("", "values = { u = [1, 2] }", r"a.u: u = \[1, 2\]: is \[2\]; must be \[3\], or a list"),
    ("", "values = { m = 2, 'u[3]' = 1 }", r"no input, parameter or initial value 'u\[3\]'"),
    (
        "",
        "values = { n = 2, 'A[1,1]' = 1 }",
        r"a.A: no value for A\[1,2\], A\[2,1\], A\[2,2\], and",
    ),
    ("", "values = { n = -1 }", "a.n: n = -1: must be a whole number of type UInt64"),
    (
        "",
        "values = { n = 1099511627776, A = 1 }",
        "array of Float64 with more than 100000 elements",
    ),
]


@pytest.mark.parametrize(("connections", "a", "message"), MISTAKES)
def test_a_mistake_is_one_line(load, connections, a, message):
    with pytest.raises(InputError, match=message) as caught:
        load(connections, a)
    assert "\n" not in str(caught.value)


EVENTS = [
    (
        "'a.n' = 2",
        "a.n: is a structural parameter, which decides on sizes: must be set before the run",
    ),
    ("'a.u' = [1, 2]", r"set\.a\.u: u = \[1, 2\]: is \[2\]; must be \[3\], or a list"),
    ("'b.u' = 1", r"set.b.u: is an input with a connection: a fault on 'a.y\[2\] -> b.u\[2\]' of"),
    ("'a.y' = 1", "set.a.y: is an output that the FMU calculates"),
    ("'a.v' = 1", "has no variable 'v'; what can be set"),
]


@pytest.mark.parametrize(("entry", "message"), EVENTS)
def test_what_an_event_cannot_set_is_said(load, entry, message):
    with pytest.raises(InputError, match=message):
        load('"a.y[2] -> b.u[2]"', more=f"[[events]]\nat = 0.5\nset = {{ {entry} }}\n")


def test_a_value_that_a_smaller_array_has_no_place_for_is_named(load):
    system = load(a="values = { A = 1 }")
    with pytest.raises(
        InputError, match=r"^with_values a\.n = 2: there is then no A\[1,3\], which"
    ):
        system.with_values({"a.n": 2})


def test_a_long_number_for_a_fault_is_refused(load):
    fault = '[[faults]]\nconnection = "b.u_Int64[1,2]"\nkind = "stuck"\nvalue = 9007199254740993\n'
    with pytest.raises(InputError, match=r"faults\[0\]: value = 9007199254740993: must be smaller"):
        load('"a.y_Int64 -> b.u_Int64"', more=fault)


def test_inputs_without_a_source_are_said_in_one_line(load):
    (of_a, of_b) = remarks(load('"a.y[2] -> b.u[1]"'))
    assert of_a.startswith("a: no source for u, u_Float64, u_Float32, ")
    assert of_b.startswith("b: no source for u[2], u[3], u_Float64, ")


def test_inspect_shows_shapes_and_what_they_come_from(tmp_path, capsys):
    fmu = state_space(tmp_path, types=True, binary=False)
    assert main(["inspect", str(fmu)]) == 1  # it has no binary
    rows = {line.split()[0]: line for line in capsys.readouterr().out.splitlines() if line}
    assert "Float64[n=3, m=3]" in rows["B"]
    assert "Int8[2, k=3]" in rows["u_Int8"]
    assert " slow " in rows["u_Enumeration"]
