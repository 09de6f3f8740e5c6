"""The parameters of the node that do not fit, each in one line."""

import pytest
from grasp_cosim import InputError
from grasp_cosim_ros.settings import Settings


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({}, "fmu = '', system = '': must have one of the two"),
        ({"fmu": "a", "system": "b"}, "must have one of the two"),
        ({"fmu": "a"}, "topics = '': must be the YAML file"),
        ({"fmu": "a", "topics": "t", "without": "b"}, "without = 'b': must be empty with an FMU"),
        ({"fmu": "a", "topics": "t", "mode": "fast"}, "must be one of lockstep, clock"),
        ({"fmu": "a", "topics": "t", "on_loss": "x"}, "must be one of stop, failsafe, hold"),
        ({"fmu": "a", "topics": "t", "timeout": 0.0}, "timeout = 0.0: must be a time in s"),
        ({"fmu": "a", "topics": "t", "period": -1.0}, "period = -1.0: must be 0 or a time"),
        ({"fmu": "a", "topics": "t", "misses_tolerated": -1}, "misses_tolerated = -1: must be"),
    ],
)
def test_what_does_not_fit_is_refused(settings, message):
    with pytest.raises(InputError) as caught:
        Settings(**settings)
    assert message in str(caught.value)
