"""The states that an FMU keeps for its host: what fmi2GetFMUstate gives, and fmi3GetFMUState."""

from collections import deque
from collections.abc import Callable
from ctypes import byref, c_void_p
from typing import Any

from .instance import WARNING

Place = Callable[[Any], int]
"""A function of FMI over a state, or over the place of one; its status."""


class KeptState:
    """A state that an FMU keeps until nothing here refers to it any more."""

    __slots__ = ("_released", "address")

    def __init__(self, address: int, released: deque[int]) -> None:
        self.address, self._released = address, released

    def __del__(self) -> None:
        """The FMU may be at work, in another thread: it is told later."""
        self._released.append(self.address)


class States:
    """The states of one instance."""

    def __init__(self, get: Place, set_: Place, free: Place) -> None:
        self._get, self._set, self._free = get, set_, free
        self._kept: set[int] = set()
        self._released: deque[int] = deque()

    def take(self) -> tuple[int, KeptState | None]:
        """The FMI status, and the state of now unless that is a bad one."""
        while self._released:
            self._let_go(self._released.popleft())
        place = c_void_p()
        status = self._get(byref(place))
        if status > WARNING:
            return status, None
        address = place.value or 0
        self._kept.add(address)
        return status, KeptState(address, self._released)

    def put(self, state: KeptState) -> int:
        """Have the FMU go back to a state of its own; the FMI status."""
        return self._set(c_void_p(state.address))

    def close(self) -> None:
        """Have the FMU free all of them, before it is freed itself."""
        for address in [*self._kept]:
            self._let_go(address)

    def _let_go(self, address: int) -> None:
        if address in self._kept:
            self._kept.remove(address)
            self._free(byref(c_void_p(address)))
