"""The surfaces by name."""

from proximity_sensor import optics
from proximity_sensor.surfaces import REFLECTANCE


def test_the_published_surfaces() -> None:
    assert REFLECTANCE == {"white": 1.0, "blue": 0.93, "red": 0.92, "brown": 0.86, "black": 0.57}


def test_the_sensor_was_fitted_to_white() -> None:
    assert optics.Params().reflectance == REFLECTANCE["white"]
