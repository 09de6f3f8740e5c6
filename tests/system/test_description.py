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


WRONG = [
    (
        "[experiment]",
        "[experment]",
        "unknown entry 'experment'; did you mean experiment",
    ),
    (
        "step = 1e-4",
        "stepp = 1e-4",
        r"\[experiment\]: unknown entry 'stepp'; did you mean step",
    ),
    ("step = 1e-4", "step = 0", r"experiment.step = 0 s: must be a number greater than 0"),
    ("step = 1e-4", "step = 'fast'", "experiment.step = 'fast' s: must be a number"),
    ("step = 1e-4", "step = 1.5e-9", "must be a whole number of nanoseconds"),
    ("step = 1e-4", "step = 7e-4", "step = 0.0007 s does not divide stop = 3 s; stop could be"),
    ("stop = 3.0", "", "experiment.stop = None s: must be a number"),
    ('"sequential"', '"parallel"', "'parallel': must be one of sequential, jacobi"),
    ("plant.gap[1] ->", "plnt.gap[1] ->", "no component 'plnt'; did you mean plant"),
    (
        "plant.gap[1] ->",
        "plant.gap[3] ->",
        r"no output 'gap\[3\]'; did you mean gap\[1\], g",
    ),
    ("-> sensor_1.gap", "-> sensor_1.gain", "sensor_1 has no input 'gain'; valid: gap"),
    ("-> sensor_1.gap", "-> sensor_2.gap", "sensor_2.gap has two sources, plant.gap"),
    ("plant.gap[1] ->", "plant.contact[1] ->", "is Boolean and sensor_1.gap is Real; must be both"),
    (
        '  "plant.gap[1] -> sensor_1.gap",\n',
        "",
        "input sensor_1.gap has no source; connect one of",
    ),
    (" -> sensor_1.gap", " sensor_1.gap", "must be 'component.output -> component.input'"),
    ("GripperPlant.fmu", "Gripper.fmu", "Gripper.fmu: no such FMU file"),
    ('fmu = "GripperPlant.fmu"', "fmu = 7", r"\[components.plant\]: fmu = 7: must be the path"),
    (
        'fmu = "GripperPlant.fmu"',
        'fnu = "x"',
        "unknown entry 'fnu'; did you mean fmu",
    ),
    (
        "object_width = 0.07",
        "width = 0.07",
        "parameter 'width'; did you mean object_width",
    ),
    ("object_width = 0.07", "object_width = -1.0", "must be a finite number from 0 to 10 m"),
    ("object_width = 0.07", "object_width = '7 cm'", "must be a finite number from 0 to 10 m"),
    ("object_width = 0.07", "object_width = [0.07]", "is not an array; must be one value"),
    ("object_width = 0.07", "object_width = [{}]", "must be a number, boolean or string"),
    ("[experiment]", "[experiment", "not readable as TOML"),
]


@pytest.mark.parametrize(("right", "wrong", "message"), WRONG)
def test_a_mistake_is_one_line(fmus, tmp_path, right, wrong, message):
    assert right in TEXT
    with pytest.raises(InputError, match=message) as caught:
        load(TEXT.replace(right, wrong, 1), fmus, tmp_path)
    assert "\n" not in str(caught.value)


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


def test_an_output_cannot_be_set(grasp):
    with pytest.raises(InputError, match=r"no input or parameter 'gap\[1\]'"):
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
    assert "dp: several variables of dp.fmu are called b: they are left alone" in remarks(system)
    with pytest.raises(InputError, match=r"dp\.fmu, where several are called b, has no "):
        system.with_values({"dp.b": 2.0})
