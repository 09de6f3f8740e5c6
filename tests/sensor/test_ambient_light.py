"""The ambient offset and its drift."""

from proximity_sensor import ambient_light
from proximity_sensor.ambient_light import Params


def test_the_published_offset_does_not_drift() -> None:
    assert [ambient_light.voltage(Params(), t) for t in (0.0, 1.0, 1e4)] == [0.35] * 3


def test_it_drifts_from_the_calibration_on() -> None:
    p = Params(offset=0.25, drift=-0.125)
    volts = [ambient_light.voltage(p, t) for t in (-1.0, 0.0, 1.0, 4.0)]
    assert volts == [0.25, 0.25, 0.125, -0.25]
