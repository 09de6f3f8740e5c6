"""What the settings of two runs differ in."""

from dataclasses import replace

import pytest
from grasp_cosim.comparison.side import differences
from report.runs import component, grasp_run


def with_settings(run, **settings):
    return replace(run, settings={**run.settings, **settings})


def with_controller(**values):
    run = grasp_run()
    parts = dict(run.settings["components"])
    parts["controller"] = component("GraspController.fmu", **values)
    return with_settings(run, components=parts)


def test_equal_runs_differ_in_nothing_whenever_they_were_made():
    run = replace(grasp_run(), origin={"date": "2026-01-01", "versions": {"numpy": "2.1"}})
    later = replace(run, wall_time=9.0, origin={**run.origin, "date": "2026-02-02"})
    assert differences(run, later) == ()


def test_the_case_and_the_values_behind_it_are_named():
    off = {"simultaneous_contact.enabled": False, "impact_reduction.enabled": False}
    found = differences(grasp_run(), with_controller(**off))
    assert [tuple(d) for d in found] == [
        ("case", "2", "0"),
        ("controller.simultaneous_contact.enabled", "as the FMU starts", "false"),
        ("controller.impact_reduction.enabled", "as the FMU starts", "false"),
    ]


def test_a_mixture_of_cases_is_none_of_them():
    found = differences(grasp_run(), with_controller(**{"impact_reduction.enabled": False}))
    assert found[0] == ("case", "2", "other")


@pytest.mark.parametrize(
    ("settings", "what", "a", "b"),
    [
        ({"step": 2e-3}, "step", "0.001 s", "0.002 s"),
        ({"scheme": "jacobi"}, "scheme", "sequential", "jacobi"),
        ({"system": "own.toml"}, "system", "grasp.toml", "own.toml"),
        ({"faults": []}, "faults", "connection = controller.intensity[1], kind = bias, value = 0.1",
         "none"),
        ({"roles": {"plant": "gripper"}}, "role plant", "none", "gripper"),
        ({"connections": []}, "source of plant.force[1]", "controller.force[1]", "none"),
        ({"initialisation": {"loops": "refuse"}}, "initialisation loops", "iterate", "refuse"),
    ],
)  # fmt: skip
def test_a_setting_that_differs_is_named(settings, what, a, b):
    found = differences(grasp_run(), with_settings(grasp_run(), **settings))
    assert (what, a, b) in found


def test_the_fmu_and_the_versions_are_named():
    def made(guid, version, **more):
        fmus = {"plant": {"guid": guid, "tool": "t", **more}}
        return replace(grasp_run(), origin={"fmus": fmus, "versions": {"numpy": version}})

    found = differences(made("aa", "2.1"), made("bb", "2.2", native_twin_of="aa"))
    assert [tuple(d) for d in found] == [
        ("FMU of plant", "GripperPlant.fmu aa", "GripperPlant.fmu bb, native"),
        ("version of numpy", "2.1", "2.2"),
    ]


def test_another_order_of_execution_is_a_difference():
    run = grasp_run()
    turned = dict(reversed(run.settings["components"].items()))
    found = differences(run, with_settings(run, components=turned))
    assert [d.what for d in found] == ["order of the components"]
