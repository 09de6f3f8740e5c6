"""The diagram: every connection from its port to its port, boxes apart, feedback below."""

import itertools
import random
import re
import xml.etree.ElementTree as ET
from dataclasses import replace

import pytest
from grasp_cosim.report.diagram import Arrow, diagram_svg
from support.marks import slow

SVG = "{http://www.w3.org/2000/svg}"
GRASP_CONNECTIONS = """
plant.gap[1] sensor_1.gap
plant.gap[2] sensor_2.gap
plant.position[1] controller.position[1]
plant.velocity[1] controller.velocity[1]
sensor_1.intensity controller.intensity[1]
sensor_2.intensity controller.intensity[2]
controller.force[1] plant.force[1]
controller.force[2] plant.force[2]
"""


def links(text):
    ends = [line.split() for line in text.split("\n") if line]
    return [Arrow(*(tuple(end.split(".", 1)) for end in pair)) for pair in ends]


def many(seed, components, connections):
    numbers = random.Random(seed)
    names = [f"c{k}" for k in range(components)]
    pairs = [(numbers.choice(names), numbers.choice(names)) for _ in range(connections)]
    return names, [Arrow((a, f"y{k % 3}"), (b, f"u{k}")) for k, (a, b) in enumerate(pairs)]


CASES = {
    "grasp": (["plant", "sensor_1", "sensor_2", "controller"], links(GRASP_CONNECTIONS)),
    "ring of 64": (
        [f"c{k}" for k in range(64)],
        [Arrow((f"c{k}", "y"), (f"c{(k + 1) % 64}", "u")) for k in range(64)],
    ),
    "64 at random": many(1, 64, 100),
    "12 at random": many(2, 12, 40),
    "without connections": (["a", "b", "c"], []),
    "nothing": ([], []),
    "on itself": (["a"], links("a.y a.u")),
}


def corners(path):
    """The points of a path of M, C, H and V, control points left out."""
    points = []
    for kind, text in re.findall(r"([MCHV])([^MCHV]*)", path):
        *_, last = numbers = [float(n) for n in text.split()]
        x, y = (last, points[-1][1]) if kind == "H" else (points[-1][0], last) if points else (0, 0)
        points.append((x, y) if kind in "HV" else (numbers[-2], last))
    return points


def boxes_of(groups):
    """Left, top, right, bottom by name; and how high ports are, by box, side and name."""
    boxes, ports = {}, {}
    for group in groups:
        rect = group.find(f"{SVG}rect")
        x, y, w, h = (float(rect.attrib[k]) for k in ("x", "y", "width", "height"))
        name, _, *texts = group.findall(f"{SVG}text")
        boxes[name.text] = (x, y, x + w, y + h)
        for port in texts:
            side = "output" if port.get("text-anchor") == "end" else "input"
            ports[name.text, side, port.text] = float(port.attrib["y"]) - 4.0
    return boxes, ports


def assert_beside(points, boxes, width, height):
    """No way runs through a box, or leaves the picture."""
    for (x, y), (to_x, to_y) in itertools.pairwise(points):
        assert 0 <= to_x <= width
        assert 0 <= to_y <= height
        if abs(x - to_x) > 1 and abs(y - to_y) > 1:
            continue  # a bend between two columns
        for left, top, right, bottom in boxes.values():
            across = min(x, to_x) < right - 0.2 and max(x, to_x) > left + 0.2
            down = min(y, to_y) < bottom - 0.2 and max(y, to_y) > top + 0.2
            assert not (across and down)


@pytest.mark.parametrize("case", [slow(c) if c == "ring of 64" else c for c in CASES])
def test_every_connection_leads_to_its_port_past_all_boxes_and_feedback_below(case):
    names, connections = CASES[case]
    root = ET.fromstring(diagram_svg(dict.fromkeys(names, "X.fmu"), connections, {}))
    groups = root.findall(f"{SVG}g")
    boxes, ports = boxes_of(g for g in groups if g.attrib["class"] == "box")
    ways = {g.find(f"{SVG}title").text: g for g in groups if g.attrib["class"] != "box"}
    assert list(boxes) == names
    assert sorted(ways) == sorted(w.name for w in connections)
    lowest, lanes = max((box[3] for box in boxes.values()), default=0.0), []
    for w in connections:
        way = ways[w.name]
        points = corners(way.find(f"{SVG}path[@class='line']").attrib["d"])
        start = boxes[w.source[0]][2], ports[w.source[0], "output", w.source[1]]
        end = boxes[w.target[0]][0], ports[w.target[0], "input", w.target[1]]
        assert points[0] == pytest.approx(start, abs=0.11)
        assert points[-1] == pytest.approx(end, abs=0.11)
        assert_beside(points, boxes, *(float(root.attrib[k]) for k in ("width", "height")))
        if names.index(w.source[0]) < names.index(w.target[0]):
            assert [x for x, _ in points] == sorted(x for x, _ in points)
            assert way.attrib["class"] == "connection"
        else:
            lanes.append(max(y for _, y in points))
            assert lanes[-1] > lowest
            assert way.attrib["class"] == "connection back"
            assert way.find(f"{SVG}text").text == w.name
    assert len(set(lanes)) == len(lanes)


def test_a_system_in_a_notebook_is_its_diagram(grasp):
    page = replace(grasp, name="<b>.toml")._repr_html_()
    assert "<b>&lt;b&gt;.toml</b>: 3 s in steps of 0.1 ms, sequential; 10 connections" in page
    assert page.count('<g class="box">') == 4
    assert "plant.gap[1] → sensor_1.gap" in page
    assert ":root" not in page
    assert ".diagram .box rect" in page
