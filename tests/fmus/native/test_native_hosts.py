"""A native FMU of FMI 2.0 in hosts of all kinds: memory, names, places, threads, many lives."""

import _ctypes
import ctypes
import re
import shutil
import subprocess
import threading
from collections import Counter
from collections.abc import Iterator
from ctypes import byref, c_char_p, c_double, c_int, c_size_t, c_uint, c_void_p
from pathlib import Path
from typing import Any

import pytest
from grasp_fmus.native.sources import C
from hypothesis import example, given
from hypothesis import strategies as st
from support.examples import examples
from support.fmi2 import _ALLOCATE, _FREE, _LOGGER, ERROR, OK, Fmu, Instance, _Callbacks, _Calls
from support.hand_written import GUID, native_fmu
from support.native_fmus import needs_gcc

pytestmark = needs_gcc

COSIMULATION, MODEL_EXCHANGE = 1, 0

KEPT: list[_Callbacks] = []
"""What instances may call for as long as they live."""


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    folder = tmp_path_factory.mktemp("native")
    return Fmu(native_fmu(folder), folder / "unpacked")


def callbacks(said: list[str], **more: Any) -> _Callbacks:
    log = _LOGGER(lambda _, name, status, category, text: said.append(text.decode()))
    free = more.get("free", _FREE())
    made = _Callbacks(more.get("logger", log), more.get("allocate", _ALLOCATE()), free, None, None)
    KEPT.append(made)
    return made


def instantiate(
    fmu: Fmu,
    functions: Any,
    name: bytes | None = b"one",
    guid: bytes | None = GUID.encode(),
    resources: bytes | None = None,
    kind: int = COSIMULATION,
) -> c_void_p:
    reference = byref(functions) if functions else None
    found = fmu.library.fmi2Instantiate(name, kind, guid, resources, reference, 0, 1)
    return c_void_p(found)


def refuse(fmu: Fmu, component: c_void_p) -> int:
    """A step before initialisation."""
    return int(fmu.library.fmi2DoStep(component, c_double(0.0), c_double(1e-3), 1))


@given(st.binary(max_size=60).filter(lambda name: 0 not in name))
@examples(300)
@example(b"\xe0\xa0")
@example(b"\xf0\x9f\x98\x80\xf0\x9f\x98")
@example(b"\xed\xa0\x80")
@example(b"n" * 100_000)
@example(b"\xff" * 100_000)
@example(b"%" * 100_000)
def test_any_name(fmu: Fmu, name: bytes) -> None:
    said: list[str] = []
    functions = callbacks(said)
    component = instantiate(fmu, functions, name)
    assert refuse(fmu, component) == ERROR
    shown = name.decode(errors="replace").replace("%", "%%")
    assert said == [f"{shown}, t = 0 s: fmi2DoStep before initialisation: must be in step mode"]
    fmu.library.fmi2FreeInstance(component)


@pytest.mark.parametrize("resources", [None, b"", b"file:///no/such/folder", b"\xff" * 9000])
def test_any_place(fmu: Fmu, resources: bytes | None) -> None:
    component = instantiate(fmu, callbacks([]), resources=resources)
    assert component
    fmu.library.fmi2FreeInstance(component)


@pytest.mark.parametrize("functions", [None, callbacks([], logger=_LOGGER())])
def test_no_callbacks_and_no_name(fmu: Fmu, functions: _Callbacks | None) -> None:
    component = instantiate(fmu, functions, name=None)
    assert refuse(fmu, component) == ERROR
    assert instantiate(fmu, functions, guid=b"another").value is None
    fmu.library.fmi2FreeInstance(component)


@pytest.mark.parametrize("guid", [None, b"", b"{0f1e2d3c", GUID.encode() + b"0", b"%n" * 5000])
def test_another_guid_is_refused(fmu: Fmu, guid: bytes | None) -> None:
    said: list[str] = []
    assert instantiate(fmu, callbacks(said), guid=guid).value is None
    shown = "NULL" if guid is None else guid.decode().replace("%", "%%")
    (line,) = said
    assert line.startswith(f"one, t = 0 s: GUID = {shown}"[:4000])
    assert len(shown) > 100 or line.endswith(f": must be that of this FMU, {GUID}")


def test_model_exchange_is_refused(fmu: Fmu) -> None:
    said: list[str] = []
    assert instantiate(fmu, callbacks(said), kind=MODEL_EXCHANGE).value is None
    assert "must be fmi2CoSimulation" in said[0]


