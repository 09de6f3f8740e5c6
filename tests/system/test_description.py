"""The system description: a mistake is one line with the place and the valid choices."""

import re
import zipfile

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.system.validity import remarks

TEXT = SYSTEM.read_text("utf-8")


def load(text, fmus, folder):
    path = folder / "system.toml"
    path.write_text(text, encoding="utf-8")
    return System.load(path, fmus)


EVENTS = """
[[events]]
at = 0.5
set = { "sensor_1.reflectance" = 0.6 }

[[events]]
when = "plant.gap[1] < 0.01"
set = { "sensor_1.reflectance" = 0.4, "sensor_2.reflectance" = 1 }
"""
FAULTS = """
[[faults]]
connection = "sensor_1.intensity -> controller.intensity[1]"
kind = "noise"
standard_deviation = 0.002
from = 0.5
until = 1.0
when = "plant.contact[2] == true"
seed = 1

[[faults]]
connection = "controller.intensity[1]"
kind = "saturation"
high = 0.4
"""
MISTAKES = [
    ("system", '["grasp"]', '["grasps"]'),
    ("system", '["grasp"]', '["foot"]'),
    ("system", '["grasp"]', '"grasp"'),
    ("system", '["grasp"]', "[1]"),
    ("more", "X", "[realtime]\nfactor = 0"),
    ("more", "X", '[roles]\nsensor_1 = "ear"'),
    ("more", "X", "[roles]\nsensor_1 = 1"),
    ("more", "X", "[[roles]]"),
    ("system", "[presets.case_0]", "[presets]\ndim = 3\n[presets.case_0]"),
    ("more", "X", '[presets.dim]\n"sensor_1.gain" = [{}]'),
    ("more", "X", "[presets.dim]\nsensor_1.gain = 1"),
    ("system", "[experiment]", "[experment]"),
    ("system", "step = 1e-4", "stepp = 1e-4"),
    ("system", "step = 1e-4", "step = 0"),
    ("system", "step = 1e-4", "step = 'fast'"),
    ("system", "step = 1e-4", "step = 1.5e-9"),
    ("system", "step = 1e-4", "step = 7e-4"),
    ("system", "stop = 3.0", ""),
    ("system", '"sequential"', '"parallel"'),
    ("system", "plant.gap[1] ->", "plnt.gap[1] ->"),
    ("system", "plant.gap[1] ->", "plant.gap[3] ->"),
    ("system", "-> sensor_1.gap", "-> sensor_1.gain"),
    ("system", "-> sensor_1.gap", "-> sensor_2.gap"),
    ("system", "plant.gap[1] ->", "plant.contact[1] ->"),
    ("system", '  "plant.gap[1] -> sensor_1.gap",\n', ""),
    ("system", " -> sensor_1.gap", " sensor_1.gap"),
    ("system", "GripperPlant.fmu", "Gripper.fmu"),
    ("system", 'fmu = "GripperPlant.fmu"', "fmu = 7"),
    ("system", 'fmu = "GripperPlant.fmu"', 'fnu = "x"'),
    ("system", "object_width = 0.07", "width = 0.07"),
    ("system", "object_width = 0.07", "object_width = -1.0"),
    ("system", "object_width = 0.07", "object_width = '7cm'"),
    ("system", "object_width = 0.07", "object_width = '7 kg'"),
    ("system", "object_width = 0.07", "object_width = [0.07]"),
    ("system", "object_width = 0.07", "object_width = [{}]"),
    ("system", "[experiment]", "[experiment"),
    ("events", "at = 0.5", "att = 0.5"),
    ("events", "at = 0.5", ""),
    ("events", "at = 0.5", 'at = 0.5\nwhen = "plant.gap[1] < 1"'),
    ("events", "at = 0.5", "at = -1"),
    ("events", "at = 0.5", "at = 'now'"),
    ("events", "at = 0.5", "at = 1.5e-9"),
    ("events", '"sensor_1.reflectance" = 0.6', ""),
    ("events", 'set = { "sensor_1.reflectance" = 0.6 }', ""),
    ("events", '"sensor_1.reflectance" = 0.6', "reflectance = 0.6"),
    ("events", '"sensor_1.reflectance" = 0.6', "sensor_1.reflectance = 0.6"),
    ("events", "sensor_1.reflectance", "sensr.reflectance"),
    ("events", "sensor_1.reflectance", "sensor_1.reflection"),
    ("events", "sensor_1.reflectance", "plant.object_width"),
    ("events", "sensor_1.reflectance", "sensor_1.intensity"),
    ("events", "sensor_1.reflectance", "sensor_1.gap"),
    ("events", "= 0.6", "= 11"),
    ("events", "= 0.6", "= [0.6]"),
    ("events", "plant.gap[1] < 0.01", "plant.gap[1]"),
    ("events", "plant.gap[1] < 0.01", "gap < 0.01"),
    ("events", "plant.gap[1] < 0.01", "plant.gap[1] < true"),
    ("events", "plant.gap[1] < 0.01", "plant.gap[1] == 0.01"),
    ("events", "plant.gap[1] < 0.01", "plant.contact[1] > 0.5"),
    ("events", "plant.gap[1] < 0.01", "plant.contact[1] < true"),
    ("events", "plant.gap[1] < 0.01", "plant.force[3] < 1"),
    ("events", "plant.gap[1] < 0.01", "robot.gap[1] < 1"),
    ("more", "X", "[events]\nat = 0.5"),
    ("faults", 'kind = "noise"', 'kind = "hum"'),
    ("faults", 'kind = "noise"', "kind = ['noise']"),
    ("faults", "standard_deviation", "sigma"),
    ("faults", "standard_deviation = 0.002", ""),
    ("faults", "= 0.002", "= -1"),
    ("faults", "from = 0.5", "from = -0.5"),
    ("faults", "until = 1.0", "until = 0"),
    ("faults", "until = 1.0", "until = 0.5"),
    ("faults", "from = 0.5\nuntil = 1.0", "from = 0.11e-3\nuntil = 0.19e-3"),
    ("faults", "seed = 1", "seed = -1"),
    ("faults", "sensor_1.intensity ->", "sensor_2.intensity ->"),
    ("faults", "sensor_1.intensity ->", "a.b -> c.d ->"),
    ("faults", '"controller.intensity[1]"', "7"),
    ("faults", '"controller.intensity[1]"', '"intensity"'),
    ("faults", '"controller.intensity[1]"', '"sensor_1.intensity"'),
    ("faults", "contact[2] ==", "contact[3] =="),
    ("faults", "high = 0.4", ""),
    ("faults", "high = 0.4", "high = 0.4\nlow = 0.4"),
    ("faults", "high = 0.4", "high = 0.4\nseed = 1"),
    ("faults", '"saturation"\nhigh = 0.4', '"dropout"\nprobability = 1.1'),
    ("faults", '"saturation"\nhigh = 0.4', '"quantisation"\nstep = 0'),
    ("faults", '"saturation"\nhigh = 0.4', '"bias"\nvalue = "x"'),
    ("faults", '"saturation"\nhigh = 0.4', '"delay"\ntime = -1e-3'),
    ("faults", '"saturation"\nhigh = 0.4', '"delay"\ntime = 1.23e-3'),
    ("faults", '"saturation"\nhigh = 0.4', '"stuck"\nvalue = nan'),
    ("faults", '"saturation"\nhigh = 0.4', '"stuck"\nhold = 1.0'),
    ("more", "X", "[initialisation]\nloop = 'refuse'"),
    ("more", "X", "[initialisation]\nloops = 'ignore'"),
    ("more", "X", "[initialisation]\ntolerance = 0.0"),
    ("more", "X", "[initialisation]\niterations = 0"),
]


