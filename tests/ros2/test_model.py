"""A model that begins again, with parameters that are set before and meanwhile."""

import pytest
from grasp_cosim import InputError, grasp_system, simulate
from grasp_cosim_ros.model import Model, single_fmu
from support.native_fmus import state_space


@pytest.fixture
def controller(fmus):
    model = Model(single_fmu(fmus / "GraspController.fmu", 1e-3), None, None, recorded=False)
    yield model
    model.close()


def test_all_inputs_of_a_single_fmu_are_free(controller):
    controller.begin({"fmu.position[1]": 0.1})
    assert controller.advance({"fmu.position[1]": 0.2, "fmu.intensity[2]": 1.0})
    assert controller.read(["fmu.position[1]"]) == {"fmu.position[1]": 0.2}
    assert controller.time_ns == 1_000_000


def test_elements_of_arrays_are_free_inputs_too(tmp_path):
    state_space(tmp_path, types=False, binary=False)
    system = single_fmu(tmp_path / "ss.fmu", 1e-3)
    assert {"u[1]", "u[2]", "u[3]"} <= system.by_name["fmu"].values.keys()


def test_each_begin_starts_from_the_values_that_were_set(controller):
    name = "fmu.contact_force.stiffness"
    controller.set(name, 80.0, tunable=True)
    for _ in range(2):
        controller.begin({})
        assert controller.time_ns == 0
        assert controller.session[name] == 80.0
        controller.advance({})


def test_a_fixed_parameter_waits_for_the_end():
    model = Model(grasp_system().without("controller"), 1e-3, 0.002, recorded=True)
    name = "plant.object_width"
    model.begin({})
    with pytest.raises(InputError, match="object_width: is fixed while the node"):
        model.set(name, 0.05, tunable=False)
    assert model.advance({})
    assert not model.advance({})  # the stop time
    model.end()
    model.set(name, 0.05, tunable=False)
    model.begin({})
    assert model.session[name] == 0.05
    model.close()


def test_parameters_are_those_that_no_topic_sets(controller):
    names = controller.parameters(["fmu.position[1]"])
    assert "fmu.position[1]" not in names
    assert names["fmu.position[2]"][1]
    assert names["fmu.contact_force.stiffness"][1]


def test_a_period_is_a_whole_number_of_steps():
    system = grasp_system().without("controller")
    with pytest.raises(InputError, match=r"period = 0.00015: must be a whole number of 0.0001 s"):
        Model(system, 0.00015, None, recorded=False)


def test_steps_within_a_period_have_the_bits_of_a_run():
    """The forces are held for a period, as by a controller of that step."""
    system = grasp_system().with_experiment(stop=0.1)
    slow = system.with_settings({"components.controller.step": 1e-3})
    run = simulate(slow)
    model = Model(system.without("controller"), 1e-3, 0.1, recorded=True)
    model.begin({})
    for row in range(0, len(run.time) - 1, 10):
        forces = {f"plant.force[{i}]": float(run[f"controller.force[{i}]"][row]) for i in (1, 2)}
        model.advance(forces)
    result = model.session.result()
    assert (result["plant.position[1]"] == run["plant.position[1]"]).all()
    model.close()
