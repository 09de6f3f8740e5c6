"""Whatever a host calls, in whatever order and with whatever numbers, it lives.

Drawn are sequences of calls, legal and illegal, on two instances. After each call the status is one
that FMI knows and never fatal; where a call was refused the log says why; and after the sequence a
fresh life of the same instance computes what it always does.
"""

import ctypes
from dataclasses import dataclass, field
from typing import Any

import pytest
from conftest import Load
from hypothesis import HealthCheck, given
from hypothesis import strategies as st
from support.examples import examples
from support.fmi2 import DISCARD, ERROR, OK, Fmu, Instance, State
from support.kinds import all_kinds

pytestmark = all_kinds

NAMES = (
    "GripperPlant",
    "GripperPlantCompliant",
    "GripperPlantMovable",
    "GripperPlantMuJoCo",
    "ProximitySensor",
    "GraspController",
)

ANY = st.floats(width=64)
SENSIBLE = st.sampled_from([0.0, 1e-3, 0.01, 0.05, 0.1, 0.5, 1.0, -0.1, -1.0])
NUMBERS = st.one_of(SENSIBLE, ANY)
REFERENCES = st.lists(st.one_of(st.integers(0, 30), st.integers(0, 2**32 - 1)), max_size=6)
CALLS = st.one_of(
    st.tuples(st.just("setup"), NUMBERS),
    st.tuples(st.sampled_from(["enter", "exit", "terminate", "reset"])),
    st.tuples(st.sampled_from(["step", "step", "step"]), NUMBERS, NUMBERS),
    st.tuples(st.just("next"), st.sampled_from([1e-4, 1e-3, 0.1])),
    st.tuples(st.just("set"), REFERENCES, st.lists(NUMBERS, min_size=6, max_size=6)),
    st.tuples(st.just("input"), NUMBERS),
    st.tuples(st.sampled_from(["get", "get_boolean", "get_integer", "get_string"]), REFERENCES),
    st.tuples(st.just("set_boolean"), REFERENCES),
    st.tuples(st.sampled_from(["save", "restore", "bytes"])),
    st.tuples(st.just("damage"), st.binary(max_size=300)),
    st.tuples(st.just("logging"), st.booleans()),
)
SEQUENCES = st.lists(st.tuples(st.integers(0, 1), CALLS), max_size=40)


@dataclass
class Drawn:
    """An instance that is called as drawn."""

    instance: Instance
    time: float = 0.0
    states: list[State] = field(default_factory=list)

    def call(self, action: str, *drawn: Any) -> int:
        """One drawn call; returns its status."""
        status: int = getattr(self, f"_{action}")(*drawn)
        return status

    def _setup(self, start: float) -> int:
        status = self.instance.setup(start)
        self.time = start if status == OK else self.time
        return status

    def _enter(self) -> int:
        return self.instance.enter()

    def _exit(self) -> int:
        return self.instance.exit()

    def _terminate(self) -> int:
        return self.instance.call("Terminate")

    def _reset(self) -> int:
        self.time = 0.0
        return self.instance.call("Reset")

    def _step(self, time: float, size: float) -> int:
        return self.instance.step(time, size)

    def _next(self, size: float) -> int:
        status = self.instance.step(self.time, size)
        self.time += size if status == OK else 0.0
        return status

    def _set(self, references: list[int], values: list[float]) -> int:
        return self.instance.set_real(references, values[: len(references)])

    def _input(self, value: float) -> int:
        return self.instance.set({self.instance.fmu.names("input")[0]: value})

    def _get(self, references: list[int]) -> int:
        return self.instance.get_real(references)[0]

    def _get_boolean(self, references: list[int]) -> int:
        return self.instance.get_boolean(references)[0]

    def _set_boolean(self, references: list[int]) -> int:
        return self.instance.set_boolean(references, [True] * len(references))

    def _get_integer(self, references: list[int]) -> int:
        return self._array("GetInteger", ctypes.c_int, references)

    def _get_string(self, references: list[int]) -> int:
        return self._array("GetString", ctypes.c_char_p, references)

    def _array(self, function: str, kind: Any, references: list[int]) -> int:
        n = len(references)
        vector = (ctypes.c_uint * n)(*references)
        return self.instance.call(function, vector, ctypes.c_size_t(n), (kind * n)())

    def _save(self) -> int:
        self.states.append(self.instance.state())
        return OK

    def _restore(self) -> int:
        return self.instance.restore(self.states[-1]) if self.states else OK

    def _bytes(self) -> int:
        if not self.states:
            return OK
        status, state = self.instance.from_bytes(self.states[-1].to_bytes())
        self.states.append(state)
        return status

    def _damage(self, data: bytes) -> int:
        status = self.instance.from_bytes(data)[0]
        assert status == ERROR
        return status

    def _logging(self, on: bool) -> int:
        return self.instance.call("SetDebugLogging", on, ctypes.c_size_t(0), None)


def in_order(fmu: Fmu) -> list[float]:
    with Instance(fmu).initialise() as instance:
        assert {instance.step(k * 1e-3, 1e-3) for k in range(5)} == {OK}
        return instance.outputs()


@pytest.mark.hypothesis  # it finds those that are decorated, not what is inside of them
@pytest.mark.parametrize("name", NAMES)
def test_any_sequence_of_calls(load: Load, name: str) -> None:
    expected = in_order(load(name))

    @given(sequence=SEQUENCES)
    @examples(150, suppress_health_check=list(HealthCheck))
    def run(sequence: list[tuple[int, tuple[Any, ...]]]) -> None:
        with Instance(load(name), "one") as one, Instance(load(name), "two", True) as two:
            drawn = (Drawn(one), Drawn(two))
            for which, call in sequence:
                target = drawn[which]
                target.instance.log.clear()
                status = target.call(*call)
                assert status in (OK, DISCARD, ERROR)
                assert bool(target.instance.log) == (status != OK)
            for target in drawn:
                for state in target.states:
                    state.free()
                assert target.instance.call("Reset") == OK
                target.instance.initialise()
                assert {target.instance.step(k * 1e-3, 1e-3) for k in range(5)} == {OK}
                assert target.instance.outputs() == expected
                assert target.instance.call("Terminate") == OK

    run()
