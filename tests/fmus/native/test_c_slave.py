"""The C slave behind both versions of FMI, with a small block: what it refuses, and why.

Texts are those of FMI 2.0; support.fmi3 puts those of FMI 3.0 so, and is a host for it.
"""

import ctypes
import re
import struct
from ctypes import byref, c_bool, c_double, c_float, c_int, c_int64, c_size_t, c_uint, c_void_p
from math import inf, nan
from typing import Any

import pytest
from fmus.native.mass import GUID, native_fmu
from grasp_cosim.fmu_export.native.sources import C
from hypothesis import example, given
from hypothesis import strategies as st
from support.compiled import compile_c
from support.fmi2 import (
    _ALLOCATE,
    _FREE,
    _LOGGER,
    DISCARD,
    ERROR,
    OK,
    Fmu,
    Instance,
    _Callbacks,
)  # fmt: skip
from support.marks import examples, slow
from support.native_fmus import needs_gcc

pytestmark = needs_gcc

FORCE, HELD, POSITION, VELOCITY, MOVES, MASS, GAIN, START, SEED, FAULT, NOISY, TIME = range(12)
H = 1e-3


CHECKS = ("-fsanitize=undefined,float-cast-overflow", "-fno-sanitize-recover=all", "-O1")


class Fmus(dict[tuple[Any, bool], Fmu]):
    """By version of FMI, and whether the compiler checks for undefined behaviour."""

    def __init__(self, folder):
        self._folder = folder

    def __missing__(self, key):
        folder = self._folder("native")
        path = native_fmu(folder, key[0], options=CHECKS if key[1] else ())
        self[key] = Fmu(path, folder / "unpacked")
        return self[key]


@pytest.fixture(scope="module")
def fmus(tmp_path_factory):
    return Fmus(tmp_path_factory.mktemp)


@pytest.fixture(params=[(2, False), (3, False), slow((2, True))], ids=["2", "3", "2, checked"])
def fmu(request, fmus):
    return fmus[request.param]


def saved(instance):
    state = instance.state()
    data = state.to_bytes()
    state.free()
    return data


def begin(instance, phase):
    if phase:
        instance.initialise(force=2.0)
        assert instance.step(0.0, H) == OK
    if phase == "terminated":
        assert instance.call("Terminate") == OK
    return instance


REFUSED = [
    ("", lambda i: i.step(0.0, H), "fmi2DoStep before initialisation: must be in step mode"),
    ("", lambda i: i.exit(),
     "fmi2ExitInitializationMode before initialisation: must be in initialisation mode"),
    ("", lambda i: i.set_real([FORCE, MOVES], [1.0, 1.0]),
     "moves: accessed as Real: must be as Boolean"),
    ("", lambda i: i.get_boolean([SEED])[0], "seed: accessed as Boolean: must be as Integer"),
    ("", lambda i: i.get_real([99])[0], "value reference 99: must be from 0 to 1"),
    ("", lambda i: i.get_real([2**32 - 1])[0], "value reference -1: must be from 0 to 1"),
    ("", lambda i: i.set_real([FORCE, POSITION], [1.0, 1.0]),
     "position: output set: must be an input or a parameter"),
    ("", lambda i: i.set_real([FORCE, MASS], [1.0, 0.0]),
     "mass = 0.0 kg: must be from 0.001 to 1000 kg"),
    ("", lambda i: i.set({"force": nan}), "force = nan N: must be a finite number"),
    ("", lambda i: i.set({"start": -inf}), "start = -inf m: must be a finite number"),
    ("", lambda i: i.set_integer([FAULT], [4]), "fault = 4: must be from 0 to 3"),
    ("", lambda i: i.setup(inf) or i.enter(), "start time = inf s: must be a finite number"),
    ("", lambda i: i.call("SetFMUstate", c_void_p()), "state NULL: must be one of fmi2GetFMUstate"),
    ("stepping", lambda i: i.enter(),
     "fmi2EnterInitializationMode in step mode: must be before initialisation"),
    ("stepping", lambda i: i.set({"force": 1.0, "mass": 1.0}),
     "mass: fixed parameter set in step mode: must be before fmi2ExitInitializationMode"),
    ("stepping", lambda i: i.step(0.5, H), "step from 0.5 s: must be from 0.001 s"),
    ("stepping", lambda i: i.step(nan, H), "step from nan s: must be from 0.001 s"),
    ("stepping", lambda i: i.step(H, -1.0), "step size = -1.0 s: must be a finite number above 0"),
    ("stepping", lambda i: i.step(H, inf), "step size = inf s: must be a finite number above 0"),
    ("terminated", lambda i: i.set({"force": 1.0}), "force: set after fmi2Terminate: must be"),
    ("terminated", lambda i: i.step(H, H), "fmi2DoStep after fmi2Terminate: must be in step mode"),
]  # fmt: skip


