"""What a host gets when it does something wrong, or a block does: a status, a reason, its life."""

import ctypes
import sys
from math import nan

import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi2 import (
    FMU2Slave,
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)
from support.fmi2 import FATAL, OK, Fmu, Instance
from support.kinds import all_kinds, both_of_fmi_2, python_only

pytestmark = all_kinds


def plant(load, **options):
    return Instance(load("GripperPlant"), "plant", **options)


def real(name, value):
    return lambda instance: instance.set({name: value})


def other(call, type_):
    """The last of the Reals as of another type."""
    return lambda i: i.call(call, (ctypes.c_uint * 1)(3), ctypes.c_size_t(1), (type_ * 1)())


BEFORE = [
    (real("object_width", 99.0), "object_width = 99.0 m: must be from 0 to 10 m"),
    (real("finger_mass[2]", 0.0), "finger_mass[2] = 0.0 kg: must be from 0.001 to 1000 kg"),
    (real("force[1]", nan), "force[1] = nan N: must be a finite number"),
    (real("gap[1]", 0.0), "gap[1]: output set: must be an input or a parameter"),
    (lambda i: i.exit(), "fmi2ExitInitializationMode before initialisation: must be in init"),
    (lambda i: i.step(0.0, 1e-3), "fmi2DoStep before initialisation: must be in step mode"),
    (lambda i: i.set_real([99], [0.0]), "value reference 99: must be"),
    (lambda i: i.set_boolean([0], [True]), "force[1]: accessed as Boolean: must be as Real"),
    (lambda i: i.get_real([10])[0], "contact[1]: accessed as Real: must be as Boolean"),
    (other("GetInteger", ctypes.c_int), "Integer"),
    (other("GetString", ctypes.c_char_p), "String"),
]
STEPPING = [
    (lambda i: i.step(1e-3, 0.0), "step size = 0.0 s: must be a finite number above 0"),
    (lambda i: i.step(1e-3, nan), "step size = nan s: must be a finite number above 0"),
    (lambda i: i.step(0.0, 1e-3), "step from 0.0 s: must be from 0.001 s"),
    (lambda i: i.step(2e-3, 1e-3), "step from 0.002 s: must be from 0.001 s"),
    (real("force[1]", nan), "force[1] = nan N: must be a finite number"),
    (real("object_width", 0.05), "object_width: fixed parameter set in step mode: must be before"),
    (lambda i: i.enter(), "fmi2EnterInitializationMode in step mode: must be before init"),
]
TERMINATED = [
    (real("force[1]", 1.0), "force[1]: set after fmi2Terminate: must be before"),
    (lambda i: i.step(1e-3, 1e-3), "fmi2DoStep after fmi2Terminate: must be in step mode"),
]


def refused(instance, act, time, reason):
    """The call is refused, said once and in full, and everything is as it was."""
    before = instance.state().to_bytes()
    assert act(instance) == instance.fmu.refused
    (said,) = instance.log
    assert (said.instance, said.status) == ("plant", instance.fmu.refused)
    begin, _, rest = said.text.partition(" s: ")
    assert begin == f"plant, t = {time}"
    assert reason in rest
    assert "\n" not in said.text
    assert instance.state().to_bytes() == before
    instance.log.clear()


def test_refused_before_initialisation(load):
    with plant(load) as instance:
        for act, reason in BEFORE:
            refused(instance, act, "0", reason)
        instance.initialise()  # the host may go on
        assert instance.step(0.0, 1e-3) == OK


def test_refused_while_stepping_and_after_the_end(load):
    with plant(load).initialise() as instance:
        assert instance.step(0.0, 1e-3) == OK
        for act, reason in STEPPING:
            refused(instance, act, "0.001", reason)
        assert instance.step(1e-3, 1e-3) == OK
        assert instance.call("Terminate") == OK
        for act, reason in TERMINATED:
            refused(instance, act, "0.002", reason)
        assert instance.get("finger_mass[1]") == [0.5]


@both_of_fmi_2
def test_the_start_time_is_finite_and_set_before_initialisation(load):
    with plant(load) as instance:
        text = "start time = nan s: must be a finite number"
        refused(instance, lambda i: i.setup(nan), "0", text)
        instance.initialise()
        text = "fmi2SetupExperiment in step mode: must be before initialisation"
        refused(instance, lambda i: i.setup(), "0", text)


def test_parameters_that_do_not_go_together(load):
    with plant(load) as instance:
        assert instance.set({"object_width": 0.5}) == OK
        text = "object spans -0.22 to 0.28 m, must fit between the fingertips"
        refused(instance, lambda i: i.enter(), "0", text)
        assert instance.set({"object_width": 0.05}) == OK
        assert (instance.enter(), instance.exit()) == (OK, OK)


def test_a_refused_list_of_values_sets_none_of_them(load):
    with plant(load) as instance:
        instance.initialise(**{"force[1]": -1.0})
        assert instance.set({"force[1]": 5.0, "force[2]": nan}) == instance.fmu.refused
        assert instance.get("force[1]", "force[2]") == [-1.0, 0.0]


