"""What a host gets when it does something wrong, or a block does: a status, a reason, its life."""

import ctypes
import gc
import re
import sys
from collections.abc import Callable
from math import inf, nan
from pathlib import Path
from random import Random
from typing import Any

import pytest
from conftest import Altered, Load
from support.fmi2 import DISCARD, ERROR, OK, Fmu, Instance
from support.kinds import Kind, all_kinds, both_of_fmi_2, python_only

pytestmark = all_kinds

Act = Callable[[Instance], int]


def plant(load: Load, **options: Any) -> Instance:
    return Instance(load("GripperPlant"), "plant", **options)


def real(name: str, value: float) -> Act:
    return lambda instance: instance.set({name: value})


BEFORE = [
    (real("object_width", 99.0), "object_width = 99.0 m: must be from 0 to 10 m"),
    (real("finger_mass[2]", 0.0), "finger_mass[2] = 0.0 kg: must be from 0.001 to 1000 kg"),
    (real("object_width", nan), "object_width = nan m: must be from 0 to 10 m"),
    (real("force[1]", nan), "force[1] = nan N: must be a finite number"),
    (real("force[2]", -inf), "force[2] = -inf N: must be a finite number"),
    (real("gap[1]", 0.0), "gap[1]: output set: must be an input or a parameter"),
    (lambda i: i.exit(), "fmi2ExitInitializationMode before initialisation: must be in init"),
    (lambda i: i.step(0.0, 1e-3), "fmi2DoStep before initialisation: must be in step mode"),
    (lambda i: i.set_real([99], [0.0]), "value reference 99: must be from 0 to {last}"),
    (lambda i: i.set_real([2**32 - 1], [0.0]), "value reference -1: must be from 0 to {last}"),
    (lambda i: i.set_boolean([0], [True]), "force[1]: accessed as Boolean: must be as Real"),
    (lambda i: i.get_real([10])[0], "contact[1]: accessed as Real: must be as Boolean"),
    (lambda i: i.get_boolean([2])[0], "position[1]: accessed as Boolean: must be as Real"),
    (lambda i: integer(i, "GetInteger"), "value reference 3: there is no Integer variable"),
    (lambda i: integer(i, "SetInteger"), "value reference 3: there is no Integer variable"),
    (lambda i: string(i, "GetString"), "value reference 3: there is no String variable"),
    (lambda i: string(i, "SetString"), "value reference 3: there is no String variable"),
]
STEPPING = [
    (lambda i: i.step(1e-3, 0.0), "step size = 0.0 s: must be a finite number above 0"),
    (lambda i: i.step(1e-3, -1e-3), "step size = -0.001 s: must be a finite number above 0"),
    (lambda i: i.step(1e-3, nan), "step size = nan s: must be a finite number above 0"),
    (lambda i: i.step(1e-3, inf), "step size = inf s: must be a finite number above 0"),
    (lambda i: i.step(0.0, 1e-3), "step from 0.0 s: must be from 0.001 s"),
    (lambda i: i.step(2e-3, 1e-3), "step from 0.002 s: must be from 0.001 s"),
    (lambda i: i.step(nan, 1e-3), "step from nan s: must be from 0.001 s"),
    (real("force[1]", nan), "force[1] = nan N: must be a finite number"),
    (
        real("object_width", 0.05),
        "object_width: fixed parameter set in step mode: must be before fmi2ExitInit",
    ),
    (lambda i: i.enter(), "fmi2EnterInitializationMode in step mode: must be before init"),
    (lambda i: i.exit(), "fmi2ExitInitializationMode in step mode: must be in init"),
]
TERMINATED = [
    (real("force[1]", 1.0), "force[1]: set after fmi2Terminate: must be before"),
    (lambda i: i.step(1e-3, 1e-3), "fmi2DoStep after fmi2Terminate: must be in step mode"),
]


def integer(instance: Instance, function: str) -> int:
    return instance.call(function, (ctypes.c_uint * 1)(3), ctypes.c_size_t(1), (ctypes.c_int * 1)())


def string(instance: Instance, function: str) -> int:
    return instance.call(
        function, (ctypes.c_uint * 1)(3), ctypes.c_size_t(1), (ctypes.c_char_p * 1)(b"x")
    )


def refused(instance: Instance, act: Act, time: str, reason: str) -> None:
    """The call is refused, said once and in full, and everything is as it was."""
    before = instance.state().to_bytes()
    assert act(instance) == ERROR
    (said,) = instance.log
    assert (said.instance, said.status, said.category) == ("plant", ERROR, "logStatusError")
    last = 29 if instance.fmu.fmi == 2 else 30  # in FMI 3.0 the time is a variable, too
    assert said.text.startswith(f"plant, t = {time} s: {reason.format(last=last)}")
    assert "\n" not in said.text
    assert instance.state().to_bytes() == before


