"""The published grasp as two nodes: the controller, and plant and sensors, in lockstep.

ros2 launch grasp_cosim_ros grasp.launch.py system:=my_system.toml fmu:=fmus/build/NAME.fmu
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration, PathJoinSubstitution
from launch_ros.actions import Node
from launch_ros.substitutions import FindPackageShare

ARGUMENTS = {
    "system": "The system file with plant and sensors, as grasp-cosim init writes it.",
    "fmu": "The FMU of the controller.",
    "period": "The time in s between two exchanges.",
    "stop": "The time in s at which both nodes end; 0 is never.",
}
DEFAULTS = {"period": "0.001", "stop": "3.0"}


def config(name):
    """The path of a file of topics."""
    return PathJoinSubstitution([FindPackageShare("grasp_cosim_ros"), "config", name])


def node(name, **parameters):
    """A node that starts itself."""
    common = {key: LaunchConfiguration(key) for key in DEFAULTS}
    return Node(
        package="grasp_cosim_ros",
        executable="node",
        name=name,
        output="screen",
        parameters=[{"autostart": True, "timeout": 5.0, **common, **parameters}],
    )


def generate_launch_description():
    """Both nodes."""
    return LaunchDescription(
        [
            *(
                DeclareLaunchArgument(name, description=text, default_value=DEFAULTS.get(name))
                for name, text in ARGUMENTS.items()
            ),
            node("controller", fmu=LaunchConfiguration("fmu"), topics=config("controller.yaml")),
            node(
                "plant",
                system=LaunchConfiguration("system"),
                without="controller",
                topics=config("plant.yaml"),
                initiate=True,
                publish_clock=True,
            ),
        ]
    )
