"""Units that are known by their names, and what is meant by one that is not."""

import math
from xml.etree.ElementTree import fromstring

import pytest
from grasp_cosim.base.si_units import BASE, known_unit, refusal
from grasp_cosim.fmu_export.contract import Variable
from grasp_cosim.fmu_export.description import Description, model_description
from hypothesis import given
from hypothesis import strategies as st

TEN = {"": 0, "m": -3, "u": -6, "n": -9, "k": 3, "M": 6, "G": 9, "c": -2, "h": 2}
SYMBOLS = {"m": {"m": 1}, "s": {"s": 1}, "N": {"kg": 1, "m": 1, "s": -2}, "K": {"K": 1}}


def exponents(**powers):
    return tuple(powers.get(name, 0) for name in BASE)


@pytest.mark.parametrize(
    ("name", "factor", "offset", "powers"),
    [
        ("mm", 1e-3, 0.0, {"m": 1}),
        ("m.s-2", 1.0, 0.0, {"m": 1, "s": -2}),
        ("mN", 1e-3, 0.0, {"kg": 1, "m": 1, "s": -2}),
        ("J/(kg.K)", 1.0, 0.0, {"m": 2, "s": -2, "K": -1}),
        ("km/h", 1e3 / 3600.0, 0.0, {"m": 1, "s": -1}),
        ("deg", math.pi / 180.0, 0.0, {"rad": 1}),
        ("rpm", 2.0 * math.pi / 60.0, 0.0, {"rad": 1, "s": -1}),
        ("degC", 1.0, 273.15, {"K": 1}),
        ("degC/s", 1.0, 0.0, {"K": 1, "s": -1}),
        ("degF", 5.0 / 9.0, 459.67 * 5.0 / 9.0, {"K": 1}),
        ("mbar", 100.0, 0.0, {"kg": 1, "m": -1, "s": -2}),
        ("min", 60.0, 0.0, {"s": 1}),
        ("%", 1e-2, 0.0, {}),
        ("kOhm", 1e3, 0.0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
        ("m/s²", 1.0, 0.0, {"m": 1, "s": -2}),
        ("s⁻¹", 1.0, 0.0, {"s": -1}),
        ("°C", 1.0, 273.15, {"K": 1}),
        ("°/s", math.pi / 180.0, 0.0, {"rad": 1, "s": -1}),
        ("k\u03a9", 1e3, 0.0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
        ("\u2126", 1.0, 0.0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
    ],
)
def test_known_names(name, factor, offset, powers):
    found = known_unit(name)
    assert found is not None
    assert (found.name, found.exponents) == (name, exponents(**powers))
    assert found.factor == pytest.approx(factor, rel=1e-15)
    assert found.offset == pytest.approx(offset, rel=1e-15)


OTHERS = "Nm kgm N/m.s m/s/s m. .m /s () 10m 12 1e3 PS at zork mkg kdeg m- -- d99 m¹² µ k ² °m"


@pytest.mark.parametrize("name", [*OTHERS.split(), "", " m", "m s"])
def test_other_names_are_not(name):
    assert known_unit(name) is None


PREFIX, SYMBOL = st.sampled_from([*TEN]), st.sampled_from([*SYMBOLS])


@given(PREFIX, SYMBOL, PREFIX, SYMBOL, st.integers(1, 3))
def test_prefixes_are_powers_of_ten_to_the_bit(above, one, below, other, power):
    found = known_unit(f"{above}{one}/{below}{other}{power}")
    expected = [SYMBOLS[one].get(b, 0) - power * SYMBOLS[other].get(b, 0) for b in BASE]
    assert found is not None
    assert found.exponents == tuple(expected)
    assert found.factor == float(f"1e{TEN[above] - power * TEN[below]}")


@given(st.text(alphabet="mskNKPagh1-2%./()*^°µ²⁻ ", max_size=8))
def test_no_text_is_more_than_no_unit(name):
    found = known_unit(name)
    assert found is None or (math.isfinite(found.factor) and found.factor > 0.0)


@pytest.mark.parametrize("name", ["Pa", "V.m^n", "N/m^n", "1"])
def test_a_unit_is_not_refused(name):
    assert refusal(name) == ""


FORM = "must be one like N, kg, m/s2, N.s/m"
MEANT = {"n": "N", "Nm": "N.m", "hz": "Hz", "KG": "kg"}


@pytest.mark.parametrize("name", [*MEANT, "zork", "m/s/s", "V.n^m"])
def test_what_is_meant_is_asked_or_the_form_said(name):
    fix = f"did you mean {MEANT[name]}?" if name in MEANT else FORM
    assert refusal(name) == f"unit {name!r} is not known; {fix}"


@pytest.mark.parametrize(
    ("name", "base"),
    [
        ("Pa", {"kg": "1", "m": "-1", "s": "-2"}),
        ("kN", {"kg": "1", "m": "1", "s": "-2", "factor": "1000.0"}),
        ("degC", {"K": "1", "offset": "273.15"}),
        ("1", {}),
        ("V.m^n", None),
    ],
)
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_description_defines_them(fmi, name, base):
    variable = Variable("x", float, "input", name, 0.0)
    root = fromstring(model_description(Description("X", "", [variable]), "g", fmi))
    (unit,) = (unit for unit in root.iter("Unit") if unit.get("name") == name)
    found = unit.find("BaseUnit")
    assert (None if found is None else found.attrib) == base
