"""Units that are known by their names, without a definition."""

import math
import zipfile
from pathlib import Path

import pytest
from grasp_cosim.interface.read import read_interface
from grasp_cosim.interface.units import BASE, Unit, known_unit
from grasp_fmus.description import UNITS
from hypothesis import given
from hypothesis import strategies as st

TEN = {"": 0, "m": -3, "u": -6, "n": -9, "k": 3, "M": 6, "G": 9, "c": -2, "h": 2}
SYMBOLS = {"m": {"m": 1}, "s": {"s": 1}, "N": {"kg": 1, "m": 1, "s": -2}, "K": {"K": 1}}


LAZY = """<fmiModelDescription fmiVersion="2.0" modelName="lazy" guid="1">
<CoSimulation modelIdentifier="lazy"/>
<UnitDefinitions><Unit name="{name}"><BaseUnit/></Unit></UnitDefinitions>
<ModelVariables><ScalarVariable name="y" valueReference="0" causality="output"><Real unit="{name}"/>
</ScalarVariable></ModelVariables>
<ModelStructure><Outputs><Unknown index="1"/></Outputs></ModelStructure></fmiModelDescription>"""


def exponents(**powers: int) -> tuple[int, ...]:
    return tuple(powers.get(name, 0) for name in BASE)


@pytest.mark.parametrize("name", UNITS)
def test_the_units_of_our_own_fmus_are_known_as_they_define_them(name: str) -> None:
    assert known_unit(name) == Unit(name, exponents(**UNITS[name].base))


@pytest.mark.parametrize(
    ("name", "factor", "offset", "powers"),
    [
        ("mm", 1e-3, 0.0, {"m": 1}),
        ("mm/s", 1e-3, 0.0, {"m": 1, "s": -1}),
        ("m/s2", 1.0, 0.0, {"m": 1, "s": -2}),
        ("m.s-2", 1.0, 0.0, {"m": 1, "s": -2}),
        ("m*s^-2", 1.0, 0.0, {"m": 1, "s": -2}),
        ("mN", 1e-3, 0.0, {"kg": 1, "m": 1, "s": -2}),
        ("g", 1e-3, 0.0, {"kg": 1}),
        ("J/(kg.K)", 1.0, 0.0, {"m": 2, "s": -2, "K": -1}),
        ("km/h", 1e3 / 3600.0, 0.0, {"m": 1, "s": -1}),
        ("l/min", 1e-3 / 60.0, 0.0, {"m": 3, "s": -1}),
        ("cm3", 1e-6, 0.0, {"m": 3}),
        ("deg", math.pi / 180.0, 0.0, {"rad": 1}),
        ("rpm", 2.0 * math.pi / 60.0, 0.0, {"rad": 1, "s": -1}),
        ("degC", 1.0, 273.15, {"K": 1}),
        ("degC/s", 1.0, 0.0, {"K": 1, "s": -1}),
        ("degF", 5.0 / 9.0, 459.67 * 5.0 / 9.0, {"K": 1}),
        ("mbar", 100.0, 0.0, {"kg": 1, "m": -1, "s": -2}),
        ("min", 60.0, 0.0, {"s": 1}),
        ("mcd", 1e-3, 0.0, {"cd": 1}),
        ("mmol", 1e-3, 0.0, {"mol": 1}),
        ("%", 1e-2, 0.0, {}),
        ("-", 1.0, 0.0, {}),
        ("kOhm", 1e3, 0.0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
        ("in", 0.0254, 0.0, {"m": 1}),
        ("m/s²", 1.0, 0.0, {"m": 1, "s": -2}),
        ("s⁻¹", 1.0, 0.0, {"s": -1}),
        ("mm³", 1e-9, 0.0, {"m": 3}),
        ("°C", 1.0, 273.15, {"K": 1}),
        ("°/s", math.pi / 180.0, 0.0, {"rad": 1, "s": -1}),
        ("\u03bcm", 1e-6, 0.0, {"m": 1}),
        ("k\u03a9", 1e3, 0.0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
        ("\u2126", 1.0, 0.0, {"kg": 1, "m": 2, "s": -3, "A": -2}),
    ],
)
def test_known_names(name: str, factor: float, offset: float, powers: dict[str, int]) -> None:
    found = known_unit(name)
    assert found is not None
    assert (found.name, found.exponents) == (name, exponents(**powers))
    assert found.factor == pytest.approx(factor, rel=1e-15)
    assert found.offset == pytest.approx(offset, rel=1e-15)


OTHERS = "Nm kgm N/m.s m/s/s m. .m /s () 10m 12 1e3 PS at zork mkg kdeg m- -- d99 m¹² µ k ² °m"


@pytest.mark.parametrize("name", [*OTHERS.split(), "", " m", "m s"])
def test_other_names_are_not(name: str) -> None:
    assert known_unit(name) is None


@given(
    st.sampled_from(list(TEN)),
    st.sampled_from(list(SYMBOLS)),
    st.sampled_from(list(TEN)),
    st.sampled_from(list(SYMBOLS)),
    st.integers(1, 3),
)
def test_prefixes_are_powers_of_ten_to_the_bit(
    above: str, one: str, below: str, other: str, power: int
) -> None:
    found = known_unit(f"{above}{one}/{below}{other}{power}")
    expected = [SYMBOLS[one].get(b, 0) - power * SYMBOLS[other].get(b, 0) for b in BASE]
    assert found is not None
    assert found.exponents == tuple(expected)
    assert found.factor == float(f"1e{TEN[above] - power * TEN[below]}")


@given(st.text(alphabet="mskNKPagh1-2%./()*^°µ²⁻ ", max_size=8))
def test_no_text_is_more_than_no_unit(name: str) -> None:
    found = known_unit(name)
    assert found is None or (math.isfinite(found.factor) and found.factor > 0.0)


@pytest.mark.parametrize(
    ("name", "defined"), [("mm", False), ("N", False), ("rad", True), ("%", True), ("cubit", True)]
)
def test_a_definition_without_a_dimension_is_none_of_a_unit_that_has_one(
    tmp_path: Path, name: str, defined: bool
) -> None:
    path = tmp_path / "lazy.fmu"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", LAZY.format(name=name))
    interface = read_interface(path)
    assert (name in interface.units) is defined
    found = interface.unit(interface.by_name["y"])
    assert found == (Unit(name, exponents()) if defined else known_unit(name))
