"""The states that an FMU keeps for its host: what fmi2GetFMUstate gives, and fmi3GetFMUState."""

from collections import deque
from collections.abc import Callable
from ctypes import byref, c_void_p
from typing import Any

from .instance import WARNING

OfState = Callable[[Any], int]
"""A function of FMI over a state, or over the place of one; its status."""


class KeptState:
    """A state that an FMU keeps until nothing here refers to it any more."""

    __slots__ = ("_released", "place")

    def __init__(self, place: c_void_p, released: deque[c_void_p]) -> None:
        self.place, self._released = place, released

    def __del__(self) -> None:
        """The FMU may be at work, in another thread: it is told later."""
        self._released.append(self.place)


class States:
    """The states of one instance.

    What is no longer referred to is overwritten by the next one, as FMI has it. pythonfmu does not
    do that: with it this has to be freed before.
    """

    def __init__(self, get: OfState, set_: OfState, free: OfState, overwrites: bool) -> None:
        self._get, self._set, self._free, self._overwrites = get, set_, free, overwrites
        self._kept: dict[int, c_void_p] = {}
        self._released: deque[c_void_p] = deque()

    def take(self) -> tuple[int, KeptState | None]:
        """The FMI status, and the state of now unless that is a bad one."""
        place = self._released.popleft() if self._released else c_void_p()
        if not self._overwrites:
            self._let_go(place)
        self._kept[id(place)] = place
        state, status = KeptState(place, self._released), self._get(byref(place))
        return status, state if status <= WARNING else None

    def put(self, state: KeptState) -> int:
        """Have the FMU go back to its own state; the FMI status."""
        return self._set(state.place)

    def close(self) -> None:
        """Have the FMU free all of them, before it is freed itself."""
        for place in self._kept.values():
            self._let_go(place)
        self._kept.clear()

    def _let_go(self, place: c_void_p) -> None:
        if place:
            self._free(byref(place))
            place.value = None
