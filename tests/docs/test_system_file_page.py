"""The page on system files lists all keys that the code accepts, with their defaults."""

import re
from dataclasses import fields
from pathlib import Path

import pytest
from grasp_cosim.system.faults import FAULTS
from grasp_cosim.system.overrides import ENTRIES_OF_COMPONENT, ENTRIES_OF_SECTIONS, SECTIONS
from grasp_cosim.system.parts import Acceptance, Initialisation, Realtime

PAGE = (Path(__file__).parents[2] / "docs/reference/system_file.md").read_text("utf-8")
SECTIONS_OF_PAGE = dict(re.findall(r"^## (\S+)\n(.*?)(?=^## |\Z)", PAGE, re.DOTALL | re.MULTILINE))


def rows(section):
    """The cells of the rows of a section by the keys that they begin with."""
    found = {}
    for line in SECTIONS_OF_PAGE[section].splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        for key in re.findall(r"`([\w.]+)`", cells[0]) if line.startswith("| `") else ():
            found[key] = cells
    return found


@pytest.mark.parametrize("section", sorted({*ENTRIES_OF_SECTIONS} - {"roles"}))
def test_a_section_lists_its_keys(section):
    name, entries = section, ENTRIES_OF_SECTIONS[section]
    if section == "components":
        name, entries = "components.NAME", ENTRIES_OF_COMPONENT
    assert {*entries} <= {*rows(name)}
    solver = {"relative_tolerance", "absolute_tolerance", "maximum_step"}
    lists = {"signals"} if section == "record" else set()
    assert {*rows(name)} - {*entries} - solver == lists


def test_each_section_has_a_heading():
    headings = {name.partition(".")[0] for name in SECTIONS_OF_PAGE}
    assert {*SECTIONS} - {"metrics"} <= headings


def test_each_kind_of_fault_is_listed():
    assert {*FAULTS} <= {*rows("faults")}


@pytest.mark.parametrize(
    ("section", "cls"),
    [("realtime", Realtime), ("verdict", Acceptance), ("initialisation", Initialisation)],
)
def test_the_defaults_are_those_of_the_code(section, cls):
    heads = re.search(r"^\| key \|.*$", SECTIONS_OF_PAGE[section], re.MULTILINE)[0]
    column = [cell.strip() for cell in heads.strip("|").split("|")].index("default")
    for field in fields(cls):
        shown = rows(section)[field.name][column].strip("`")
        if isinstance(field.default, bool):
            assert shown == str(field.default).lower()
        elif isinstance(field.default, int | float):
            assert float(shown) == field.default
        elif isinstance(field.default, str):
            assert shown == f'"{field.default}"'
