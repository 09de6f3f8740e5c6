"""The connections of a system as a diagram: SVG, components in columns along the data.

A connection goes forward where its source is listed before its target, in the order of execution;
the others are feedback. The column of a component is one more than the furthest of those it gets
forward connections from. A connection to the next column is a curve; one that passes columns goes
around above all boxes, feedback, dashed, below them, each in a lane of its own.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from math import inf

PITCH, HEAD, FOOT = 20.0, 46.0, 8.0
"""px: between ports, above the first and below the last."""
GAP, GUTTER, MARGIN = 26.0, 50.0, 14.0
"""px: between boxes, between columns without what stands there, around all."""
LANE, NEST, NEAR = 18.0, 6.0, 18.0
"""px: between lanes, between their ways to the ports, from these to a box."""
LETTER, SMALL = 7.2, 6.0
"""px a letter in a box and in a label takes, rather too much than too little."""


@dataclass(frozen=True, slots=True)
class Link:
    """A connection between ports (component, variable); `label` stands on it, if there is one.

    `fault` marks a connection that is disturbed.
    """

    source: tuple[str, str]
    target: tuple[str, str]
    label: str = ""
    fault: bool = False

    @property
    def name(self) -> str:
        """Like plant.gap[1] → sensor_1.gap."""
        return f"{'.'.join(self.source)} → {'.'.join(self.target)}"


@dataclass(eq=False, slots=True)
class _Box:
    """A component; x, y is the upper left corner. The ports are from top to bottom."""

    name: str
    line: str
    column: int
    inputs: list[str]
    outputs: list[str]
    x: float = 0.0
    y: float = 0.0
    width: float = 0.0

    @property
    def height(self) -> float:
        return HEAD + PITCH * max(len(self.inputs), len(self.outputs)) + FOOT

    @property
    def needed(self) -> float:
        """The width that the texts take."""
        longest = [max(map(len, names)) for names in (self.inputs, self.outputs) if names]
        letters = sum(longest) + (10 if len(longest) == 2 else 6)
        return LETTER * max(len(self.name) + 2, len(self.line), letters, 14) + 20.0

    def port(self, names: list[str], name: str) -> float:
        """The height at which a port is drawn."""
        return self.y + HEAD + PITCH * (names.index(name) + 0.5)


@dataclass(eq=False, slots=True)
class _Way:
    """A connection between its boxes; away is 0 to the next column, -1 above and 1 below all."""

    link: Link
    source: _Box
    target: _Box
    away: int

    @property
    def ends(self) -> tuple[float, float, float, float]:
        """Its start x, y and its end x, y."""
        start = self.source.port(self.source.outputs, self.link.source[1])
        end = self.target.port(self.target.inputs, self.link.target[1])
        return self.source.x + self.source.width, start, self.target.x, end

    @property
    def label(self) -> str:
        """The text on it: with its name where it is far from its ports."""
        return ", ".join(filter(None, (self.link.name if self.away else "", self.link.label)))

    @property
    def wide(self) -> float:
        """The width of the label in px."""
        return SMALL * len(self.label)


def diagram_svg(
    boxes: Mapping[str, str], links: Sequence[Link], units: Mapping[str, str | None]
) -> str:
    """Return an SVG element: `boxes` are the components in the order of execution, a line on each.

    `units` are those of the outputs, by names like plant.gap[1]. The style is in page/page.css.
    """
    drawn: dict[str, _Box] = {}
    for name, line in boxes.items():
        inputs = dict.fromkeys(w.target[1] for w in links if w.target[0] == name)
        outputs = dict.fromkeys(w.source[1] for w in links if w.source[0] == name)
        before = {w.source[0] for w in links if w.target[0] == name} & drawn.keys()
        column = max((drawn[other].column + 1 for other in before), default=0)
        drawn[name] = _Box(name, line, column, [*inputs], [*outputs])
    place, ways = [*boxes], []
    for link in links:
        source, target = drawn[link.source[0]], drawn[link.target[0]]
        ahead = -1 if target.column != source.column + 1 else 0
        back = place.index(source.name) >= place.index(target.name)
        ways.append(_Way(link, source, target, 1 if back else ahead))
    over, under = (sum(way.away == away for way in ways) for away in (-1, 1))
    top = MARGIN + (LANE * over + NEST if over else 0.0)
    bottom, right = _put(list(drawn.values()), ways, top)
    parts, lanes = list[str](), {-1: top - LANE, 1: bottom + LANE, 0: 0.0}
    leaving, coming = Counter[int](), Counter[int]()
    free = Counter(way.target.column for way in ways if way.away)
    for way in sorted(ways, key=lambda w: (abs(w.ends[2] - w.ends[0]), -w.away * w.ends[1])):
        k, j = way.source.column, way.target.column
        nested = coming[j] if way.away else free[j]
        out, into = NEAR + NEST * leaving[k], NEAR + NEST * nested
        parts.append(_drawn(way, lanes[way.away], out, into))
        lanes[way.away] += way.away * LANE  # short ones innermost
        leaving[k] += abs(way.away)
        coming[j] += abs(way.away)
    parts += [_box(box, units) for box in drawn.values()]
    width = MARGIN + max([right, *(MARGIN + way.wide for way in ways if way.away)])
    height = bottom + (LANE * under + NEST if under else 0.0) + MARGIN
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="connections" '
        f'width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}">'
        f"<defs>{''.join(map(_tip, ('tip', 'tip-back', 'tip-fault')))}</defs>"
        f"{''.join(parts)}</svg>"
    )


def _put(boxes: Sequence[_Box], ways: Sequence[_Way], top: float) -> tuple[float, float]:
    """Put the boxes, each column about a common middle, with room for connections and labels.

    Ports are in the order of the boxes they are connected to, those of feedback lowest. Returned
    are the bottom and the right end.
    """
    columns = [[b for b in boxes if b.column == k] for k in range(len({b.column for b in boxes}))]
    heights = [sum(box.height + GAP for box in column) - GAP for column in columns]
    bottom, right = top + max(heights, default=0.0), MARGIN
    for k, (column, height) in enumerate(zip(columns, heights, strict=True)):
        leaving = sum(w.source.column == k for w in ways if w.away)
        coming = sum(w.target.column == k for w in ways if w.away)
        labels = [w.wide + NEAR for w in ways if w.target.column == k and not w.away]
        right += max([GUTTER, *labels]) if k else 0.0
        right += NEAR + NEST * coming if k or coming else 0.0
        y = (top + bottom - height) / 2
        for box in column:
            box.x, box.y, box.width = right, y, max(box.needed for box in column)
            y += box.height + GAP
        right += column[0].width + (NEAR + NEST * leaving if leaving else 0.0)
    for box in boxes:
        _sort(box.outputs, ((w.link.source[1], w.target, w.away) for w in ways if w.source is box))
        _sort(box.inputs, ((w.link.target[1], w.source, w.away) for w in ways if w.target is box))
    return bottom, right


def _sort(names: list[str], ways: Iterable[tuple[str, _Box, int]]) -> None:
    wanted = dict.fromkeys(names, inf)
    for name, other, away in ways:
        wanted[name] = min(wanted[name], away * inf if away else other.y + other.height / 2)
    names.sort(key=wanted.__getitem__)


def _drawn(way: _Way, lane: float, out: float, into: float) -> str:
    """A connection with its label, and its whole name on hover.

    One that goes around leaves its ports by so many px to its lane, the label in the middle of it.
    """
    x, y, to_x, to_y = way.ends
    middle = (x + to_x) / 2
    path = f"M{x:.1f} {y:.1f}C{middle:.1f} {y:.1f} {middle:.1f} {to_y:.1f} {to_x:.1f} {to_y:.1f}"
    at, anchor = (to_x - into, to_y - 5), "end"
    if way.away:
        start, end = x + out, to_x - into
        path = f"M{x:.1f} {y:.1f}H{start:.1f}V{lane:.1f}H{end:.1f}V{to_y:.1f}H{to_x:.1f}"
        at, anchor = (max((start + end) / 2, MARGIN + way.wide / 2), lane + 4), "middle"
    text = (
        f'<text x="{at[0]:.1f}" y="{at[1]:.1f}" text-anchor="{anchor}">{escape(way.label)}</text>'
    )
    note = escape(", ".join(filter(None, (way.link.name, way.link.label))))
    kind = f"connection{' back' * (way.away > 0)}{' fault' * way.link.fault}"
    return (
        f'<g class="{kind}"><title>{note}</title>'
        f'<path d="{path}"/><path class="line" d="{path}"/>{text if way.label else ""}</g>'
    )


def _box(box: _Box, units: Mapping[str, str | None]) -> str:
    left, right = box.x + 9, box.x + box.width - 9
    parts = [
        f'<g class="box"><rect x="{box.x:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" '
        f'height="{box.height:.1f}" rx="7"/>',
        f'<text class="name" x="{left:.1f}" y="{box.y + 19:.1f}">{escape(box.name)}</text>',
        f'<text class="more" x="{left:.1f}" y="{box.y + 34:.1f}">{escape(box.line)}</text>',
    ]
    parts += [
        f'<text x="{left:.1f}" y="{box.port(box.inputs, port) + 4:.1f}">{escape(port)}</text>'
        for port in box.inputs
    ]
    parts += [
        f'<text x="{right:.1f}" y="{box.port(box.outputs, port) + 4:.1f}" text-anchor="end">'
        f'{escape(port)}<tspan class="unit" dx="5">'
        f"{escape(units.get(f'{box.name}.{port}') or '')}</tspan></text>"
        for port in box.outputs
    ]
    return "".join([*parts, "</g>"])


def _tip(name: str) -> str:
    return (
        f'<marker id="{name}" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" '
        'markerHeight="8" orient="auto" markerUnits="userSpaceOnUse"><path d="M0 .5 8 4 0 7.5z"/>'
        "</marker>"
    )
