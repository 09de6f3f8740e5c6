"""The table of symbols has the variables, units and defaults that the blocks declare."""

import re
from pathlib import Path

import pytest
from grasp_cosim.fmu_export.contract import declared
from grasp_cosim.fmu_export.shipped import blocks

PAGE = Path(__file__).parents[2] / "docs/reference/symbols.md"
BLOCKS = {"plant": "GripperPlant", "sensor": "ProximitySensor", "controller": "GraspController"}
ROW = re.compile(
    r"^\| \$.*?\$ \|.*?\| `(\w+)\.(.*?)` \| (.*?) \| ?(.*?) ?\| (.*?) ?\|$", re.MULTILINE
)
ROWS = ROW.findall(PAGE.read_text("utf-8"))


@pytest.mark.parametrize(("component", "name", "unit", "default", "equation"), ROWS)
def test_a_symbol_is_as_declared(component, name, unit, default, equation):
    fields = {field.name: field for field in declared(blocks()[BLOCKS[component]])}
    field = fields[name]
    start = field.start if isinstance(field.start, tuple) else (field.start,)
    shown = "" if field.start is None else ", ".join(map(str, dict.fromkeys(start)))
    assert (unit, default) == (field.unit, shown)


def test_the_parameters_of_the_published_equations_are_all_there():
    listed = {(component, name) for component, name, *_ in ROWS}
    for component, block in BLOCKS.items():
        for field in declared(blocks()[block]):
            symbol = re.match(r"[MDKmlWnx]_?\w*,", field.description)
            published = not field.name.startswith(
                ("friction", "actuator", "baumgarte", "initial_po")
            )
            if symbol and published and field.causality == "parameter":
                assert (component, field.name) in listed, field.description
