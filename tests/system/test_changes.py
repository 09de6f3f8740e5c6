"""One rule for settings, by their places in the file; a component with another FMU."""

import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from comparison.made import PLANT, write_fmu, write_system
from grasp_cosim import InputError, Quantity, System
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.system.toml import to_do

TEXT = SYSTEM.read_text("utf-8")
TABLE = "[components.plant]\n"


def written(text, folder, fmus):
    (folder / "grasp.toml").write_text(text, "utf-8")
    return System.load(folder / "grasp.toml", fmus)


@pytest.mark.parametrize(
    ("settings", "was", "now"),
    [
        ({"experiment.scheme": "jacobi"}, '"sequential"', '"jacobi"'),
        ({"experiment.step": "5e-4"}, "step = 1e-4", "step = 5e-4"),
        ({"experiment.stop": 2}, "stop = 3.0", "stop = 2.0"),
        ({"experiment.diverging": "continue"}, "stop = 3.0", 'stop = 3.0\ndiverging = "continue"'),
        ({"plant.object_width": "0.06"}, "object_width = 0.07", "object_width = 0.06"),
        ({"components.plant.values.object_width": 0.06}, "th = 0.07", "th = 0.06"),
        ({"plant.finger_mass[1]": 1}, "width = 0.07", 'width = 0.07, "finger_mass[1]" = 1.0'),
        ({"components.plant.step": "2e-4"}, TABLE, f"{TABLE}step = 2e-4\n"),
        ({"components.plant.isolation": "process"}, TABLE, f'{TABLE}isolation = "process"\n'),
        ({"components.plant.units.gap[1]": "m"}, TABLE, f'{TABLE}units = {{"gap[1]" = "m"}}\n'),
        ({"initialisation.iterations": "9"}, TABLE, f"[initialisation]\niterations = 9\n{TABLE}"),
        ({"roles.plant": "controller"}, TABLE, f'[roles]\nplant = "controller"\n{TABLE}'),
        (
            {"realtime.priority": "80", "realtime.lock_memory": "true", "realtime.factor": "0.5"},
            TABLE,
            f"[realtime]\npriority = 80\nlock_memory = true\nfactor = 0.5\n{TABLE}",
        ),
    ],
)
def test_a_setting_is_as_if_the_file_said_it(grasp, fmus, tmp_path, settings, was, now):
    text = TEXT.replace(was, now, 1)
    assert text != TEXT
    expected = written(text, tmp_path, fmus)
    found = grasp.with_settings(settings)
    assert found == expected != grasp
    assert found == replace(found), "what is not checked again stands up to a check"


def test_stimuli_and_their_interpolation(tmp_path, fmus):
    text = TEXT.replace('  "controller.force[1] -> plant.force[1]",\n', "", 1)
    (tmp_path / "push.csv").write_text("time,plant.force[1]\n0,0\n1,-2\n", "utf-8")
    entry = '[input]\nfile = "push.csv"\ninterpolation = "held"\n'
    held = written(text + entry, tmp_path, fmus)
    linear = held.with_settings({"input.interpolation": "linear"})
    assert linear != held == linear.with_settings({"input.interpolation": "held"})
    again = {"input.file": tmp_path / "push.csv", "input.interpolation": "held"}
    assert linear.with_settings(again) == held


def test_an_fmu_comes_with_its_names_and_units(grasp, fmus, tmp_path):
    other = shutil.copy(fmus / "GripperPlant.fmu", tmp_path / "other.fmu")
    found = grasp.with_settings(
        {
            "components.plant.fmu": str(other),
            "components.plant.rename.breadth": "object_width",
            "components.plant.values.breadth": 0.05,
        }
    )
    plant = found.component("plant", "test")
    assert (plant.fmu, plant.rename) == (Path(other), {"breadth": "object_width"})
    assert plant.values == {"initial_object_position": 0.03, "breadth": 0.05}
    assert "has no parameter object_width: its value 0.07 is left out" in found.notes[-1]