@pytest.mark.parametrize(("section", "right", "wrong"), MISTAKES)
def test_a_mistake_is_one_line(fmus, tmp_path, snapshot, section, right, wrong):
    more = {"system": "", "events": EVENTS, "faults": FAULTS, "more": "X"}[section]
    assert right in (more or TEXT)
    text = TEXT + more.replace(right, wrong, 1) if more else TEXT.replace(right, wrong, 1)
    with pytest.raises(InputError) as caught:
        load(text, fmus, tmp_path)
    said = str(caught.value).replace(str(fmus), "FMUS").replace(str(tmp_path), "HERE")
    assert "\n" not in said
    assert said.partition("as TOML")[0] == snapshot


def test_an_unconnected_input_may_have_a_value(fmus, tmp_path):
    text = TEXT.replace('  "plant.gap[1] -> sensor_1.gap",\n', "")
    text = text.replace("[components.sensor_2]", "values = { gap = 0.02 }\n\n[components.sensor_2]")
    assert load(text, fmus, tmp_path).component("sensor_1", "test").values == {"gap": 0.02}


def test_missing_system_file():
    with pytest.raises(InputError, match=r"nowhere\.toml: no such system file"):
        System.load("nowhere.toml")


@pytest.mark.parametrize("content", [b"", b"not a zip archive"])
def test_a_file_that_is_no_fmu(grasp, tmp_path, content):
    path = tmp_path / "broken.fmu"
    path.write_bytes(content)
    with pytest.raises(InputError, match=re.escape(f"{path}: not a readable FMU")) as caught:
        grasp.swap("plant", path)
    assert "\n" not in str(caught.value)


