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

PITCH, HEAD, FOOT = 20.0, 46.0, 8.0
"""px: between ports, above the first and below the last."""
GAP, GUTTER, MARGIN = 26.0, 50.0, 14.0
"""px: between boxes, between columns without what stands there, around all."""
LANE, NEST, NEAR, BEND = 18.0, 6.0, 18.0, 5.0
"""px: between lanes, between their ways to the ports, from these to a box, radius of corners."""
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


Point = tuple[float, float]


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
        """Return the height at which a port is drawn."""
        return self.y + HEAD + PITCH * (names.index(name) + 0.5)


@dataclass(eq=False, slots=True)
class _Way:
    """A connection between its boxes; kind is "" to the next column, "over" others, or "back"."""

    link: Link
    source: _Box
    target: _Box
    kind: str

    @property
    def start(self) -> Point:
        y = self.source.port(self.source.outputs, self.link.source[1])
        return self.source.x + self.source.width, y

    @property
    def end(self) -> Point:
        return self.target.x, self.target.port(self.target.inputs, self.link.target[1])

    @property
    def label(self) -> str:
        """The text on it: with its name where it is far from its ports."""
        return ", ".join(filter(None, (self.link.name if self.kind else "", self.link.label)))

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
    drawn = _boxes(boxes, links)
    place = {name: k for k, name in enumerate(boxes)}
    ways = []
    for link in links:
        source, target = drawn[link.source[0]], drawn[link.target[0]]
        ahead = "" if target.column == source.column + 1 else "over"
        kind = "back" if place[source.name] >= place[target.name] else ahead
        ways.append(_Way(link, source, target, kind))
    columns = [
        [box for box in drawn.values() if box.column == k]
        for k in range(1 + max((box.column for box in drawn.values()), default=-1))
    ]
    over, back = (sum(way.kind == kind for way in ways) for kind in ("over", "back"))
    top = MARGIN + (LANE * over + NEST if over else 0.0)
    bottom = _stack(columns, top)
    _sort_ports(ways)
    right = _spread(columns, ways)
    lanes = _lanes(ways, top - LANE, bottom + LANE)
    coming = Counter(way.target.column for way in lanes)
    parts = [
        _connection(way, lanes.get(way, ()), NEAR + NEST * coming[way.target.column])
        for way in ways
    ]
    parts += [_drawn(box, units) for box in drawn.values()]
    width = MARGIN + max([right, *(MARGIN + way.wide for way in lanes)])
    height = bottom + (LANE * back + NEST if back else 0.0) + MARGIN
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="connections" '
        f'width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}">'
        f"<defs>{''.join(map(_tip, ('tip', 'tip-back', 'tip-fault')))}</defs>"
        f"{''.join(parts)}</svg>"
    )


def _boxes(boxes: Mapping[str, str], links: Sequence[Link]) -> dict[str, _Box]:
    """The boxes by name, in their columns, with the ports that are connected."""
    drawn: dict[str, _Box] = {}
    for name, line in boxes.items():
        inputs = dict.fromkeys(w.target[1] for w in links if w.target[0] == name)
        outputs = dict.fromkeys(w.source[1] for w in links if w.source[0] == name)
        before = {w.source[0] for w in links if w.target[0] == name} & drawn.keys()
        column = max((drawn[other].column + 1 for other in before), default=0)
        drawn[name] = _Box(name, line, column, list(inputs), list(outputs))
    return drawn


def _stack(columns: Iterable[Sequence[_Box]], top: float) -> float:
    """Put the boxes one below the other, the columns about a common middle; return the bottom."""
    heights = [sum(box.height + GAP for box in column) - GAP for column in columns]
    tallest = max(heights, default=0.0)
    for column, height in zip(columns, heights, strict=True):
        y = top + (tallest - height) / 2
        for box in column:
            box.y = y
            y += box.height + GAP
    return top + tallest


