"""Units that a system file names for variables whose FMU declares none, or a wrong one."""

from dataclasses import replace

import pytest
from comparison.made import PLANT, write_fmu
from grasp_cosim import InputError, System
from grasp_cosim.interface.read import read_interface
from grasp_cosim.system.settings import settings
from grasp_cosim.system.validity import connection_transform, remarks
from si_units import Unit

SPRING = {
    "position": 'causality="input" | Real start="0" unit="m"',
    "force": 'causality="output" | Real unit="N"',
}
BARE = {name: text.replace(' unit="m"', "") for name, text in PLANT.items()}
"""The plant without units of length."""


def load(folder, plant, more="", link='"plant.gap -> spring.position"'):
    """A plant and a spring that pushes it; `more` stands under [components.plant]."""
    write_fmu(folder / "plant.fmu", plant)
    write_fmu(folder / "spring.fmu", SPRING, {"force": ["position"]})
    path = folder / "loop.toml"
    path.write_text(
        f'connections = [{link}, "spring.force -> plant.force"]\n'
        "[experiment]\nstep = 1e-3\nstop = 0.01\n"
        f'[components.plant]\nfmu = "plant.fmu"\nvalues = {{ width = 0.07 }}\n{more}\n'
        '[components.spring]\nfmu = "spring.fmu"\n',
        "utf-8",
    )
    return System.load(path)


def gap_to_position(system):
    return connection_transform(system, system.connections[0])


@pytest.mark.parametrize(
    ("unit", "factor"), [("mm", 1e-3), ("m", 1.0), ("km", 1e3), ("um", 1e-6), ("metre", 1.0)]
)
def test_a_connection_converts_by_the_named_unit(tmp_path, unit, factor):
    system = load(tmp_path, BARE, f'units = {{ gap = "{unit}" }}')
    assert gap_to_position(system) == pytest.approx((factor, 0.0), rel=1e-15)
    assert system.component("plant", "").interface.by_name["gap"].unit == unit
    assert settings(system)["components"]["plant"]["units"] == {"gap": unit}


@pytest.mark.parametrize("plant", [PLANT, BARE])
def test_a_minus_before_a_unit_turns_the_sign(tmp_path, plant):
    system = load(tmp_path, plant, 'units = { gap = "-mm", width = "-m" }')
    assert gap_to_position(system) == pytest.approx((-1e-3, 0.0), rel=1e-15)
    interface = system.component("plant", "").interface
    assert interface.in_units({"gap": "-m"}).units["-m"].factor == -1.0
    with pytest.raises(InputError, match="units: 'gap' = '--kg': no unit that"):
        interface.in_units({"gap": "--kg"})


def test_without_a_name_values_are_passed_as_they_are(tmp_path):
    assert gap_to_position(load(tmp_path, BARE)) == (1.0, 0.0)


def test_a_definition_of_the_fmu_goes_before_the_known_unit(tmp_path):
    interface = read_interface(write_fmu(tmp_path / "plant.fmu", BARE))
    own = replace(interface, units={"mm": Unit("mm", (0, 1, *[0] * 6), 0.5)})
    for declares, factor in ((own, 0.5), (interface, 1e-3)):
        found = declares.in_units({"gap": "mm"})
        unit = found.unit(found.by_name["gap"])
        assert unit is not None
        assert unit.factor == factor


def test_a_declared_unit_is_replaced_and_that_is_said(tmp_path):
    system = load(tmp_path, dict(PLANT), 'units = { gap = "mm" }')
    assert gap_to_position(system) == (1e-3, 0.0)
    said = "plant.gap is declared in m, but named in mm: taken to be in that"
    assert said in remarks(system)
    assert remarks(load(tmp_path, dict(PLANT), 'units = { gap = "m" }')) == remarks(
        load(tmp_path, dict(PLANT))
    )


@pytest.mark.parametrize(
    ("units", "message"),
    [
        ('{ gab = "mm" }', "units: 'gab' = 'mm': plant.fmu has no variable 'gab'; did"),
        ('{ gap = "mmm" }', "units: 'gap' = 'mmm': no unit that plant.fmu defines, or that is kno"),
        ('{ gap = "" }', "units: 'gap' = '': no unit that plant.fmu defines, or that is known; mu"),
        ('{ touching = "1" }', "units: 'touching' = '1': is of type Boolean; must be a Real, as o"),
        ("{ gap = 1 }", "units: 'gap' = 1: must be the name of a unit, like 'mm'"),
        ('"mm"', "units: 'mm'; must be a table"),
    ],
)
def test_a_name_that_is_wrong_is_one_line(tmp_path, units, message):
    with pytest.raises(InputError) as caught:
        load(tmp_path, BARE, f"units = {units}")
    assert str(caught.value).startswith(f"loop.toml: [components.plant]: {message}")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("unit", "end"),
    [("CM", "did you mean cm?"), ("-mM", "did you mean mm, Mm?"), ("DEGC", "did you mean degC?")],
)
def test_a_unit_in_other_capitals_is_asked_about(tmp_path, unit, end):
    with pytest.raises(InputError, match=r"or that is known; ") as caught:
        load(tmp_path, BARE, f'units = {{ gap = "{unit}" }}')
    assert str(caught.value).endswith(f"; {end}")


# ------------------------------------------------------------------------- another FMU in its place


def in_mm(folder, name="other.fmu"):
    plant = {n: text.replace('unit="m"', 'unit="mm"') for n, text in PLANT.items()}
    plant["width"] = plant["width"].replace('start="0.05"', 'start="50"').replace(' max="1"', "")
    return write_fmu(folder / name, plant)


def test_values_are_converted_for_an_fmu_in_other_units(tmp_path):
    system = load(tmp_path, dict(PLANT))
    swapped = system.swap("plant", in_mm(tmp_path))
    assert swapped.start("plant.width") == pytest.approx(70.0, rel=1e-15)
    assert gap_to_position(swapped) == (1e-3, 0.0)
    again = swapped.swap("plant", tmp_path / "plant.fmu")
    assert again.start("plant.width") == pytest.approx(0.07, rel=1e-15)
    revised = system.with_settings({"components.plant.fmu": in_mm(tmp_path), "plant.width": 60.0})
    assert revised.start("plant.width") == 60.0
