"""FMU states: complete, exact to the bit, across instances and through bytes."""

import random
import struct
from hashlib import blake2b

import pytest
from conftest import Load
from hypothesis import given
from hypothesis import strategies as st
from support.driven import H, drive
from support.examples import examples
from support.fmi2 import ERROR, OK, Fmu, Instance
from support.kinds import all_kinds

pytestmark = all_kinds

NAMES = (
    "GripperPlant",
    "GripperPlantCompliant",
    "GripperPlantMovable",
    "GripperPlantMuJoCo",
    "ProximitySensor",
    "GraspController",
    "GraspControllerAdaptive",
)

PLANTS = NAMES[:4]

PARAMETERS = {
    "GripperPlant": {"finger_mass[1]": 0.7, "object_width": 0.06},
    "GripperPlantCompliant": {"finger_mass[1]": 0.7, "kelvin_voigt.stiffness": 800.0},
    "GripperPlantMovable": {"object_mass": 0.04, "friction.coulomb[2]": 0.1},
    "GripperPlantMuJoCo": {"object_mass": 0.04, "object_fixed": False, "friction.coulomb[2]": 0.1},
    "ProximitySensor": {"offset_distance": 0.006},
    "GraspController": {"contact_force.stiffness": 90.0, "impact_reduction.mass": 1.3},
    "GraspControllerAdaptive": {"contact_force.stiffness": 90.0, "hold.squeeze": 0.2},
}


def ready(fmu: Fmu) -> Instance:
    """An instance in step mode, with parameters that are not those it starts with."""
    return Instance(fmu).initialise(**PARAMETERS[fmu.name])


@pytest.mark.parametrize("name", NAMES)
def test_step_save_step_restore_step(load: Load, name: str) -> None:
    with ready(load(name)) as instance:
        drive(instance, 0, 150)
        state = instance.state()
        first = drive(instance, 150, 300)
        assert instance.restore(state) == OK
        assert drive(instance, 150, 300) == first
        state.free()


@pytest.mark.parametrize("name", NAMES)
def test_outputs_are_those_of_the_moment_of_saving(load: Load, name: str) -> None:
    with ready(load(name)) as instance:
        drive(instance, 0, 100)
        saved = instance.state(), instance.outputs()
        drive(instance, 100, 120)
        assert instance.restore(saved[0]) == OK
        assert instance.outputs() == saved[1]
        saved[0].free()


@pytest.mark.parametrize("name", NAMES)
def test_a_state_carries_over_to_another_instance(load: Load, name: str) -> None:
    with ready(load(name)) as one, Instance(load(name), "two") as two:
        drive(one, 0, 100)
        state = one.state()
        assert two.restore(state) == OK  # even one that was never initialised
        assert drive(two, 100, 200) == drive(one, 100, 200)
        state.free()


@pytest.mark.parametrize("name", NAMES)
def test_a_state_goes_through_bytes(load: Load, name: str) -> None:
    with ready(load(name)) as one:
        drive(one, 0, 100)
        state = one.state()
        data = state.to_bytes()
        state.free()
        expected = drive(one, 100, 200)
    with Instance(load(name), "two") as two:
        status, restored = two.from_bytes(data)
        assert (status, restored.to_bytes()) == (OK, data)
        assert two.restore(restored) == OK
        assert drive(two, 100, 200) == expected
        restored.free()


@pytest.mark.parametrize("name", NAMES)
def test_the_phase_is_part_of_the_state(load: Load, name: str) -> None:
    with Instance(load(name)) as instance:
        fresh = instance.state()
        instance.initialise()
        stepping = instance.state()
        drive(instance, 0, 10)
        assert instance.restore(fresh) == OK
        assert instance.step(0.0, H) == ERROR
        instance.initialise()
        assert instance.call("Terminate") == OK
        assert instance.restore(stepping) == OK
        assert instance.step(0.0, H) == OK
        fresh.free()
        stepping.free()


def test_a_state_frozen_in_time_does_not_follow_the_instance(load: Load) -> None:
    with ready(load("GripperPlant")) as instance:
        state = instance.state()
        data = state.to_bytes()
        drive(instance, 0, 50)
        assert state.to_bytes() == data
        state.free()


