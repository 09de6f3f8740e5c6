"""Metrics of a hand whose plant or controller tells less than ours do."""

import numpy as np
import pytest
from grasp_cosim.hand.metrics import METRICS, is_hand
from grasp_cosim.metrics.metric import Signals, measure

TIME = 0.01 * np.arange(51)


def closing(touches):
    """Fingers of 0.1 m/s that touch at these times and press with 3 N each then."""
    found = {}
    for k, touch in enumerate(touches, 1):
        found |= {
            f"plant.gap[{k}]": 0.1 * np.maximum(touch - TIME, 0.0),
            f"plant.contact_force[{k}]": np.where(touch <= TIME, 3.0, 0.0),
        }
    return found


def test_a_hand_has_the_metrics_of_all_fingers_that_its_signals_permit():
    """Three forces of 3 N in even directions are in balance."""
    found = measure(Signals(TIME, closing([0.105, 0.205, 0.155])), METRICS)
    assert found.values["time_to_contact"] == pytest.approx([0.105, 0.205, 0.155])
    assert found.values["time_difference"] == pytest.approx(0.1)
    assert found.values["impact_velocity"] == pytest.approx([0.1] * 3)
    assert found.values["steady_contact_force"] == pytest.approx([3.0] * 3)
    assert found.values["net_force"] == pytest.approx(0.0, abs=1e-12)
    assert found.missing == (
        "no object_shift, object_drift: plant lacks object_position[1]",
        "no object_turn: plant lacks object_angle",
    )


def test_fingers_close_as_their_positions_fall_whatever_tells_of_a_hand():
    """Their speeds grow by 2 m/s², 10 ms before the contacts they are 0.21 m/s on the mean."""
    signals = {}
    for k in (1, 2, 3):
        way = TIME * TIME
        signals |= {
            f"plant.position[{k}]": 0.05 - way,
            f"plant.velocity[{k}]": -2.0 * TIME,
            f"plant.gap[{k}]": np.maximum(0.01211 - way, 0.0),
        }
    found = measure(Signals(TIME, signals), METRICS)
    assert found.values["impact_velocity"] == pytest.approx([0.22] * 3)
    assert found.values["time_to_contact"] == pytest.approx([0.11 + 0.00001 / 0.22] * 3)


def test_a_finger_without_a_force_is_named():
    signals = closing([0.105, 0.205, 0.155])
    del signals["plant.contact_force[3]"]
    found = measure(Signals(TIME, signals), METRICS)
    assert list(found.values) == ["time_to_contact", "time_difference", "impact_velocity"]
    assert found.failures == ()
    first, *_ = found.missing
    assert first == (
        "no impact_impulse, force_overshoot, settling_time: plant lacks contact_force[3]"
    )


def test_a_hand_is_shown_where_all_fingers_tell_what_is_drawn():
    quantities = ("position", "velocity", "gap", "contact_force")
    names = [f"plant.{quantity}[{k}]" for quantity in quantities for k in (1, 2, 3)]
    names += ["plant.object_position[1]", "plant.object_position[2]", "plant.object_angle"]
    signals = dict.fromkeys(names, TIME)
    assert is_hand(Signals(TIME, signals))
    for name in ("plant.velocity[3]", "plant.object_position[2]", "plant.object_angle"):
        assert not is_hand(Signals(TIME, {n: c for n, c in signals.items() if n != name}))