def test_swap_wants_the_same_variables(grasp, fmus):
    with pytest.raises(
        InputError, match=r"ProximitySensor.fmu has no output 'gap\[1\]', and 7 more"
    ):
        grasp.swap("plant", fmus / "ProximitySensor.fmu")
    with pytest.raises(InputError, match=r"GraspController.fmu has no input 'gap'"):
        grasp.swap("sensor_1", fmus / "GraspController.fmu")


def test_values_by_name(grasp):
    changed = grasp.with_values(
        {"plant.finger_mass[1]": 0.7, "controller.impact_reduction.enabled": False}
    )
    assert changed.component("plant", "test").values["finger_mass[1]"] == 0.7
    assert changed.component("controller", "test").values["impact_reduction.enabled"] is False
    assert "finger_mass[1]" not in grasp.component("plant", "test").values
    assert changed.start("plant.finger_mass[1]") == 0.7
    assert changed.start("plant.finger_mass[2]") == 0.5


def test_text_is_converted_to_the_declared_type(grasp):
    changed = grasp.with_values(
        {"controller.impact_reduction.enabled": "false", "sensor_1.reflectance": "0.86"}
    )
    assert changed.component("controller", "test").values == {"impact_reduction.enabled": False}
    assert changed.component("sensor_1", "test").values == {"reflectance": 0.86}


def test_an_item_of_an_enumeration_by_its_name_or_number(grasp):
    for given in ("brown", 4, "4"):
        changed = grasp.with_values({"sensor_1.surface": given})
        assert changed.component("sensor_1", "test").values == {"surface": 4}


@pytest.mark.parametrize("given", ["green", "BROWN", 6, -1, 4.5, True])
def test_no_item_of_an_enumeration(grasp, given):
    items = "custom, white, blue, red, brown, black"
    message = f"sensor_1.surface: surface = {given!r}: must be one of {items}"
    with pytest.raises(InputError, match=re.escape(message)):
        grasp.with_values({"sensor_1.surface": given})


