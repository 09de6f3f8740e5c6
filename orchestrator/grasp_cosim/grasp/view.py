"""How the result of a grasp is shown: the fingers and the object, the case of the paper."""

from ..recording.result import View
from .metrics import is_grasp
from .pictures import draw_grasp
from .presets import case_of, words_of
from .scene import grasp_scene

VIEW = View(
    "grasp",
    lambda result: is_grasp(result.by_role),
    draw_grasp,
    grasp_scene,
    lambda result: {"case": case_of(result.settings)},
    lambda result: words_of(result.settings),
)
