"""The search of docs/tune.py, with two gains, in coarse steps."""

import numpy as np
import pytest
import tune
from grasp_cosim import simulate

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
