"""Draws docs/three_layers.svg: the three layers in series, and the loop through the sensors."""

from typing import NamedTuple

SIZE = (860, 230)
"""px, of the picture."""

STYLE = """
:root { --paper: #fbfbf9; --ink: #1d2023; --muted: #6a7078; --lens: #f0f0ec; --accent: #1f5fa8; }
@media (prefers-color-scheme: dark) {
  :root { --paper: #15171a; --ink: #e7e6e2; --muted: #979da6; --lens: #1f2226; --accent: #6ba5e7; }
}
text { font: 13px system-ui, "Segoe UI", "Helvetica Neue", "DejaVu Sans", sans-serif;
  fill: var(--ink); text-anchor: middle; }
.name { font-weight: 600; }
.more { fill: var(--muted); font-size: 12px; }
.signal { fill: var(--accent); font-style: italic; }
.paper { fill: var(--paper); }
.box { fill: var(--lens); stroke: var(--muted); }
.frame { fill: none; stroke: var(--muted); stroke-dasharray: 4 3; }
.line { fill: none; stroke: var(--muted); stroke-width: 1.4; marker-end: url(#tip); }
.tip { fill: var(--muted); }
"""

TIP = (
    '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" '
    'orient="auto"><path class="tip" d="M0 0L8 4L0 8z"/></marker></defs>'
)


class Box(NamedTuple):
    """A part of the loop: its left upper corner and its height in px, and its lines of text."""

    x: int
    y: int
    height: int
    name: str
    function: str
    equations: str


BOXES = (
    Box(24, 40, 70, "layer 3", "simultaneous contact", "Eqs. (2) to (4)"),
    Box(236, 40, 70, "layer 2", "impact reduction", "Eqs. (5), (6)"),
    Box(448, 40, 70, "layer 1", "contact force", "Eq. (7)"),
    Box(690, 40, 70, "gripper", "fingers and object", "Eq. (1)"),
    Box(690, 160, 54, "sensors", "", "Eq. (9)"),
)
WIDTH = 150
"""px, of a box."""

LINES = (
    *("M174 75H234", "M386 75H446", "M598 75H688", "M765 110V158"),
    *("M690 196H80V112", "M292 196V112", "M720 110V146H523V112", "M523 146H120V112"),
)
"""Connections, as paths of SVG."""

SIGNALS = {
    (204, 67): "x_v2",
    (416, 67): "x_vj1",
    (648, 67): "u_j",
    (780, 139): "l_j",
    (450, 212): "intensities xi_j",
    (620, 140): "x_j, x_j'",
}
"""The names of the signals by the px at which they stand."""


def three_layers_svg() -> str:
    """The picture as text."""
    width, height = SIZE
    title = "Three layers in series, and the loop through gripper and sensors"
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{title}" '
        f'width="{width}" height="{height}" viewBox="0 0 {width} {height}">',
        f"<style>{STYLE}</style>{TIP}",
        f'<rect class="paper" width="{width}" height="{height}"/>',
        '<rect class="frame" x="12" y="12" width="600" height="112" rx="6"/>',
        _text(72, 29, "more", "controller"),
    ]
    for box in BOXES:
        middle = box.x + WIDTH // 2
        place = f'x="{box.x}" y="{box.y}" width="{WIDTH}" height="{box.height}"'
        parts.append(f'<rect class="box" {place} rx="4"/>')
        parts.append(_text(middle, box.y + 21, "name", box.name))
        if box.function:
            parts.append(_text(middle, box.y + 40, "", box.function))
        parts.append(_text(middle, box.y + box.height - 12, "more", box.equations))
    parts += [f'<path class="line" d="{path}"/>' for path in LINES]
    parts += [_text(x, y, "signal", name) for (x, y), name in SIGNALS.items()]
    return "\n".join([*parts, "</svg>", ""])


def _text(x: int, y: int, kind: str, text: str) -> str:
    of_kind = f' class="{kind}"' if kind else ""
    return f'<text{of_kind} x="{x}" y="{y}">{text}</text>'
