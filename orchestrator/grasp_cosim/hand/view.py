"""How the result of a hand is shown: the fingers on their rays around the object."""

from ..grasp.presets import case_of, words_of
from ..recording.result import View
from .metrics import is_hand
from .pictures import draw_hand
from .scene import hand_scene

VIEW = View(
    "hand",
    lambda result: is_hand(result.by_role),
    draw_hand,
    hand_scene,
    lambda result: {"case": case_of(result.settings)},
    lambda result: words_of(result.settings),
)
