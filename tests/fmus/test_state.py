"""FMU states: complete, exact to the bit, across instances and through bytes."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.fmi2 import OK, H, Instance, drive
from support.kinds import all_kinds
from support.marks import examples

pytestmark = all_kinds

PARAMETERS = {
    "GripperPlant": {"finger_mass[1]": 0.7, "object_width": 0.06},
    "GripperPlantCompliant": {"finger_mass[1]": 0.7, "kelvin_voigt.stiffness": 800.0},
    "GripperPlantMovable": {"object_mass": 0.04, "friction.coulomb[2]": 0.1},
    "ProximitySensor": {"offset_distance": 0.006},
    "GraspController": {"contact_force.stiffness": 90.0, "impact_reduction.mass": 1.3},
    "GraspControllerAdaptive": {"contact_force.stiffness": 90.0, "hold.squeeze": 0.2},
}
NAMES = tuple(PARAMETERS)
PLANTS = NAMES[:3]


def ready(fmu):
    """An instance in step mode, with parameters that are not those it starts with."""
    return Instance(fmu).initialise(**PARAMETERS[fmu.name])


@pytest.mark.parametrize("name", NAMES)
def test_a_state_goes_through_bytes(load, name):
    with ready(load(name)) as one, Instance(load(name), "two") as two:
        drive(one, 0, 100)
        state = one.state()
        data = state.to_bytes()
        status, restored = two.from_bytes(data)
        assert (status, restored.to_bytes()) == (OK, data)
        assert two.restore(restored) == OK
        assert drive(two, 100, 200) == drive(one, 100, 200)
        restored.free()
        state.free()


@pytest.mark.parametrize("name", NAMES)
def test_bytes_that_are_no_state_are_refused(load, name):
    """Of another size, of another FMU; the instance goes on."""
    with ready(load(name)) as instance:
        drive(instance, 0, 20)
        state = instance.state()
        data, outputs = state.to_bytes(), instance.outputs()
        state.free()
        damaged = [data[:-1], data + b"\0", data[:24], b"", b"\0" * len(data)]
        damaged += [data[:k] + bytes([data[k] ^ 1]) + data[k + 1 :] for k in range(24)]
        for bad in damaged:
            instance.log.clear()
            assert instance.from_bytes(bad)[0] == instance.fmu.refused
            assert "t = 0.02 s: state " in instance.log[0].text
            assert ": must " in instance.log[0].text
        assert instance.outputs() == outputs
        assert drive(instance, 20, 25)


def test_a_state_of_another_fmu_is_refused(load):
    with ready(load("GripperPlant")) as plant, ready(load("ProximitySensor")) as sensor:
        state = plant.state()
        assert sensor.restore(state) == sensor.fmu.refused
        assert sensor.from_bytes(state.to_bytes())[0] == sensor.fmu.refused
        for said in sensor.log:
            assert "state of another FMU: must be of this one" in said.text
        assert sensor.step(0.0, H) == OK
        state.free()


@pytest.mark.parametrize("name", PLANTS)
@given(
    forces=st.lists(st.floats(-40.0, 40.0), min_size=2, max_size=2),
    steps=st.integers(0, 60),
    size=st.sampled_from([1e-4, 1e-3, 7e-3]),
)
@examples(25)
def test_any_moment_can_be_restored(load, name, forces, steps, size):
    """In flight, in contact, leaving: from a drawn moment on, twice the same bits."""
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


def test_what_may_be_set_follows_from_the_phase_restored(load):
    """The parameters are part of the state, too."""
    with Instance(load("GripperPlant")) as stepping, Instance(load("GripperPlant")) as fresh:
        state = stepping.initialise(**{"finger_mass[1]": 0.7}).state()
        assert fresh.set({"object_width": 0.06}) == OK
        assert fresh.restore(state) == OK
        assert fresh.get("finger_mass[1]", "object_width") == [0.7, 0.07]
        assert fresh.set({"object_width": 0.06}) == fresh.fmu.refused
        state.free()
