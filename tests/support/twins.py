"""Two instances of one block, of two kinds of FMUs, called as one: all that they say must agree."""

import re
from collections.abc import Callable
from ctypes import Array, c_char_p
from typing import Any, TypeVar

from .fmi2 import Fmu, Instance, Logged, State

R = TypeVar("R")

TRACEBACK = re.compile(r"Traceback \(most recent call last\):.*\n", re.DOTALL)
VARIABLES = re.compile(r"(?<=: must be from 0 to )\d+$")


class Twins(Instance):
    """An instance of FMI 2.0 and its twin; AssertionError where a call does not do the same."""

    def __init__(self, fmu: Fmu, twin: Fmu, name: str = "twins") -> None:
        self.fmu = fmu
        self.one, self.other = self.both = Instance(fmu, name), Instance(twin, name)
        self.log = self.one.log

    def __exit__(self, *_: object) -> None:
        for instance in self.both:
            instance.__exit__()

    def call(self, function: str, *arguments: Any) -> int:
        """Also what they leave in arrays is the same, to the bit."""
        arrays = [a for a in arguments if isinstance(a, Array)]

        def called(instance: Instance) -> tuple[int, list[Any]]:
            return instance.call(function, *arguments), [_exact(array) for array in arrays]

        return self._agreed(called)[0]

    def state(self) -> State:
        return TwinState(*(instance.state() for instance in self.both))

    def restore(self, state: State) -> int:
        """Each goes on from its own."""
        assert isinstance(state, TwinState)
        states = dict(zip(self.both, state.both, strict=True))
        return self._agreed(lambda i: i.restore(states[i]))

    def exchange(self) -> int:
        """Both go on from the bytes of both, which are the same."""
        saved = self.state()
        status, state = self.from_bytes(saved.to_bytes())
        status = status or self.restore(state)
        saved.free()
        state.free()
        return status

    def from_bytes(self, data: bytes) -> "tuple[int, State]":
        states: list[State] = []

        def made(instance: Instance) -> int:
            status, state = instance.from_bytes(data)
            states.append(state)
            return status

        return self._agreed(made), TwinState(*states)

    def _agreed(self, call: Callable[[Instance], R]) -> R:
        """What both return, having said the same."""
        for instance in self.both:
            instance.log.clear()
        one, other = map(call, self.both)
        ours, theirs = map(_said, self.both)
        assert ours == theirs, (ours, theirs)
        assert one == other, (one, other)
        return one


class TwinState(State):
    """A state of each, of the same bytes."""

    def __init__(self, one: State, other: State) -> None:
        self.both = one, other

    def to_bytes(self) -> bytes:
        one, other = (state.to_bytes() for state in self.both)
        assert one == other
        return one

    def free(self) -> None:
        for state in self.both:
            state.free()


def _exact(array: "Array[Any]") -> Any:
    """Numbers by their bytes, texts by what they are."""
    return list(array) if array._type_ is c_char_p else bytes(array)


def _said(instance: Instance) -> list[Logged]:
    """What was logged, without what Python alone adds: a second message while debug logging is on
    and the lines of a traceback before the last; in FMI 3.0 there is one variable more, the time.
    """
    return [
        said._replace(text=VARIABLES.sub("", TRACEBACK.sub("", said.text)))
        for said in instance.log
        if not said.text.endswith("PyObject_CallMethod\nfailed, for the reason logged before")
    ]
