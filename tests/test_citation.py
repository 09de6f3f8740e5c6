"""CITATION.cff is of the same version and licence as the package."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]


def test_version_and_licence_are_those_of_the_package():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    lines = (ROOT / "CITATION.cff").read_text().splitlines()
    entries = dict(line.split(": ", 1) for line in lines if ": " in line and line[0].isalpha())
    assert entries["version"] == project["version"]
    assert entries["license"] == project["license"]
    assert entries["cff-version"] == "1.2.0"