@pytest.mark.parametrize("name", NAMES)
def test_damaged_bytes_are_refused(load: Load, name: str) -> None:
    """Every byte counts, and so does the length."""
    with ready(load(name)) as instance:
        drive(instance, 0, 20)
        state = instance.state()
        data = state.to_bytes()
        outputs = instance.outputs()
        damaged = [data[:-1], data + b"\0", data[:40], b"", b"\0" * len(data)]
        damaged += [
            data[:k] + bytes([data[k] ^ 1 << random.Random(k).randrange(8)]) + data[k + 1 :]
            for k in range(len(data))
        ]
        for bad in damaged:
            instance.log.clear()
            assert instance.from_bytes(bad)[0] == ERROR
            assert "t = 0.02 s: state " in instance.log[0].text
            assert ": must " in instance.log[0].text
        assert instance.outputs() == outputs
        state.free()


def test_a_state_of_another_fmu_is_refused(load: Load) -> None:
    with ready(load("GripperPlant")) as plant, ready(load("ProximitySensor")) as sensor:
        state = plant.state()
        assert sensor.restore(state) == ERROR
        assert "state of another FMU: must be of this one" in sensor.log[0].text
        assert sensor.from_bytes(state.to_bytes())[0] == ERROR
        assert "state of the FMU with content" in sensor.log[1].text
        assert sensor.step(0.0, H) == OK
        state.free()


@pytest.mark.parametrize("name", PLANTS)
@given(
    forces=st.lists(st.floats(-40.0, 40.0), min_size=2, max_size=2),
    steps=st.integers(0, 60),
    size=st.sampled_from([1e-4, 1e-3, 7e-3]),
)
@examples(25)
def test_any_moment_can_be_restored(
    load: Load, name: str, forces: list[float], steps: int, size: float
) -> None:
    """In flight, in contact, leaving: from a drawn moment on, twice the same bits.

    In 80 steps 40 N bring a finger to 45 m/s; the MuJoCo plant refuses more than 50 m/s.
    """
    with Instance(load(name)).initialise() as instance:
        assert instance.set({"force[1]": forces[0], "force[2]": forces[1]}) == OK
        time = 0.0
        for _ in range(steps):
            assert instance.step(time, size) == OK
            time += size
        state = instance.state()
        runs = []
        for _ in range(2):
            assert instance.restore(state) == OK
            now, seen = time, []
            for _ in range(20):
                assert instance.step(now, size) == OK
                now += size
                seen += instance.outputs()
            runs.append(seen)
        assert runs[0] == runs[1]
        state.free()


def test_parameters_are_part_of_the_state(load: Load) -> None:
    with Instance(load("GripperPlant")) as heavy, Instance(load("GripperPlant")) as light:
        heavy.initialise(**{"finger_mass[1]": 0.7})
        light.initialise(**{"finger_mass[1]": 0.2})
        drive(light, 0, 5)
        state = heavy.state()
        assert light.restore(state) == OK
        assert light.get("finger_mass[1]") == [0.7]
        assert drive(light, 0, 50) == drive(heavy, 0, 50)
        state.free()


def test_what_may_be_set_follows_from_the_phase_restored(load: Load) -> None:
    with Instance(load("GripperPlant")) as stepping, Instance(load("GripperPlant")) as fresh:
        state = stepping.initialise().state()
        assert fresh.set({"object_width": 0.06}) == OK
        assert fresh.restore(state) == OK
        assert fresh.set({"object_width": 0.06}) == ERROR
        state.free()


@pytest.mark.parametrize("number", [1e300, float("inf"), float("nan"), -7.0, 9.0])
@pytest.mark.parametrize("place", [0, -1])
def test_bytes_with_a_right_check_sum_and_a_number_that_none_may_have(
    load: Load, number: float, place: int
) -> None:
    """The phase, and the surface: an enumeration that no host could read again."""
    with Instance(load("ProximitySensor")).initialise() as instance:
        data = bytearray(instance.state().to_bytes())
        surface = len(instance.fmu.names("input")) + len(instance.fmu.names("parameter"))
        at = 40 if place == 0 else 40 + 8 * (1 + surface)
        data[at : at + 8] = struct.pack("<d", number)
        data[24:40] = blake2b(bytes(data[8:24] + data[40:]), digest_size=16).digest()
        assert instance.from_bytes(bytes(data))[0] == ERROR
