"""An FMU as a host sees it: values before and after a set, steps that are too long, states."""

from ctypes import byref, c_int
from math import inf, nan
from types import SimpleNamespace

import pytest
from grasp_cosim import SimulationError, System, simulate
from grasp_cosim.fmu_export.contract import longest_step
from grasp_cosim.fmu_export.shipped import blocks
from grasp_cosim.system.parts import Component
from grasp_cosim.system.times import NANOSECONDS
from hypothesis import given
from hypothesis import strategies as st
from support.fmi2 import OK, H, Instance, drive
from support.kinds import all_kinds
from support.marks import examples

pytestmark = all_kinds

BLOCKS = blocks()
PARAMETERS = {
    "GripperPlant": {"finger_mass[1]": 0.7, "object_width": 0.06},
    "GripperPlantCompliant": {"finger_mass[1]": 0.7, "kelvin_voigt.stiffness": 800.0},
    "GripperPlantDelicate": {"object_mass": 0.04, "lift.enabled": True},
    "GripperPlantMovable": {"object_mass": 0.04, "friction.coulomb[2]": 0.1},
    "ProximitySensor": {"offset_distance": 0.006},
    "GraspController": {"contact_force.stiffness": 90.0, "impact_reduction.mass": 1.3},
    "GraspControllerAdaptive": {"contact_force.stiffness": 90.0, "hold.squeeze": 0.2},
}
NAMES = tuple(PARAMETERS)
PLANTS = NAMES[:4]


def test_outputs_agree_with_inputs_in_initialisation_mode(load):
    with Instance(load("ProximitySensor")) as instance:
        assert (instance.setup(), instance.enter()) == (OK, OK)
        for gap, reflectance in ((0.02, 1.0), (0.01, 0.5)):
            assert instance.set({"gap": gap, "reflectance": reflectance}) == OK
            expected = 0.0024 * reflectance / (gap + 0.005) ** 1.1506
            assert instance.get("intensity") == [pytest.approx(expected, rel=1e-14)]


# Long steps

TERMINATED = 3
"""Of fmi2StatusKind."""


@pytest.mark.parametrize("name", [*PLANTS, "ProximitySensor"])
def test_a_step_that_is_too_long_is_discarded(load, name):
    """The instance stays as it is, and takes the step that the log says it would take."""
    longest = BLOCKS[name].LONGEST_STEP
    with Instance(load(name)).initialise() as instance:
        assert instance.step(0.0, 1e-3) == OK
        before = instance.outputs(), instance.state().to_bytes()
        assert instance.step(1e-3, 2.0 * longest) == instance.fmu.discarded
        said = f"step of {2.0 * longest} s: must be at most {longest:g} s"
        assert instance.log[-1].text == f"instance, t = 0.001 s: {said}"
        assert (instance.outputs(), instance.state().to_bytes()) == before
        ends = c_int(-1)
        assert instance.call("GetBooleanStatus", TERMINATED, byref(ends)) == OK
        assert not ends.value  # it is the step that is wrong, not the time to end
        assert instance.step(1e-3, longest) == OK


def test_a_step_that_is_too_long_ends_a_run(kind, folder_of):
    """On each kind: ours are not gone on with in parts, as what else discards a step is."""
    sensor = Component("sensor", folder_of(kind) / "ProximitySensor.fmu", {"gap": 0.01})
    system = System("long", (sensor,), (), 4 * NANOSECONDS, 8 * NANOSECONDS, "sequential")
    refusal = r"^sensor: .* at t = 0 s: .*step of 4\.0 s: must be at most 2 s"
    with pytest.raises(SimulationError, match=refusal):
        simulate(system)


@pytest.mark.parametrize("name", ["GraspController", "GraspControllerAdaptive"])
def test_a_block_without_sub_steps_takes_any_step(load, name):
    with Instance(load(name)).initialise() as instance:
        assert instance.step(0.0, 1e300) == OK


STIFF = {
    "GripperPlant": {"baumgarte_alpha": 1e5},
    "GripperPlantDelicate": {"side.stiffness": 1e7},
}


@pytest.mark.parametrize("name", PLANTS)
def test_a_step_with_too_many_sub_steps_is_discarded(load, name):
    """They would be over 20,000; the instance takes a shorter one."""
    stiff = STIFF.get(name, {"kelvin_voigt.damping": 1e5})
    closed = {"initial_position[1]": 0.0651, "initial_position[2]": -0.0051}
    with Instance(load(name)).initialise(**closed, **stiff) as instance:
        assert instance.set({"force[1]": -3.0, "force[2]": 3.0}) == OK
        assert instance.step(0.0, 1.0) == instance.fmu.discarded
        assert "step of 1.0 s: position[1] = nan m" in instance.log[-1].text
        assert instance.log[-1].text.endswith("must be finite")
        assert instance.step(0.0, 1e-5) == OK


@pytest.mark.parametrize(("declared", "longest"), [({}, inf), ({"LONGEST_STEP": 2}, 2.0)])
def test_the_longest_step_of_a_block(declared, longest):
    assert longest_step(SimpleNamespace(**declared)) == longest


@pytest.mark.parametrize("value", [0.0, nan, "10", True])
def test_a_longest_step_is_a_positive_number(value):
    with pytest.raises(TypeError, match=r"^LONGEST_STEP = .*: must be a positive number, in s$"):
        longest_step(SimpleNamespace(LONGEST_STEP=value))


# States


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
    h=st.sampled_from([1e-4, 1e-3, 7e-3]),
)
@examples(25)
def test_any_moment_can_be_restored(load, name, forces, steps, h):
    """In flight, in contact, leaving: from a drawn moment on, twice the same bits."""

    def run(first, last):
        for k in range(first, last):
            assert instance.step(k * h, h) == OK
            yield instance.outputs()

    with Instance(load(name)).initialise() as instance:
        assert instance.set({"force[1]": forces[0], "force[2]": forces[1]}) == OK
        list(run(0, steps))
        state = instance.state()
        once = list(run(steps, steps + 20))
        assert instance.restore(state) == OK
        assert list(run(steps, steps + 20)) == once
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
