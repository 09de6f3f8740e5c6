"""What a node of ROS 2 costs: two topics there, a step, one topic back, next to only DDS.

In the environment of ROS 2, in the folder of the checkout:

    python -m benchmarks.ros2 FMU     # GraspController.fmu

A peer sends joint states and intensities and waits for the commands; one round trip follows the
other. It speaks in turn to the node of the controller, and to echoes: the same topics, and neither
an FMU nor anything of ours. One echo has the standard executor of rclpy, the other one that of the
node, by events. The differences are the cost of the node.
"""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "ros2/grasp_cosim_ros"
ROUNDS, TRIPS, WARM_UP = 9, 4000, 200
SETTLING = 0.5
"""s."""

WHOS = ("echo", "echo by events", "node")
DOMAIN = os.getpid() % 101


def environment(domain: int) -> dict[str, str]:
    """Its own domain, on this machine only."""
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(PACKAGE), os.environ.get("PYTHONPATH", "")]),
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }


def node_command(fmu: str) -> list[str]:
    """The node of the controller."""
    parameters = {
        "fmu": fmu,
        "topics": PACKAGE / "config/controller.yaml",
        "autostart": "true",
        "timeout": "10.0",
    }
    words = [w for name, value in parameters.items() for w in ("-p", f"{name}:={value}")]
    return [sys.executable, "-m", "grasp_cosim_ros.node", "--ros-args", *words]


def echo(by_events: bool = False) -> None:
    """Answer a sample of each topic by a command."""
    import rclpy
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.experimental.events_executor import EventsExecutor
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64MultiArray

    rclpy.init()
    node = rclpy.create_node("echo")
    publisher = node.create_publisher(Float64MultiArray, "commands", 10)
    came = set()

    def take(topic: str) -> None:
        came.add(topic)
        if len(came) == 2:
            came.clear()
            publisher.publish(Float64MultiArray(data=[1.0, 2.0]))

    node.create_subscription(JointState, "joint_states", lambda _: take("joints"), 10)
    node.create_subscription(Float64MultiArray, "intensity", lambda _: take("light"), 10)
    executor = EventsExecutor() if by_events else SingleThreadedExecutor()
    executor.add_node(node)
    while rclpy.ok():
        executor.spin_once(timeout_sec=0.1)


def trips() -> None:
    """Print the times of round trips in ms."""
    import rclpy
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64MultiArray

    rclpy.init()
    node = rclpy.create_node("peer")
    times: list[float] = []
    sent = 0.0

    def send() -> None:
        nonlocal sent
        sent = time.perf_counter()
        where = [0.1 - 1e-6 * len(times), -0.1]
        names = ["finger_1", "finger_2"]
        joints.publish(JointState(name=names, position=where, velocity=[0.0, 0.0]))
        light.publish(Float64MultiArray(data=[0.1, 0.2]))

    def take(_: object) -> None:
        times.append(time.perf_counter() - sent)
        if len(times) < TRIPS + WARM_UP:
            send()

    node.create_subscription(Float64MultiArray, "commands", take, 10)
    joints = node.create_publisher(JointState, "joint_states", 10)  # it listens before
    light = node.create_publisher(Float64MultiArray, "intensity", 10)
    peers = (joints.get_subscription_count, light.get_subscription_count)
    while not all(count() for count in peers) or not node.count_publishers("commands"):
        rclpy.spin_once(node, timeout_sec=0.05)
    time.sleep(SETTLING)  # until the echo sees the peer, too
    send()
    while len(times) < TRIPS + WARM_UP:
        rclpy.spin_once(node, timeout_sec=1.0)
    print(*(f"{1e3 * t:.4f}" for t in times[WARM_UP:]))
    rclpy.shutdown()


def measured(fmu: str, who: str, number: int) -> list[float]:
    """The times of the round trips with one of them, in ms."""
    given = environment((DOMAIN + number) % 101)
    command = node_command(fmu) if who == "node" else [sys.executable, __file__, who]
    peer = subprocess.Popen(command, env=given)
    try:
        done = subprocess.run(
            [sys.executable, __file__, "trips"],
            env=given, stdout=subprocess.PIPE, text=True, timeout=120, check=True,
        )  # fmt: skip
    finally:
        peer.kill()
        peer.wait()
    return [float(word) for word in done.stdout.split()]


def main(fmu: str) -> None:
    """Print the median and 99.9 % of the round trips, and the cost of the node."""
    found: dict[str, list[list[float]]] = {who: [] for who in WHOS}
    for number in range(ROUNDS):
        for side, who in enumerate(WHOS):
            found[who].append(measured(fmu, who, len(WHOS) * number + side))
    print("round trip      median  99.9 %")
    for who in WHOS:
        middle, high = np.quantile(np.concatenate(found[who]), [0.5, 0.999])
        print(f"{who:14s} {middle:6.3f} ms {high:6.2f} ms")
    medians = {who: [float(np.median(times)) for times in found[who]] for who in WHOS}
    for who in WHOS[:-1]:
        costs = sorted(n - e for n, e in zip(medians["node"], medians[who], strict=True))
        print(
            f"the node takes longer than the {who} by {np.median(costs):.3f} ms, median of {ROUNDS}"
        )
        print(f"rounds, from {costs[0]:.3f} to {costs[-1]:.3f} ms")


if __name__ == "__main__":
    actions = {"echo": echo, "echo by events": lambda: echo(by_events=True), "trips": trips}
    if sys.argv[1:] and sys.argv[1] in actions:
        actions[sys.argv[1]]()
    else:
        main(sys.argv[1])