@pytest.mark.parametrize(("phase", "call", "text"), REFUSED, ids=[row[2] for row in REFUSED])
@pytest.mark.parametrize("logging", [False, True])
def test_refused(fmu, phase, call, text, logging):
    """With one line, whether debug logging is on or not, and without effect: the host goes on."""
    with Instance(fmu, logging=logging) as instance:
        before = saved(begin(instance, phase))
        assert call(instance) == ERROR
        ((name, status, category, said),) = instance.log
        assert (name, status, category) == ("instance", ERROR, "logStatusError")
        assert said.startswith(f"instance, t = {'0.001' if phase else '0'} s: {text}")
        assert saved(instance) == before
        assert phase != "stepping" or instance.step(H, H) == OK


@pytest.mark.parametrize(
    ("fault", "h", "text"),
    [
        (0, 2.0, "step of 2.0 s: must be at most 1 s"),
        (1, H, "step of 0.001 s: position = inf m, velocity = inf m/s: must be finite"),
        (3, H, "step of 0.001 s: velocity = nan m/s: must be finite"),
    ],
)
def test_a_step_that_is_discarded(fmu, fault, h, text):
    time, ends = c_double(7.0), c_int(7)
    with Instance(fmu) as instance:
        begin(instance, "stepping")
        before = instance.get("position", "velocity")
        assert instance.set_integer([FAULT], [fault]) == OK
        assert instance.step(H, h) == DISCARD
        ((_, status, category, said),) = instance.log
        assert (status, category) == (DISCARD, "logStatusDiscard")
        assert said == f"instance, t = 0.001 s: {text}"
        assert instance.call("GetBooleanStatus", 3, byref(ends)) == OK
        if fmu.fmi == 2:
            assert instance.call("GetRealStatus", 2, byref(time)) == OK
            assert time.value == H
            for kind in ("Real", "Integer", "Boolean", "String"):
                assert instance.call(f"Get{kind}Status", 0, byref(time)) == DISCARD
        assert ends.value == 0
        assert instance.set_integer([FAULT], [0]) == OK
        assert instance.get("position", "velocity") == before
        assert instance.step(H, H) == OK


@pytest.mark.parametrize(
    ("wrong", "text"),
    [
        ({"noisy": 1.0, "seed": 0.0}, "seed = 0: must be above 0 with noise, 100 %%"),
        ({"fault": 2.0}, "position = nan m: must be finite"),
    ],
)
def test_what_does_not_go_together_is_refused_when_it_is_needed(fmu, wrong, text):
    with Instance(fmu) as instance:
        assert instance.assign(wrong) == OK
        assert instance.setup(5.0) == OK
        for call in (instance.enter, lambda: instance.get_real([POSITION])[0], instance.enter):
            instance.log.clear()
            assert call() == ERROR
            assert [said.text.partition(" s: ")[2] for said in instance.log] == [text]
        assert instance.assign({"seed": 1.0, "fault": 0.0}) == OK
        instance.initialise()


def test_outputs_follow_a_set_at_once_and_a_reset_undoes_it(fmu):
    with Instance(fmu) as instance:
        assert instance.setup() == OK
        for initialising in (False, True):
            assert not initialising or instance.enter() == OK
            for start in (3.0, -1.0):
                assert instance.set({"start": start}) == OK
                assert instance.get("position") == [start]
        assert instance.get_boolean([MOVES, HELD]) == (OK, [True, False])
        assert instance.set_boolean([HELD], [1]) == OK
        assert instance.get_boolean([HELD, MOVES]) == (OK, [True, False])
        assert instance.call("SetDebugLogging", 1, c_size_t(0), None) == OK
        assert instance.call("Reset") == OK
        assert instance.get("position") == [0.0]
        assert instance.log == []
        begin(instance, "stepping")
        assert instance.get("velocity") == [2.0 * H / 0.5]


