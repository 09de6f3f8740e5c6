"""The variable tables of the equation cards follow the declarations."""

import importlib
from pathlib import Path

import pytest
from grasp_fmus.cards import updated

ROOT = Path(__file__).parent.parent


@pytest.mark.parametrize(
    ("folder", "module"),
    [
        ("plant", "gripper_plant.rigid"),
        ("sensor", "proximity_sensor.channel"),
        ("controller", "grasp_controller.series"),
    ],
)
def test_card_is_up_to_date(folder: str, module: str) -> None:
    card = (ROOT / folder / "README.md").read_text("utf-8")
    block = importlib.import_module(module)
    assert updated(card, block) == card, "run: make cards"
