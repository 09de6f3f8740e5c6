"""A controller as a lifecycle node: its parameters by service, its states, its diagnostics."""

import pytest
from grasp_cosim import System, simulate
from support.ros2 import ROOT, domain, lines_of

CONFIG = ROOT / "ros2/grasp_cosim_ros/config"

pytestmark = [pytest.mark.interop, pytest.mark.usefixtures("domain")]
__all__ = ["domain"]

LIFECYCLE = """
from lifecycle_msgs.srv import ChangeState, GetState
from lifecycle_msgs.msg import Transition
from rcl_interfaces.srv import SetParameters, GetParameters, DescribeParameters, ListParameters
from rcl_interfaces.msg import Parameter, ParameterValue, ParameterType
from std_msgs.msg import Float64MultiArray
from sensor_msgs.msg import JointState
from diagnostic_msgs.msg import DiagnosticArray

def change(name):
    request = ChangeState.Request()
    request.transition.id = getattr(Transition, "TRANSITION_" + name)
    return call(ChangeState, "/controller/change_state", request).success

def state():
    return call(GetState, "/controller/get_state", GetState.Request()).current_state.label

def put(name, **value):
    value = ParameterValue(**value)
    request = SetParameters.Request(parameters=[Parameter(name=name, value=value)])
    (result,) = call(SetParameters, "/controller/set_parameters", request).results
    return [result.successful, result.reason]

def real(name, number):
    return put(name, type=ParameterType.PARAMETER_DOUBLE, double_value=number)

commands = []
node.create_subscription(Float64MultiArray, "commands", lambda m: commands.append([*m.data]), qos)
joints = node.create_publisher(JointState, "joint_states", qos)
light = node.create_publisher(Float64MultiArray, "intensity", qos)

def sample(position=0.1):
    message = JointState()
    message.name = ["arm", "finger_2", "finger_1"]
    message.position, message.velocity = [0.0, -position, position], [0.0, 0.0, 0.0]
    joints.publish(message)
    other = Float64MultiArray()
    other.data = [1.0, 2.0]
    light.publish(other)

def exchange(position=0.1):
    before = len(commands)
    sample(position)
    return spin(lambda: len(commands) > before)

def meet():
    return spin(lambda: joints.get_subscription_count() and light.get_subscription_count()
                and node.count_publishers("commands"))
"""


def controller(domain, fmus, **parameters):
    return domain.node(
        "controller",
        fmu=str(fmus / "GraspController.fmu"),
        topics=str(CONFIG / "controller.yaml"),
        **parameters,
    )


def commands_of_session(fmus, positions, stiffness):
    """The forces of a session with these positions, whose last step has another stiffness."""
    starts = {f"{name}[{i}]": 0.0 for name in ("position", "velocity", "intensity") for i in (1, 2)}
    system = System(
        components={"c": {"fmu": fmus / "GraspController.fmu", "values": starts}},
        experiment={"step": 1e-3, "stop": 1.0},
    )
    light = {"c.intensity[1]": 1.0, "c.intensity[2]": 2.0}
    places = [{"c.position[1]": p, "c.position[2]": -p} for p in positions]
    with simulate.session(system.with_values(light | places[0])) as session:
        forces = [[session["c.force[1]"], session["c.force[2]"]]]
        for number, place in enumerate(places[1:], 2):
            if number == len(places):
                session.set("c.contact_force.stiffness", stiffness)
            for name, value in place.items():
                session.set(name, value)
            session.step()
            forces.append([session["c.force[1]"], session["c.force[2]"]])
    return forces


def test_a_parameter_of_the_fmu_is_set_by_its_service(domain, fmus):
    node = controller(domain, fmus)
    peer = domain.peer(
        LIFECYCLE
        + """
assert meet()
name = "fmu.contact_force.stiffness"
names = [name]
described = call(DescribeParameters, "/controller/describe_parameters",
                 DescribeParameters.Request(names=names)).descriptors[0]
found["description"] = described.description
found["range"] = [described.floating_point_range[0].from_value,
                  described.floating_point_range[0].to_value]
assert exchange(0.05) and exchange(0.06)
found["set"] = real(name, 980.0)
found["value"] = call(GetParameters, "/controller/get_parameters",
                      GetParameters.Request(names=names)).values[0].double_value
assert exchange(0.07)
found["commands"] = list(commands)
found["beyond"] = real(name, -1.0)
found["unknown"] = real("fmu.nothing", 1.0)
found["kind"] = put(name, type=ParameterType.PARAMETER_STRING, string_value="stiff")
found["last"] = call(GetParameters, "/controller/get_parameters",
                     GetParameters.Request(names=names)).values[0].double_value
""",
    )
    found = domain.found(peer)
    assert found["description"] == "K_i, stiffness of the impedance [N/m]"
    assert found["range"] == [0.0, 1e6]
    assert found["set"] == [True, ""]
    assert found["value"] == 980.0
    assert found["commands"] == commands_of_session(fmus, (0.05, 0.06, 0.07), 980.0)
    assert not found["beyond"][0]
    assert not found["unknown"][0]
    assert not found["kind"][0]
    assert found["last"] == 980.0
    node.terminate()
    assert domain.ended(node) == 0