def test_a_tunable_parameter_is_checked_while_stepping(load):
    with Instance(load("ProximitySensor"), "eye") as instance:
        instance.initialise()
        assert instance.set({"reflectance": 11.0}) == instance.fmu.refused
        assert "eye, t = 0 s: reflectance = 11.0 1: must be from 0 to 10" in instance.log[0].text
        assert instance.set({"reflectance": 0.5}) == OK


def test_a_step_with_no_finite_result_leaves_everything_as_it_was(load):
    """The inputs are taken by then, and the outputs follow them."""
    with plant(load) as instance:
        instance.initialise(**{"finger_mass[1]": 1e-3})
        assert instance.set({"force[1]": 1.7e308}) == OK
        before = instance.state().to_bytes()
        for _ in range(3):
            assert instance.step(0.0, 10.0) == instance.fmu.discarded
        assert instance.log[0].status == instance.fmu.discarded
        assert "plant, t = 0 s: step of 10.0 s: " in instance.log[0].text
        assert instance.state().to_bytes() == before
        assert instance.set({"force[1]": 0.0}) == OK
        assert instance.step(0.0, 1e-3) == OK


# What a block does wrong

LIGHT = "    l = 0.0 if u.gap < 0.0 else u.gap\n"


def faulty(altered, folder, statement):
    """A sensor whose block does something when it is close; it is far away."""
    source = "proximity_sensor/optics.py"
    trap = f"    if u.gap < 0.01:\n        {statement}\n{LIGHT}"
    fmu = Fmu(altered("ProximitySensor", source, LIGHT, trap), folder)
    return Instance(fmu, "eye").initialise(gap=0.02)


@python_only
@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ("raise LookupError('the lamp is broken')", "LookupError: the lamp is broken"),
        ("raise LookupError('50 %n%s%n%s')", "50 %%n%%s%%n%%s"),  # pythonfmu would pass it on
        ("raise LookupError('\\ud800')", "LookupError: "),  # no UTF-8
        ("raise KeyboardInterrupt", "KeyboardInterrupt"),
    ],
)
def test_a_bug_in_a_block_leaves_its_traceback(altered, tmp_path, statement, said):
    with faulty(altered, tmp_path, statement) as instance:
        assert instance.set({"gap": 0.005}) == OK
        acts = [lambda i: i.step(0.0, 1e-3), lambda i: i.get_real([1])[0]]
        for act in acts:
            instance.log.clear()
            assert act(instance) == FATAL
            (logged,) = instance.log
            assert logged.text.startswith("eye, t = 0 s: Traceback (most recent call last):")
            assert said in logged.text.rpartition("\n")[2]
        assert instance.set({"gap": 0.02}) == OK
        assert instance.step(0.0, 1e-3) == OK
        assert instance.call("Terminate") == OK


@pytest.mark.parametrize(
    "result", ["u.gap / 0.0", "(u.gap + 1e308) ** 2.0", "(1e308 + u.gap) * 10.0 * 0.0"]
)
def test_arithmetic_that_fails_is_refused(altered, tmp_path, result):
    with faulty(altered, tmp_path, f"return Outputs({result})") as instance:
        assert instance.set({"gap": 0.005}) == OK
        assert instance.step(0.0, 1e-3) == instance.fmu.discarded
        assert "eye, t = 0 s: step of 0.001 s: " in instance.log[0].text
        assert instance.get_real([1])[0] == instance.fmu.refused
        assert instance.set({"gap": 0.02}) == OK
        assert instance.step(0.0, 1e-3) == OK


@python_only
def test_a_block_that_does_not_start_says_why(altered, tmp_path):
    source, start = "proximity_sensor/channel.py", "    return State(0.0, "
    broken = f"    if u.gap > 0.0:\n        raise ImportError('no lamp')\n{start}"
    fmu = Fmu(altered("ProximitySensor", source, start, broken), tmp_path)
    instance = object.__new__(Instance)
    with pytest.raises(AssertionError):
        instance.__init__(fmu, "eye")  # type: ignore[misc]
    assert [said.text for said in instance.log] == ["eye, t = 0 s: no lamp"]


# What the host sees


@both_of_fmi_2
def test_the_reason_reaches_the_log_of_fmpy(load, kind, monkeypatch):
    """Its logger is Python, and cannot run while an exception is set; Python would tell of that."""
    told = []
    said = []
    monkeypatch.setattr(sys, "unraisablehook", told.append)
    fmu = load("GripperPlant")
    callbacks = fmi2CallbackFunctions()
    callbacks.logger = fmi2CallbackLoggerTYPE(lambda *given: said.append(given[-1].decode()))
    callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE()
    callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE()
    slave = FMU2Slave(
        guid=fmu.guid, unzipDirectory=str(fmu.folder), modelIdentifier=fmu.name, instanceName="one"
    )
    slave.instantiate(callbacks=callbacks, loggingOn=True)
    slave.setupExperiment()
    for _ in range(3):
        with pytest.raises(FMICallException):
            slave.setReal([fmu.references["finger_mass[1]"]], [-1.0])
    slave.enterInitializationMode()
    slave.exitInitializationMode()
    slave.doStep(0.0, 1e-3)
    slave.terminate()
    slave.fmi2FreeInstance(slave.component)
    assert told == []
    reason = "one, t = 0 s: finger_mass[1] = -1.0 kg: must be from 0.001 to 1000 kg"
    assert [text.endswith(reason) for text in said] == [True] * 3
