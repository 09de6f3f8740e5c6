"""How the result of a gripper in tandem is shown: as a grasp, with the wrist that carries it."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from ..grasp.pictures import Line, draw_grasp
from ..grasp.presets import case_of, words_of
from ..grasp.scene import grasp_scene
from ..metrics.metric import resolved
from ..recording.result import Result, View
from ..report.traces_page import Scene
from .metrics import WRIST, is_tandem

if TYPE_CHECKING:
    from matplotlib.figure import Figure

HOW_IT_IS_SEEN = (
    "The object is drawn from face to face, where the gaps say it is; the beam that carries both "
    "fingers hangs from the wrist"
)

CARRIER = Line(WRIST, "wrist", "#2e8b57", "-.")
"""How the wrist is drawn next to the target."""


def draw_tandem(run: Result, path: Path | None = None) -> Figure:
    """The picture of a grasp, with where the wrist is.

    With a `path` the figure is written there, see report.plot.save_figure().
    """
    return draw_grasp(run, path, CARRIER)


def tandem_scene(result: Result) -> Scene | None:
    """The scene of a grasp, its fingers on the wrist; None where it is no gripper in tandem."""
    scene = grasp_scene(result, HOW_IT_IS_SEEN) if is_tandem(result.by_role) else None
    if scene is None:
        return None
    wrist = resolved(WRIST, result.roles)
    signals = [*scene.state["signals"], wrist]
    to_si = dict(scene.state["toSi"])
    if conversion := result.to_si.get(wrist):
        to_si[wrist] = conversion._asdict()
    return replace(
        scene,
        title="Gripper in tandem",
        scripts=f"{scene.scripts}\n{_script()}",
        state={**scene.state, "signals": signals, "toSi": to_si, "wrist": wrist},
        first_signals=[*scene.first_signals, wrist],
    )


def _script() -> str:
    return (files(__package__) / "page" / "tandem.js").read_text("utf-8")


VIEW = View(
    "tandem",
    lambda result: is_tandem(result.by_role),
    draw_tandem,
    tandem_scene,
    lambda result: {"case": case_of(result.settings)},
    lambda result: words_of(result.settings),
)
