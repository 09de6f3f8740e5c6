"""The file of topics: what it says, and what is refused in it."""

from pathlib import Path

import pytest
from grasp_cosim import InputError, grasp_system
from grasp_cosim.interface.units import Conversion
from grasp_cosim.system.scenario import settable_ports
from grasp_cosim_ros.model import single_fmu
from grasp_cosim_ros.topics import read_topics

CONFIG = Path(__file__).parents[2] / "ros2/grasp_cosim_ros/config"
FLOATS = "std_msgs/msg/Float64MultiArray"
FORCES = f"""
subscribe:
  commands:
    type: {FLOATS}
    data:
      - plant.force[1]
      - plant.force[2]
"""


@pytest.fixture(scope="module")
def system():
    return grasp_system().without("controller")


@pytest.fixture
def read(system, tmp_path):
    def read_text(text):
        path = tmp_path / "topics.yaml"
        path.write_text(text, "utf-8")
        return read_topics(path, system)

    return read_text


def test_variables_are_found_in_their_fields(read):
    topics = read(FORCES + "failsafe:\n  plant.force[1]: 0.5\n")
    assert [*topics.inputs] == ["plant.force[1]", "plant.force[2]"]
    assert topics.subscribe[0].type == FLOATS
    assert topics.failsafe == {"plant.force[1]": 0.5}


def test_a_number_is_changed_by_factor_and_offset(read):
    topics = read(
        "subscribe:\n  r:\n    type: std_msgs/msg/Float64\n"
        "    data: {variable: 'plant.force[1]', factor: -2.0, offset: 0.5}\n"
    )
    assert topics.inputs["plant.force[1]"].change == Conversion(-2.0, 0.5)


def test_units_other_than_si_are_converted(tmp_path):
    class Vendor:
        inputs = {"gap": (0.0, "mm")}  # noqa: RUF012
        outputs = {"y": (0.0, "kN")}  # noqa: RUF012

        def step(self, t, inputs):
            return {"y": 0.0}

    from grasp_cosim import System

    system = System(
        components={"v": {"fmu": Vendor, "values": {"gap": 0.0}}},
        experiment={"step": 0.1, "stop": 1.0},
    )
    path = tmp_path / "t.yaml"
    path.write_text(
        "subscribe: {g: {type: std_msgs/msg/Float64, data: v.gap}}\n"
        "publish: {y: {type: std_msgs/msg/Float64, data: v.y}}\n"
    )
    topics = read_topics(path, system)
    assert topics.inputs["v.gap"].change(0.05) == 50.0
    assert topics.outputs["v.y"].change.back(2.0) == 2000.0


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[]", "must be a table"),
        ("a: [", "expected"),
        ("{}", "has no topic"),
        ("topics: {}", "unknown entry 'topics'; valid: failsafe, publish, subscribe"),
        ("subscribe: {c: {data: plant.gap}}", "subscribe.c.type = None: must be like"),
        (f"subscribe: {{c: {{type: {FLOATS}}}}}", "has no variable"),
        (FORCES.replace("[2]", "[3]"), "plant.force[3]: no input without a source"),
        (FORCES.replace("force[2]", "gap[2]"), "plant.gap[2]: no input without a source"),
        (FORCES.replace("force[2]", "force[1]"), "plant.force[1] is in two fields"),
        (FORCES.replace("plant.force[2]", "plnt.force[2]"), "no component 'plnt'"),
        (FORCES + "    depth: 0\n", "depth = 0: must be a whole number from 1 to 1000"),
        (FORCES + "    reliability: fast\n", "must be one of reliable, best_effort"),
        (FORCES + "    joints: [a]\n", "joints: std_msgs/msg/Float64MultiArray has none"),
        (FORCES + "failsafe: {plant.forc: 0}\n", "failsafe.plant.forc: is in no topic"),
        (FORCES + "failsafe: {'plant.force[1]': .nan}\n", "must be a finite number"),
        (
            "publish: {p: {type: std_msgs/msg/Float64, data: 'plant.gab[1]'}}",
            "plant.gab[1]: no such number; did you mean plant.gap[1]",
        ),
        (
            "publish: {p: {type: sensor_msgs/msg/JointState, position: plant.gap}}",
            "joints = []: must be a list of names of joints",
        ),
        (
            "publish: {p: {type: sensor_msgs/msg/JointState, joints: [a, b], "
            "position: ['plant.position[1]']}}",
            "position: must be a list of 2, one for each joint",
        ),
        (
            "publish: {p: {type: sensor_msgs/msg/JointState, joints: [a], data: [x]}}",
            "unknown entry 'data'; valid: effort, position, velocity",
        ),
        (
            "subscribe: {p: {type: trajectory_msgs/msg/JointTrajectory, joints: [a], "
            "positions: ['plant.force[1]']}}",
            "is for publishing; must be sensor_msgs/msg/JointState",
        ),
        (
            "publish: {p: {type: std_msgs/msg/Float64, data: "
            "{variable: 'plant.gap[1]', factor: 0}}}",
            "factor = 0: must not be 0",
        ),
    ],
)
def test_an_error_is_one_line_with_its_place(read, text, message):
    with pytest.raises(InputError) as caught:
        read(text)
    assert message in str(caught.value)
    assert "topics.yaml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_is_named(system, tmp_path):
    with pytest.raises(InputError, match=r"nowhere\.yaml"):
        read_topics(tmp_path / "nowhere.yaml", system)


@pytest.mark.parametrize(
    ("name", "of"),
    [
        ("controller", "GraspController"),
        ("tandem", "GraspControllerTandem"),
        ("plant", "controller"),
        ("without_plant", "plant"),
    ],
)
def test_the_files_of_the_package_fit_what_they_name(fmus, grasp, name, of):
    fmu = fmus / f"{of}.fmu"
    model = single_fmu(fmu, 1e-3) if fmu.exists() else grasp.without(of)
    topics = read_topics(CONFIG / f"{name}.yaml", model)
    free = {port for port, v in settable_ports(model).items() if v.causality == "input"}
    assert topics.inputs.keys() == {*map(str, free)}
    assert topics.failsafe
