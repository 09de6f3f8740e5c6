"""The launch file names what there is. ROS's launch is not on PyPI: it is stood in for."""

import sys
from dataclasses import fields
from pathlib import Path
from types import ModuleType, SimpleNamespace

from grasp_cosim_ros.settings import Settings

PACKAGE = Path(__file__).parents[2] / "ros2/grasp_cosim_ros"


def test_it_starts_two_nodes_with_parameters_that_exist(monkeypatch):
    def module(name, **content):
        made = ModuleType(name)
        vars(made).update(content)
        monkeypatch.setitem(sys.modules, name, made)

    def given(**content):
        return SimpleNamespace(**content)

    module("launch", LaunchDescription=list)
    module("launch.actions", DeclareLaunchArgument=lambda name, **_: given(argument=name))
    module("launch.substitutions", LaunchConfiguration=str, PathJoinSubstitution=list)
    module("launch_ros")
    module("launch_ros.actions", Node=given)
    module("launch_ros.substitutions", FindPackageShare=str)
    path = PACKAGE / "launch/grasp.launch.py"
    namespace = {}
    exec(compile(path.read_text("utf-8"), path, "exec"), namespace)
    entries = namespace["generate_launch_description"]()
    arguments = {entry.argument for entry in entries if hasattr(entry, "argument")}
    nodes = {entry.name: entry for entry in entries if hasattr(entry, "executable")}
    assert [*nodes] == ["controller", "plant"]
    known = {field.name for field in fields(Settings)}
    for node in nodes.values():
        (parameters,) = node.parameters
        assert parameters.keys() <= known
        assert (PACKAGE / Path(*parameters["topics"][1:])).exists()
        assert {parameters[name] for name in ("period", "stop")} <= arguments
    assert arguments == {"system", "fmu", "period", "stop"}


def test_the_package_installs_what_it_names():
    text = (PACKAGE / "setup.py").read_text("utf-8")
    assert '"node = {NAME}.node:main"' in text.replace('f"node', '"node')
    assert (PACKAGE / "resource/grasp_cosim_ros").exists()
    xml = (PACKAGE / "package.xml").read_text("utf-8")
    imported = {
        line.split()[1].split(".")[0]
        for file in (PACKAGE / "grasp_cosim_ros").glob("*.py")
        for line in file.read_text("utf-8").splitlines()
        if line.startswith("from ") and "_msgs" in line.split()[1]
    }
    assert imported
    for package in imported - {"rcl_interfaces"}:  # rclpy brings it
        assert f"<exec_depend>{package}</exec_depend>" in xml