@pytest.mark.parametrize(("act", "reason"), BEFORE)
def test_refused_before_initialisation(load: Load, act: Act, reason: str) -> None:
    with plant(load) as instance:
        refused(instance, act, "0", reason)
        instance.initialise()  # the host may go on
        assert instance.step(0.0, 1e-3) == OK


@pytest.mark.parametrize(("act", "reason"), STEPPING)
def test_refused_while_stepping(load: Load, act: Act, reason: str) -> None:
    with plant(load) as instance:
        instance.initialise()
        assert instance.step(0.0, 1e-3) == OK
        refused(instance, act, "0.001", reason)
        assert instance.step(1e-3, 1e-3) == OK
        assert instance.call("Terminate") == OK


def test_a_start_time_that_is_none(load: Load) -> None:
    """In FMI 3.0 it comes with the next call."""
    with plant(load) as instance:
        refusing: list[Act] = [lambda i: i.setup(nan)]
        if instance.fmu.fmi == 3:
            assert instance.setup(nan) == OK
            refusing = [lambda i: i.enter()]
        refused(instance, refusing[0], "0", "start time = nan s: must be a finite number")
        instance.initialise()


@both_of_fmi_2
def test_the_start_time_is_set_before_initialisation(load: Load) -> None:
    with plant(load).initialise() as instance:
        text = "fmi2SetupExperiment in step mode: must be before initialisation"
        refused(instance, lambda i: i.setup(), "0", text)


@pytest.mark.parametrize(("act", "reason"), TERMINATED)
def test_refused_after_the_end(load: Load, act: Act, reason: str) -> None:
    with plant(load) as instance:
        instance.initialise()
        assert instance.step(0.0, 1e-3) == OK
        assert instance.call("Terminate") == OK
        refused(instance, act, "0.001", reason)
        assert instance.get("position[1]") == [0.11]


def test_parameters_that_do_not_go_together(load: Load) -> None:
    with plant(load) as instance:
        assert instance.set({"object_width": 0.5}) == OK
        assert instance.enter() == ERROR
        assert (
            "object spans -0.22 to 0.28 m, must fit between the fingertips" in instance.log[0].text
        )
        assert instance.set({"object_width": 0.05}) == OK
        assert (instance.enter(), instance.exit()) == (OK, OK)


def test_a_refused_list_of_values_sets_none_of_them(load: Load) -> None:
    with plant(load) as instance:
        instance.initialise(**{"force[1]": -1.0})
        assert instance.set({"force[1]": 5.0, "force[2]": nan}) == ERROR
        assert instance.get("force[1]", "force[2]") == [-1.0, 0.0]


def test_a_tunable_parameter_is_checked_while_stepping(load: Load) -> None:
    with Instance(load("ProximitySensor"), "eye") as instance:
        instance.initialise()
        assert instance.set({"reflectance": 11.0}) == ERROR
        assert instance.log[0].text == "eye, t = 0 s: reflectance = 11.0 1: must be from 0 to 10 1"
        assert instance.set({"reflectance": 0.5}) == OK


def test_a_step_with_no_finite_result_is_discarded(load: Load) -> None:
    """The slave stays where it was, so that the host can try a shorter one."""
    with plant(load) as instance:
        instance.initialise()
        assert instance.set({"force[1]": 1e300, "force[2]": -1e300}) == OK
        before = instance.state().to_bytes()
        assert instance.step(0.0, 1e6) == DISCARD
        (said,) = instance.log
        assert (said.status, said.category) == (DISCARD, "logStatusDiscard")
        assert said.text.startswith("plant, t = 0 s: step of 1000000.0 s: position[1] = inf m, ")
        assert instance.state().to_bytes() == before
        assert instance.step(0.0, 1e-3) == OK


def test_large_values_whose_sum_is_not_finite_are_values(load: Load) -> None:
    with plant(load) as instance:
        instance.initialise()
        assert instance.set({"force[1]": 1.7e308, "force[2]": 1.7e308}) == OK
        assert instance.get("force[1]", "force[2]") == [1.7e308, 1.7e308]


@pytest.mark.parametrize("start", [0.0, -3.0, 1e6])
def test_time_may_begin_anywhere_and_be_summed_up(load: Load, start: float) -> None:
    with plant(load) as instance:
        assert (instance.setup(start), instance.enter(), instance.exit()) == (OK, OK, OK)
        time = start
        for _ in range(2000):
            assert instance.step(time, 1e-4) == OK
            time += 1e-4
        assert instance.step(start, 1e-4) == ERROR