class Memory:
    """The memory of a host: what it gave, and what came back."""

    def __init__(self, least: int = 10**9) -> None:
        self.given: dict[int, Any] = {}
        self.calls = Counter[str]()
        self._left = least

    def allocate(self, count: int, size: int) -> int | None:
        self.calls["allocate"] += 1
        if self.calls["allocate"] > self._left:
            return None
        memory = ctypes.create_string_buffer(b"\xaa" * (count * size), count * size)
        self.given[ctypes.addressof(memory)] = memory
        return ctypes.addressof(memory)

    def free(self, address: int) -> None:
        del self.given[address]

    def callbacks(self, said: list[str]) -> _Callbacks:
        return callbacks(said, allocate=_ALLOCATE(self.allocate), free=_FREE(self.free))


def test_memory_is_the_hosts_and_only_of_the_start_and_of_states(fmu: Fmu) -> None:
    memory, said = Memory(), list[str]()
    component = instantiate(fmu, memory.callbacks(said))
    instance = adopted(fmu, component)
    instance.initialise(force=2.0)
    for _ in range(5):
        assert instance.step(0.0, 1e-3) == OK
        assert instance.step(0.5, 1e-3) == ERROR
        assert instance.call("Reset") == OK
        instance.initialise()
    assert memory.calls["allocate"] == 1
    state = instance.state()
    data = state.to_bytes()
    status, other = instance.from_bytes(data)
    assert (status, instance.from_bytes(data[:-1])[0]) == (OK, ERROR)
    assert len(memory.given) == 3
    state.free()
    other.free()
    instance.call("FreeInstance")
    assert memory.given == {}


@pytest.mark.parametrize("least", [0, 1])
def test_no_memory(fmu: Fmu, least: int) -> None:
    memory, said = Memory(least), list[str]()
    component = instantiate(fmu, memory.callbacks(said))
    assert bool(component) == bool(least)
    if component:
        pointer = c_void_p()
        assert fmu.library.fmi2GetFMUstate(component, byref(pointer)) == ERROR
        assert pointer.value is None
        assert said == ["one, t = 0 s: fmi2GetFMUstate: there is no memory"]
        fmu.library.fmi2FreeInstance(component)


def adopted(fmu: Fmu, component: c_void_p) -> Instance:
    """An instance that was made elsewhere."""
    calls, instance = object.__new__(_Calls), object.__new__(Instance)
    calls._library, calls.component = fmu.library, component
    instance.fmu, instance.log, instance._calls = fmu, [], calls
    return instance


def test_a_state_is_used_again_and_one_that_was_freed_is_told_apart(fmu: Fmu) -> None:
    with Instance(fmu) as instance:
        instance.initialise(force=1.0)
        state = instance.state()
        before = state.pointer.value
        assert instance.step(0.0, 1e-3) == OK
        assert instance.call("GetFMUstate", byref(state.pointer)) == OK
        assert state.pointer.value == before
        assert state.to_bytes() == instance.state().to_bytes()
        stale = c_void_p(before)
        state.free()
        assert state.pointer.value is None
        state.free()  # nothing is left to free
        for call, argument in (("FreeFMUstate", byref(stale)), ("SetFMUstate", stale)):
            instance.log.clear()
            assert instance.call(call, argument) == ERROR
            assert "state of another FMU: must be of this one" in instance.log[0].text
        instance.log.clear()
        assert instance.call("SetFMUstate", c_void_p()) == ERROR
        assert instance.log[0].text.endswith("state NULL: must be one of fmi2GetFMUstate")


def test_memory_that_is_too_small_for_a_state_is_not_written(fmu: Fmu) -> None:
    with Instance(fmu) as instance:
        state = instance.state()
        buffer = ctypes.create_string_buffer(b"\xaa" * 200, 200)
        assert instance.call("SerializeFMUstate", state.pointer, buffer, c_size_t(151)) == ERROR
        assert instance.log[0].text.endswith("memory of 151 bytes for a state: must have 152")
        assert buffer.raw == b"\xaa" * 200
        assert instance.call("SerializeFMUstate", state.pointer, buffer, c_size_t(200)) == OK
        assert buffer.raw[152:] == b"\xaa" * 48
        state.free()


def functions(header: str) -> list[str]:
    """The functions that a header of FMI declares."""
    text = (C / "headers" / header).read_text("utf-8")
    return re.findall(r"^\s*FMI\d_Export fmi\d\w+TYPE\s+(fmi\d\w+);", text, re.MULTILINE)


def test_every_function_is_there_and_survives_no_instance(fmu: Fmu) -> None:
    names = functions("fmi2Functions.h")
    assert len(names) == 44
    for name in names:
        if name not in ("fmi2GetTypesPlatform", "fmi2GetVersion", "fmi2Instantiate"):
            status = getattr(fmu.library, name)(*[None] * 8)
            assert status == ERROR or name == "fmi2FreeInstance"


