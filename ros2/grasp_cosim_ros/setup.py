"""The package as colcon installs it."""

from pathlib import Path

from setuptools import setup

NAME = "grasp_cosim_ros"


def files(folder: str) -> list[str]:
    """The files of a folder, as setuptools wants them."""
    return sorted(map(str, Path(folder).glob("*.*")))


setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/config", files("config")),
        (f"share/{NAME}/launch", files("launch")),
    ],
    install_requires=["setuptools"],
    license="MIT",
    description="A ROS 2 node for any FMU, or for a system of FMUs without one component",
    entry_points={"console_scripts": [f"node = {NAME}.node:main"]},
)