def _sort_ports(ways: Iterable[_Way]) -> None:
    """Put ports in the order of the boxes they are connected to, those of feedback lowest."""
    rank: dict[tuple[_Box, str, str], float] = {}
    for way in ways:
        for box, side, port, other in (
            (way.source, "output", way.link.source[1], way.target),
            (way.target, "input", way.link.target[1], way.source),
        ):
            wanted = {"over": 0.0, "back": float("inf")}.get(way.kind, other.y + other.height / 2)
            rank[box, side, port] = min(rank.get((box, side, port), wanted), wanted)
    for box, side, _ in rank:
        ports = box.inputs if side == "input" else box.outputs
        ports.sort(key=lambda port: rank[box, side, port])


def _spread(columns: Sequence[Sequence[_Box]], ways: Iterable[_Way]) -> float:
    """Put the columns side by side with room for connections and labels; return the right end."""
    leaving = Counter(w.source.column for w in ways if w.kind)
    coming = Counter(w.target.column for w in ways if w.kind)
    x = MARGIN
    for k, column in enumerate(columns):
        labels = [w.wide + NEAR for w in ways if w.target.column == k and not w.kind]
        x += max([GUTTER, *labels]) if k else 0.0
        x += NEAR + NEST * coming[k] if k or coming[k] else 0.0
        width = max(box.needed for box in column)
        for box in column:
            box.x, box.width = x, width
        x += width + (NEAR + NEST * leaving[k] if leaving[k] else 0.0)
    return x


def _lanes(ways: Sequence[_Way], top: float, bottom: float) -> dict[_Way, list[Point]]:
    """The corners of the connections that go around, short ones innermost."""
    places: Counter[tuple[str, int]] = Counter()
    lanes = {}
    for kind, edge, away in (("over", top, -1.0), ("back", bottom, 1.0)):
        of_kind = [way for way in ways if way.kind == kind]
        of_kind.sort(key=lambda w: (abs(w.end[0] - w.start[0]), -away * w.start[1]))
        for k, way in enumerate(of_kind):
            (x, y), (to_x, to_y) = way.start, way.end
            leaving, coming = ("leaving", way.source.column), ("coming", way.target.column)
            out, into = x + NEAR + NEST * places[leaving], to_x - NEAR - NEST * places[coming]
            places.update((leaving, coming))
            lane = edge + away * LANE * k
            lanes[way] = [(x, y), (out, y), (out, lane), (into, lane), (into, to_y), (to_x, to_y)]
    return lanes


def _connection(way: _Way, lane: Sequence[Point], room: float) -> str:
    """A connection with its label, and its whole name on hover.

    The label is in the middle of the lane, or `room` px before the end of a curve.
    """
    (x, y), (to_x, to_y) = way.start, way.end
    middle = (x + to_x) / 2
    path = f"M{x:.1f} {y:.1f}C{middle:.1f} {y:.1f} {middle:.1f} {to_y:.1f} {to_x:.1f} {to_y:.1f}"
    at, anchor = (to_x - room, to_y - 5), "end"
    if lane:
        path, anchor = _rounded(lane), "middle"
        at = max((lane[2][0] + lane[3][0]) / 2, MARGIN + way.wide / 2), lane[2][1] + 4
    text = (
        f'<text x="{at[0]:.1f}" y="{at[1]:.1f}" text-anchor="{anchor}">{escape(way.label)}</text>'
    )
    note = escape(", ".join(filter(None, (way.link.name, way.link.label))))
    kind = f"connection{' back' * (way.kind == 'back')}{' fault' * way.link.fault}"
    return (
        f'<g class="{kind}"><title>{note}</title>'
        f'<path d="{path}"/><path class="line" d="{path}"/>{text if way.label else ""}</g>'
    )


def _rounded(points: Sequence[Point]) -> str:
    def near(corner: Point, point: Point) -> Point:
        """The point BEND px from a corner, straight towards another."""
        x, y = (max(-BEND, min(b - a, BEND)) for a, b in zip(corner, point, strict=True))
        return corner[0] + x, corner[1] + y

    path = "M{:.1f} {:.1f}".format(*points[0])
    for before, corner, after in zip(points, points[1:], points[2:], strict=False):
        path += "L{:.1f} {:.1f}Q{:.1f} {:.1f} {:.1f} {:.1f}".format(
            *near(corner, before), *corner, *near(corner, after)
        )
    return path + "L{:.1f} {:.1f}".format(*points[-1])


def _drawn(box: _Box, units: Mapping[str, str | None]) -> str:
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
