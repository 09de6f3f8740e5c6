"""What a run was asked to do, as plain data; what of a system is not as it was read."""

import json

import pytest
from grasp_cosim import System, grasp_system, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.system.settings import changed, settings

SPECIAL = """
[initialisation]
loops = "refuse"
tolerance = 1e-6
iterations = 9

[roles]
plant = "controller"

[realtime]
factor = 0.5

[[events]]
at = 0.5
set = { "sensor_1.reflectance" = 0.6 }

[[events]]
when = "plant.gap[1] < 0.01"
set = { "sensor_1.surface" = "brown", "sensor_2.reflectance" = 1 }

[[faults]]
connection = "sensor_1.intensity -> controller.intensity[1]"
kind = "noise"
standard_deviation = 0.002
from = 1.5
until = 2.0
when = "plant.contact[2] == true"
seed = 1

[[faults]]
connection = "controller.intensity[1]"
kind = "saturation"
high = 0.4
"""


def test_the_settings_of_the_grasp_and_of_one_that_says_all(grasp, fmus, tmp_path, snapshot):
    text = SYSTEM.read_text("utf-8") + SPECIAL
    gap = '"plant.gap[1] -> sensor_1.gap"'
    scaled = '{ from = "plant.gap[1]", to = "sensor_1.gap", factor = 2.0, offset = -0.5 }'
    assert gap in text
    own = '[components.plant]\nstep = 2e-4\nisolation = "process"\nunits = { "gap[2]" = "m" }\n'
    text = text.replace(gap, scaled).replace("[components.plant]\n", own)
    text = text.replace("stop = 3.0", 'stop = 3.0\nstart = 1.0\ndiverging = "continue"')
    (tmp_path / "special.toml").write_text(text, "utf-8")
    for system in (grasp, System.load(tmp_path / "special.toml", fmus)):
        assert json.loads(json.dumps(settings(system))) == snapshot


@pytest.fixture
def system(fmus):
    """The published grasp as it is."""
    return grasp_system()


@pytest.mark.parametrize(
    ("do", "found"),
    [
        (lambda s: s, {}),
        (lambda s: s.with_values({"plant.object_width": 0.06}), {"plant.object_width": 0.06}),
        (lambda s: s.with_values({"sensor_1.reflectance": 0.5}), {"sensor_1.reflectance": 0.5}),
        (lambda s: s.with_values({"sensor_1.reflectance": 1.0}), {}),  # as its FMU starts
        (lambda s: s.with_presets("case_2"), {}),
        (
            lambda s: s.with_presets("case_1"),
            {"controller.simultaneous_contact.enabled": False},
        ),
        (lambda s: s.with_presets("case_1").with_presets("case_2"), {}),
        (lambda s: s.with_experiment(1e-3, 3.0, "jacobi"), {"step": 1e-3, "scheme": "jacobi"}),
        (
            lambda s: s.swap("plant", s.components[0].fmu.with_name("GripperPlantMovable.fmu")),
            {"plant": "GripperPlantMovable.fmu"},
        ),
    ],
)
def test_what_differs_from_the_file_and_the_fmus(do, found, system):
    assert changed(do(system)) == found


def test_a_result_tells_it(system):
    values = {"plant.initial_object_position": 0.02}
    result = simulate(system.with_values(values), step=1e-3, stop=0.01)
    assert result.settings["changed"] == {**values, "step": 1e-3, "stop": 0.01}
