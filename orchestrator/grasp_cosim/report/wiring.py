"""The wiring of a system as a diagram: SVG, components from left to right along the data.

A connection goes forward where its source is listed before its target, in the order of execution;
the others are feedback and pass below. Components are put into columns by the longest chain of
forward connections that leads to them; connections that pass a column keep a lane in it; the order
within a column follows the mean of the neighbours (Sugiyama, Tagawa and Toda, IEEE Trans. SMC-11,
1981).
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import pairwise

PITCH, HEAD, FOOT = 20.0, 46.0, 8.0
"""px: between ports, above the first and below the last."""
GAP, GUTTER, LANE, NEST, MARGIN = 26.0, 90.0, 18.0, 6.0, 14.0
"""px: between boxes, between columns, between feedback below and beside boxes, around all."""
LETTER = 7.2
"""px a letter takes, rather too much than too little."""
SWEEPS = 6
"""Passes that order and then align the columns; more change little."""

STYLE = """
.diagram text{font:12px var(--sans);fill:var(--ink)}
.diagram .box rect{fill:var(--lens);stroke:var(--muted)}
.diagram .box .name{font-weight:600;font-size:13px}
.diagram .box .more,.diagram .box .unit{fill:var(--muted);font-size:11px}
.diagram .connection path{fill:none;stroke:transparent;stroke-width:11}
.diagram .connection .line{stroke:var(--muted);stroke-width:1.3;marker-end:url(#tip)}
.diagram .connection text{font-size:11px;paint-order:stroke;stroke:var(--paper);stroke-width:4px;
stroke-linejoin:round}
.diagram .back .line{stroke:var(--back);stroke-dasharray:6 3;marker-end:url(#tip-back)}
.diagram .back text{fill:var(--back)}
.diagram .fault .line{stroke:var(--fault);marker-end:url(#tip-fault)}
.diagram .fault text{fill:var(--fault)}
.diagram .connection:hover .line{stroke-width:3}
#tip path{fill:var(--muted)}#tip-back path{fill:var(--back)}#tip-fault path{fill:var(--fault)}
"""


@dataclass(frozen=True, slots=True)
class Link:
    """A connection between ports (component, variable); label stands on it, if there is one.

    fault marks a connection that is disturbed.
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
class _Node:
    """A box, or the lanes of the connections that pass a column; x, y is the upper left corner."""

    column: int
    width: float
    height: float
    inputs: list[str] = field(default_factory=list)
    outputs: list[str] = field(default_factory=list)
    x: float = 0.0
    y: float = 0.0

    @property
    def middle(self) -> float:
        return self.y + self.height / 2

    def port(self, names: list[str], name: str) -> float:
        """The height at which a port is drawn."""
        return self.y + HEAD + PITCH * (names.index(name) + 0.5)


Chain = list[_Node]
"""From the box of a connection's source through the lanes to the box of its target."""


def wiring_svg(
    boxes: Mapping[str, str], links: Sequence[Link], units: Mapping[str, str | None]
) -> str:
    """An SVG element: boxes are the components in the order of execution, with a line on each.

    units are those of the outputs, by names like plant.gap[1]. Colours are CSS variables of the
    page, see STYLE.
    """
    place = {name: k for k, name in enumerate(boxes)}
    forward = [w for w in links if place[w.source[0]] < place[w.target[0]]]
    back = [w for w in links if place[w.source[0]] >= place[w.target[0]]]
    column = _columns(boxes, forward)
    nodes = {name: _box(name, line, column[name], links) for name, line in boxes.items()}
    chains = _chains(nodes, forward)
    layers = _layers([*nodes.values(), *(lane for c in chains.values() for lane in c[1:-1])])
    before, after = _neighbours(chains.values())
    _order(layers, before, after)
    _stack(layers)
    _align(layers, before, after)
    _sort_ports(nodes, forward, back)
    right = _spread(layers, nodes, back, chains)
    bottom = max((n.y + n.height for layer in layers for n in layer), default=MARGIN) + GAP
    drawn = [
        *_forward_connections(forward, nodes, chains),
        *_back_connections(back, nodes, bottom),
        *(_drawn(name, line, nodes[name], units) for name, line in boxes.items()),
    ]
    height = bottom + LANE * len(back) + (MARGIN if back else 0.0)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="wiring diagram" '
        f'width="{right:.0f}" height="{height:.0f}" viewBox="0 0 {right:.0f} {height:.0f}">'
        f"<style>{STYLE}</style><defs>{''.join(map(_tip, ('tip', 'tip-back', 'tip-fault')))}</defs>"
        f"{''.join(drawn)}</svg>"
    )


def _columns(boxes: Iterable[str], forward: Sequence[Link]) -> dict[str, int]:
    """The column of each box: one more than the furthest of those before it."""
    sources = defaultdict(list)
    for w in forward:
        sources[w.target[0]].append(w.source[0])
    column: dict[str, int] = {}
    for name in boxes:
        column[name] = max((column[s] + 1 for s in sources[name]), default=0)
    return column


def _box(name: str, line: str, column: int, links: Sequence[Link]) -> _Node:
    inputs = list(dict.fromkeys(w.target[1] for w in links if w.target[0] == name))
    outputs = list(dict.fromkeys(w.source[1] for w in links if w.source[0] == name))
    longest = max(map(len, inputs), default=0) + max(map(len, outputs), default=0)
    letters = max(len(name) + 2, len(line), longest + (10 if inputs and outputs else 6))
    rows = max(len(inputs), len(outputs))
    height = HEAD + PITCH * rows + FOOT
    return _Node(column, max(LETTER * letters + 20.0, 120.0), height, inputs, outputs)


def _chains(nodes: Mapping[str, _Node], forward: Sequence[Link]) -> dict[tuple[str, str], Chain]:
    """The way of the connections between each two boxes."""
    counts: dict[tuple[str, str], int] = defaultdict(int)
    for w in forward:
        counts[w.source[0], w.target[0]] += 1
    return {
        (s, t): [
            nodes[s],
            *(
                _Node(column, 0.0, PITCH * count)
                for column in range(nodes[s].column + 1, nodes[t].column)
            ),
            nodes[t],
        ]
        for (s, t), count in counts.items()
    }


def _layers(nodes: Sequence[_Node]) -> list[list[_Node]]:
    layers: list[list[_Node]] = [[] for _ in range(1 + max((n.column for n in nodes), default=-1))]
    for node in nodes:
        layers[node.column].append(node)
    return layers


Neighbours = Mapping[_Node, Sequence[_Node]]


def _neighbours(chains: Iterable[Chain]) -> tuple[Neighbours, Neighbours]:
    """For each node those one column before and those one column after."""
    before: dict[_Node, list[_Node]] = defaultdict(list)
    after: dict[_Node, list[_Node]] = defaultdict(list)
    for chain in chains:
        for left, right in pairwise(chain):
            before[right].append(left)
            after[left].append(right)
    return before, after


def _order(layers: list[list[_Node]], before: Neighbours, after: Neighbours) -> None:
    """Sort each column by the mean place of the neighbours, forth and back."""
    place = {n: float(k) for layer in layers for k, n in enumerate(layer)}

    def mean(node: _Node, neighbours: Neighbours) -> float:
        near = [place[n] for n in neighbours.get(node, ())]
        return sum(near) / len(near) if near else place[node]

    for sweep in range(SWEEPS):
        neighbours, ordered = (after, layers[::-1]) if sweep % 2 else (before, layers)
        for layer in ordered:
            wanted = {n: mean(n, neighbours) for n in layer}
            layer.sort(key=wanted.__getitem__)
            place.update((n, float(k)) for k, n in enumerate(layer))


def _stack(layers: list[list[_Node]]) -> None:
    """One below the other, the columns about a common middle."""
    for layer in layers:
        total = sum(n.height for n in layer) + GAP * (len(layer) - 1)
        y = -total / 2
        for node in layer:
            node.y = y
            y += node.height + GAP


def _align(layers: list[list[_Node]], before: Neighbours, after: Neighbours) -> None:
    """Move nodes to the height of their neighbours as far as their order lets them."""
    for sweep in range(SWEEPS):
        neighbours, ordered = (after, layers[::-1]) if sweep % 2 else (before, layers)
        for layer in ordered:
            wanted = []
            for node in layer:
                near = [n.middle for n in neighbours.get(node, ())]
                middle = sum(near) / len(near) if near else node.middle
                wanted.append(middle - node.height / 2)
            _settle(layer, wanted)
    top = min((n.y for layer in layers for n in layer), default=0.0)
    for layer in layers:
        for node in layer:
            node.y += MARGIN - top


def _settle(layer: list[_Node], wanted: list[float]) -> None:
    """Put nodes where wanted, pushed down by those above, then all back up by the mean push."""
    y = float("-inf")
    for node, want in zip(layer, wanted, strict=True):
        node.y = max(want, y)
        y = node.y + node.height + GAP
    push = sum(n.y - want for n, want in zip(layer, wanted, strict=True)) / len(layer)
    for node in layer:
        node.y -= push


def _sort_ports(nodes: Mapping[str, _Node], forward: Sequence[Link], back: Sequence[Link]) -> None:
    """Ports in the order in which their connections come in and leave; those of feedback lowest."""
    sources = {w.target: nodes[w.source[0]].middle for w in forward}
    targets: dict[tuple[str, str], float] = {}
    for w in forward:
        middle = nodes[w.target[0]].middle
        targets[w.source] = min(targets.get(w.source, middle), middle)
    fed = {w.target for w in back}
    for name, node in nodes.items():
        node.inputs.sort(key=lambda p: ((name, p) in fed, sources.get((name, p), 0.0)))
        node.outputs.sort(key=lambda p: targets.get((name, p), float("inf")))


def _spread(
    layers: list[list[_Node]],
    nodes: Mapping[str, _Node],
    back: Sequence[Link],
    chains: Mapping[tuple[str, str], Chain],
) -> float:
    """Put the columns side by side, room for connections between them; return the whole width."""
    leaving = Counter(nodes[w.source[0]].column for w in back)
    coming = Counter(nodes[w.target[0]].column for w in back)
    crossing = Counter(node.column for chain in chains.values() for node in chain[:-1])
    x, right = MARGIN, MARGIN
    for k, layer in enumerate(layers):
        x += NEST * coming[k] + (GAP if coming[k] else 0.0)
        widest = max(n.width for n in layer)
        for node in layer:
            node.x = x + (widest - node.width) / 2
            if not node.width:
                node.x, node.width = x, widest
        right = x + widest + (NEST * leaving[k] + GAP if leaving[k] else 0.0)
        x = right + GUTTER + min(NEST * crossing[k], 2 * GUTTER)
    return right + MARGIN


def _forward_connections(
    forward: Sequence[Link], nodes: Mapping[str, _Node], chains: Mapping[tuple[str, str], Chain]
) -> Iterable[str]:
    """Connections from port to port, through the lanes between them."""
    bundles: dict[tuple[str, str], list[Link]] = defaultdict(list)
    for w in forward:
        bundles[w.source[0], w.target[0]].append(w)
    for pair, bundle in bundles.items():
        first, *lanes, last = chains[pair]
        bundle.sort(key=lambda w: first.outputs.index(w.source[1]))
        for k, w in enumerate(bundle):
            x, y = first.x + first.width, first.port(first.outputs, w.source[1])
            path = f"M{x:.1f} {y:.1f}"
            for lane in lanes:
                height = lane.y + PITCH * (k + 0.5)
                path += _bend(x, y, lane.x, height) + f"H{lane.x + lane.width:.1f}"
                x, y = lane.x + lane.width, height
            end = last.port(last.inputs, w.target[1])
            path += _bend(x, y, last.x, end)
            yield _connection(w, path, "", (x + last.x) / 2, (y + end) / 2 - 4)


def _bend(x: float, y: float, to_x: float, to_y: float) -> str:
    half = (x + to_x) / 2
    return f"C{half:.1f} {y:.1f} {half:.1f} {to_y:.1f} {to_x:.1f} {to_y:.1f}"


def _back_connections(
    back: Sequence[Link], nodes: Mapping[str, _Node], bottom: float
) -> Iterable[str]:
    """Connections around below all boxes, nested, those of the lowest ports innermost."""
    nested = sorted(
        back, key=lambda w: -nodes[w.source[0]].port(nodes[w.source[0]].outputs, w.source[1])
    )
    leaving: dict[int, int] = defaultdict(int)
    coming: dict[int, int] = defaultdict(int)
    for k, w in enumerate(nested):
        source, target = nodes[w.source[0]], nodes[w.target[0]]
        y, end = source.port(source.outputs, w.source[1]), target.port(target.inputs, w.target[1])
        out = source.x + source.width + GAP / 2 + NEST * leaving[source.column]
        back_in = target.x - GAP - NEST * coming[target.column]
        leaving[source.column] += 1
        coming[target.column] += 1
        lane = bottom + LANE * k
        path = (
            f"M{source.x + source.width:.1f} {y:.1f}H{out - 5:.1f}q5 0 5 5V{lane - 5:.1f}q0 5 -5 5"
            f"H{back_in + 5:.1f}q-5 0 -5 -5V{end + 5:.1f}q0 -5 5 -5H{target.x:.1f}"
        )
        yield _connection(w, path, " back", (out + back_in) / 2, lane + 4)


def _connection(w: Link, path: str, kind: str, x: float, y: float) -> str:
    """A connection with its label in the middle and its whole name on hover."""
    text = ", ".join(filter(None, (w.name if kind else "", w.label)))
    label = f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="middle">{escape(text)}</text>'
    note = escape(", ".join(filter(None, (w.name, w.label))))
    return (
        f'<g class="connection{kind}{" fault" if w.fault else ""}"><title>{note}</title>'
        f'<path d="{path}"/><path class="line" d="{path}"/>{label if text else ""}</g>'
    )


def _drawn(name: str, line: str, node: _Node, units: Mapping[str, str | None]) -> str:
    """A box with its name, the line below it and its ports."""
    left, right = node.x + 9, node.x + node.width - 9
    parts = [
        f'<g class="box"><rect x="{node.x:.1f}" y="{node.y:.1f}" width="{node.width:.1f}" '
        f'height="{node.height:.1f}" rx="7"/>',
        f'<text class="name" x="{left:.1f}" y="{node.y + 19:.1f}">{escape(name)}</text>',
        f'<text class="more" x="{left:.1f}" y="{node.y + 34:.1f}">{escape(line)}</text>',
    ]
    for port in node.inputs:
        y = node.port(node.inputs, port) + 4
        parts.append(f'<text x="{left:.1f}" y="{y:.1f}">{escape(port)}</text>')
    for port in node.outputs:
        y = node.port(node.outputs, port) + 4
        unit = escape(units.get(f"{name}.{port}") or "")
        parts.append(
            f'<text x="{right:.1f}" y="{y:.1f}" text-anchor="end">{escape(port)}'
            f'<tspan class="unit" dx="5">{unit}</tspan></text>'
        )
    return "".join([*parts, "</g>"])


def _tip(name: str) -> str:
    return (
        f'<marker id="{name}" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="8" '
        'markerHeight="8" orient="auto" markerUnits="userSpaceOnUse"><path d="M0 .5 8 4 0 7.5z"/>'
        "</marker>"
    )
