"""Columns by name: what Python asks of any object."""

import numpy as np
from grasp_cosim.metrics.metric import Signals
from report.runs import grasp_run


def test_two_of_the_same_columns_are_two_keys_of_a_dictionary():
    columns = {"a.x": np.zeros(3), "a.y": np.ones(3)}
    one, other = (Signals(np.arange(3.0), columns) for _ in range(2))
    assert one == one
    assert one != other
    assert {one: 1, other: 2}[one] == 1


def test_tab_behind_a_bracket_offers_the_names():
    run = grasp_run()
    assert run._ipython_key_completions_() == list(run)
    assert run.metrics._ipython_key_completions_() == list(run.metrics)
    assert "plant.gap[1]" in run
    assert "time_to_contact" in run.metrics
