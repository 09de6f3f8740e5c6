"""Our controller and our plant as two nodes over DDS, in lockstep."""

import csv
import time

import pytest
from grasp_cosim import simulate
from grasp_cosim.grasp.presets import SYSTEM
from support.ros2 import ROOT, domain, lines_of

CONFIG = ROOT / "ros2/grasp_cosim_ros/config"
pytestmark = [pytest.mark.interop, pytest.mark.usefixtures("domain")]
__all__ = ["domain"]


def columns(folder):
    with (folder / "signals.csv").open(newline="") as file:
        rows = [*csv.reader(file)]
    return {name: [row[i] for row in rows[1:]] for i, name in enumerate(rows[0])}


@pytest.fixture
def system_file(fmus, tmp_path):
    """The built-in system with steps of 1 ms, and its FMUs where they are."""
    text = SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/')
    path = tmp_path / "grasp.toml"
    path.write_text(text.replace("step = 1e-4", "step = 1e-3"), "utf-8")
    return path


def pair(domain, system_file, fmus, stop, plant=None, controller=None):
    """Both nodes, started, until `stop` s."""
    common = {"stop": stop}
    first = domain.node(
        "controller",
        fmu=str(fmus / "GraspController.fmu"),
        topics=str(CONFIG / "controller.yaml"),
        **common | (controller or {}),
    )
    second = domain.node(
        "plant",
        system=str(system_file),
        without="controller",
        topics=str(CONFIG / "plant.yaml"),
        initiate=True,
        out=str(domain.folder / "plant"),
        **common | (plant or {}),
    )
    return first, second


def test_lockstep_has_the_bits_of_a_run(domain, system_file, fmus, tmp_path):
    controller, plant = pair(domain, system_file, fmus, 2.5)
    assert (domain.ended(controller), domain.ended(plant)) == (0, 0)
    simulate(system_file, stop=2.5).save(tmp_path / "run")
    over_dds, in_one = columns(tmp_path / "plant"), columns(tmp_path / "run")
    shared = over_dds.keys() & in_one.keys()
    assert len(over_dds["time"]) == 2501
    assert {"plant.contact_force[1]", "sensor_2.intensity", "plant.gap[2]"} <= shared
    assert [name for name in shared if over_dds[name] != in_one[name]] == []
    told = lines_of(plant, "INFO")
    assert "2500 steps, 0 missed, 0 samples late, 0 refused, 0 losses of the peers" in told


def test_a_lost_controller_makes_the_forces_safe(domain, system_file, fmus, tmp_path):
    """From the last command to safe forces it takes exactly misses_tolerated + 1 steps."""
    settings = {"on_loss": "failsafe", "timeout": 2.0, "misses_tolerated": 2}
    controller, plant = pair(domain, system_file, fmus, 20.0, plant=settings)
    wait_for_steps(domain)
    controller.kill()
    domain.waits_for(
        plant, "the peers are lost: no sample of commands within 2 s, 3 steps in a row"
    )
    plant.terminate()
    assert domain.ended(plant) == 0
    forces = columns(tmp_path / "plant")["plant.force[1]"]
    first_safe = len(forces) - next(i for i, f in enumerate(reversed(forces)) if float(f) != 0.0)
    held = forces[first_safe - 1]
    before = forces[:first_safe]
    assert len(before) - max(i for i, f in enumerate(before) if f != held) - 1 == 1 + 2


def test_a_lost_controller_ends_the_plant_by_default(domain, system_file, fmus):
    controller, plant = pair(domain, system_file, fmus, 20.0, plant={"timeout": 1.0})
    wait_for_steps(domain)
    controller.kill()
    assert domain.ended(plant) == 3
    (line,) = lines_of(plant, "ERROR")
    assert line.endswith("no sample of commands within 1 s, 4 steps in a row: stop")


def test_by_the_clock_of_the_computer_both_keep_their_pace(domain, system_file, fmus):
    settings = {"mode": "clock", "period": 0.01, "stall": 60.0, "misses_tolerated": 1000}
    controller, plant = pair(domain, system_file, fmus, 1.0, plant=settings, controller=settings)
    started = time.monotonic()
    assert (domain.ended(controller), domain.ended(plant)) == (0, 0)
    assert time.monotonic() - started >= 0.99  # s, for 100 steps from the first sample on
    for node in (controller, plant):
        last = lines_of(node, "INFO")[-1]
        assert last.startswith("100 steps, ")
        assert last.endswith(" 0 losses of the peers")


def wait_for_steps(domain):
    """Until the plant has had a command."""
    peer = domain.peer(
        """
from std_msgs.msg import Float64MultiArray
got = []
node.create_subscription(Float64MultiArray, "commands", got.append, qos)
found["many"] = spin(lambda: len(got) > 20)
"""
    )
    assert domain.found(peer)["many"]
