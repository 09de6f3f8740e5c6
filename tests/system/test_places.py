"""One rule for settings: what a file says, with_settings says by its place."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest
from grasp_cosim import InputError, Realtime, System
from grasp_cosim.grasp.presets import SYSTEM

TEXT = SYSTEM.read_text("utf-8")
PLANT, SENSOR = "[components.plant]\n", "[components.sensor_1]"


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
        ({"components.plant.step": "2e-4"}, PLANT, f"{PLANT}step = 2e-4\n"),
        ({"components.plant.isolation": "process"}, PLANT, f'{PLANT}isolation = "process"\n'),
        ({"components.plant.units.gap[1]": "m"}, PLANT, f'{PLANT}units = {{"gap[1]" = "m"}}\n'),
        ({"initialisation.iterations": "9"}, PLANT, f"[initialisation]\niterations = 9\n{PLANT}"),
        ({"roles.plant": "controller"}, PLANT, f'[roles]\nplant = "controller"\n{PLANT}'),
        (
            {"realtime.priority": "80", "realtime.lock_memory": "true", "realtime.factor": "0.5"},
            PLANT,
            f"[realtime]\npriority = 80\nlock_memory = true\nfactor = 0.5\n{PLANT}",
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
        ("plant.object_widt", 1, ": GripperPlant.fmu has no input or parameter 'object_widt'; did"),
        ("plont.object_width", 1, ": no component 'plont'; did you mean plant?"),
        ("object_width", 1, ": no place in a system file; did you mean plant.object_width?"),
        ("scheme", "jacobi", ": no place in a system file; did you mean experiment.scheme?"),
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
        ("components.plant.units.gap[1]", 1, " = 1: must be a string"),
        ("realtime.overrun", "x", "overrun = 'x': must be one of catch-up, continue, stop"),
        ("realtime.priority", "100", "priority = 100: must be a whole number from 1 to 99"),
        ("input.interpolation", "held", ": there is no input file; must have input.file, too"),
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
    with pytest.raises(InputError, match=r"^with_settings components.plant.* is given twice"):
        grasp.with_settings(twice)


def test_a_section_is_no_name_of_a_component(fmus, tmp_path):
    text = TEXT.replace("plant.", "input.").replace("[components.plant]", "[components.input]")
    with pytest.raises(InputError, match=r"^grasp.toml: component 'input': is the name of a sec"):
        written(text, tmp_path, fmus)


def test_the_pacing_is_read_and_checked(fmus, tmp_path):
    paced = written(f'{TEXT}\n[realtime]\noverrun = "stop"\ncpu = 1\n', tmp_path, fmus)
    assert paced.realtime == Realtime(overrun="stop", cpu=1)
    with pytest.raises(InputError, match=r"^grasp.toml: \[realtime\]: factor = 0: must be"):
        written(f"{TEXT}\n[realtime]\nfactor = 0\n", tmp_path, fmus)
