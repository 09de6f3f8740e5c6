"""The page on ROS 2: its two nodes, its file of topics, and its table of parameters."""

import csv
import re
import shlex
from dataclasses import fields
from pathlib import Path

import pytest
from grasp_cosim import cli, grasp_system, simulate
from grasp_cosim_ros.model import single_fmu
from grasp_cosim_ros.settings import DESCRIPTIONS, Settings
from grasp_cosim_ros.topics import read_topics
from support.ros2 import domain, lines_of

PAGE = (Path(__file__).parents[2] / "docs/how_to/ros2.md").read_text("utf-8")

__all__ = ["domain"]


def blocks(kind):
    return re.findall(rf"^```{kind}\n(.*?)^```$", PAGE, re.M | re.DOTALL)


def test_its_file_of_topics_is_valid(fmus, tmp_path):
    (text,) = blocks("yaml")
    path = tmp_path / "topics.yaml"
    path.write_text(text, "utf-8")
    topics = read_topics(path, single_fmu(fmus / "GraspController.fmu", 1e-3))
    assert topics.outputs["fmu.force[2]"].change.back(2.0) == -2.0


def test_it_names_all_parameters_of_the_node():
    names = {field.name for field in fields(Settings)}
    assert names == DESCRIPTIONS.keys()
    table = PAGE.split("The parameters of the node itself are:")[1].split("\n\n")[1]
    first_cells = [line.split("|")[1] for line in table.splitlines()[2:]]
    assert {word for cell in first_cells for word in re.findall(r"`(\w+)`", cell)} == names


@pytest.mark.interop
def test_its_two_nodes_have_the_values_of_a_run(domain, checkout):
    assert cli.main(["init", "my_system.toml"]) == 0
    commands = [b for b in blocks("sh") if b.startswith("python -m grasp_cosim_ros.node")]
    domain.folder = checkout
    nodes = []
    for name, command in zip(("controller", "plant"), commands, strict=True):
        _, _, *words = shlex.split(command.replace("\\\n", " "))
        assert words[:4] == ["grasp_cosim_ros.node", "--ros-args", "-r", f"__node:={name}"], words
        nodes.append(domain.start(["-m", *words, "-p", "timeout:=20.0"], f"{name}.log"))
    assert [domain.ended(node) for node in nodes] == [0, 0]
    shown = blocks("text")[0].replace("\nof the", " of the").splitlines()
    assert shown[0].endswith(lines_of(nodes[0], "INFO")[-2])
    assert shown[1].endswith(lines_of(nodes[1], "INFO")[-1])
    with (checkout / "over_ros/signals.csv").open(newline="") as file:
        rows = [*csv.DictReader(file)]
    slow = grasp_system().with_settings({"components.controller.step": 1e-3})
    run = simulate(slow, stop=2.5)
    for name in ("plant.contact_force[1]", "plant.position[2]"):
        assert [float(row[name]) for row in rows] == run[name].tolist()
