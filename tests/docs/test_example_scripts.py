"""Scripts that the pages have as examples: blocks obey their equations, tune.py finds gains."""

import runpy
from pathlib import Path

import numpy as np
import pytest
import tune
from grasp_cosim import simulate
from grasp_cosim.inspection.block_templates import TEMPLATE_FOLDER
from gripper_plant.friction import Params as Friction
from scipy import integrate

DOCS = Path(__file__).parents[2] / "docs"


def test_an_object_that_moves_is_a_fixed_one_seen_from_it():
    """Fingers that are pushed evenly, m·x'' = u, until the right one is stopped by the object."""
    block = runpy.run_path(str(DOCS / "moving_object.py"))
    p = block["Params"](initial_object_position=0.0, object_velocity=0.05)
    u = block["Inputs"]((-0.5, 0.25))
    x = block["initial_state"](p, u)
    for _ in range(20):
        x = block["step"](p, x, u, 0.01)
    y = block["outputs"](p, x, u)
    assert y.position == pytest.approx((0.11 - 0.5 * 0.2**2, -0.11 + 0.25 * 0.2**2), abs=1e-12)
    assert y.velocity == pytest.approx((-0.2, 0.1), abs=1e-12)
    assert y.object_position == pytest.approx(0.01, abs=1e-12)
    assert y.gap == pytest.approx((0.045, 0.075), abs=1e-12)
    for _ in range(200):
        x = block["step"](p, x, u, 0.01)
    y = block["outputs"](p, x, u)
    assert y.contact[0]
    assert y.velocity[0] == pytest.approx(0.05, abs=1e-6)
    assert y.position[0] == pytest.approx(y.object_position + 0.035, abs=1e-4)
    with pytest.raises(ValueError, match="friction: must be 0"):
        block["Params"](friction=Friction(coulomb=(1.0, 0.0)))


def test_the_spring_plant_obeys_its_equations():
    """Against an adaptive integration, error control at the step at which a face is touched."""
    plant = runpy.run_path(str(TEMPLATE_FOLDER / "spring_plant.py"))
    p = plant["Params"](initial_position=(0.07, -0.11))
    u = plant["Inputs"](force=(-0.5, 0.1))

    def rates(_, y):
        x_1, x_2, x, v_1, v_2, v = y
        into_1, into_2 = x + 0.035 - x_1, x_2 - (x - 0.035)
        f_1 = max(0.0, 1e4 * into_1 + 20.0 * (v - v_1)) if into_1 > 0.0 else 0.0
        f_2 = max(0.0, 1e4 * into_2 + 20.0 * (v_2 - v)) if into_2 > 0.0 else 0.0
        spring = -100.0 * (x - 0.03) - 2.0 * v
        return [v_1, v_2, v, (-0.5 + f_1) / 0.5, (0.1 - f_2) / 0.5, (spring - f_1 + f_2) / 0.1]

    start = [0.07, -0.11, 0.03, 0.0, 0.0, 0.0]
    exact = integrate.solve_ivp(rates, (0.0, 0.3), start, max_step=1e-3, rtol=1e-9, atol=1e-12)
    errors = []
    for h in (4e-5, 2e-5):  # below its own sub-steps, so that it takes just one
        s = plant["initial_state"](p, u)
        for _ in range(round(0.3 / h)):
            s = plant["step"](p, s, u, h)
        found = [*s.position, s.object_position]
        errors.append(max(abs(a - b) for a, b in zip(found, exact.y[:3, -1], strict=True)))
    assert errors[0] < 1e-4  # m, on a way of several mm
    assert 1.5 < errors[0] / errors[1] < 2.5  # first order


# The search of docs/tune.py, with two gains, in coarse steps

POSITION = "plant.initial_object_position"


@pytest.fixture
def small(monkeypatch):
    """One grasp, two gains, steps of 5 ms."""
    monkeypatch.setattr(tune, "SYSTEM", tune.SYSTEM.with_experiment(step=5e-3))
    monkeypatch.setattr(tune, "GAINS", tune.GAINS[:1] + tune.GAINS[-1:])
    monkeypatch.setattr(tune, "CONDITIONS", [{POSITION: 0.03}])
    monkeypatch.setattr(tune, "CHECKS", {"a check": {POSITION: 0.01, "experiment.stop": 3.0}})


@pytest.mark.slow
@pytest.mark.usefixtures("small")
def test_what_is_found_is_no_worse_than_published_and_keeps_the_limits(capsys):
    best, search = tune.tuned(generations=3)
    found = search.worst(best)[:, 0]
    assert (found <= search.published).all()
    assert len(search.known) > 10
    within = [w for w in search.known.values() if (w[1:] <= search.published[1:]).all()]
    assert found[0] == min(w[0] for w in within)

    metrics = simulate(tune.SYSTEM.with_values({POSITION: 0.03, **tune.gains(best)})).metrics
    both = zip(metrics["time_to_contact"], metrics["settling_time"], strict=True)
    worst = [max(sum(pair) for pair in both), max(metrics["impact_velocity"])]
    worst += [metrics["time_difference"], max(metrics["force_overshoot"])]
    assert found.tolist() == worst

    tune.main(0)
    lines = capsys.readouterr().out.splitlines()
    assert f"{search.published[0]:.3f}" in lines[2]
    assert lines[-1].startswith("a check")


def test_a_run_without_a_contact_breaks_every_limit(monkeypatch):
    monkeypatch.setattr(tune, "SYSTEM", tune.SYSTEM.with_experiment(step=5e-3, stop=0.02))
    found = tune.measured(np.zeros((len(tune.GAINS), 1)), [{}])
    assert np.isinf(found).all()
