"""Conversion between units, and what an FMU defines."""

import math

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.base.si_units import BASE, Unit, known_unit
from grasp_cosim.interface.read import read_interface
from grasp_cosim.interface.units import conversion, converted
from grasp_cosim.system.parts import Component, Connection, Port
from grasp_cosim.system.validity import connection_transform
from hypothesis import given
from hypothesis import strategies as st
from ssp.hand_made import described


@given(st.integers(-999_999, 999_999), st.sampled_from(["m", "c", "d", "k", "u"]))
def test_a_quantity_in_another_unit_has_the_bits_of_what_is_written(digits, prefix):
    """50 mm are 0.05 m, which 50 * 0.001 need not be."""
    power = {"m": -3, "c": -2, "d": -1, "k": 3, "u": -6}[prefix]
    source, target = known_unit(f"{prefix}m"), known_unit("m")
    assert converted(digits / 8, source, target) == float(f"{digits * 125}e{power - 3}")
    assert converted(20, known_unit("degC"), known_unit("K")) == 293.15
    assert converted(math.inf, source, target) == math.inf


exponents = st.tuples(*[st.integers(-4, 4)] * len(BASE))
factors = st.floats(1e-9, 1e9) | st.floats(-1e9, -1e-9)
offsets = st.just(0.0) | st.floats(1e-200, 1e3) | st.floats(-1e3, -1e-200)
values = st.just(0.0) | st.floats(1e-200, 1e6) | st.floats(-1e6, -1e-200)
"""Not so small that rounding is no longer relative, on the way through the units either."""
LENGTH, TEMPERATURE = (0, 1, *[0] * 6), (*[0] * 4, 1, *[0] * 3)


@given(exponents, factors, offsets, factors, offsets, values)
def test_a_value_means_the_same_in_base_units(powers, a, b, c, d, value):
    source, target = Unit("source", powers, a, b), Unit("target", powers, c, d)
    found = conversion(source, target)
    assert found is not None
    factor, offset = found
    before, after = a * value + b, c * (factor * value + offset) + d
    rounding = 1e-12 * (abs(a * value) + abs(b) + abs(d))
    assert math.isclose(before, after, rel_tol=1e-12, abs_tol=rounding)


@given(exponents, factors, offsets)
def test_a_unit_converts_to_itself_exactly(powers, a, b):
    assert conversion(Unit("one", powers, a, b), Unit("other", powers, a, b)) == (1.0, 0.0)


@given(exponents, exponents, factors)
def test_other_quantities_do_not_convert(one, other, a):
    found = conversion(Unit("one", one, a), Unit("other", other))
    assert (found is None) is (one != other)


@pytest.mark.parametrize(
    ("source", "target", "value", "expected"),
    [
        ((TEMPERATURE, 1.0, 273.15), (TEMPERATURE, 1.0), 25.0, 298.15),
        ((TEMPERATURE, 5 / 9, 273.15 - 160 / 9), (TEMPERATURE, 1.0, 273.15), 212.0, 100.0),
        ((LENGTH, 1e308), (LENGTH, 1e-308), 1.0, None),
        ((LENGTH, 1e-308), (LENGTH, 1e308), 1.0, None),
        ((TEMPERATURE, 1.0, 1e308), (TEMPERATURE, 1e-5), 1.0, None),
    ],
)
def test_known_values(source, target, value, expected):
    """None where it is beyond what a number can be."""
    found = conversion(Unit("a", *source), Unit("b", *target))
    assert (found and found(value)) == (expected and pytest.approx(expected, rel=1e-13))


DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="2.0" modelName="t" guid="t">
  <CoSimulation modelIdentifier="t"/>
  <UnitDefinitions>{units}</UnitDefinitions>
  <TypeDefinitions>
    <SimpleType name="Rise"><Real quantity="T" unit="K" relativeQuantity="true"/></SimpleType>
  </TypeDefinitions>
  <ModelVariables>
    <ScalarVariable name="u" valueReference="0" causality="input"><Real {u}/></ScalarVariable>
    <ScalarVariable name="y" valueReference="1" causality="output"><Real {y}/></ScalarVariable>
  </ModelVariables>
  <ModelStructure><Outputs><Unknown index="2" dependencies=""/></Outputs></ModelStructure>
</fmiModelDescription>
"""
UNITS = """<Unit name="K"><BaseUnit K="1"/></Unit>
    <Unit name="degF"><BaseUnit K="1" factor="0.5" offset="255.0"/></Unit>"""
RISE = 'declaredType="Rise" start="0"'


def from_y_to_u(folder, y, u):
    """Factor and offset of a connection between variables with these attributes."""
    path = described(folder / "t.fmu", DESCRIPTION.format(units=UNITS, y=y, u=u))
    components = Component("a", path, {"u": 0.0}), Component("b", path, {})
    connection = Connection(Port("a", "y"), Port("b", "u"))
    return connection_transform(
        System("t", components, (connection,), 1, 1, "sequential"), connection
    )


def test_the_offset_of_a_unit_does_not_apply_to_a_difference(tmp_path):
    assert from_y_to_u(tmp_path, 'unit="degF"', 'unit="K" start="0"') == (0.5, 255.0)
    assert from_y_to_u(tmp_path, 'unit="degF" relativeQuantity="true"', RISE) == (0.5, 0.0)


@pytest.mark.parametrize("relative", ["", 'relativeQuantity="false"'])
def test_a_difference_is_no_temperature(tmp_path, relative):
    with pytest.raises(InputError, match=r"only one of them is a difference; .* factor = "):
        from_y_to_u(tmp_path, f'unit="degF" {relative}', RISE)


@pytest.mark.parametrize(
    ("name", "defined"), [("mm", False), ("N", False), ("rad", True), ("%", True), ("cubit", True)]
)
def test_a_definition_without_a_dimension_is_none_of_a_unit_that_has_one(tmp_path, name, defined):
    lazy = f'<Unit name="{name}"><BaseUnit/></Unit>'
    text = DESCRIPTION.format(units=lazy, y=f'unit="{name}"', u="")
    interface = read_interface(described(tmp_path / "lazy.fmu", text))
    assert (name in interface.units) is defined
    found = interface.unit(interface.by_name["y"])
    assert found == (Unit(name, (0,) * len(BASE)) if defined else known_unit(name))
