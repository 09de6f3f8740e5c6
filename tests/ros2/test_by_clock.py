"""A controller that steps by the clock of another node, as by that of Gazebo."""

import pytest
from support.ros2 import ROOT, domain, lines_of

pytestmark = [pytest.mark.interop, pytest.mark.usefixtures("domain")]
__all__ = ["domain"]

GAZEBO = """
from rosgraph_msgs.msg import Clock
from std_msgs.msg import Float64MultiArray
from sensor_msgs.msg import JointState
from trajectory_msgs.msg import JointTrajectory
clock = node.create_publisher(Clock, "/clock", qos)
joints = node.create_publisher(JointState, "joint_states", qos)
light = node.create_publisher(Float64MultiArray, "intensity", qos)
wrist, grip = [], []
node.create_subscription(JointTrajectory, "wrist_controller/joint_trajectory", wrist.append, qos)
node.create_subscription(Float64MultiArray, "gripper_controller/commands", grip.append, qos)

def tick(ms):
    message = Clock()
    message.clock.sec, message.clock.nanosec = 100 + ms // 1000, ms % 1000 * 1_000_000
    clock.publish(message)

def sample():
    message = JointState()
    message.name, message.position = ["finger_1", "finger_2"], [0.1, -0.1]
    message.velocity = [0.0, 0.0]
    joints.publish(message)
    other = Float64MultiArray()
    other.data = [1.0, 2.0]
    light.publish(other)

assert spin(lambda: joints.get_subscription_count() and light.get_subscription_count()
            and clock.get_subscription_count()
            and node.count_publishers("gripper_controller/commands"))
for _ in range(10):  # messages on /clock may get lost
    tick(0)
    spin(lambda: False, 0.1)
sample()
assert spin(lambda: wrist and grip)  # initialised
for number in range(1, 6):
    sample()
    spin(lambda: False, 0.1)
    tick(5 * number)
    assert spin(lambda: len(grip) == 1 + 5 * number and len(wrist) == 1 + 5 * number, 10.0)
found["grip"] = [m.data[0] for m in grip]
found["point"] = [list(wrist[-1].points[0].positions), wrist[-1].points[0].time_from_start.nanosec]
found["joints"] = list(wrist[-1].joint_names)
for number in range(6, 12):  # and no samples any more
    tick(5 * number)
    spin(lambda: len(grip) == 1 + 5 * number, 5.0)
found["lost"] = [m.data[0] for m in grip]
sample()
assert spin(lambda: len(grip) == 57)  # initialised
sample()
spin(lambda: False, 0.1)
tick(60)
assert spin(lambda: len(grip) == 62)
found["back"] = [m.data[0] for m in grip[56:]]
tick(0)  # the simulation begins again
spin(lambda: False, 1.0)
"""


def test_steps_are_those_of_the_clock(domain, fmus):
    node = domain.node(
        "controller",
        fmu=str(fmus / "GraspControllerTandem.fmu"),
        topics=str(ROOT / "ros2/grasp_cosim_ros/config/tandem.yaml"),
        mode="clock",
        use_sim_time=True,
        timeout=0.01,
        misses_tolerated=2,
        on_loss="failsafe",
        resume=True,
    )
    found = domain.found(domain.peer(GAZEBO))
    node.terminate()
    assert domain.ended(node) == 0
    assert found["grip"][0] == 0.0
    assert all(force < 0.0 for force in found["grip"][1:])
    assert found["joints"] == ["wrist"]
    assert found["point"][1] == 1_000_000
    safe = [number for number, force in enumerate(found["lost"]) if force == 0.0 and number]
    # The last sample came before 25 ms: up to 10 ms, and 2 misses more, are held.
    assert safe == [*range(26 + 10 + 2, 56)] or safe == [*range(21 + 10 + 2, 56)]
    assert found["back"] == found["grip"][:6]
    errors = lines_of(node, "ERROR")
    assert "no sample of joint_states, intensity within 0.01 s, 3 steps in a row" in errors[0]
    assert "the clock went back by 0.06 s" in errors[1]