@pytest.mark.parametrize(("start", "off"), [(0.0, 1e-9), (-3.0, 1e-9), (1e6, 1e-6)])
def test_how_far_the_clocks_may_be_apart(load: Load, start: float, off: float) -> None:
    """A nanosecond, or 1e-12 of the time where that is more."""
    with plant(load) as instance:
        assert (instance.setup(start), instance.enter(), instance.exit()) == (OK, OK, OK)
        for factor in (1.5, -1.5):
            assert instance.step(start + factor * off, 1e-3) == ERROR
        assert instance.step(start + 0.8 * off, 1e-3) == OK
        assert instance.step(start + 1e-3, 1e-3) == OK


def test_outputs_follow_an_input_whose_step_was_discarded(altered: Altered, tmp_path: Path) -> None:
    source, step = "proximity_sensor/channel.py", "    return x\n"
    never = "    return x._replace(wait=x.wait / 0.0)\n"
    fmu = Fmu(altered("ProximitySensor", source, step, never), tmp_path)
    with Instance(fmu, "eye") as instance:
        instance.initialise(gap=0.02)
        (far,) = instance.get("intensity")
        assert instance.set({"gap": 0.01}) == OK
        assert instance.step(0.0, 1e-3) == DISCARD
        assert instance.get("intensity")[0] > far


def test_a_host_with_ever_new_lists_of_references_fills_no_memory(load: Load) -> None:
    with plant(load) as instance:
        instance.initialise()
        references = list(range(9))
        random = Random(1)

        def read(times: int) -> int:
            for _ in range(times):
                random.shuffle(references)
                assert instance.get_real(references)[0] == OK
            gc.collect()
            return sys.getallocatedblocks()

        before = read(200)
        assert read(1200) - before < 700


def test_time_may_be_multiplied(load: Load) -> None:
    with plant(load) as instance:
        instance.initialise()
        assert {instance.step(k * 1e-4, 1e-4) for k in range(2000)} == {OK}


@python_only
def test_with_debug_logging_pythonfmu_adds_no_second_reason(load: Load) -> None:
    with plant(load, logging=True) as instance:
        assert instance.set({"force[1]": nan}) == ERROR
        assert [said.text.partition(":")[2].strip() for said in instance.log] == [
            "force[1] = nan N: must be a finite number",
            "[setReal] PyObject_CallMethod\nfailed, for the reason logged before",
        ]


def test_per_cent_signs_do_not_reach_the_hosts_printf(load: Load) -> None:
    """The logger of FMI is a printf: a %s in a message would read memory that is not there."""
    with Instance(load("GripperPlant"), "50 %s") as instance:
        assert instance.set({"force[1]": nan}) == ERROR
        assert instance.log[0].text.startswith("50 %%s, t = 0 s: force[1]")


LIGHT = "    l = 0.0 if u.gap < 0.0 else u.gap\n"


def faulty(altered: Altered, folder: Path, statement: str) -> Fmu:
    """A sensor whose block does something when it is close."""
    source = "proximity_sensor/optics.py"
    trap = f"    if u.gap < 0.01:\n        {statement}\n{LIGHT}"
    return Fmu(altered("ProximitySensor", source, LIGHT, trap), folder)


@pytest.mark.parametrize("logging", [False, True])
def test_a_bug_in_a_block_leaves_its_traceback(
    altered: Altered, kind: Kind, tmp_path: Path, logging: bool
) -> None:
    fmu = faulty(altered, tmp_path, "raise LookupError('the lamp is broken')")
    with Instance(fmu, "eye", logging) as instance:
        instance.initialise(gap=0.02)
        assert instance.set({"gap": 0.005}) == OK
        acts: list[Act] = [lambda i: i.step(0.0, 1e-3), lambda i: i.get_real([1])[0]]
        for act in acts:
            instance.log.clear()
            assert act(instance) == ERROR
            begin, broken = "eye, t = 0 s: ", "LookupError: the lamp is broken"
            text = instance.log[0].text
            if kind == "python":
                assert text.startswith(f"{begin}Traceback (most recent call last):")
                assert re.search(r"optics\.py\", line \d+, in ", text)
                assert text.endswith(broken)
            else:  # what is in C has no traceback
                assert text == begin + broken
        assert instance.set({"gap": 0.02}) == OK
        assert instance.step(0.0, 1e-3) == OK
        assert instance.call("Terminate") == OK


