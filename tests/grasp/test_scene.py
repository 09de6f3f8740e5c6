"""The scene of a grasp in its page: which signals it is drawn from, where contacts begin."""

import json
from dataclasses import replace

import numpy as np
from grasp_cosim.grasp.scene import grasp_scene
from grasp_cosim.report.page import page_html
from report.runs import grasp_run, ring_run
from report.test_page import Elements


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
    assert scene.shown == [
        *(f"hand.{q}[{j}]" for q in ("gap", "contact_force", "velocity") for j in (1, 2)),
        "controller.target_position",
    ]


def test_signals_of_a_finger_have_its_colour():
    scene = grasp_scene(grasp_run())
    assert scene is not None
    assert scene.colors["plant.gap[1]"] == scene.colors["sensor_1.intensity"] == "--finger1"
    assert scene.colors["controller.force[2]"] == "--finger2"
    assert "controller.target_position" not in scene.colors


def test_first_contacts_are_marked_and_have_buttons():
    scene = grasp_scene(grasp_run())
    assert scene is not None
    assert [color for _, color in scene.marks] == ["--finger1", "--finger2"]
    np.testing.assert_allclose([t for t, _ in scene.marks], [1.0, 1.2], atol=1e-9)
    spans = {zoom.text: (zoom.begin, zoom.end) for zoom in scene.zooms}
    assert list(spans) == ["Contact of finger 1", "Contact of finger 2", "Both contacts"]
    np.testing.assert_allclose(spans["Both contacts"], (1.0 - 0.005, 1.2 + 0.03), atol=1e-9)


def test_contacts_begin_where_the_metrics_say_and_again_after_each_release():
    run = grasp_run()
    contact = run.signals["plant.contact[1]"].copy()
    contact[1500:1600] = False
    again = replace(run, signals={**run.signals, "plant.contact[1]": contact})
    page = Elements(page_of(again))
    found = [(c["finger"], c["t"]) for c in json.loads(page.texts["page"])["scene"]["contacts"]]
    assert [finger for finger, _ in found] == [1, 2, 1]
    np.testing.assert_allclose([t for _, t in found], [1.0, 1.2, 1.6], atol=1e-9)