def other_sensor(fmus, folder, **numbers):
    """A sensor whose surfaces have other numbers; one of 0 is not there."""
    path = folder / "Other.fmu"
    with zipfile.ZipFile(fmus / "ProximitySensor.fmu") as old, zipfile.ZipFile(path, "w") as new:
        for name in old.namelist():
            data = old.read(name).decode("latin-1")
            if name == "modelDescription.xml":
                for item, number in numbers.items():
                    changed = f'<Item name="{item}" value="{number}" />' if number else ""
                    data, count = re.subn(f'<Item name="{item}" value="[0-9]" />', changed, data)
                    assert count == 1
            new.writestr(name, data.encode("latin-1"))
    return path


def test_a_number_between_the_items_is_none(grasp, fmus, tmp_path):
    swapped = grasp.swap("sensor_1", other_sensor(fmus, tmp_path, red=0))
    with pytest.raises(InputError, match="surface = 3: must be one of custom, white, blue, brown"):
        swapped.with_values({"sensor_1.surface": 3})


def test_another_fmu_may_not_take_a_number_for_another_item(grasp, fmus, tmp_path):
    """Where a number that the system sets is the same item, or none is set, it is taken."""
    brown = grasp.with_values({"sensor_1.surface": "brown"})
    same = other_sensor(fmus, tmp_path, black=7)
    assert brown.swap("sensor_1", same).component("sensor_1", "x").values["surface"] == 4
    assert grasp.swap("sensor_1", other_sensor(fmus, tmp_path, brown=7))
    swapped = "surface = 4 is brown in ProximitySensor.fmu and {} in Other.fmu; must be set again"
    with pytest.raises(InputError, match=swapped.format("nothing")):
        brown.swap("sensor_1", other_sensor(fmus, tmp_path, brown=7))
    with pytest.raises(InputError, match=swapped.format("black")):
        brown.swap("sensor_1", other_sensor(fmus, tmp_path, black=4, brown=5))


def test_an_output_cannot_be_set(grasp):
    with pytest.raises(InputError, match=r"gap\[1\] = .* is an output that the FMU calculates"):
        grasp.with_values({"plant.gap[1]": 0.1})


def test_a_name_of_several_variables_is_left_alone_and_refused_where_it_is_wanted(tmp_path):
    """As DPController.fmu of ecos' demo has one."""
    twice = "".join(
        f'<ScalarVariable name="{name}" valueReference="{i}" causality="parameter" '
        'variability="fixed"><Real start="1"/></ScalarVariable>'
        for i, name in enumerate("abb")
    )
    with zipfile.ZipFile(tmp_path / "dp.fmu", "w") as file:
        file.writestr(
            "modelDescription.xml",
            '<fmiModelDescription fmiVersion="2.0" modelName="M" guid="{1}"><ModelVariables>'
            f'{twice}</ModelVariables><CoSimulation modelIdentifier="m"/></fmiModelDescription>',
        )
    text = 'experiment = { step = 0.1, stop = 1.0 }\n[components.dp]\nfmu = "dp.fmu"\n'
    (tmp_path / "s.toml").write_text(text)
    system = System.load(tmp_path / "s.toml").with_values({"dp.a": 2.0})
    assert "dp: several variables of dp.fmu are called b: they are left out" in remarks(system)
    with pytest.raises(InputError, match=r"dp\.fmu, where several are called b, has no "):
        system.with_values({"dp.b": 2.0})


def test_equal_systems_are_one_key_and_others_another(grasp):
    again = System.load(SYSTEM, grasp.components[0].fmu.parent)
    same = System.load(SYSTEM, grasp.components[0].fmu.parent)
    wide = same.with_values({"plant.object_width": 0.05})
    assert again == same
    assert hash(again) == hash(same)
    assert hash(wide) != hash(same)
    assert {same: 1, wide: 2}[again] == 1


def test_a_system_shows_itself_in_five_lines(grasp):
    lines = repr(grasp).splitlines()
    assert lines[0] == "System grasp.toml"
    assert len(lines) == 5
    assert max(map(len, lines)) <= 120
    assert "3 s in steps of 0.1 ms, sequential" in lines[1]
    assert len(repr(grasp.components[0].interface)) < 120