@pytest.mark.parametrize(
    "statement", ["return Outputs(u.gap / 0.0)", "return Outputs((u.gap + 1e308) ** 2.0)"]
)
def test_arithmetic_that_fails_in_a_step_is_discarded(
    altered: Altered, tmp_path: Path, statement: str
) -> None:
    fmu = faulty(altered, tmp_path, statement)
    with Instance(fmu, "eye") as instance:
        instance.initialise(gap=0.02)
        assert instance.set({"gap": 0.005}) == OK
        assert instance.step(0.0, 1e-3) == DISCARD
        error = r"(ZeroDivisionError|OverflowError): .+: must be finite"
        assert re.fullmatch(rf"eye, t = 0 s: step of 0\.001 s: {error}", instance.log[0].text)


def test_an_output_that_is_not_finite_is_not_given(altered: Altered, tmp_path: Path) -> None:
    fmu = faulty(altered, tmp_path, "return Outputs((1e308 + u.gap) * 10.0 * 0.0)")
    with Instance(fmu, "eye") as instance:
        instance.initialise(gap=0.02)
        assert instance.set({"gap": 0.005}) == OK
        assert instance.get_real([1])[0] == ERROR
        assert instance.log[0].text == "eye, t = 0 s: intensity = nan V: must be finite"
        assert instance.step(0.0, 1e-3) == DISCARD


@python_only
@pytest.mark.parametrize(
    "statement",
    [
        "raise LookupError('50 %n%s%n%s')",  # pythonfmu would pass it to the host's printf
        "raise type('Odd', (Exception,), {'__repr__': lambda self: 1 / 0})()",
        "raise KeyboardInterrupt",
    ],
)
def test_what_pythonfmu_adds_to_an_exception_is_harmless(
    altered: Altered, tmp_path: Path, statement: str
) -> None:
    fmu = faulty(altered, tmp_path, statement)
    with Instance(fmu, "eye", logging=True) as instance:
        instance.initialise(gap=0.02)
        assert instance.set({"gap": 0.005}) == OK
        assert instance.step(0.0, 1e-3) == ERROR
        logged, added = instance.log
        assert "Traceback" in logged.text
        assert "%" not in logged.text.replace("%%", "")
        assert added.text.endswith("PyObject_CallMethod\nfailed, for the reason logged before")


def test_a_block_that_does_not_start_says_why(altered: Altered, tmp_path: Path) -> None:
    source, start = "proximity_sensor/channel.py", "    return State(0.0, "
    broken = f"    if u.gap > 0.0:\n        raise LookupError('no lamp')\n{start}"
    fmu = Fmu(altered("ProximitySensor", source, start, broken), tmp_path)
    instance = object.__new__(Instance)
    with pytest.raises(AssertionError):
        instance.__init__(fmu, "eye")  # type: ignore[misc]
    (said,) = instance.log
    assert said.status == ERROR
    assert said.text.endswith("LookupError: no lamp")


@pytest.mark.parametrize("name", ["", "fifteen letters", "sixteen letters.", "x" * 300, "Größe µ"])
def test_the_reason_is_logged_whatever_the_name(load: Load, name: str) -> None:
    with Instance(load("GripperPlant"), name) as instance:
        assert instance.set({"force[1]": nan}) == ERROR
        (said,) = instance.log
        assert said.instance == name
        assert said.text == f"{name}, t = 0 s: force[1] = nan N: must be a finite number"


def test_a_host_without_a_logger(load: Load) -> None:
    with Instance(load("GripperPlant"), logger=False) as instance:
        assert instance.set({"force[1]": nan}) == ERROR
        instance.initialise()
        assert instance.log == []


NOTHING = ctypes.c_void_p()
FROM_C = [
    lambda i: i.call("SetFMUstate", NOTHING),
    lambda i: i.call("SerializedFMUstateSize", NOTHING, ctypes.byref(ctypes.c_size_t())),
]


@pytest.mark.parametrize("act", FROM_C)
def test_exceptions_that_never_reach_the_slave(load: Load, act: Act) -> None:
    """In a Python FMU they arise in pythonfmu, which would give up references that it uses."""
    with plant(load) as instance:
        instance.initialise()
        assert [act(instance) for _ in range(20)] == [ERROR] * 20
        assert instance.step(0.0, 1e-3) == OK


def test_sixty_exceptions_in_one_instance(load: Load) -> None:
    """pythonfmu 0.7.0 alone gives up a reference to it with each."""
    with plant(load) as instance:
        for _ in range(60):
            assert instance.set({"force[1]": nan}) == ERROR
        instance.initialise()
        assert instance.call("Reset") == OK
        for _ in range(60):
            assert instance.step(0.0, 1e-3) == ERROR
        assert instance.call("Terminate") == OK
