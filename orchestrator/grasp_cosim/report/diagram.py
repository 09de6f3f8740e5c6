"""The connections of a system as a diagram: SVG, components in columns along the data.

A connection goes forward where its source is listed before its target, in the order of execution;
the others are feedback. The column of a component is one more than the furthest of those it gets
forward connections from. A connection to the next column is a curve; one that passes columns goes
around above all boxes, feedback, dashed, below them, each in its own lane.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from math import inf

PORT_PITCH = 20.0
"""px between the ports of a box."""
HEAD_HEIGHT = 46.0
"""px of a box above its first port, for its name and its line."""
FOOT_HEIGHT = 8.0
"""px of a box below its last port."""
BOX_GAP = 26.0
"""px between the boxes of a column."""
COLUMN_GAP = 50.0
"""px between two columns, at least; labels and lanes between them add to it."""
MARGIN = 14.0
"""px around the diagram."""
LANE_PITCH = 18.0
"""px between the lanes above, and between those below all boxes."""
NEST_PITCH = 6.0
"""px between the vertical lines from ports to lanes, which are nested."""
NEST_MARGIN = 18.0
"""px from a box to the nearest of these lines."""
LETTER_WIDTH, SMALL_LETTER_WIDTH = 7.2, 6.0
"""px that a letter in a box, and one in a label, takes, rather too much than too little."""
MIN_LETTERS = 14
"""So many letters are at least as wide as a box."""
TEXT_MARGIN = 9.0
"""px between the left or right edge of a box and its texts."""

ABOVE, DIRECT, BELOW = -1, 0, 1
"""How a connection goes: in a lane above all boxes, to the next column, in a lane below them."""


@dataclass(frozen=True, slots=True)
class Arrow:
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
        return HEAD_HEIGHT + PORT_PITCH * max(len(self.inputs), len(self.outputs)) + FOOT_HEIGHT

    @property
    def text_width(self) -> float:
        """The width in px that the texts take."""
        longest = [max(map(len, names)) for names in (self.inputs, self.outputs) if names]
        room_for_units = 10 if len(longest) == 2 else 6
        port_letters = sum(longest) + room_for_units
        letters = max(len(self.name) + 2, len(self.line), port_letters, MIN_LETTERS)
        return LETTER_WIDTH * letters + 20.0

    def port_y(self, names: list[str], name: str) -> float:
        """The height in px at which a port of these is drawn."""
        return self.y + HEAD_HEIGHT + PORT_PITCH * (names.index(name) + 0.5)


@dataclass(eq=False, slots=True)
class _Route:
    """How an arrow goes between its boxes; `side` is ABOVE, DIRECT or BELOW."""

    arrow: Arrow
    source: _Box
    target: _Box
    side: int

    @property
    def ends(self) -> tuple[float, float, float, float]:
        """Its start x, y and its end x, y."""
        start_y = self.source.port_y(self.source.outputs, self.arrow.source[1])
        end_y = self.target.port_y(self.target.inputs, self.arrow.target[1])
        return self.source.x + self.source.width, start_y, self.target.x, end_y

    @property
    def label(self) -> str:
        """The text on it: with its name where it is far from its ports."""
        if self.side == DIRECT:
            return self.arrow.label
        return ", ".join(text for text in (self.arrow.name, self.arrow.label) if text)

    @property
    def label_width(self) -> float:
        """The width of the label in px."""
        return SMALL_LETTER_WIDTH * len(self.label)


def diagram_svg(
    components: Mapping[str, str], arrows: Sequence[Arrow], units: Mapping[str, str | None]
) -> str:
    """Return an SVG element of a system.

    Args:
        components: In the order of execution, by name the line below the name.
        arrows: The connections between them.
        units: The units of the outputs, by names like plant.gap[1].

    The style is in page/page.css.
    """
    boxes = _boxes(components, arrows)
    routes = _routes(boxes, arrows)
    lanes = Counter(route.side for route in routes)
    top = MARGIN + _lanes_height(lanes[ABOVE])
    bottom, right = _place(list(boxes.values()), routes, top)
    drawn_routes = _drawn_routes(routes, top, bottom)
    drawn_boxes = [_box_svg(box, units) for box in boxes.values()]
    labels = [MARGIN + route.label_width for route in routes if route.side != DIRECT]
    width = MARGIN + max([right, *labels])
    height = bottom + _lanes_height(lanes[BELOW]) + MARGIN
    tips = "".join(_tip_svg(name) for name in ("tip", "tip-back", "tip-fault"))
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="connections" '
        f'width="{width:.0f}" height="{height:.0f}" viewBox="0 0 {width:.0f} {height:.0f}">'
        f"<defs>{tips}</defs>{''.join(drawn_routes)}{''.join(drawn_boxes)}</svg>"
    )


def _boxes(components: Mapping[str, str], arrows: Sequence[Arrow]) -> dict[str, _Box]:
    """The box of each component, with its ports and its column, without its place in px."""
    boxes: dict[str, _Box] = {}
    for name, line in components.items():
        incoming = [arrow for arrow in arrows if arrow.target[0] == name]
        outgoing = [arrow for arrow in arrows if arrow.source[0] == name]
        sources = {arrow.source[0] for arrow in incoming}
        columns = [box.column for source, box in boxes.items() if source in sources]
        boxes[name] = _Box(
            name,
            line,
            column=max(columns) + 1 if columns else 0,
            inputs=list(dict.fromkeys(arrow.target[1] for arrow in incoming)),
            outputs=list(dict.fromkeys(arrow.source[1] for arrow in outgoing)),
        )
    return boxes


def _routes(boxes: Mapping[str, _Box], arrows: Iterable[Arrow]) -> list[_Route]:
    """The route of each arrow."""
    order = list(boxes)
    routes = []
    for arrow in arrows:
        source, target = boxes[arrow.source[0]], boxes[arrow.target[0]]
        if order.index(source.name) >= order.index(target.name):
            side = BELOW
        elif target.column == source.column + 1:
            side = DIRECT
        else:
            side = ABOVE
        routes.append(_Route(arrow, source, target, side))
    return routes


def _lanes_height(lanes: int) -> float:
    """The height in px that so many lanes take."""
    return LANE_PITCH * lanes + NEST_PITCH if lanes else 0.0


def _drawn_routes(routes: Iterable[_Route], top: float, bottom: float) -> list[str]:
    """The routes as SVG, those above and below in lanes: the shortest in the innermost."""
    lane_y = {ABOVE: top - LANE_PITCH, BELOW: bottom + LANE_PITCH, DIRECT: 0.0}
    leaving, arriving = Counter[int](), Counter[int]()
    arriving_in_lanes = Counter(route.target.column for route in routes if route.side != DIRECT)
    parts = []
    for route in sorted(routes, key=_inner_first):
        source, target = route.source.column, route.target.column
        nested = arriving_in_lanes[target] if route.side == DIRECT else arriving[target]
        out = NEST_MARGIN + NEST_PITCH * leaving[source]
        into = NEST_MARGIN + NEST_PITCH * nested
        parts.append(_route_svg(route, lane_y[route.side], out, into))
        if route.side != DIRECT:
            lane_y[route.side] += route.side * LANE_PITCH
            leaving[source] += 1
            arriving[target] += 1
    return parts


def _inner_first(route: _Route) -> tuple[float, float]:
    """The key that sorts short routes first, of equally long ones those nearest to their lane."""
    x, y, to_x, _ = route.ends
    return abs(to_x - x), -route.side * y


def _place(boxes: Sequence[_Box], routes: Sequence[_Route], top: float) -> tuple[float, float]:
    """Place the boxes, each column about a common middle, with space for connections and labels.

    Ports are in the order of the boxes they are connected to, those of feedback lowest. Returned
    are the bottom and the right end in px.
    """
    number_of_columns = len({box.column for box in boxes})
    columns = [[box for box in boxes if box.column == k] for k in range(number_of_columns)]
    heights = [sum(box.height + BOX_GAP for box in column) - BOX_GAP for column in columns]
    bottom, right = top + max(heights, default=0.0), MARGIN
    in_lanes = [route for route in routes if route.side != DIRECT]
    for k, (column, height) in enumerate(zip(columns, heights, strict=True)):
        leaving = sum(route.source.column == k for route in in_lanes)
        arriving = sum(route.target.column == k for route in in_lanes)
        if k > 0:
            right += max([COLUMN_GAP, *_label_rooms(routes, k)])
        if k > 0 or arriving:
            right += NEST_MARGIN + NEST_PITCH * arriving
        y = (top + bottom - height) / 2
        width = max(box.text_width for box in column)
        for box in column:
            box.x, box.y, box.width = right, y, width
            y += box.height + BOX_GAP
        right += width
        if leaving:
            right += NEST_MARGIN + NEST_PITCH * leaving
    for box in boxes:
        outgoing = [(r.arrow.source[1], r.target, r.side) for r in routes if r.source is box]
        incoming = [(r.arrow.target[1], r.source, r.side) for r in routes if r.target is box]
        _sort_ports(box.outputs, outgoing)
        _sort_ports(box.inputs, incoming)
    return bottom, right


def _label_rooms(routes: Iterable[_Route], column: int) -> list[float]:
    """The widths in px that labels need in front of a column."""
    return [
        route.label_width + NEST_MARGIN
        for route in routes
        if route.target.column == column and route.side == DIRECT
    ]


def _sort_ports(names: list[str], connections: Iterable[tuple[str, _Box, int]]) -> None:
    """Sort ports by the height of the boxes at the other ends; lanes are above or below all."""
    heights = dict.fromkeys(names, inf)
    for name, box, side in connections:
        height = box.y + box.height / 2 if side == DIRECT else side * inf
        heights[name] = min(heights[name], height)
    names.sort(key=heights.__getitem__)


def _route_svg(route: _Route, lane_y: float, out: float, into: float) -> str:
    """A connection with its label, and its whole name on hover.

    One in a lane leaves its port by `out` px to its lane and the lane by `into` px to its port; its
    label is in the middle of the lane.
    """
    x, y, to_x, to_y = route.ends
    if route.side == DIRECT:
        middle = (x + to_x) / 2
        bend = f"{middle:.1f} {y:.1f} {middle:.1f} {to_y:.1f}"
        path = f"M{x:.1f} {y:.1f}C{bend} {to_x:.1f} {to_y:.1f}"
        text_x, text_y, anchor = to_x - into, to_y - 5, "end"
    else:
        start, end = x + out, to_x - into
        lane = f"H{start:.1f}V{lane_y:.1f}H{end:.1f}V{to_y:.1f}"
        path = f"M{x:.1f} {y:.1f}{lane}H{to_x:.1f}"
        text_x = max((start + end) / 2, MARGIN + route.label_width / 2)
        text_y, anchor = lane_y + 4, "middle"
    text = ""
    if route.label:
        place = f'x="{text_x:.1f}" y="{text_y:.1f}" text-anchor="{anchor}"'
        text = f"<text {place}>{escape(route.label)}</text>"
    note = ", ".join(part for part in (route.arrow.name, route.arrow.label) if part)
    kind = "connection"
    if route.side == BELOW:
        kind += " back"
    if route.arrow.fault:
        kind += " fault"
    return (
        f'<g class="{kind}"><title>{escape(note)}</title>'
        f'<path d="{path}"/><path class="line" d="{path}"/>{text}</g>'
    )


def _box_svg(box: _Box, units: Mapping[str, str | None]) -> str:
    """A component: its name and its line, inputs on the left, outputs with units on the right."""
    left, right = box.x + TEXT_MARGIN, box.x + box.width - TEXT_MARGIN
    frame = (
        f'<rect x="{box.x:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" '
        f'height="{box.height:.1f}" rx="7"/>'
    )
    name = f'<text class="name" x="{left:.1f}" y="{box.y + 19:.1f}">{escape(box.name)}</text>'
    line = f'<text class="more" x="{left:.1f}" y="{box.y + 34:.1f}">{escape(box.line)}</text>'
    ports = []
    for port in box.inputs:
        y = box.port_y(box.inputs, port) + 4
        ports.append(f'<text x="{left:.1f}" y="{y:.1f}">{escape(port)}</text>')
    for port in box.outputs:
        y = box.port_y(box.outputs, port) + 4
        unit = escape(units.get(f"{box.name}.{port}") or "")
        unit_text = f'<tspan class="unit" dx="5">{unit}</tspan>'
        place = f'x="{right:.1f}" y="{y:.1f}" text-anchor="end"'
        ports.append(f"<text {place}>{escape(port)}{unit_text}</text>")
    return f'<g class="box">{frame}{name}{line}{"".join(ports)}</g>'


def _tip_svg(name: str) -> str:
    """The tip of an arrow, to which the style refers by this name."""
    return (
        f'<marker id="{name}" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" '
        'markerHeight="8" orient="auto" markerUnits="userSpaceOnUse"><path d="M0 .5 8 4 0 7.5z"/>'
        "</marker>"
    )
