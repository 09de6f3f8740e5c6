"""What of a system is not as it was read."""

from collections.abc import Callable

import pytest
from grasp_cosim import System, grasp_system, simulate
from grasp_cosim.system.settings import changed

Do = Callable[[System], System]


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
