"""Nodes of ROS 2 in processes of their own, and small peers that speak to them over DDS.

ROS 2 from PyPI lives in an environment of its own, which GRASP_COSIM_TOOLS may name. Each test has
a domain of its own, on this machine only; each process is ended by its id.
"""

import json
import os
import re
import subprocess
import time
from pathlib import Path

import pytest

from .foreign_tools import python_with

ROOT = Path(__file__).parents[2]
VERSION = "7.1.6"
"""Of rclpy, as docs/results/tools.md has it."""

LONGEST = 120.0
"""s until a process that does not end is killed, and the test fails."""

PEER = """
import json, sys, time
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile
given = json.loads(sys.argv[1])
found = {}
rclpy.init()
node = Node("peer")
qos = QoSProfile(depth=100)
end = time.monotonic() + 60.0

def spin(done, seconds=60.0):
    limit = min(end, time.monotonic() + seconds)
    while not done() and time.monotonic() < limit:
        rclpy.spin_once(node, timeout_sec=0.02)
    return done()

def call(type, service, request):
    client = node.create_client(type, service)
    if not client.wait_for_service(30.0):
        raise SystemExit("no service " + service)
    future = client.call_async(request)
    spin(future.done)
    return future.result()

{program}
print("FOUND " + json.dumps(found), flush=True)
rclpy.shutdown()
"""
"""What a peer is made of: `given` is what the test gives, `found` what it gets."""

_domains = iter(range(1, 100))


class Domain:
    """A domain of ROS 2 with its processes."""

    def __init__(self, folder, number):
        self.folder, self._started = folder, []
        self.python = python_with("ros-rclpy", VERSION, "grasp-cosim")
        parts = ["ros2/grasp_cosim_ros", "orchestrator", "plant", "sensor", "controller", "fmus"]
        self.environment = {
            **os.environ,
            "PYTHONPATH": os.pathsep.join(str(ROOT / part) for part in parts),
            "ROS_DOMAIN_ID": str(number),
            "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
            "ROS_LOG_DIR": str(folder / "ros_log"),
            "FASTDDS_BUILTIN_TRANSPORTS": "UDPv4",  # killed processes leave shared memory behind
            "RCUTILS_COLORIZED_OUTPUT": "0",
        }

    def start(self, arguments, log):
        """Start a process of the Python of ROS 2, whose log is that file."""
        with (self.folder / log).open("w") as file:
            process = subprocess.Popen(
                [self.python, *arguments],
                cwd=self.folder,
                env=self.environment,
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.STDOUT,
            )
        process.log = self.folder / log
        self._started.append(process)
        return process

    def node(self, name, **parameters):
        """Start a node with these parameters; by default it starts itself."""
        given = {"autostart": True, "timeout": 20.0, **parameters}
        words = [w for key, value in given.items() for w in ("-p", f"{key}:={_yaml(value)}")]
        start = ["-m", "grasp_cosim_ros.node", "--ros-args", "-r", f"__node:={name}"]
        return self.start([*start, *words], f"{name}.log")

    def peer(self, program, **given):
        """Start a peer with a program, see PEER."""
        return self.start(["-c", PEER.replace("{program}", program), json.dumps(given)], "peer.log")

    def found(self, process):
        """What a peer found, once it has ended."""
        assert self.ended(process) == 0, process.log.read_text("utf-8")
        line = next(
            line
            for line in process.log.read_text("utf-8").splitlines()
            if line.startswith("FOUND ")
        )
        return json.loads(line.removeprefix("FOUND "))

    def ended(self, process):
        """The exit code of a process that ends by itself."""
        try:
            return process.wait(LONGEST)
        except subprocess.TimeoutExpired:
            pytest.fail(process.log.read_text("utf-8"))

    def waits_for(self, process, text):
        """Wait until a process has logged a text, a regular expression."""
        end = time.monotonic() + LONGEST
        while not re.search(text, process.log.read_text("utf-8")):
            if time.monotonic() > end or process.poll() is not None:
                pytest.fail(f"no {text!r} in:\n{process.log.read_text('utf-8')}")
            time.sleep(0.02)

    def close(self):
        """End all processes."""
        for process in self._started:
            if process.poll() is None:
                process.kill()
            process.wait()


def _yaml(value):
    return value if isinstance(value, str) else json.dumps(value)


def lines_of(process, level):
    """The lines of a level that a node has logged."""
    text = process.log.read_text("utf-8")
    return [m[1] for m in re.finditer(rf"^\[{level}\] \[[\d.]+\] \[[\w.]+\]: (.*)$", text, re.M)]


@pytest.fixture
def domain(tmp_path):
    """A domain of ROS 2, whose processes end with the test."""
    worker = os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw")
    made = Domain(tmp_path, (os.getpid() * 7 + int(worker) * 31 + next(_domains)) % 101)
    yield made
    made.close()
