"""The ambient offset and its drift."""

import pytest
from proximity_sensor import ambient_light, channel, low_pass, sliding_median
from proximity_sensor.ambient_light import Params
from proximity_sensor.channel import Params as Electronics


def test_the_published_offset_does_not_drift():
    assert [ambient_light.voltage(Params(), t) for t in (0.0, 1.0, 1e4)] == [0.35] * 3


def test_it_drifts_from_the_calibration_on():
    p = Params(offset=0.25, drift=-0.125)
    volts = [ambient_light.voltage(p, t) for t in (-1.0, 0.0, 1.0, 4.0)]
    assert volts == [0.25, 0.25, 0.125, -0.25]


def test_what_the_calibration_missed_stays_in_the_intensity():
    """From the start on, filter and median settled; the offset that it knew of does not."""
    electronics = Electronics(
        ambient=Params(enabled=True, offset=0.25, calibration_error=0.125),
        filter=low_pass.Params(enabled=True),
        median=sliding_median.Params(enabled=True),
    )
    dark = channel.Inputs(gap=1e9)
    x = channel.initial_state(electronics, dark)
    for _ in range(3):
        assert channel.outputs(electronics, x, dark).intensity == pytest.approx(0.125, abs=1e-9)
        x = channel.step(electronics, x, dark, 1e-3)
    assert ambient_light.voltage(electronics.ambient, 1.0) == 0.375
