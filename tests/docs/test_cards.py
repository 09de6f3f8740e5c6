"""The variable tables of the equation cards follow the declarations."""

import importlib
from pathlib import Path

import pytest
from grasp_fmus.cards import updated

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("folder", "package", "blocks"),
    [
        ("plant", "gripper_plant", ["rigid", "compliant", "movable", "mujoco_box"]),
        ("sensor", "proximity_sensor", ["channel"]),
        ("controller", "grasp_controller", ["series"]),
    ],
)
def test_card_is_up_to_date(folder: str, package: str, blocks: list[str]) -> None:
    card = (ROOT / folder / "README.md").read_text("utf-8")
    modules = {name: importlib.import_module(f"{package}.{name}") for name in blocks}
    assert updated(card, modules) == card, "run: make cards"
