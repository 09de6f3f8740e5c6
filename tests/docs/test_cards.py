"""The variable tables of the equation cards follow the declarations."""

from pathlib import Path

import pytest
from grasp_fmus.cards import blocks_by_card, updated
from grasp_fmus.shipped import SHIPPED

ROOT = Path(__file__).parents[2]
CARDS = blocks_by_card()


@pytest.mark.parametrize(
    ("card", "blocks"), CARDS.items(), ids=lambda of: of.parent.name if isinstance(of, Path) else ""
)
def test_card_is_up_to_date(card, blocks):
    text = card.read_text("utf-8")
    assert updated(text, blocks) == text, "run: make cards"


def test_every_block_has_a_card():
    assert set(CARDS) == {ROOT / room / "README.md" for room in ("plant", "sensor", "controller")}
    assert sum(len(blocks) for blocks in CARDS.values()) == len(SHIPPED)
