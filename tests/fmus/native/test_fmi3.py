"""The interface of FMI 3.0: the same slave as that of FMI 2.0, with the names of FMI 3.0."""

import ctypes
import re
from collections.abc import Iterator
from ctypes import byref, c_bool, c_char_p, c_double, c_int32, c_int64, c_size_t, c_uint32, c_void_p
from math import nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import extract, read_model_description, simulate_fmu
from fmpy.validation import validate_fmu
from grasp_fmus.native.sources import C
from support.fmi2 import DISCARD, ERROR, OK, Fmu
from support.fmi2 import Instance as Instance2
from support.hand_written import GUID, NAME, native_fmu
from support.native_fmus import needs_gcc
from support.packages import skip_where_fmpy_runs_none

pytestmark = needs_gcc

_LOGGER = ctypes.CFUNCTYPE(None, c_void_p, ctypes.c_int, c_char_p, c_char_p)

FORCE, HELD, POSITION, VELOCITY, MOVES, MASS, START, SEED, FAULT, NOISY, TIME = (
    0, 1, 2, 3, 4, 5, 7, 8, 9, 10, 11,
)  # fmt: skip
TYPES: dict[str, Any] = {
    "Float64": c_double, "Boolean": c_bool, "Int32": c_int32, "Int64": c_int64,
}  # fmt: skip


