"""The scene of a grasp in its page, and its picture: signals, contacts, close-ups."""

import json
import struct
from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim.grasp import pictures
from grasp_cosim.grasp.scene import grasp_scene
from grasp_cosim.report.run_report import page_html
from report.runs import grasp_run, ring_run
from report.test_page import Elements
from support.marks import slow


def page_of(result):
    """The page as the command report makes it."""
    return page_html(result, scene=grasp_scene(result))


def test_only_a_grasp_has_the_scene():
    assert grasp_scene(ring_run(["a", "b"])) is None
    page = Elements(page_of(grasp_run()))
    assert {"scene", "fingers", "readings"} <= set(page.ids())
    assert len(page.ids()) == len(set(page.ids()))
    assert ring_run(["a"]).view.scene(ring_run(["a"])) is None
    assert grasp_run().view.scene(grasp_run()) == grasp_scene(grasp_run())


def test_signals_go_by_roles():
    """Also of a gripper that another component plays."""
    run = grasp_run()
    other = {name.replace("plant.", "hand."): values for name, values in run.signals.items()}
    units = {name.replace("plant.", "hand."): unit for name, unit in run.units.items()}
    settings = {**run.settings, "roles": {"plant": "hand"}}
    scene = grasp_scene(replace(run, signals=other, units=units, settings=settings))
    assert scene is not None
    assert scene.state["gap"] == {1: "hand.gap[1]", 2: "hand.gap[2]"}
    assert scene.first_signals == [
        *(f"hand.{q}[{j}]" for q in ("gap", "contact_force", "velocity") for j in (1, 2)),
        "controller.target_position",
    ]


def test_first_contacts_are_marked_and_have_buttons():
    scene = grasp_scene(grasp_run())
    assert scene is not None
    assert [color for _, color in scene.marks] == ["--finger1", "--finger2"]
    np.testing.assert_allclose([t for t, _ in scene.marks], [1.0, 1.2], atol=1e-9)
    spans = {zoom.text: (zoom.begin, zoom.end) for zoom in scene.zooms}
    assert list(spans) == ["Contact of finger 1", "Contact of finger 2", "Both contacts"]
    np.testing.assert_allclose(spans["Both contacts"], (1.0 - 0.005, 1.2 + 0.03), atol=1e-9)


def without(run, *starts):
    """The run without the signals whose names begin so."""
    left = {name: column for name, column in run.signals.items() if not name.startswith(starts)}
    return replace(run, signals=left)


def test_a_grasp_without_target_and_contact_is_shown_all_the_same():
    """The contacts are where the gaps are used up; there is no target to draw."""
    run = grasp_run()
    gaps = {name: np.round(run.signals[name], 9) for name in ("plant.gap[1]", "plant.gap[2]")}
    less = without(run, "controller.target", "plant.contact[")
    less = replace(less, signals={**less.signals, **gaps})
    assert less.view.stem == "grasp"
    scene = grasp_scene(less)
    assert scene is not None
    np.testing.assert_allclose([c["t"] for c in scene.state["contacts"]], [1.0, 1.2], atol=1e-9)
    assert set(scene.state["signals"]) <= set(less.signals)
    assert "target" not in scene.state
    assert "touches" not in scene.html
    figure = pictures.draw_grasp(less)
    (legend,) = figure.legends
    names = [text.get_text() for text in legend.get_texts()]
    assert names == ["finger 1", "finger 2", "centre of the object"]


@pytest.mark.parametrize("quantity", ["position", "velocity", "gap", "contact_force", "object"])
def test_a_grasp_without_what_is_drawn_is_shown_as_any_system(quantity):
    less = without(grasp_run(), f"plant.{quantity}")
    assert (less.view.stem, grasp_scene(less)) == ("signals", None)


def test_contacts_begin_where_the_metrics_say_and_again_after_each_release():
    run = grasp_run()
    contact = run.signals["plant.contact[1]"].copy()
    contact[1500:1600] = False
    again = replace(run, signals={**run.signals, "plant.contact[1]": contact})
    page = Elements(page_of(again))
    found = [(c["finger"], c["t"]) for c in json.loads(page.texts["page"])["scene"]["contacts"]]
    assert [finger for finger, _ in found] == [1, 2, 1]
    np.testing.assert_allclose([t for _, t in found], [1.0, 1.2, 1.6], atol=1e-9)


def width(path):
    """Of a PNG, in pixels."""
    head = path.read_bytes()[:24]
    assert head.startswith(b"\x89PNG")
    return int(struct.unpack(">I", head[16:20])[0])


def touching_from(run, moments):
    """The run with contacts that begin at these times only."""
    contacts = {f"plant.contact[{j}]": run.time >= moments.get(j, np.inf) - 1e-9 for j in (1, 2)}
    return replace(run, signals={**run.signals, **contacts})


@pytest.mark.parametrize(
    ("moments", "close_ups"),
    [
        slow({}, []),
        slow({1: 1.0, 2: 1.2}, [[1], [2]]),
        ({1: 1.03, 2: 1.0}, [[1, 2]]),
        slow({2: 0.0}, [[2]]),
    ],
)
def test_close_ups_of_the_contacts(moments, close_ups, tmp_path):
    run = touching_from(grasp_run(), moments)
    axes = pictures.draw_grasp(run, tmp_path / "grasp.png").axes
    assert len(axes) == 3 * (1 + len(close_ups))
    by_column = [axes[1 + k :: 1 + len(close_ups)] for k in range(len(close_ups))]
    for fingers, column in zip(close_ups, by_column, strict=True):
        begin, end = column[0].get_xlim()
        assert all(begin < moments[j] < end for j in fingers)
        assert end - begin < 0.1
        for one in column:
            assert [line.get_label() for line in one.lines] == [f"finger {j}" for j in fingers]
            assert one.get_xlim() == (begin, end)
    assert width(tmp_path / "grasp.png") == int(130 * (7.2 + 2.9 * len(close_ups)))


def test_fingers_differ_in_grey_and_there_is_one_legend():
    figure = pictures.draw_grasp(grasp_run())
    assert figure.texts[0].get_text() == "grasp, case 2, GraspController"
    for axes in figure.axes:
        assert axes.get_legend() is None
        dashes = {line.get_label(): line.get_linestyle() for line in axes.lines}
        for finger, style in (("finger 1", "-"), ("finger 2", "--")):
            assert dashes.get(finger, style) == style
    (legend,) = figure.legends
    names = [text.get_text() for text in legend.get_texts()]
    assert names == ["finger 1", "finger 2", "target", "centre of the object"]