@pytest.mark.parametrize(
    ("key", "value", "said"),
    [
        (
            "plant.object_widt",
            1,
            ": GripperPlant.fmu has no input, parameter or initial value 'object_widt'; did",
        ),
        ("plont.object_width", 1, ": no component 'plont'; did you mean plant?"),
        ("object_width", 1, ": no key of a system file; did you mean plant.object_width?"),
        ("scheme", "jacobi", ": no key of a system file; did you mean experiment.scheme?"),
        ("experimnt.step", 1, ": no component 'experimnt'; did you mean experiment?"),
        ("experiment.schem", "x", ": no entry 'schem' of [experiment]; did you mean scheme?"),
        ("experiment.scheme", "x", " = 'x': must be one of sequential, jacobi"),
        ("experiment.step", "x", " = 'x' s: must be a number"),
        ("experiment.stop", "-1", " = -1 s: must be a number greater than 0"),
        ("connections.1", 1, ": no component 'connections'; valid: plant, sensor_1"),
        ("presets.bench", 1, ": no component 'presets'; valid: plant, sensor_1"),
        ("components.plont.fmu", "x", ": no component 'plont'; did you mean plant?"),
        ("components.plant.isolated", 1, ": no entry 'isolated' of a component; did you mean iso"),
        ("components.plant.isolation", "x", " = 'x': must be one of none, process"),
        ("components.plant.values", 1, ": must be components.plant.values.NAME"),
        ("components.plant.step.x", 1, ": must be components.plant.step"),
        ("components.plant.fmu", 1, " = 1: must be the path of an FMU"),
        ("components.plant.units.gap[1]", 1, " = 1: must be the name of a unit"),
        ("realtime.overrun", "x", "overrun = 'x': must be one of auto, catch-up, continue, stop"),
        ("realtime.priority", "100", "priority = 100: must be a whole number from 1 to 99"),
        ("input.interpolation", "held", "input.file = None: must be the path of a CSV"),
    ],
)
def test_a_mistake_is_one_line(grasp, key, value, said):
    with pytest.raises(InputError) as caught:
        grasp.with_settings({key: value})
    message = str(caught.value)
    assert message.startswith(f"with_settings {key.partition('.')[0]}")
    assert said in message
    assert "\n" not in message


def test_a_place_is_given_once(grasp):
    twice = {"plant.object_width": 0.06, "components.plant.values.object_width": 0.06}
    with pytest.raises(InputError, match=r"^with_settings components.plant.* is set twice"):
        grasp.with_settings(twice)


def test_a_section_is_no_name_of_a_component(fmus, tmp_path):
    text = TEXT.replace("plant.", "input.").replace("[components.plant]", "[components.input]")
    with pytest.raises(InputError, match=r"^grasp.toml: input: is the name of a sec"):
        written(text, tmp_path, fmus)


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


def test_scalars_that_are_named_as_elements_are_an_array(tmp_path):
    """By its name in rename, which the next version keeps, and in units."""
    force, gap = PLANT["force"], PLANT["gap"]
    several = {f"Gaps[{j}]": gap for j in (1, 2)} | {"Gaps[1].far": gap, "force": force}
    fmus = [write_fmu(tmp_path / f"{n}.fmu", {**PLANT, **several}, {}) for n in ("one", "two")]
    system = write_system(tmp_path)
    for fmu in fmus:
        more = {"rename": {"way": "Gaps"}, "units": {"way": "mm"}} if fmu == fmus[0] else {}
        system = system.swap("plant", fmu, **more)
        plant = system.component("plant", "test").interface.by_name
        assert [plant[f"way[{j}]"].unit for j in (1, 2)] == ["mm", "mm"]
        assert "Gaps[1].far" in plant


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
    with pytest.raises(InputError, match=r"with_values plant.width: bare.fmu has no input, para"):
        swapped.with_values({"plant.width": 0.05})


def test_a_swap_leaves_out_what_the_new_fmu_calculates(tmp_path):
    state = 'causality="output" initial="exact" | Real start="1" unit="m"'
    moved = write_fmu(tmp_path / "moved.fmu", {**PLANT, "opening": state})
    system = write_system(tmp_path).swap("plant", moved).with_values({"plant.opening": 2.0})
    other = write_fmu(tmp_path / "other.fmu", {**PLANT, "opening": 'causality="output" | Real'})
    swapped = system.swap("plant", other)
    assert "opening" not in swapped.component("plant", "test").values
    assert swapped.notes[-1] == (
        "swap plant: in other.fmu opening is an output that the FMU calculates from the start on: "
        "its value 2.0 is left out"
    )


MILLI = {**PLANT, "width": PLANT["width"].replace('unit="m"', 'unit="mm"').replace('max="1"', "")}
SAID = [
    50,
    50.0,
    "50",
    "50 mm",
    "5 cm",
    (0.05, "m"),
    Quantity("50 mm"),
    np.int64(50),
    np.array(50.0),
]


