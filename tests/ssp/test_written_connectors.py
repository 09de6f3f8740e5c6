"""The connectors that an archive is written with: kinds, types and units, inside and outside."""

import re
import zipfile

import pytest
from grasp_cosim import System
from grasp_cosim.ssp.to_archive import write_ssp
from ssp.hand_made import archive, component, connect, fmu, linear, structure, system

FMU = fmu(
    "input Real u 0.5 m",
    "output Real y - m",
    "parameter Real k 1.0",
    "input Integer n 3",
    "input Boolean on false",
    "input Enumeration mode 1",
    "output Enumeration state -",
    "parameter Enumeration kind 1",
    "output Boolean high -",
)


@pytest.fixture
def written(tmp_path):
    """An archive with these connectors and connections of its system, written anew: its text."""

    def write(connectors="", connections=""):
        top = system("top", component("a"), connections, connectors)
        loaded = System.load(archive(tmp_path, structure(top), {"a": FMU}))
        write_ssp(loaded, tmp_path / "anew.ssp")
        with zipfile.ZipFile(tmp_path / "anew.ssp") as file:
            return file.read("SystemStructure.ssd").decode()

    return write


def connectors(text):
    """Kind, type and unit by name, of the system first and then of its component."""
    head, _, component_part = text.partition("<ssd:Elements>")
    listed = []
    for part in (head, component_part):
        found = {}
        for attributes, content in re.findall(
            r"<ssd:Connector ([^>]*?)(?:/>|>(.*?)</ssd:Connector>)", part, re.DOTALL
        ):
            name, kind = (re.search(f'{key}="([^"]*)"', attributes)[1] for key in ("name", "kind"))
            of_type = re.search(r'<ssc:(\w+)(?: unit="(\w+)")?', content)
            found[name] = (kind, *(of_type.groups() if of_type else (None, None)))
        listed.append(found)
    return listed


def test_those_of_a_component_have_the_types_of_its_variables(written):
    """Of an enumeration the items are in the FMU; as a parameter it has no connector at all."""
    of_system, of_component = connectors(written())
    assert of_system == {}
    assert of_component == {
        "u": ("input", "Real", "m"),
        "y": ("output", "Real", "m"),
        "k": ("parameter", "Real", None),
        "n": ("input", "Integer", None),
        "on": ("input", "Boolean", None),
        "mode": ("input", None, None),
        "state": ("output", None, None),
        "high": ("output", "Boolean", None),
    }


def test_those_of_the_system_have_the_types_of_what_is_behind_them(written):
    drawn = "".join(
        connect(name, f"a/{behind}")
        for name, behind in (("U", "u"), ("K", "k"), ("N", "n"), ("On", "on"), ("Mode", "mode"))
    )
    drawn += connect("a/y", "Y") + connect("a/state", "State") + connect("a/high", "High")
    listed = (
        "input U Real mm; parameter K; input N; input On; input Mode; "
        "output Y Real mm; output State; output High"
    )
    of_system, _ = connectors(written(listed, drawn))
    assert of_system == {
        "U": ("input", "Real", "mm"),
        "K": ("parameter", "Real", None),
        "N": ("input", "Integer", None),
        "On": ("input", "Boolean", None),
        "Mode": ("input", None, None),
        "Y": ("output", "Real", "mm"),
        "State": ("output", None, None),
        "High": ("output", "Boolean", None),
    }


@pytest.mark.parametrize(("factor", "offset"), [(1.0, 0.0), (2.0, 0.0), (1.0, 0.5), (-3.0, 0.25)])
def test_a_change_on_the_way_comes_back(written, tmp_path, factor, offset):
    written("input U Real", connect("U", "a/u", linear(factor, offset)))
    again = System.load(tmp_path / "anew.ssp").with_values({"U": 4.0})
    assert again.start("a.u") == factor * 4.0 + offset
