"""The loop reads outputs of native FMUs made here where they are, as the call of FMI gives them."""

import shutil

import numpy as np
import pytest
from grasp_cosim import grasp_system, simulate
from grasp_cosim.base.calls import READ, TRANSFER_2
from grasp_cosim.fmi.load import load
from grasp_cosim.system.parts import Component
from support.marks import needs_compiler

pytestmark = needs_compiler


@pytest.fixture(scope="module")
def native():
    return grasp_system(native=True).with_experiment(step=1e-3, stop=2.5)


@pytest.fixture
def plant(native):
    component = native.by_name["plant"]
    instance = load(component)
    instance.enter_initialization(component.values, None)
    instance.exit_initialization()
    yield instance
    instance.close()


def shape(plant, names, action="get"):
    variables = [plant.interface.by_name[name] for name in names]
    return plant.transfer(action, variables, np.zeros(len(variables))).native.shape


OUTPUTS = [
    *(f"plant.{name}[{j}]" for name in ("position", "gap", "contact_force") for j in (1, 2)),
    *("plant.object_position", "sensor_1.intensity", "controller.force[1]"),
]


def test_what_is_read_is_what_the_call_gives(native):
    """At each point, also after a parameter was set between two steps."""
    with simulate.session(native) as session:
        instances = {instance.name: instance for instance in session.master.instances}
        while session.step(50):
            for name in OUTPUTS:
                component, _, variable = name.partition(".")
                instance = instances[component]
                assert instance.get([instance.interface.by_name[variable]]) == [session[name]]
            session.set("sensor_1.reflectance", 0.5 + session.time / 10.0)


def test_only_outputs_in_a_row_are_read_so(plant):
    assert shape(plant, ["position[1]", "position[2]", "velocity[1]"]) == READ
    assert shape(plant, ["position[2]"]) == READ
    assert shape(plant, ["position[1]", "velocity[1]"]) == TRANSFER_2
    assert shape(plant, ["force[1]", "force[2]"]) == TRANSFER_2
    assert shape(plant, ["object_width"]) == TRANSFER_2
    assert shape(plant, ["force[1]", "force[2]"], "set") == TRANSFER_2


def test_a_python_fmu_and_a_traced_one_are_asked(native, fmus, tmp_path):
    python = load(Component("plant", fmus / "GripperPlant.fmu", {}))
    assert shape(python, ["position[1]", "position[2]"]) == TRANSFER_2
    python.close()
    shutil.copy(native.by_name["plant"].native, tmp_path / "plant.fmu")
    trace = tmp_path / "calls"
    traced = load(Component("plant", tmp_path / "plant.fmu", {}, trace=trace))
    variables = [traced.interface.by_name["position[1]"]]
    assert traced.transfer("get", variables, np.zeros(1)).native is None
    traced.close()