@pytest.mark.parametrize("said", SAID)
def test_a_number_is_in_the_unit_of_its_variable_unless_it_says_one(tmp_path, said):
    plant = write_fmu(tmp_path / "milli.fmu", MILLI)
    system = write_system(tmp_path).swap("plant", plant, values={"width": said})
    again = system.with_values({"plant.width": said}).with_settings({"plant.width": said})
    for each in (system, again):
        value = each.component("plant", "test").values["width"]
        assert (value, type(value)) == (50.0, float)


def test_a_file_and_its_presets_may_name_a_unit(grasp, fmus, tmp_path):
    preset = '[presets.wide]\n"plant.object_width" = "9 cm"\n'
    text = TEXT.replace("object_width = 0.07", 'object_width = "60 mm"') + preset
    made = written(text, tmp_path, fmus)
    assert made.start("plant.object_width") == 0.06  # to the bit
    assert made.with_presets("wide").start("plant.object_width") == 0.09
    assert grasp.with_settings({"experiment.step": "0.2 ms"}).step_ns == 200_000


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        (
            "plant.width",
            "50 kg",
            "width = 50 kg: cannot be converted into mm; must be in a unit of",
        ),
        ("plant.width", (50, "mmm"), "width = 50 mmm: unit 'mmm' is not known; did you mean m.mm"),
        ("plant.width", "50mm", "finite number from 0 to .* mm; with its unit it is '50 mm'"),
        ("plant.width", "-5 cm", "width = '-5 cm': must be a finite number from 0"),
        (
            "plant.mass",
            "5 g",
            "mass = 5 g: milli.fmu declares no unit of it; must have none, or `un",
        ),
        ("plant.name", (5, "g"), "name = 5 g: is of type String; must have no unit"),
        ("experiment.step", "5 g", "experiment.step = 5 g: must be in a unit of time, like ms"),
    ],
)
def test_a_unit_of_something_else_is_refused_in_a_line(tmp_path, place, value, said):
    plant = MILLI["width"].replace("min", 'max="1000" min')
    fmu = write_fmu(tmp_path / "milli.fmu", {**MILLI, "width": plant})
    system = write_system(tmp_path).swap("plant", fmu)
    with pytest.raises(InputError, match=said) as caught:
        system.with_settings({place: value})
    assert "\n" not in str(caught.value)


def test_numbers_of_numpy_are_as_good_as_those_of_python(grasp):
    found = grasp.with_values(
        {
            "controller.impact_reduction.enabled": np.bool_(False),
            "sensor_1.noise.seed": np.int64(4),
            "plant.object_width": np.float32(0.5),
            "plant.finger_mass[1]": np.array(0.25),
        }
    ).with_experiment(step=np.float64(1e-3), stop=np.int64(2))
    values = [c.values for c in found.components]
    assert [type(value) for own in values for value in own.values()] == [float] * 3 + [int, bool]
    assert (found.step_ns, found.stop_ns) == (1_000_000, 2_000_000_000)


def test_what_a_system_sets_and_another_fmu_has_otherwise_is_said_in_a_line(tmp_path):
    system = write_system(tmp_path)
    other = PLANT["width"].replace("0.05", "0.02")
    fmu = write_fmu(tmp_path / "other.fmu", {**PLANT, "width": other})
    swapped = system.swap("plant", fmu)
    assert swapped.notes[len(system.notes) :] == (
        "swap plant: the values of the system stay: width = 0.07 m (its own is 0.02 m); "
        "--own-values, or swap(..., own_values=True), takes those of other.fmu",
    )
    assert swapped.start("plant.width") == 0.07
    own = system.swap("plant", fmu, values={"mass": 0.3}, own_values=True)
    assert own.notes == system.notes
    assert (own.start("plant.width"), own.start("plant.mass")) == (0.02, 0.3)
    same = PLANT["width"].replace("0.05", "70").replace('"m"', '"mm"').replace('max="1"', "")
    equal = write_fmu(tmp_path / "equal.fmu", {**PLANT, "width": same})
    assert "width" not in "".join(system.swap("plant", equal).notes)


def test_own_values_are_not_those_of_inputs(grasp, fmus):
    """Which have no other source."""
    cut = tuple(c for c in grasp.connections if str(c.target) != "plant.force[1]")
    plant = replace(grasp.component("plant", "x"), values={"force[1]": 0.5, "object_width": 0.06})
    system = replace(grasp, components=(plant, *grasp.components[1:]), connections=cut)
    found = system.swap("plant", fmus / "GripperPlant.fmu", own_values=True)
    assert found.component("plant", "x").values == {"force[1]": 0.5}


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