# What a host is, or lacks


class Memory:
    """The memory of a host: what it gave, and what came back."""

    def __init__(self, most):
        self.given = {}
        self.left = most

    def allocate(self, count, size):
        self.left -= 1
        if self.left < 0:
            return None
        memory = ctypes.create_string_buffer(b"\xaa" * (count * size), count * size)
        self.given[ctypes.addressof(memory)] = memory
        return ctypes.addressof(memory)

    def free(self, address):
        del self.given[address]


def callbacks(said, memory=None):
    log = _LOGGER(lambda *words: said.append(words[-1]))
    allocate = _ALLOCATE(memory.allocate) if memory else _ALLOCATE()
    return _Callbacks(log, allocate, _FREE(memory.free) if memory else _FREE(), None, None)


def instantiate(fmu, functions, name=b"one", guid=GUID.encode(), kind=1):  # noqa: B008
    reference = byref(functions) if functions else None
    return c_void_p(fmu.library.fmi2Instantiate(name, kind, guid, None, reference, 0, 1))


def test_what_cannot_be_instantiated(fmus):
    said = []
    functions = callbacks(said)
    for guid in (None, b"", b"{0f1e2d3c", b"%n" * 5000):
        assert not instantiate(fmus[2, False], functions, guid=guid)
    assert not instantiate(fmus[2, False], functions, kind=0)
    starts = ["NULL", "", "{0f1e2d3c", "%%n%%n"]
    texts = [f"GUID = {start}" for start in starts] + ["fmi2Instantiate as fmi2ModelExchange"]
    assert all(f"one, t = 0 s: {text}" in s.decode() for s, text in zip(said, texts, strict=True))
    assert said[0].endswith(f": must be that of this FMU, {GUID}".encode())
    assert not instantiate(fmus[2, False], None, guid=None)  # nobody to tell
    nobody = instantiate(fmus[2, False], None, name=None)
    assert fmus[2, False].library.fmi2CancelStep(nobody) == ERROR
    fmus[2, False].library.fmi2FreeInstance(nobody)


def test_what_cannot_be_instantiated_in_fmi_3(fmus):
    said = []
    log = ctypes.CFUNCTYPE(None, c_void_p, c_int, ctypes.c_char_p, ctypes.c_char_p)
    logger, token = log(lambda *words: said.append(words[-1])), GUID.encode()
    library = fmus[3, False].library
    plain = (b"50 %", token, None, c_bool(False), c_bool(True))
    none = (None, c_size_t(0), None)
    for function, arguments in {
        "CoSimulation": (*plain, c_bool(True), c_bool(False), *none, logger, None),
        "ModelExchange": (*plain, None, logger),
        "ScheduledExecution": (*plain, None, logger, None, None, None),
    }.items():
        call = library[f"fmi3Instantiate{function}"]
        call.restype = c_void_p
        assert not call(*arguments)
    texts = ["eventModeUsed = true", "fmi3InstantiateModelExchange: must be fmi3InstantiateCoSim",
             "fmi3InstantiateScheduledExecution: must be"]  # fmt: skip
    assert all(f"50 %, t = 0 s: {text}" in s.decode() for s, text in zip(said, texts, strict=True))


@pytest.mark.parametrize("most", [0, 1, 2])
def test_memory_is_the_hosts_and_only_of_the_start_and_of_states(fmus, most):
    said = []
    memory, pointer, library = Memory(most), c_void_p(), fmus[2, False].library
    functions = callbacks(said, memory)
    component = instantiate(fmus[2, False], functions)
    assert bool(component) == (most > 0)
    if component:
        library.fmi2DoStep(component, c_double(0.0), c_double(H), 1)
        library.fmi2Reset(component)
        assert memory.left == most - 1
        status = library.fmi2GetFMUstate(component, byref(pointer))
        assert (status, bool(pointer)) == ((OK, True) if most == 2 else (ERROR, False))
        assert most == 2 or said[-1] == b"one, t = 0 s: there is no memory for a state"
        assert library.fmi2FreeFMUstate(component, byref(pointer)) == OK
        assert pointer.value is None
        assert library.fmi2FreeFMUstate(component, byref(pointer)) == OK
        library.fmi2FreeInstance(component)
    assert memory.given == {}


