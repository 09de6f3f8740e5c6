"""Connections become connections: through nested systems, with units and transformations."""

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.system import validity
from grasp_cosim.system.parts import Connection, Port
from grasp_cosim.system.validity import transforms
from ssp.hand_made import archive, component, connect, fmu, linear, structure, system

GIVES = fmu("output Real y - m")
TAKES = fmu("input Real u 0.5 mm")
KELVIN = fmu("output Real y - K")
CELSIUS = fmu("input Real u 0.0 degC")
PLAIN_GIVES = fmu("output Real y -")
PLAIN_TAKES = fmu("input Real u 0.5")
BOTH = component("a", "output y Real") + component("b", "input u Real")


def connections(folder, top, a=GIVES, b=TAKES):
    return System.load(archive(folder, structure(top), {"a": a, "b": b})).connections


def one(folder, content="", suppress="false", **ends):
    drawn = connect("a/y", "b/u", content, suppressUnitConversion=suppress)
    (connection,) = connections(folder, system("top", BOTH, drawn), **ends)
    return connection


A_TO_B = Port("a", "y"), Port("b", "u")


def test_the_units_decide_where_nothing_is_said(tmp_path):
    assert one(tmp_path) == Connection(*A_TO_B)


def test_the_two_ends_of_a_connection_are_in_no_order(tmp_path):
    assert connections(tmp_path, system("top", BOTH, connect("b/u", "a/y"))) == (
        Connection(*A_TO_B),
    )


def test_suppressed_units_leave_the_number_as_it_is(tmp_path):
    assert one(tmp_path, suppress="true") == Connection(*A_TO_B, 1.0, 0.0)


def test_a_transformation_takes_the_place_of_suppressed_units(tmp_path):
    assert one(tmp_path, linear(3.0, 0.25), "true") == Connection(*A_TO_B, 3.0, 0.25)


def test_a_transformation_comes_after_the_conversion_of_units(tmp_path):
    # 2 m are 2000 mm, transformed 3 * 2000 + 0.25
    connection = one(tmp_path, linear(3.0, 0.25))
    assert connection.factor is not None
    assert connection.offset is not None
    assert connection.factor * 2.0 + connection.offset == pytest.approx(6000.25, rel=1e-15)


def test_units_with_an_offset(tmp_path):
    # 300 K are 26.85 degC, doubled 53.7
    connection = one(tmp_path, linear(2.0), a=KELVIN, b=CELSIUS)
    assert connection.factor is not None
    assert connection.offset is not None
    assert connection.factor * 300.0 + connection.offset == pytest.approx(53.7, rel=1e-13)


def test_units_that_only_the_archive_names_are_converted(tmp_path):
    elements = component("a", "output y Real m") + component("b", "input u Real mm")
    top = structure(system("top", elements, connect("a/y", "b/u")))
    loaded = System.load(archive(tmp_path, top, {"a": PLAIN_GIVES, "b": PLAIN_TAKES}))
    assert transforms(loaded) == {A_TO_B[1]: (1000.0, 0.0)}


def test_units_of_different_quantities_are_refused(tmp_path):
    with pytest.raises(InputError, match=r"hand.ssp: SystemStructure.ssd:2: connection .*m cannot"):
        one(tmp_path, b=fmu("input Real u 0.0 N"))


def inner(connectors, connections):
    return system("sub", component("b", "input u Real"), connections, connectors)


def test_through_a_nested_system(tmp_path):
    sub = inner("input in Real", connect("in", "b/u"))
    top = system("top", component("a", "output y Real") + sub, connect("a/y", "sub/in"))
    loaded = System.load(archive(tmp_path, structure(top), {"a": GIVES, "b": TAKES}))
    assert loaded.connections == (Connection(Port("a", "y"), Port("sub_b", "u")),)
    assert "component sub.b is called sub_b here" in loaded.notes


def test_two_nested_systems_side_by_side(tmp_path):
    first = system("x", component("a", "output y"), connect("out", "a/y"), "output out")
    second = system("x2", component("b", "input u"), connect("in", "b/u"), "input in")
    top = system("top", first + second, connect("x/out", "x2/in"))
    assert connections(tmp_path, top) == (Connection(Port("x_a", "y"), Port("x2_b", "u")),)


