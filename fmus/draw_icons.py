"""Draws the icons of the FMUs.

    python fmus/draw_icons.py [FOLDER]

One picture per FMU, NAME.png, and one for all proxies, 256 x 256 px with a transparent background,
by default into grasp_fmus/icons. FMI tools show them small, on white as well as on dark: few
shapes, thick lines, and colours of middle brightness.
"""

import sys
from collections.abc import Callable
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrow, FancyBboxPatch, Polygon

BLUE, RED, AMBER, GREY = "#2f74c0", "#cf4434", "#e09b24", "#7d8893"
"""Finger 1 is blue and finger 2 red, as in the figures."""

WHITE, BLACK = "#ffffff", "#22272c"
SIZE = 256
"""Width and height in px; the pictures are drawn in these coordinates, y upwards."""
ROUND = "round,pad=0,rounding_size=10"
"""The style of a box, radius in px."""


def main(folder: Path) -> None:
    """Draw every icon into the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in ICONS.items():
        figure = Figure(figsize=(SIZE / 100, SIZE / 100), dpi=100)
        axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
        axes.set(xlim=(0, SIZE), ylim=(0, SIZE))
        axes.set_axis_off()
        draw(axes)
        # Without the version of matplotlib the same drawing gives the same bytes.
        figure.savefig(folder / f"{name}.png", transparent=True, metadata={"Software": None})


def gripper_plant(axes: Axes) -> None:
    """Two fingers under a wrist, an object between them."""
    _gripper(axes)
    _box(axes, 84, 24, 88, 108, AMBER)
    _arrow(axes, 56, 78, 26, 0, RED, 16)
    _arrow(axes, 200, 78, -26, 0, BLUE, 16)


def gripper_plant_compliant(axes: Axes) -> None:
    """The object gives where the fingers press."""
    _gripper(axes)
    waist = [(84, 24), (172, 24), (172, 54), (146, 78), (172, 102), (172, 132)]
    axes.add_patch(Polygon([*waist, (84, 132), (84, 102), (110, 78), (84, 54)], color=AMBER, lw=0))
    _arrow(axes, 56, 78, 48, 0, RED, 16)
    _arrow(axes, 200, 78, -48, 0, BLUE, 16)


def gripper_plant_movable(axes: Axes) -> None:
    """One finger alone pushes the object over an edge, on a floor."""
    _gripper(axes)
    _box(axes, 70, 2, 116, 18, GREY)
    axes.add_patch(Polygon([(90, 40), (162, 22), (186, 118), (114, 136)], color=AMBER, lw=0))
    _arrow(axes, 56, 92, 46, 0, RED, 16)


def gripper_plant_mujoco(axes: Axes) -> None:
    """The object as a mesh, as a simulator of bodies shows it."""
    gripper_plant(axes)
    for y in (78, 114):
        axes.plot([102, 154], [y, y - 36], color=WHITE, lw=6, solid_capstyle="round")
    frame = [(102, 42), (154, 42), (154, 114), (102, 114)]
    axes.add_patch(Polygon(frame, fill=False, edgecolor=WHITE, lw=6, joinstyle="round"))
    axes.plot([102, 154], [78, 78], color=WHITE, lw=6, solid_capstyle="round")


def proximity_sensor(axes: Axes) -> None:
    """The face of a sensor, its cone of light on a surface, a ray that comes back."""
    axes.add_patch(Polygon([(62, 178), (210, 236), (210, 84)], color=AMBER, alpha=0.5, lw=0))
    _box(axes, 202, 16, 40, 224, GREY)
    _box(axes, 14, 32, 70, 192, BLUE)
    _box(axes, 34, 156, 36, 44, AMBER)
    _box(axes, 34, 56, 36, 44, WHITE)
    axes.plot([84, 198], [172, 140], color=RED, lw=10, solid_capstyle="round")
    _arrow(axes, 198, 140, -108, -56, RED, 13)


def grasp_controller(axes: Axes) -> None:
    """Three layers, one after the other, each an impedance."""
    _layers(axes)
    for bottom in (184, 99, 14):
        _spring(axes, bottom + 29)


def grasp_controller_adaptive(axes: Axes) -> None:
    """The same, but to the first a white face and a black one are equal."""
    _layers(axes)
    for bottom in (99, 14):
        _spring(axes, bottom + 29)
    _box(axes, 42, 194, 58, 38, WHITE)
    _box(axes, 156, 194, 58, 38, BLACK)
    for y in (206, 220):
        axes.plot([114, 142], [y, y], color=WHITE, lw=6, solid_capstyle="round")


def proxy(axes: Axes) -> None:
    """A block in outline, and what goes to and fro between it and the real one."""
    outline = FancyBboxPatch((26, 150), 204, 80, ROUND, fill=False, edgecolor=BLUE, lw=9, ls=":")
    axes.add_patch(outline)
    _box(axes, 20, 16, 216, 84, BLUE)
    _arrow(axes, 92, 148, 0, -44, RED, 16)
    _arrow(axes, 164, 102, 0, 44, AMBER, 16)


ICONS: dict[str, Callable[[Axes], None]] = {
    "GripperPlant": gripper_plant,
    "GripperPlantCompliant": gripper_plant_compliant,
    "GripperPlantMovable": gripper_plant_movable,
    "GripperPlantMuJoCo": gripper_plant_mujoco,
    "ProximitySensor": proximity_sensor,
    "GraspController": grasp_controller,
    "GraspControllerAdaptive": grasp_controller_adaptive,
    "Proxy": proxy,
}
"""The function that draws the icon of each FMU, and of all proxies."""


def _gripper(axes: Axes) -> None:
    _box(axes, 20, 16, 40, 184, RED)
    _box(axes, 196, 16, 40, 184, BLUE)
    _box(axes, 100, 196, 56, 48, GREY)
    _box(axes, 12, 168, 232, 44, GREY)


def _layers(axes: Axes) -> None:
    for top in (186, 101):
        _arrow(axes, 128, top, 0, -28, GREY, 16)
    for bottom, color in ((184, AMBER), (99, RED), (14, BLUE)):
        _box(axes, 24, bottom, 208, 58, color)


def _spring(axes: Axes, middle: float) -> None:
    x = [46, 80, 92, 116, 140, 164, 176, 210]
    y = [0, 0, 15, -15, 15, -15, 0, 0]
    axes.plot(x, [middle + dy for dy in y], color=WHITE, lw=7, solid_joinstyle="round")


def _box(axes: Axes, left: float, bottom: float, width: float, height: float, color: str) -> None:
    axes.add_patch(FancyBboxPatch((left, bottom), width, height, ROUND, color=color, lw=0))


def _arrow(axes: Axes, x: float, y: float, dx: float, dy: float, color: str, width: float) -> None:
    """An arrow from (x, y) that ends at (x + dx, y + dy)."""
    axes.add_patch(
        FancyArrow(
            x, y, dx, dy, width=width, head_width=3 * width, head_length=1.6 * width,
            length_includes_head=True, color=color, lw=0,
        )
    )  # fmt: skip


if __name__ == "__main__":
    main(Path(sys.argv[1]) if sys.argv[1:] else Path(__file__).parent / "grasp_fmus" / "icons")
