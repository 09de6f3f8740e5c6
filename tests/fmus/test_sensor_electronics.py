"""The sensor's electronics through the FMU: states, steps, seeds, refusals."""

from grasp_fmus.contract import declared
from proximity_sensor import channel
from support.fmi2 import Instance
from support.kinds import all_kinds

pytestmark = all_kinds

STAGES = ("pattern", "ambient", "noise", "adc", "filter", "median")


def sensor(load, **values):
    """With every stage on; a double underscore in a name stands for the point."""
    on = {f"{stage}.enabled": True for stage in STAGES}
    given = {name.replace("__", "."): value for name, value in values.items()}
    return Instance(load("ProximitySensor")).initialise(**on, **given)


def test_off_by_default():
    switches = [f for f in declared(channel) if f.path[-1] == "enabled"]
    assert [(f.path[0], f.start) for f in switches] == [(stage, False) for stage in STAGES]
