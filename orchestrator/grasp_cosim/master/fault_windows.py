"""Faults at run time: when each acts, all of a connection in turn. Kinds: system/faults.py."""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial

from ..system.faults import FAULTS, INITIAL, Draws
from ..system.parts import Fault, Port, first_step

FaultFunction = Callable[[float, int], float]
"""Changes a value passed at a step number."""


class Window:
    """The steps in which a fault acts. With a condition they are only known when it begins."""

    def __init__(self, name: str, fault: Fault, step_ns: int, start_ns: int = 0) -> None:
        self.name = name
        self.fault = fault
        self.begun = False
        self._ended = False
        self._earliest = first_step(fault.start_ns, step_ns, start_ns)
        self._end: float = math.inf
        if fault.end_ns is not None:
            self._end = first_step(fault.end_ns, step_ns, start_ns)
        self._first: float = self._earliest or INITIAL
        if fault.when is not None:
            self._first = math.inf

    def __str__(self) -> str:
        return f"{self.fault.target}: {self.fault.kind}"

    def acts(self, step: int) -> bool:
        """Return True if the fault acts on the values passed in this step."""
        return self._first <= step < self._end

    def may_begin(self, step: int) -> bool:
        """Return True if it begins at this step, provided that its condition holds."""
        return not self.begun and self._earliest <= step < self._end

    def begin(self, step: int) -> None:
        """Act from this step on, at the latest."""
        self.begun = True
        self._first = min(self._first, step)

    def must_end(self, step: int) -> bool:
        """Return True if it has begun, and this step is behind its last one."""
        return self.begun and not self._ended and step >= self._end

    def end(self) -> None:
        """Note that it is over."""
        self._ended = True

    def next_step(self, step: int) -> int | None:
        """Return the first step from this one on at which it may begin or must end, or None."""
        if not self.begun:
            earliest = max(step, self._earliest)
            return earliest if earliest < self._end else None
        return None if self._ended or self._end == math.inf else max(step, int(self._end))


def fault_functions(windows: Sequence[Window], step_ns: int) -> Mapping[Port, FaultFunction]:
    """Return for each connection that has faults, by target, all of them one after the other."""
    chains: dict[Port, list[FaultFunction]] = {}
    kinds: Counter[tuple[Port, str]] = Counter()
    for window in windows:
        fault = window.fault
        key = (fault.target, fault.kind)
        chains.setdefault(fault.target, []).append(_function(window, kinds[key], step_ns))
        kinds[key] += 1
    return {target: partial(_in_turn, chain) for target, chain in chains.items()}


def _function(window: Window, count: int, step_ns: int) -> FaultFunction:
    """Return the fault of a window, before which the connection has `count` of its kind."""
    fault = window.fault
    act = FAULTS[fault.kind].start(fault.parameters, Draws(fault, count), step_ns)
    return lambda value, step: act(value, step, window.acts(step))


def _in_turn(functions: Sequence[FaultFunction], value: float, step: int) -> float:
    for function in functions:
        value = function(value, step)
    return value