def test_its_states_are_those_of_a_lifecycle_node(domain, fmus):
    node = controller(domain, fmus, autostart=False)
    peer = domain.peer(
        LIFECYCLE
        + """
found["begin"] = state()
assert change("CONFIGURE")
found["configured"] = state()
found["fixed"] = "fmu.contact_force.stiffness" in call(
    ListParameters, "/controller/list_parameters", ListParameters.Request()).result.names
assert change("ACTIVATE") and meet()
assert exchange(0.05) and exchange(0.06)
found["first run"] = list(commands)
assert change("DEACTIVATE")
spin(lambda: len(commands) > 2, 5.0)
found["safe"] = commands[-1]
found["after"] = state()
assert spin(lambda: not joints.get_subscription_count() + light.get_subscription_count()
            + node.count_publishers("commands"))
del commands[:]
assert change("ACTIVATE") and meet()
assert exchange(0.05) and exchange(0.06)
found["second run"] = list(commands)
assert change("DEACTIVATE") and change("CLEANUP")
found["cleaned"] = state()
assert change("CONFIGURE") and change("CLEANUP")
""",
    )
    found = domain.found(peer)
    assert [found[s] for s in ("begin", "configured", "after", "cleaned")] == [
        "unconfigured",
        "inactive",
        "inactive",
        "unconfigured",
    ]
    assert found["fixed"]
    assert any(found["first run"][-1])
    assert found["safe"] == [0.0, 0.0]
    assert found["second run"] == found["first run"]
    node.terminate()
    assert domain.ended(node) == 0


def test_a_node_that_is_ended_leaves_safe_commands(domain, fmus):
    node = controller(domain, fmus)
    peer = domain.peer(
        LIFECYCLE
        + """
assert meet()
assert exchange(0.05) and exchange(0.06) and any(commands[-1])
print("READY", flush=True)
assert spin(lambda: not any(commands[-1]))
""",
    )
    domain.waits_for(peer, "READY")
    node.terminate()
    assert domain.ended(node) == 0
    domain.found(peer)


def test_a_late_sample_is_counted(domain, fmus):
    node = controller(domain, fmus, timeout=1.0, misses_tolerated=5)
    peer = domain.peer(
        LIFECYCLE
        + """
def counters():
    message = []
    s = node.create_subscription(DiagnosticArray, "/diagnostics", message.append, qos)
    spin(lambda: message, 10.0)
    node.destroy_subscription(s)
    (status,) = message[0].status
    return status.message, {v.key: v.value for v in status.values}

assert meet()
assert exchange()
assert exchange()
before = len(commands)
assert spin(lambda: len(commands) > before, 30.0)  # the step that missed the sample
sample()
spin(lambda: False, 0.3)
found["status"], found["values"] = counters()
"""
    )
    found = domain.found(peer)
    assert int(found["values"]["misses"]) >= 1
    assert found["values"]["late"] == "2"  # of two topics
    node.terminate()
    assert domain.ended(node) == 0
    assert lines_of(node, "ERROR") == []


def test_a_message_that_lacks_a_joint_is_refused_in_one_line(domain, fmus):
    node = controller(domain, fmus)
    peer = domain.peer(
        LIFECYCLE
        + """
assert meet()
message = JointState()
message.name, message.position, message.velocity = ["finger_1"], [0.1], [0.0]
for _ in range(3):
    joints.publish(message)
spin(lambda: False, 0.5)
assert exchange()
"""
    )
    domain.found(peer)
    node.terminate()
    assert domain.ended(node) == 0
    assert lines_of(node, "ERROR") == ["joint_states: no joint 'finger_2'; did you mean finger_1?"]
    assert ", 3 refused," in lines_of(node, "INFO")[-1]


def test_a_peer_with_another_type_is_named(domain, fmus):
    node = controller(domain, fmus)
    domain.peer(
        """
from std_msgs.msg import Float64
publisher = node.create_publisher(Float64, "intensity", qos)
spin(lambda: False, 20.0)
"""
    )
    domain.waits_for(node, "ERROR.*intensity: peer publishes std_msgs/msg/Float64; must be")
    node.terminate()
    assert domain.ended(node) == 0


@pytest.mark.parametrize(
    ("parameters", "text", "reason"),
    [
        ({"fmu": "nowhere.fmu"}, None, "nowhere.fmu"),
        ({}, "fmu.force[2]|fmu.forc[2]", "fmu.forc[2]: no such number; did you mean fmu.force[2]"),
        ({}, "Float64MultiArray|Float64Array", "no such type is installed"),
        ({}, "data:|date:", "date: no such field; did you mean data?"),
        ({"stop": "soon"}, None, "stop = 'soon': must be 0 or a time in s"),
        ({"mode": "often"}, None, "mode = 'often': must be one of lockstep, clock"),
        ({"fmu.contact_force.stiffness": -1.0}, None, "fmu.contact_force.stiffness"),
        ({"without": "plant"}, None, "without = 'plant': must be empty with an FMU"),
    ],
)
def test_what_does_not_fit_is_one_line_and_exit_code_2(domain, fmus, parameters, text, reason):
    topics = (CONFIG / "controller.yaml").read_text("utf-8")
    path = domain.folder / "topics.yaml"
    path.write_text(topics.replace(*text.split("|")) if text else topics, "utf-8")
    given = {"fmu": str(fmus / "GraspController.fmu"), "topics": str(path), **parameters}
    node = domain.node("controller", **given)
    assert domain.ended(node) == 2
    (line,) = lines_of(node, "ERROR")
    assert reason in line
    assert "Traceback" not in node.log.read_text("utf-8")