# States

PLACES = {name: 24 + 8 * i for i, name in enumerate(
    ("phase", "time", "force", "held", "mass", "gain", "start", "seed", "fault", "noisy",
     "x", "v", "steps", "moves"))}  # fmt: skip
SIZE = 24 + 8 * len(PLACES)


def test_the_bytes_of_a_state(fmus):
    """The same in both versions of FMI, which go on from each other's; a state is used again."""
    with Instance(fmus[2, False]) as two, Instance(fmus[3, False]) as three:
        begin(two, "stepping")
        data = saved(two)
        assert (len(data), data[:24]) == (SIZE, b"graspFMU0123456789abcdef")
        values = dict(zip(PLACES, struct.unpack(f"<{len(PLACES)}d", data[24:]), strict=True))
        assert (values["phase"], values["time"], values["force"]) == (2.0, H, 2.0)
        assert [values["x"], values["v"]] == two.get("position", "velocity")
        status, state = three.from_bytes(data)
        assert (status, three.restore(state)) == (OK, OK)
        assert (two.step(H, H), three.step(H, H)) == (OK, OK)
        assert two.get("position", "velocity") == three.get("position", "velocity")
        before = state.pointer.value
        assert three.call("GetFMUstate", byref(state.pointer)) == OK
        assert (state.pointer.value, state.to_bytes()) == (before, saved(two))
        state.free()


def number(name, value):
    at = PLACES[name]
    return lambda data: data[:at] + struct.pack("<d", value) + data[at + 8 :]


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda data: data[:-1], f"state of {SIZE - 1} bytes: must have {SIZE}"),
        (lambda data: data + b"\0", f"state of {SIZE + 1} bytes: must have {SIZE}"),
        (lambda data: data[:10], f"state of 10 bytes: must have {SIZE}"),
        (lambda data: b"G" + data[1:], "state of another FMU: must be of this one, 0123456789abc"),
        (lambda data: data[:8] + b"f" * 16 + data[24:], "state of another FMU: must be of this"),
        (number("phase", 4.0), "state in phase 4.0 at 0.001 s: is none"),
        (number("phase", 0.5), "state in phase 0.5 at 0.001 s: is none"),
        (number("time", nan), "state in phase 2.0 at nan s: is none"),
        (number("force", inf), "force = inf N: must be a finite number"),
        (number("mass", 0.0), "mass = 0.0 kg: must be from 0.001 to 1000 kg"),
        (number("seed", 0.5), "seed = 0.5: must be from 0 to 2.14748e+09"),
        (number("held", 2.0), "held = true: must be"),
    ],
)
def test_bytes_that_are_no_state(fmu, change, text):
    with Instance(fmu) as instance:
        data = saved(begin(instance, "stepping"))
        status, state = instance.from_bytes(change(data))
        assert (status, state.pointer.value) == (ERROR, None)
        assert instance.log[0].text.startswith(f"instance, t = 0.001 s: {text}")
        assert saved(instance) == data


# Functions and types

NO_INSTANCE = r"fmi\d(GetTypesPlatform|GetVersion|Instantiate\w*)"
HAS = {
    "SetDebugLogging", "FreeInstance", "SetupExperiment", "EnterInitializationMode",
    "ExitInitializationMode", "Terminate", "Reset", "DoStep", "GetRealStatus", "GetIntegerStatus",
    "GetBooleanStatus", "GetStringStatus",
}  # fmt: skip
TYPED = r"[GS]et(U?Int\d+|Float\d+|Real|Integer|Boolean|String|Binary|Clock)"


