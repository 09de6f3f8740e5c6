"""How the result of a hand is shown: fingers on rays around the object, from above."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files

from ..grasp.presets import case_of, words_of
from ..grasp.scene import scene_of_fingers
from ..metrics.metric import resolved
from ..recording.result import Result, View
from ..report.page import Scene
from .metrics import directions, is_disc, is_hand
from .pictures import draw_hand

SEEN = (
    "The hand is seen from above; the object is drawn from face to face, where the gaps say it is"
)


def hand_scene(result: Result) -> Scene | None:
    """Return the scene of a result; None where it is no hand."""
    signals = result.by_role
    if not is_hand(signals):
        return None
    names = ("object_position[1]", "object_position[2]", "object_angle")
    where = [resolved(f"plant.{name}", result.roles) for name in names]
    state = {"where": where, "angles": directions(signals), "disc": is_disc(signals)}
    made = scene_of_fingers(result, "Hand", SEEN, where, state)
    return replace(
        made,
        style=made.style + _text("hand.css"),
        scripts=f"{made.scripts}\n{_text('hand.js')}",
        shown=[name for name in made.shown if name not in where],
    )


def _text(name: str) -> str:
    return (files(__package__) / "page" / name).read_text("utf-8")


VIEW = View(
    "hand",
    lambda result: is_hand(result.by_role),
    draw_hand,
    hand_scene,
    lambda result: {"case": case_of(result.settings)},
    lambda result: words_of(result.settings),
)
