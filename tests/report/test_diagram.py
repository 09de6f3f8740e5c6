"""The diagram: every connection from its port to its port, boxes apart, feedback below."""

import itertools
import random
import re
import xml.etree.ElementTree as ET

import pytest
from grasp_cosim.report.diagram import Link, diagram_svg
from support.marks import slow

SVG = "{http://www.w3.org/2000/svg}"


class Diagram:
    """What is drawn, read back: boxes by name as left, top, right, bottom; connections by name."""

    def __init__(self, svg):
        root = ET.fromstring(svg)
        self.width, self.height = float(root.attrib["width"]), float(root.attrib["height"])
        self.boxes = {}
        self.ports = {}
        self.connections = {}
        self.labels = {}
        self.kinds = {}
        for group in root.findall(f"{SVG}g"):
            if group.attrib["class"] == "box":
                self._box(group)
            else:
                self._connection(group)

    def _box(self, group):
        rect = group.find(f"{SVG}rect")
        assert rect is not None
        x, y, w, h = (float(rect.attrib[k]) for k in ("x", "y", "width", "height"))
        name, _, *ports = group.findall(f"{SVG}text")
        self.boxes[str(name.text)] = (x, y, x + w, y + h)
        for port in ports:
            side = "output" if port.get("text-anchor") == "end" else "input"
            self.ports[str(name.text), side, str(port.text)] = float(port.attrib["y"]) - 4.0

    def _connection(self, group):
        title, *paths = (e for e in group if e.tag != f"{SVG}text")
        label = group.find(f"{SVG}text")
        assert len(paths) == 2
        name = str(title.text).partition(", ")[0]
        self.connections[name] = corners(paths[1].attrib["d"])
        self.labels[name] = "" if label is None else str(label.text)
        self.kinds[name] = group.attrib["class"]


def corners(path):
    """The points of a path of M, C, H and V, control points left out."""
    points = []
    for kind, text in re.findall(r"([MCHV])([^MCHV]*)", path):
        *_, last = numbers = [float(n) for n in text.split()]
        x, y = (last, points[-1][1]) if kind == "H" else (points[-1][0], last) if points else (0, 0)
        points.append((x, y) if kind in "HV" else (numbers[-2], last))
    return points


def link(text):
    return Link(*(tuple(end.split(".", 1)) for end in text.split(" → ")))


def draw(names, links):
    return Diagram(diagram_svg(dict.fromkeys(names, "X.fmu"), links, {}))


GRASP = ["plant", "sensor_1", "sensor_2", "controller"]
GRASP_CONNECTIONS = [
    link(text)
    for text in (
        "plant.gap[1] → sensor_1.gap",
        "plant.gap[2] → sensor_2.gap",
        "plant.position[1] → controller.position[1]",
        "plant.position[2] → controller.position[2]",
        "plant.velocity[1] → controller.velocity[1]",
        "plant.velocity[2] → controller.velocity[2]",
        "sensor_1.intensity → controller.intensity[1]",
        "sensor_2.intensity → controller.intensity[2]",
        "controller.force[1] → plant.force[1]",
        "controller.force[2] → plant.force[2]",
    )
]


def many(seed, components, connections):
    numbers = random.Random(seed)
    names = [f"c{k}" for k in range(components)]
    pairs = [(numbers.choice(names), numbers.choice(names)) for _ in range(connections)]
    return names, [Link((a, f"y{k % 3}"), (b, f"u{k}")) for k, (a, b) in enumerate(pairs)]


CASES = {
    "grasp": (GRASP, GRASP_CONNECTIONS),
    "ring of 64": (
        [f"c{k}" for k in range(64)],
        [Link((f"c{k}", "y"), (f"c{(k + 1) % 64}", "u")) for k in range(64)],
    ),
    "64 at random": many(1, 64, 100),
    "12 at random": many(2, 12, 40),
    "without connections": (["a", "b", "c"], []),
    "nothing": ([], []),
    "on itself": (["a"], [link("a.y → a.u")]),
}


@pytest.mark.parametrize("case", [slow(c) if c == "ring of 64" else c for c in CASES])
def test_every_connection_leads_from_its_port_to_its_port(case):
    names, links = CASES[case]
    diagram = draw(names, links)
    assert list(diagram.boxes) == names
    assert sorted(diagram.connections) == sorted(w.name for w in links)
    for w in links:
        points = diagram.connections[w.name]
        left, right = diagram.boxes[w.target[0]][0], diagram.boxes[w.source[0]][2]
        start = right, diagram.ports[w.source[0], "output", w.source[1]]
        end = left, diagram.ports[w.target[0], "input", w.target[1]]
        assert points[0] == pytest.approx(start, abs=0.11)
        assert points[-1] == pytest.approx(end, abs=0.11)


@pytest.mark.parametrize("case", CASES)
def test_no_connection_runs_through_a_box(case):
    diagram = draw(*CASES[case])
    for name, points in diagram.connections.items():
        for (x, y), (to_x, to_y) in itertools.pairwise(points):
            assert 0 <= to_x <= diagram.width
            assert 0 <= to_y <= diagram.height
            if abs(x - to_x) > 1 and abs(y - to_y) > 1:
                continue  # a bend between two columns
            for left, top, right, bottom in diagram.boxes.values():
                across = min(x, to_x) < right - 0.2 and max(x, to_x) > left + 0.2
                down = min(y, to_y) < bottom - 0.2 and max(y, to_y) > top + 0.2
                assert not (across and down), name


@pytest.mark.parametrize("case", CASES)
def test_data_flow_to_the_right_and_feedback_below(case):
    names, links = CASES[case]
    diagram = draw(names, links)
    lowest = max((box[3] for box in diagram.boxes.values()), default=0.0)
    lanes = set()
    for w in links:
        points = diagram.connections[w.name]
        if names.index(w.source[0]) < names.index(w.target[0]):
            assert [x for x, _ in points] == sorted(x for x, _ in points)
            assert "back" not in diagram.kinds[w.name]
        else:
            lane = max(y for _, y in points)
            assert lane > lowest
            lanes.add(lane)
            assert "back" in diagram.kinds[w.name]
            assert diagram.labels[w.name] == w.name
    assert len(lanes) == sum("back" in kind for kind in diagram.kinds.values())