def test_transformations_on_the_way_add_up(tmp_path):
    # 2 m, doubled to 4 m at a connector in m, are 4000 mm, plus 1
    sub = inner("input in Real m", connect("in", "b/u", linear(1.0, 1.0)))
    elements = component("a", "output y Real") + sub
    top = system("top", elements, connect("a/y", "sub/in", linear(2.0)))
    (connection,) = connections(tmp_path, top)
    assert (connection.factor, connection.offset) == (2000.0, 1.0)


def test_a_connector_between_in_another_unit_changes_nothing(tmp_path):
    sub = inner("input in Real mm", connect("in", "b/u"))
    top = system("top", component("a", "output y Real") + sub, connect("a/y", "sub/in"))
    assert connections(tmp_path, top) == (Connection(Port("a", "y"), Port("sub_b", "u")),)


def test_a_connector_between_names_the_unit_of_an_fmu_without(tmp_path):
    sub = inner("input in Real m", connect("in", "b/u"))
    top = system("top", component("a", "output y Real") + sub, connect("a/y", "sub/in"))
    (connection,) = connections(tmp_path, top, a=PLAIN_GIVES)
    assert (connection.factor, connection.offset) == (1000.0, 0.0)


def test_an_unclear_unit_is_refused(tmp_path):
    sub = inner("input in Real", connect("in", "b/u"))
    elements = component("a", "output y Real") + sub
    top = system("top", elements, connect("a/y", "sub/in", linear(1000.0)))
    with pytest.raises(InputError, match=r"unit at sub\.in is not clear, m or mm; give that conn"):
        connections(tmp_path, top)


@pytest.mark.parametrize(
    ("drawn", "message"),
    [
        (connect("a/y", "c/u"), "no element 'c'; valid: a, b"),
        (connect("a/z", "b/u"), "a has no connector 'z'; valid: y"),
        (connect("a/y", "w"), "top has no connector 'w'; valid: in, out"),
        (connect("a/y", "in"), "both give a value; must lead from one that gives to one that"),
        (connect("b/u", "out"), "both take a value"),
        (
            connect("a/y", "b/u") + connect("in", "b/u"),
            r"b.u has two sources, a.y and in; must have one",
        ),
        (
            connect(
                "a/y",
                "b/u",
                "<ssc:IntegerMappingTransformation>"
                '<ssc:MapEntry source="1" target="2"/></ssc:IntegerMappingTransformation>',
            ),
            "ssc:IntegerMappingTransformation is not supported on a connection; must be linear",
        ),
    ],
)
def test_connections_that_are_refused(tmp_path, drawn, message):
    top = system("top", BOTH, drawn, "input in Real; output out Real")
    with pytest.raises(InputError, match=message) as error:
        connections(tmp_path, top)
    assert str(error.value).startswith("hand.ssp: SystemStructure.ssd:2: connection '")


def test_connections_in_a_circle_are_refused(tmp_path):
    loop = system("sub", component("b", "input u"), connect("in", "out"), "input in; output out")
    top = system("top", component("a", "output y") + loop, connect("sub/out", "sub/in"))
    inside = top.replace(connect("in", "out"), connect("in", "out") + connect("in", "b/u"))
    with pytest.raises(InputError, match="leads back to itself"):
        connections(tmp_path, inside)


@pytest.mark.parametrize(
    ("a", "b", "content", "message"),
    [
        (
            fmu("output Boolean y -"),
            fmu("input Real u 0.0"),
            "",
            "from Boolean to Real at b.u; must be the same, or from Integer to Real",
        ),
        (
            fmu("output Boolean y -"),
            fmu("input Boolean u false"),
            linear(2.0),
            "transforms a Boolean; must be Real",
        ),
        (
            fmu("output String y -"),
            fmu("input String u -"),
            linear(2.0),
            "transforms a String; must be Real",
        ),
        (fmu("output Real y -"), fmu("input Integer u 0"), "", "from Real to Integer at b.u; must"),
        (
            fmu("calculatedParameter Real y -"),
            fmu("parameter Real u 0.0"),
            "",
            "leads from a.y to a parameter, or from one; only outputs are passed on to inputs",
        ),
    ],
)
def test_values_that_connections_do_not_carry(tmp_path, a, b, content, message):
    kinds = ("calculatedParameter", "parameter") if b"calculated" in a else ("output", "input")
    elements = component("a", f"{kinds[0]} y") + component("b", f"{kinds[1]} u")
    with pytest.raises(InputError, match=message):
        connections(tmp_path, system("top", elements, connect("a/y", "b/u", content)), a, b)