def test_every_function_is_there_and_survives_no_instance(fmu):
    text = (C / "headers" / f"fmi{fmu.fmi}Functions.h").read_text("utf-8")
    names = re.findall(r"^\s*FMI\d_Export fmi\d\w+TYPE\s+(fmi\d\w+);", text, re.MULTILINE)
    assert len(names) == {2: 44, 3: 75}[fmu.fmi]
    library = fmu.library
    with Instance(fmu) as instance:
        for name in (n for n in names if not re.fullmatch(NO_INSTANCE, n)):
            status = library[name](*[None] * 12)
            assert status == ERROR or name.endswith("FreeInstance")
            if name[4:] in HAS or "FMUstate" in name or "FMUState" in name:
                continue
            instance.log.clear()
            if not re.fullmatch(TYPED, name[4:]):
                assert library[name](instance._component, *[None] * 11) == ERROR
                said = f"instance, t = 0 s: fmi2{name[4:]}: is not supported by this FMU"
                assert [s.text for s in instance.log] == [said]
            elif not re.search("Binary|Clock", name):
                assert (
                    library[name](instance._component, None, c_size_t(0), None, c_size_t(0)) == OK
                )


def test_types_and_the_time_of_fmi_3(fmus):
    library = fmus[3, False].library
    with Instance(fmus[3, False]) as instance:

        def call(name, reference, value, count=1):
            n, vr = c_size_t(1), (c_uint * 1)(reference)
            return int(library[f"fmi3{name}"](instance._component, vr, n, value, c_size_t(count)))

        for found, size in ((c_int64(7), "64"), (c_int(7), "32")):
            assert call(f"SetInt{size}", SEED, byref(found)) == OK
            assert call(f"GetInt{size}", SEED, byref(found)) == OK
            assert found.value == 7
        assert call("SetInt64", SEED, byref(c_int64(2**40))) == ERROR
        assert "seed = 1099511627776: must be from 0 to" in instance.log[-1].text
        assert call("GetFloat32", VELOCITY, byref(c_float())) == ERROR
        assert "velocity: accessed as Float32: must be as Real" in instance.log[-1].text
        assert call("GetFloat64", VELOCITY, byref(c_double()), count=2) == ERROR
        assert "not as many values as value references" in instance.log[-1].text
        begin(instance, "stepping")
        assert instance.get_real([TIME]) == (OK, [H])
        assert instance.set_real([TIME], [1.0]) == ERROR
        flags, last = [c_bool(True) for _ in range(3)], c_double()
        step = (instance._component, c_double(H), c_double(H), c_bool(True))
        assert library.fmi3DoStep(*step, *map(byref, flags), byref(last)) == OK
        assert ([f.value for f in flags], last.value) == ([False] * 3, 2 * H)
        assert library.fmi3DoStep(*step[:1], c_double(2 * H), *step[2:], *[None] * 4) == OK


# Numbers in texts

TEXTS = """#include "variable.h"
size_t number(double v, int digits, char *to)
{
    Text text;
    text_clear(&text);
    if (digits) {
        text_general(&text, v, digits);
    } else {
        text_number(&text, v);
    }
    memcpy(to, text.at, text.length + 1);
    return text.length;
}
"""


@pytest.fixture(scope="module")
def texts(tmp_path_factory):
    folder = tmp_path_factory.mktemp("texts")
    (folder / "texts.c").write_text(TEXTS, "ascii")
    command = ["gcc", "-std=c99", "-O1", "-Wall", "-Wextra", "-shared", "-fPIC", f"-I{C}"]
    return ctypes.CDLL(str(compile_c([*command, folder / "texts.c"], folder / "texts.so")))


@given(st.floats(), st.integers(1, 17))
@examples(300)
@example(9007199254740992.0, 16)
@example(2.0**-1022, 17)
@example(5e-324, 1)
@example(99999.95, 6)
@example(1e16, 17)
@example(2.9535626990606368e16, 16)
def test_numbers_in_texts_are_those_of_python(texts, v, digits):
    to = ctypes.create_string_buffer(100)
    texts.number(c_double(v), digits, to)
    assert to.value.decode() == f"{v:.{digits}g}".replace("-nan", "nan")
    texts.number(c_double(v), 0, to)
    fewest = next((d for d in (15, 16) if float(f"{v:.{d}g}") == v), 17)
    expected = repr(float(f"{v:.{fewest}g}")) if abs(v) > 1e-300 else to.value.decode()
    assert to.value.decode() == expected
    assert v != v or float(to.value) == v
