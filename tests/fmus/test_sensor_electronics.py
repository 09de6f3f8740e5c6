"""The sensor's electronics through the FMU: states, steps, seeds, refusals."""

import pytest
from grasp_fmus.contract import declared
from proximity_sensor import channel
from support.driven import drive
from support.fmi2 import OK, Instance
from support.kinds import all_kinds

pytestmark = all_kinds

STAGES = ("pattern", "ambient", "noise", "adc", "filter", "median")
H = 1e-4


def sensor(load, **values):
    """With every stage on; a double underscore in a name stands for the point."""
    on = {f"{stage}.enabled": True for stage in STAGES}
    given = {name.replace("__", "."): value for name, value in values.items()}
    return Instance(load("ProximitySensor")).initialise(**on, **given)


def test_off_by_default():
    switches = [f for f in declared(channel) if f.path[-1] == "enabled"]
    assert [(f.path[0], f.start) for f in switches] == [(stage, False) for stage in STAGES]


@pytest.mark.parametrize("size", [1e-4, 1.7e-4, 1 / 3e4])
def test_a_state_in_the_middle_of_a_sampling_period(load, size):
    """In the instance, and through bytes in another, in which every stage is off."""
    with sensor(load, noise__seed=3, ambient__drift=0.1) as one:
        drive(one, 0, 101, size)
        state = one.state()
        first = drive(one, 101, 250, size)
        assert len(set(first)) > 20
        assert one.restore(state) == OK
        assert drive(one, 101, 250, size) == first
        with Instance(load("ProximitySensor"), "two") as two:
            status, restored = two.from_bytes(state.to_bytes())
            assert (status, two.restore(restored)) == (OK, OK)
            assert drive(two, 101, 250, size) == first
            restored.free()
        state.free()


def test_the_step_changes_neither_noise_nor_filter(load):
    seen = []
    for every in (1, 2, 10):
        with sensor(load) as instance:
            values = []
            for k in range(100 // every):
                assert instance.step(k * every * H, every * H) == OK
                values += instance.outputs()
            seen.append(values[10 // every - 1 :: 10 // every])
    assert len(set(seen[0])) > 5
    assert seen[0] == seen[1] == seen[2]


def test_equal_seeds_equal_noise(load):
    runs = []
    for seed in (1, 1, 2):
        with sensor(load, noise__seed=seed) as instance:
            runs.append(drive(instance, 0, 50, H))
    assert runs[0] == runs[1]
    assert not set(runs[1]) & set(runs[2])


@pytest.mark.parametrize(
    ("name", "value", "at_once", "text"),
    [
        ("adc.range[1]", 10.0, False, "adc.range = 10.0, 10.0 V: the second must be above the fir"),
        ("filter.cutoff", 5e3, False, "filter.cutoff = 5000.0 Hz: must be below half of sampling"),
        ("noise.seed", -1, True, "noise.seed = -1: must be from 0 to 1e+09"),
        ("adc.bits", 33, True, "adc.bits = 33: must be from 1 to 32"),
    ],
)
def test_what_does_not_fit_is_refused(load, name, value, at_once, text):
    with Instance(load("ProximitySensor")) as instance:
        refused = instance.fmu.refused
        assert instance.assign({"filter.enabled": True}) == OK
        assert instance.assign({name: value}) == (refused if at_once else OK)
        assert (instance.setup(), instance.enter()) == (OK, OK if at_once else refused)
        assert text in instance.log[0].text
