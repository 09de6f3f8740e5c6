"""The adaptive grasp as a whole: what holds for any faces, places, widths and masses.

The FMUs are native ones, with the bits of Python's and a run in milliseconds.
"""

from math import log

import numpy as np
import pytest
from support.adaptive import adaptive_grasp, last, run, values_of

STEP = 1e-3
"""s, ten times the paper's: nothing below depends on it."""

FINGER = (1, 2)


# ---------------------------------------------------------------- where there is little to see


@pytest.mark.parametrize("alpha", [(0.0, 1.0), (1.0, 0.0), (0.0, 0.0)])
def test_a_blind_sensor(natives, alpha):
    """0 V tells nothing: what is learnt stays 1, and nothing is not a number."""
    result = run(adaptive_grasp(natives), values_of(alpha), STEP, 3.0)
    assert set(result["controller.reflectance_ratio"]) == {1.0}
    for name in ("controller.force[1]", "controller.force[2]", "controller.estimated_gap[1]"):
        assert np.all(np.isfinite(result[name]))


@pytest.mark.parametrize("volts", [0.2, 0.5])
@pytest.mark.parametrize("alpha", [(0.57, 1.0), (1.0, 0.57)])
def test_a_sensor_that_saturates(natives, alpha, volts):
    """What has been learnt until then stays learnt, and the forces settle equal."""
    values = values_of(alpha)
    for j in FINGER:
        values[f"sensor_{j}.adc.enabled"] = True
        values[f"sensor_{j}.adc.range[2]"] = volts
    result = run(adaptive_grasp(natives), values, STEP, 6.0)
    ratio = result["controller.reflectance_ratio"][-1]
    assert log(ratio) == pytest.approx(log(alpha[0] / alpha[1]), abs=0.05)
    assert last(result, "plant.contact_force") == pytest.approx((3.43, -3.43), abs=5e-3)


@pytest.mark.parametrize("gap", [1e-3, 3e-3])
@pytest.mark.parametrize("alpha", [(0.57, 1.0), (1.0, 0.57), (1.0, 1.0)])
def test_a_start_within_millimetres_of_a_face(natives, alpha, gap):
    """A finger that arrives before it has learnt anything still holds as firmly as the other."""
    result = run(adaptive_grasp(natives), values_of(alpha, 0.075 - gap), 2e-3, 9.0)
    assert None not in result.metrics["time_to_contact"]
    assert max(result.metrics["impact_velocity"]) < 8e-3
    assert last(result, "plant.contact_force") == pytest.approx((3.43, -3.43), abs=5e-3)
    assert np.all(np.abs(np.log(result["controller.reflectance_ratio"])) <= 2.5)