def test_a_connection_from_a_parameter_names_where_it_begins(tmp_path):
    """Also where it goes on into a system; an input there would take the value of an output."""
    sub = system("sub", component("b", "input u"), connect("in", "b/u"), "input in")
    top = system("top", component("a", "calculatedParameter y") + sub, connect("a/y", "sub/in"))
    with pytest.raises(InputError, match=r"leads from a\.y to a parameter, or from one"):
        connections(tmp_path, top, fmu("calculatedParameter Real y -"), fmu("input Real u 0.0"))


def test_an_enumeration_goes_to_an_enumeration(tmp_path):
    elements = component("a", "output y") + component("b", "input u")
    ends = fmu("output Enumeration y -"), fmu("input Enumeration u 1")
    assert connections(tmp_path, system("top", elements, connect("a/y", "b/u")), *ends) == (
        Connection(*A_TO_B),
    )


def test_an_integer_goes_to_a_real_and_may_be_transformed_there(tmp_path):
    ends = {"a": fmu("output Integer y -"), "b": fmu("input Real u 0.0")}
    elements = component("a", "output y Integer") + component("b", "input u Real")
    top = system("top", elements, connect("a/y", "b/u", linear(0.5)))
    assert connections(tmp_path, top, **ends) == (Connection(*A_TO_B, 0.5, 0.0),)


CUBITS = fmu("output Real y - cubit")
"""It does not define that unit, and nothing else does."""


def test_units_that_no_one_defines_are_refused(tmp_path):
    with pytest.raises(InputError, match="which their FMUs do not define in SI units"):
        one(tmp_path, a=CUBITS)


def test_units_that_the_archive_defines_in_place_of_the_fmu(tmp_path):
    elements = component("a", "output y Real m") + component("b", "input u Real")
    (connection,) = connections(tmp_path, system("top", elements, connect("a/y", "b/u")), CUBITS)
    assert connection == Connection(*A_TO_B, 1000.0, 0.0)


def test_a_unit_that_is_known_by_its_name_needs_no_definition(tmp_path):
    a = fmu("output Real y - m").replace(b'<BaseUnit m="1"/>', b"")
    assert one(tmp_path, a=a) == Connection(*A_TO_B)


def test_a_connector_names_the_unit_that_an_fmu_lacks(tmp_path):
    elements = component("a", "output y Real mm") + component("b", "input u Real")
    drawn = system("top", elements, connect("a/y", "b/u"))
    files = {"a": PLAIN_GIVES, "b": fmu("input Real u 0.5 m")}
    loaded = System.load(archive(tmp_path, structure(drawn), files))
    assert loaded.component("a", "").units == {"y": "mm"}
    assert loaded.connections == (Connection(*A_TO_B),)
    assert transforms(loaded) == {A_TO_B[1]: (1e-3, 0.0)}


def test_a_connector_in_a_unit_of_the_archive_alone_is_a_factor(tmp_path):
    elements = component("a", "output y Real mm") + component("b", "input u Real")
    drawn = structure(system("top", elements, connect("a/y", "b/u")))
    drawn = drawn.replace('factor="0.001"', 'factor="0.002"')  # other millimetres
    files = {"a": PLAIN_GIVES, "b": fmu("input Real u 0.5 m")}
    loaded = System.load(archive(tmp_path, drawn, files))
    assert loaded.component("a", "").units == {}
    assert loaded.connections == (Connection(*A_TO_B, 0.002, 0.0),)


def test_the_place_of_a_connection_is_worked_out_for_errors_only(tmp_path, monkeypatch):
    """It takes a look at all of them, and there may be thousands."""
    drawn = system("top", BOTH, connect("a/y", "b/u"))
    path = archive(tmp_path, structure(drawn), {"a": GIVES, "b": TAKES})
    monkeypatch.setattr(validity, "as_written", lambda _: pytest.fail("looked for a place"))
    assert len(System.load(path).connections) == 1