NOT_THERE = (
    "GetDirectionalDerivative", "SetRealInputDerivatives", "GetRealOutputDerivatives",
    "EnterEventMode", "NewDiscreteStates", "EnterContinuousTimeMode", "CompletedIntegratorStep",
    "SetTime", "SetContinuousStates", "GetDerivatives", "GetEventIndicators",
    "GetContinuousStates", "GetNominalsOfContinuousStates",
)  # fmt: skip


@pytest.mark.parametrize("name", [*NOT_THERE, "CancelStep", "GetStatus"])
def test_what_is_not_there_says_so(fmu: Fmu, name: str) -> None:
    with Instance(fmu) as instance:
        assert instance.call(name, *[None] * 6) == ERROR
        (said,) = instance.log
        assert said.text.startswith(f"instance, t = 0 s: fmi2{name}: ")


def test_after_a_discarded_step_a_host_learns_how_far_it_came(fmu: Fmu) -> None:
    time, ends, text = c_double(7.0), c_int(7), c_char_p()
    with Instance(fmu) as instance:
        instance.initialise()
        assert instance.step(0.0, 1e-3) == OK
        assert instance.step(1e-3, 100.0) == 2
        assert instance.call("GetRealStatus", 2, byref(time)) == OK
        assert instance.call("GetBooleanStatus", 3, byref(ends)) == OK
        assert (time.value, ends.value) == (1e-3, 0)
        for name, value in (("Real", time), ("Integer", ends), ("String", text)):
            assert instance.call(f"Get{name}Status", 0, byref(value)) == 2


def test_logging_on_says_nothing_twice(fmu: Fmu) -> None:
    with Instance(fmu, logging=True) as instance:
        categories = (c_char_p * 1)(b"nonsense")
        assert instance.call("SetDebugLogging", 1, c_size_t(1), categories) == OK
        assert instance.step(0.0, 1e-3) == ERROR
        assert len(instance.log) == 1
        assert instance.call("SetDebugLogging", 0, c_size_t(0), None) == OK
        assert instance.step(0.0, 1e-3) == ERROR
        assert len(instance.log) == 2


def run(fmu: Fmu, force: float, steps: int) -> list[float]:
    with Instance(fmu) as instance:
        instance.initialise(force=force)
        for k in range(steps):
            assert instance.step(k * 1e-3, 1e-3) == OK
            assert instance.step(k * 1e-3, 1e-3) == ERROR
        return instance.get("position", "velocity")


def test_instances_in_threads_do_not_meet(fmu: Fmu) -> None:
    """ctypes gives up the GIL in each call."""
    forces = [0.1 * k - 0.3 for k in range(6)]
    alone = [run(fmu, force, 300) for force in forces]
    found: dict[int, list[float]] = {}

    def work(k: int) -> None:
        found[k] = run(fmu, forces[k], 300)

    threads = [threading.Thread(target=work, args=(k,)) for k in range(len(forces))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert [found[k] for k in range(len(forces))] == alone


def loaded_again(fmu: Path, folder: Path, lives: int) -> Iterator[list[float]]:
    """What a run gives in each life of the library in this process."""
    for _ in range(lives):
        here = Fmu(fmu, folder)
        handle = here.library._handle
        yield run(here, 1.0, 10)
        del here
        _ctypes.dlclose(handle)
        assert str(folder) not in Path("/proc/self/maps").read_text()


@pytest.mark.slow
def test_load_run_free_unload_load(tmp_path: Path) -> None:
    first, *others = loaded_again(native_fmu(tmp_path), tmp_path / "unpacked", 3)
    assert others == [first, first]


@pytest.mark.skipif(not shutil.which("nm"), reason="NO nm")
def test_no_state_of_the_process(fmu: Fmu) -> None:
    """The library has nothing that can be written, but what the compiler itself puts there."""
    command = ["nm", "--format=sysv", fmu.library._name]
    rows = subprocess.run(command, capture_output=True, text=True, check=True).stdout.splitlines()
    sections: dict[str, set[str]] = {}
    for row in rows:
        if row.count("|") == 6:
            name, *_, section = (item.strip() for item in row.split("|"))
            sections.setdefault(section, set()).add(name)
    written = sections.get(".data", set()) | sections.get(".bss", set())
    assert {name for name in written if not name.startswith("_")} <= {"completed.0"}
    assert {"variables", "slave_phases"} <= sections[".data.rel.ro"]  # constants


def test_value_references_that_are_no_int(fmu: Fmu) -> None:
    with Instance(fmu) as instance:
        for vr in (2**31, 2**32 - 1):
            assert instance.call("GetReal", byref(c_uint(vr)), c_size_t(1), None) == ERROR
            assert f"value reference {vr - 2**32}: must be" in instance.log[-1].text
