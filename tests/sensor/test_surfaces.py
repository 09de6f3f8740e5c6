"""The surfaces by name."""

import pytest
from proximity_sensor import channel, optics
from proximity_sensor.surfaces import REFLECTANCE, Surface

GAP = channel.Inputs(0.02)


def seen(p):
    return channel.outputs(p, channel.initial_state(p, GAP), GAP).intensity


def test_the_published_surfaces():
    found = {surface.name.lower(): alpha for surface, alpha in REFLECTANCE.items()}
    assert found == {"white": 1.0, "blue": 0.93, "red": 0.92, "brown": 0.86, "black": 0.57}


def test_the_sensor_was_fitted_to_white():
    assert optics.Params().reflectance == REFLECTANCE[Surface.WHITE]


@pytest.mark.parametrize(("surface", "alpha"), REFLECTANCE.items())
def test_a_surface_by_name_wins_over_the_reflectance(surface, alpha):
    named = channel.Params(surface=surface, reflectance=0.1)
    assert seen(named) == seen(channel.Params(reflectance=alpha))


def test_a_custom_surface_has_the_reflectance_given():
    assert seen(channel.Params(reflectance=0.5)) == pytest.approx(0.5 * seen(channel.Params()))
