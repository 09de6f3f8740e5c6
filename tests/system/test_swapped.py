"""A component with another FMU: which of its names, units and values stay, and which are given."""

import pytest
from comparison.made import PLANT, write_fmu, write_system
from grasp_cosim import InputError, System
from grasp_cosim.system.toml import to_do

VENDOR = {{"gap": "luft", "force": "kraft"}.get(n, n): text for n, text in PLANT.items()}
RENAME = {"gap": "luft", "force": "kraft"}


@pytest.fixture
def vendor(tmp_path):
    """A spring and the plant of a vendor, whose names and unit of a mass the system gives."""
    system = write_system(tmp_path)
    fmu = write_fmu(tmp_path / "vendor.fmu", VENDOR, {})
    return system.swap("plant", fmu, rename=RENAME, units={"mass": "g"})


def test_names_and_units_are_given(vendor):
    plant = vendor.component("plant", "test")
    assert (plant.rename, plant.units) == (RENAME, {"mass": "g"})
    assert plant.interface.by_name["mass"].unit == "g"


def test_names_stay_where_they_fit(vendor, tmp_path):
    next_version = write_fmu(tmp_path / "next.fmu", {**VENDOR, "kraft_2": PLANT["gap"]}, {})
    swapped = vendor.swap("plant", next_version).component("plant", "test")
    assert (swapped.rename, swapped.units) == (RENAME, {"mass": "g"})
    back = vendor.swap("plant", tmp_path / "plant.fmu").component("plant", "test")
    assert (back.rename, back.units) == ({}, {"mass": "g"})
    both = write_fmu(tmp_path / "both.fmu", {**VENDOR, "gap": PLANT["gap"]}, {})
    assert vendor.swap("plant", both).component("plant", "test").rename == {"force": "kraft"}


def test_names_that_are_given_go_before(vendor, tmp_path):
    other = {"abstand" if n == "luft" else n: text for n, text in VENDOR.items()}
    swapped = vendor.swap(
        "plant", write_fmu(tmp_path / "c.fmu", other, {}), rename={"gap": "abstand"}
    )
    assert swapped.component("plant", "test").rename == {"gap": "abstand", "force": "kraft"}
    with pytest.raises(InputError, match=r"^swap plant: rename: 'gap' = 'weg': c.fmu has no vari"):
        vendor.swap("plant", tmp_path / "c.fmu", rename={"gap": "weg"})


def test_a_unit_that_the_new_fmu_declares_otherwise_is_not_kept(vendor, tmp_path):
    grams = {**VENDOR, "mass": PLANT["mass"] + ' unit="1"'}
    fmu = write_fmu(tmp_path / "kg.fmu", grams, {})
    assert vendor.swap("plant", fmu).component("plant", "test").units == {}


def test_a_value_of_a_variable_that_is_not_there_is_left_out_and_said(vendor, tmp_path):
    heated = vendor.with_values({"plant.mass": 300.0})
    bare = {n: text for n, text in VENDOR.items() if n not in ("width", "mass")}
    swapped = heated.swap("plant", write_fmu(tmp_path / "bare.fmu", bare, {}))
    assert swapped.component("plant", "test").values == {}
    assert swapped.notes[-2:] == (
        "swap plant: bare.fmu has no parameter width: its value 0.07 is left out",
        "swap plant: bare.fmu has no parameter mass: its value 300.0 is left out",
    )
    with pytest.raises(InputError, match=r"with_values plant.width: bare.fmu has no input or para"):
        swapped.with_values({"plant.width": 0.05})


TODO = """connections = [
  "spring.force -> plant.force",
  "TODO -> spring.position",
]
[experiment]
step = 1e-3
stop = 0.01
[components.plant]  # "TODO here is none
fmu = "plant.fmu"
values = { width = "TODO: in m" }
[components.spring]
fmu = "spring.fmu"
"""


def test_a_file_with_something_left_to_do_is_refused_by_its_line(tmp_path):
    write_system(tmp_path)
    path = tmp_path / "left.toml"
    path.write_text(TODO)
    with pytest.raises(InputError) as caught:
        System.load(path)
    assert str(caught.value) == (
        'left.toml: line 3: "TODO -> spring.position": must be filled in, as is line 10'
    )
    path.write_text(TODO.replace("TODO ->", "plant.gap ->"))
    with pytest.raises(InputError, match=r"^left.toml: line 10: values = .*: must be filled in$"):
        System.load(path)
    path.write_text(TODO.replace("TODO ->", "plant.gap ->").replace('"TODO: in m"', "0.1"))
    assert System.load(path).start("plant.width") == 0.1


def test_a_hash_in_quotes_begins_no_comment():
    line = """"a # 'b" = 1, 'c # "d' = "TODO: e\""""
    assert to_do(f'{line}\n"f" = 1  # "TODO"\n') == {1: line}
