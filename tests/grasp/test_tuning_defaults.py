"""What tune does of itself: that of a grasp, by the roles of any system."""

from dataclasses import replace
from pathlib import Path

import pytest
from grasp_cosim import System, simulate
from grasp_cosim.grasp.controllers import with_controller
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.grasp.tuning import (
    default_checks,
    default_conditions,
    default_gains,
    default_limits,
    grasp_time,
    is_published,
)
from grasp_cosim.tuning.problem import Condition, Problem


@pytest.mark.parametrize("law", ["published", "adaptive"])
def test_both_controllers_have_a_problem_about_their_published_gains(
    grasp: System, law: str
) -> None:
    system = with_controller(grasp, law)
    gains = default_gains(system)
    checks, left_out = default_checks(system)
    problem = Problem(
        gains, "grasp_time", default_limits(), default_conditions(system), checks, (grasp_time,)
    )
    assert not left_out
    assert problem.start == (10.0, 25.0, 0.6, 12.0, 36.0, 3.0, 14.0)
    assert [g.at(g.share(x)) for g, x in zip(gains, problem.start, strict=True)] == list(
        problem.start
    )
    assert problem.values(problem.start)["controller.impact_reduction.viscosity[2]"] == -0.6
    assert is_published(system, gains)
    assert not is_published(system.with_values({"controller.contact_force.damping": 15.0}), gains)
    tuned_for = {c.system.start("plant.initial_object_position") for c in problem.conditions}
    assert tuned_for == {0.0, 0.02, 0.05}


def noise(condition: Condition) -> tuple[bool, float, float]:
    """If there is noise, of which seed, and how much friction."""
    system = condition.system
    there = system.component("sensor_1", "").values.get("noise.enabled", False)
    seed, friction = "sensor_1.noise.seed", "plant.friction.viscous[1]"
    return bool(there), system.start(seed) if there else 0.0, system.start(friction)


def test_noise_is_tuned_for_and_checked_with_another_seed_and_with_friction(grasp: System) -> None:
    checks, _ = default_checks(grasp)
    assert [noise(c) for c in default_conditions(grasp) if noise(c)[0]] == [(True, 1.0, 0.0)]
    assert [noise(c) for c in checks if noise(c)[0]] == [(True, 11.0, 0.0), (True, 1.0, 35.7696)]
    assert any(c.system.step_ns == 100_000 and not noise(c)[0] for c in checks)


def test_a_check_that_a_system_cannot_have_is_left_out_and_said(grasp: System) -> None:
    """A controller in the place of the right sensor has no reflectance."""
    checks, left_out = default_checks(replace(grasp, roles={"sensor_1": "controller"}))
    assert "20 mm, brown and white" not in [c.name for c in checks]
    assert len(checks) + len(left_out) == 6
    assert left_out[0].startswith("left out the check '20 mm, brown and white': ")


def test_the_time_of_a_grasp_is_until_a_force_has_settled(natives: Path) -> None:
    grasp = System.load(SYSTEM, natives)
    m = simulate(grasp, step=1e-3, stop=4.0, metrics=[grasp_time]).metrics
    assert m["grasp_time"] == [
        a + b for a, b in zip(m["time_to_contact"], m["settling_time"], strict=True)
    ]
    assert m["grasp_time"][0] == pytest.approx(1.887 + 0.943, abs=0.01)
    short = simulate(grasp, step=1e-3, stop=1.0, metrics=[grasp_time])
    assert short.metrics["grasp_time"] == [None, None]
