"""The sensor's electronics through the FMU: states, steps, seeds, refusals."""

from math import sin

import pytest
from conftest import Load
from grasp_fmus.contract import declared
from proximity_sensor import channel
from support.fmi2 import OK, Instance
from support.kinds import all_kinds

pytestmark = all_kinds

STAGES = ("pattern", "ambient", "noise", "adc", "filter", "median")
H = 1e-4


def sensor(load: Load, seed: int = 1, **values: float) -> Instance:
    """With every stage on; a double underscore in a name stands for the point."""
    instance = Instance(load("ProximitySensor"))
    on = {f"{stage}.enabled": True for stage in STAGES}
    given = {name.replace("__", "."): value for name, value in values.items()}
    return instance.initialise(**on, **{"noise.seed": seed}, **given)


def drive(instance: Instance, first: int, last: int, size: float = H) -> list[float]:
    """Steps from first to last under a gap that changes; returns the outputs before each."""
    seen = []
    for k in range(first, last):
        assert instance.set({"gap": 0.05 + 0.045 * sin(20.0 * k * size)}) == OK
        seen += instance.outputs()
        assert instance.step(k * size, size) == OK
    return seen


def test_off_by_default() -> None:
    switches = [f for f in declared(channel) if f.path[-1] == "enabled"]
    assert [f.path[0] for f in switches] == list(STAGES)
    assert [f.start for f in switches] == [False] * len(STAGES)


@pytest.mark.parametrize("size", [1e-4, 1.7e-4, 1 / 3e4])
def test_step_save_step_restore_step(load: Load, size: float) -> None:
    """In the middle of a sampling period as well."""
    with sensor(load, seed=3, ambient__drift=0.1) as instance:
        drive(instance, 0, 101, size)
        state = instance.state()
        first = drive(instance, 101, 250, size)
        assert len(set(first)) > 20
        assert instance.restore(state) == OK
        assert drive(instance, 101, 250, size) == first
        state.free()


def test_a_state_goes_through_bytes_to_another_instance(load: Load) -> None:
    with sensor(load, seed=3) as one:
        drive(one, 0, 101)
        state = one.state()
        data = state.to_bytes()
        state.free()
        expected = drive(one, 101, 200)
    with Instance(load("ProximitySensor"), "two") as two:  # in which every stage is off
        status, restored = two.from_bytes(data)
        assert (status, restored.to_bytes()) == (OK, data)
        assert two.restore(restored) == OK
        assert drive(two, 101, 200) == expected
        restored.free()


def test_the_step_changes_neither_noise_nor_filter(load: Load) -> None:
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


def test_equal_seeds_equal_noise(load: Load) -> None:
    runs = []
    for seed in (1, 1, 2):
        with sensor(load, seed=seed) as instance:
            runs.append(drive(instance, 0, 50))
    assert runs[0] == runs[1]
    assert not set(runs[1]) & set(runs[2])


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("adc.range[1]", 10.0, "adc.range = 10.0, 10.0 V: the second must be above the first"),
        ("filter.cutoff", 5e3, "filter.cutoff = 5000.0 Hz: must be below half of sampling.rate, "),
    ],
)
def test_what_does_not_fit_is_refused(load: Load, name: str, value: float, text: str) -> None:
    with Instance(load("ProximitySensor")) as instance:
        assert instance.assign({"filter.enabled": True, name: value}) == OK
        assert (instance.setup(), instance.enter()) == (OK, instance.fmu.refused)
        assert text in instance.log[0].text


@pytest.mark.parametrize(
    ("name", "value", "text"),
    [
        ("noise.seed", -1, "noise.seed = -1: must be from 0 to 1e+09"),
        ("adc.bits", 33, "adc.bits = 33: must be from 1 to 32"),
    ],
)
def test_whole_numbers_have_a_range_too(load: Load, name: str, value: int, text: str) -> None:
    with Instance(load("ProximitySensor")) as instance:
        assert instance.assign({name: value}) == instance.fmu.refused
        assert text in instance.log[0].text
