"""Delicate things as a system: each preset is grasped, lifted, and told of by its metrics."""

import pytest
from grasp_cosim import System, delicate_system, simulate
from grasp_cosim.grasp.delicate import SYSTEM

THINGS = ("tofu", "strawberry", "tomato", "egg", "marshmallow", "paper_cup")


@pytest.fixture(scope="module")
def system(fmus):
    return System.load(SYSTEM, fmus).with_experiment(step=2e-3)


def test_its_presets_are_things(system):
    assert tuple(system.presets) == THINGS


@pytest.mark.slow
@pytest.mark.parametrize("name", THINGS)
def test_a_thing_is_grasped_and_lifted_as_far_as_friction_holds_it(system, name):
    run = simulate(system.with_presets(name).natively(None))
    m = run.metrics
    assert None not in m["time_to_contact"]
    assert m["damaged"] is False
    assert m["dropped"] == (m["lift_margin"] < 1.0)
    assert run.signals["plant.fingertip_height"][-1] == pytest.approx(0.1, abs=1e-4)
    weight = system.presets[name]["plant.object_mass"] * 9.80665
    if not m["dropped"]:
        lifted = sum(run.signals[f"plant.tangential_force[{j}]"][-1] for j in (1, 2))
        assert lifted == pytest.approx(weight, rel=1e-6)
        assert m["slip"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.slow
def test_an_event_may_begin_the_lift(fmus, tmp_path):
    text = SYSTEM.read_text("utf-8").replace('"lift.enabled" = true, "lift.time" = 4.5', "")
    text = text.replace("0.01,  }", "0.01 }")
    event = '[[events]]\nwhen = "plant.contact_force[1] > 2.0"\n'
    file = tmp_path / "mine.toml"
    file.write_text(f'{text}\n{event}set = {{ "plant.lift.enabled" = true }}\n', "utf-8")
    run = simulate(System.load(file, fmus).with_presets("tomato"), stop=3.0)
    forces, heights = run.signals["plant.contact_force[1]"], run.signals["plant.fingertip_height"]
    pressed = next(k for k, force in enumerate(forces) if force > 2.0)
    assert heights[pressed] == 0.0
    assert 0.0 < heights[pressed + 2] < 1e-4
    assert heights[-1] == pytest.approx(0.1, abs=1e-4)


def test_init_writes_it(command, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert command("init", "mine.toml", "--delicate")[0] == 0
    assert System.load("mine.toml").with_presets("egg") is not None
    code, _, said = command("init", "other.toml", "--delicate", "--tandem")
    assert code == 2
    assert "--tandem cannot be used with --delicate; each makes another system" in said


def test_the_laws_are_those_of_the_grasp():
    adaptive = delicate_system("adaptive", native=False)
    assert adaptive.component("controller", "").fmu.name == "GraspControllerAdaptive.fmu"
    assert delicate_system(native=False).component("plant", "").fmu.name == (
        "GripperPlantDelicate.fmu"
    )