@pytest.fixture(scope="module")
def path(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return native_fmu(tmp_path_factory.mktemp("three"), 3)


@pytest.fixture(scope="module")
def library(path: Path) -> ctypes.CDLL:
    (file,) = Path(extract(path, path.parent / "unpacked")).glob(f"binaries/*/{NAME}.so")
    found = ctypes.CDLL(str(file))
    found.fmi3InstantiateCoSimulation.restype = c_void_p
    found.fmi3InstantiateModelExchange.restype = c_void_p
    found.fmi3InstantiateScheduledExecution.restype = c_void_p
    found.fmi3GetVersion.restype = c_char_p
    return found


class Instance:
    """An instance; calls return the FMI status."""

    def __init__(self, library: ctypes.CDLL, token: bytes | None = GUID.encode(),
                 events: bool = False, name: bytes | None = b"three") -> None:  # fmt: skip
        self.library = library
        self.log: list[tuple[int, str, str]] = []
        self._logger = _LOGGER(
            lambda _, status, category, text: self.log.append(
                (status, category.decode(), text.decode())
            )
        )
        self.component = c_void_p(
            library.fmi3InstantiateCoSimulation(
                name, token, None, False, True, events, False, None, c_size_t(0), None,
                self._logger, None,
            )
        )  # fmt: skip

    def call(self, name: str, *arguments: Any) -> int:
        return int(getattr(self.library, f"fmi3{name}")(self.component, *arguments))

    def enter(self, start: float = 0.0) -> int:
        return self.call(
            "EnterInitializationMode", False, c_double(0.0), c_double(start), False, c_double(0.0)
        )

    def initialise(self, start: float = 0.0) -> "Instance":
        assert (self.enter(start), self.call("ExitInitializationMode")) == (OK, OK)
        return self

    def set(self, kind: str, values: dict[int, Any], count: int | None = None) -> int:
        n = len(values)
        count = n if count is None else count
        return self.call(f"Set{kind}", (c_uint32 * n)(*values), c_size_t(n),
                         (TYPES[kind] * n)(*values.values()), c_size_t(count))  # fmt: skip

    def get(self, kind: str, *references: int) -> tuple[int, list[Any]]:
        n = len(references)
        values = (TYPES[kind] * n)()
        status = self.call(
            f"Get{kind}", (c_uint32 * n)(*references), c_size_t(n), values, c_size_t(n)
        )
        return status, list(values)

    def step(self, time: float, h: float) -> tuple[int, list[bool], float]:
        flags = [c_bool(True) for _ in range(3)]
        last = c_double(nan)
        status = self.call(
            "DoStep", c_double(time), c_double(h), True, *map(byref, flags), byref(last)
        )
        return status, [flag.value for flag in flags], last.value

    def to_bytes(self) -> bytes:
        state, size = c_void_p(), c_size_t()
        assert self.call("GetFMUState", byref(state)) == OK
        assert self.call("SerializedFMUStateSize", state, byref(size)) == OK
        data = (ctypes.c_ubyte * size.value)()
        assert self.call("SerializeFMUState", state, data, size) == OK
        assert self.call("FreeFMUState", byref(state)) == OK
        assert state.value is None
        return bytes(data)

    def restore(self, data: bytes) -> int:
        state = c_void_p()
        array = (ctypes.c_ubyte * len(data)).from_buffer_copy(data)
        status = self.call("DeserializeFMUState", array, c_size_t(len(data)), byref(state))
        if status == OK:
            assert self.call("SetFMUState", state) == OK
            assert self.call("FreeFMUState", byref(state)) == OK
        return status


@pytest.fixture
def instance(library: ctypes.CDLL) -> Iterator[Instance]:
    made = Instance(library)
    assert made.component
    yield made
    made.call("FreeInstance")


def refused(instance: Instance, status: int, text: str) -> None:
    """The call failed and said why, once."""
    assert status == ERROR
    (said,) = instance.log
    assert said == (ERROR, "logStatusError", f"three, t = 0 s: {text}")
    instance.log.clear()


def test_it_is_valid_and_runs_in_plain_fmpy(path: Path) -> None:
    assert validate_fmu(path) == []
    skip_where_fmpy_runs_none("3.0")
    result: Any = simulate_fmu(path, stop_time=0.01, step_size=1e-3, start_values={"force": 1.0})
    velocity = result["velocity"]
    np.testing.assert_allclose(velocity, 2.0 * result["time"], rtol=1e-12)
    description = read_model_description(path)
    (time,) = (v for v in description.modelVariables if v.causality == "independent")
    assert (time.name, time.valueReference) == ("time", TIME)


def test_refusals_name_the_functions_and_types_of_fmi_3(instance: Instance) -> None:
    refused(instance, instance.step(0.0, 1e-3)[0],
            "fmi3DoStep before initialisation: must be in step mode")  # fmt: skip
    refused(instance, instance.set("Float64", {MOVES: 1.0}),
            "moves: accessed as Float64: must be as Boolean")  # fmt: skip
    refused(instance, instance.get("Boolean", SEED)[0],
            "seed: accessed as Boolean: must be as Int32 or Int64")  # fmt: skip
    refused(instance, instance.get("Float64", 12)[0], "value reference 12: must be from 0 to 11")
    refused(instance, instance.enter(nan), "start time = nan s: must be a finite number")
    instance.initialise()
    refused(instance, instance.enter(),
            "fmi3EnterInitializationMode in step mode: must be before initialisation")  # fmt: skip
    fixed = "mass: fixed parameter set in step mode: must be before fmi3ExitInitializationMode"
    refused(instance, instance.set("Float64", {MASS: 1.0}), fixed)
    assert instance.call("Terminate") == OK
    refused(instance, instance.set("Float64", {FORCE: 1.0}),
            "force: set after fmi3Terminate: must be before")  # fmt: skip
    refused(instance, instance.step(0.0, 1e-3)[0],
            "fmi3DoStep after fmi3Terminate: must be in step mode")  # fmt: skip


def test_the_logger_is_no_printf(library: ctypes.CDLL) -> None:
    instance = Instance(library, name=b"50 %s")
    assert instance.set("Float64", {FORCE: nan}) == ERROR
    assert instance.log[0][2].startswith("50 %s, t = 0 s: force = nan N")
    instance.call("FreeInstance")


def test_types(instance: Instance) -> None:
    for kind in ("Int32", "Int64"):
        assert instance.set(kind, {SEED: 7}) == OK
        assert instance.get(kind, SEED, FAULT) == (OK, [7, 0])
    refused(instance, instance.set("Int64", {SEED: 2**40}),
            "seed = 1099511627776: must be from 0 to 2.14748e+09")  # fmt: skip
    assert instance.set("Boolean", {NOISY: True, HELD: False}) == OK
    assert instance.get("Boolean", NOISY, HELD) == (OK, [True, False])
    refused(instance, instance.set("Float64", {FORCE: 1.0}, count=2),
            "as many values as value references: must be so, all are scalars")  # fmt: skip


@pytest.mark.parametrize(
    "kind", ["Float32", "Int8", "UInt8", "Int16", "UInt16", "UInt32", "UInt64", "String"]
)
def test_types_of_which_there_are_none(instance: Instance, kind: str) -> None:
    for call in ("Get", "Set"):
        reference, values = (c_uint32 * 1)(3), (ctypes.c_byte * 8)()
        status = instance.call(f"{call}{kind}", reference, c_size_t(1), values, c_size_t(1))
        refused(instance, status, f"value reference 3: there is no {kind} variable")
        assert instance.call(f"{call}{kind}", None, c_size_t(0), None, c_size_t(0)) == OK


def test_the_time_is_a_variable(instance: Instance) -> None:
    instance.initialise(2.0)
    assert instance.step(2.0, 0.25) == (OK, [False, False, False], 2.25)
    assert instance.get("Float64", POSITION, TIME)[1][1] == 2.25
    assert instance.set("Float64", {TIME: 1.0}) == ERROR
    assert instance.log[0][2].endswith("time: output set: must be an input or a parameter")


def test_a_step_says_what_a_host_must_know(instance: Instance) -> None:
    instance.initialise()
    assert instance.step(0.0, 1e-3) == (OK, [False, False, False], 1e-3)
    assert instance.step(1e-3, 50.0) == (DISCARD, [False, False, False], 1e-3)
    assert instance.log[0][:2] == (DISCARD, "logStatusDiscard")
    assert instance.step(7.0, 1e-3) == (ERROR, [False, False, False], 1e-3)
    nothing = [None] * 4
    assert instance.call("DoStep", c_double(1e-3), c_double(1e-3), True, *nothing) == OK


def test_a_start_that_is_refused_leaves_the_time(instance: Instance) -> None:
    assert instance.set("Int32", {SEED: 0}) == OK
    assert instance.set("Boolean", {NOISY: True}) == OK
    assert instance.enter(5.0) == ERROR
    assert instance.get("Float64", TIME) == (OK, [0.0])
    assert instance.set("Int32", {SEED: 1}) == OK
    instance.initialise(5.0)


@pytest.mark.slow
def test_states_are_those_of_fmi_2(instance: Instance, tmp_path: Path) -> None:
    fmu = Fmu(native_fmu(tmp_path, 2), tmp_path / "two")
    with Instance2(fmu) as two:
        two.initialise(force=3.0)
        assert two.step(0.0, 1e-3) == OK
        data = two.state().to_bytes()
        assert instance.restore(data) == OK
        assert instance.to_bytes() == data
        assert (two.step(1e-3, 1e-3), instance.step(1e-3, 1e-3)[0]) == (OK, OK)
        assert instance.get("Float64", POSITION, VELOCITY)[1] == two.get("position", "velocity")
        assert instance.to_bytes() == two.state().to_bytes()
    assert instance.restore(data[:-1]) == ERROR
    assert instance.log[0][2].endswith("state of 151 bytes: must have 152")


def test_what_cannot_be_instantiated(library: ctypes.CDLL) -> None:
    for token in (None, b"another"):
        instance = Instance(library, token)
        assert not instance.component
        assert "instantiation token = " in instance.log[0][2]
    instance = Instance(library, events=True)
    assert not instance.component
    assert "eventModeUsed = true: must be false" in instance.log[0][2]
    for kind, more in (("ModelExchange", 0), ("ScheduledExecution", 3)):
        instance.log.clear()
        made = getattr(library, f"fmi3Instantiate{kind}")(
            b"x", GUID.encode(), None, False, False, None, instance._logger, *[None] * more
        )
        assert made is None
        assert instance.log == [
            (ERROR, "logStatusError", f"fmi3Instantiate{kind}: must be fmi3InstantiateCoSimulation")
        ]
        assert (
            getattr(library, f"fmi3Instantiate{kind}")(None, None, None, 0, 0, None, None) is None
        )


def test_no_logger(library: ctypes.CDLL) -> None:
    nothing = (None, c_size_t(0), None, None, None)
    found = library.fmi3InstantiateCoSimulation(None, GUID.encode(), None, 0, 1, 0, 1, *nothing)
    assert library.fmi3EnterStepMode(c_void_p(found)) == ERROR
    library.fmi3FreeInstance(c_void_p(found))
    assert library.fmi3InstantiateCoSimulation(None, None, None, 0, 1, 0, 1, *nothing) is None


TYPED = r"[GS]et(U?Int\d+|Float\d+|Boolean|String|Binary|Clock)"
USED = (
    "GetVersion", "SetDebugLogging", "FreeInstance", "EnterInitializationMode",
    "ExitInitializationMode", "Terminate", "Reset", "DoStep",
)  # fmt: skip


def names() -> list[str]:
    """The functions of the standard."""
    text = (C / "headers" / "fmi3Functions.h").read_text("utf-8")
    return re.findall(r"^FMI3_Export fmi3\w+TYPE\s+fmi3(\w+);", text, re.MULTILINE)


def test_every_function_is_there(instance: Instance) -> None:
    assert len(names()) == 75
    assert instance.library.fmi3GetVersion() == b"3.0"
    for name in names():
        if name != "GetVersion" and not name.startswith("Instantiate"):
            status = getattr(instance.library, f"fmi3{name}")(*[None] * 12)  # no instance
            assert status == ERROR or name == "FreeInstance"
        if not (name in USED or "FMUState" in name or "Instantiate" in name
                or re.fullmatch(TYPED, name)):  # fmt: skip
            refused(instance, instance.call(name, *[None] * 8),
                    f"fmi3{name}: is not supported by this FMU")  # fmt: skip


def test_reset_and_logging(instance: Instance) -> None:
    assert instance.set("Float64", {START: 3.0}) == OK
    instance.initialise()
    assert instance.get("Float64", POSITION) == (OK, [3.0])
    assert instance.call("SetDebugLogging", True, c_size_t(0), None) == OK
    assert instance.call("Reset") == OK
    assert instance.get("Float64", POSITION, TIME) == (OK, [0.0, 0.0])
    assert instance.log == []
