"""The controllers of ours by the names of their laws, in any system that has a controller."""

import json
import shutil
from dataclasses import replace

import pytest
from grasp_cosim import InputError
from grasp_cosim.grasp.presets import SYSTEM, with_preset
from grasp_cosim.grasp.system import CONTROLLERS, grasp_system, with_controller
from grasp_fmus.build import shipped_fmus

ADAPTIVE = "GraspControllerAdaptive.fmu"


def fmus_of(system):
    return {c.name: c.fmu.name for c in system.components}


@pytest.fixture
def brain(fmus, tmp_path):
    """A system file in which the component brain plays the controller."""
    text = SYSTEM.read_text("utf-8").partition("# Cases of the paper")[0]
    for place in ('"{}.', "-> {}.", "components.{}]"):
        text = text.replace(place.format("controller"), place.format("brain"))
    text = text.replace('fmu = "', f'fmu = "{fmus}/')
    path = tmp_path / "brain.toml"
    path.write_text(f'{text}\n[roles]\ncontroller = "brain"\n', "utf-8")
    return path


def test_the_law_takes_the_place_of_the_controller_alone(grasp):
    adaptive = with_controller(grasp, "adaptive")
    assert fmus_of(adaptive) == {**fmus_of(grasp), "controller": ADAPTIVE}
    assert with_controller(adaptive, "published") == grasp == with_controller(grasp, "published")
    assert {f for law in CONTROLLERS for f in fmus_of(with_controller(grasp, law)).values()} > {
        *(f"GraspController{law}.fmu" for law in CONTROLLERS.values())
    }


def test_what_the_system_says_of_its_controller_stays(grasp):
    given = with_preset(grasp, "case_1").with_values({"controller.contact_force.stiffness": 49.0})
    adaptive = with_controller(given, "adaptive")
    assert adaptive.component("controller", "test").values == {
        "simultaneous_contact.enabled": False,
        "impact_reduction.enabled": True,
        "contact_force.stiffness": 49.0,
    }
    learning = adaptive.with_values({"controller.hold.squeeze": 0.2})
    (note,) = with_controller(learning, "published").notes
    assert "has no parameter hold.squeeze: its value 0.2 is left out" in note


def test_in_python_the_grasp_is_asked_for_by_law():
    assert fmus_of(grasp_system(controller="adaptive"))["controller"] == ADAPTIVE
    assert fmus_of(grasp_system())["controller"] == "GraspController.fmu"
    with pytest.raises(InputError, match=r"^controller = 'blind': must be one of published, adapt"):
        grasp_system(controller="blind")


def test_one_that_is_not_beside_the_other_is_that_of_the_cache(grasp, tmp_path):
    own = tmp_path / "mine.fmu"
    shutil.copy(grasp.component("controller", "test").fmu, own)
    mine = with_controller(grasp.swap("controller", own), "adaptive")
    assert mine.component("controller", "test").fmu == shipped_fmus() / ADAPTIVE
    shutil.copy(grasp.component("controller", "test").fmu.with_name(ADAPTIVE), tmp_path)
    mine = with_controller(grasp.swap("controller", own), "adaptive")
    assert mine.component("controller", "test").fmu == tmp_path / ADAPTIVE


def test_a_system_without_a_controller_is_one_line(grasp):
    plant = replace(grasp.components[0], values={"force[1]": 0.0, "force[2]": 0.0})
    bare = replace(grasp, components=(plant,), connections=())
    with pytest.raises(InputError, match=r"^controller adaptive: grasp.toml has no component 'con"):
        with_controller(bare, "adaptive")


def test_run_goes_by_the_role_and_says_which_it_was(command, brain, tmp_path):
    arguments = ("--controller", "adaptive", "--case", "1", "--stop", "0.01", "--step", "1e-3")
    assert command("run", brain, *arguments, "--out", "out")[0] == 0
    made = json.loads((tmp_path / "out/run.json").read_text("utf-8"))["components"]
    assert made["brain"]["fmu"] == ADAPTIVE
    assert made["brain"]["values"]["simultaneous_contact.enabled"] is False


def test_one_controller_is_not_replaced_twice(command):
    code, _, err = command("run", "--controller", "adaptive", "--swap", "controller=mine.fmu")
    assert (code, err.splitlines()) == (
        2,
        ["grasp-cosim: controller adaptive: cannot be used with another FMU for controller"],
    )
