"""Faults at run time: what a connection makes of the values it passes. Meaning: system/scenario.py.

A fault function gets each value that its connection passes, units converted, and the number of the
base step in which it does so, INITIAL in initialisation mode. Step numbers never fall. Within a
step it may be asked several times, as initialisation and iteration do: only what came last counts
for later steps, so that the same value at the same step number always has the same result.

It never raises, since a compiled loop could not pass that on: what is not finite goes through and
is found where it is recorded.
"""

import hashlib
import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence

from ..system.parts import NANOSECONDS, Fault, Port

INITIAL = -1
"""The step number of the exchanges in initialisation mode."""

FaultFunction = Callable[[float, int], float]
"""What becomes of a value at a step number."""


def first_step(time_ns: int, step_ns: int) -> int:
    """The number of the first communication point at or after a time."""
    return -(-time_ns // step_ns)


class Window:
    """The steps in which a fault acts. With a condition they are only known when it begins."""

    def __init__(self, name: str, fault: Fault, step_ns: int) -> None:
        self.name = name
        self.fault = fault
        self.begun = False
        self._ended = False
        self._earliest = first_step(fault.start_ns, step_ns)
        self._end = math.inf if fault.end_ns is None else first_step(fault.end_ns, step_ns)
        self._first: float = self._earliest or INITIAL
        if fault.when is not None:
            self._first = math.inf

    def __str__(self) -> str:
        return f"{self.fault.target}: {self.fault.kind}"

    def acts(self, step: int) -> bool:
        """Whether the fault acts on the values passed in this step."""
        return self._first <= step < self._end

    def may_begin(self, step: int) -> bool:
        """Whether it begins at this step, if its condition holds."""
        return not self.begun and self._earliest <= step < self._end

    def begin(self, step: int) -> None:
        """It acts from this step on, at the latest."""
        self.begun = True
        self._first = min(self._first, step)

    def must_end(self, step: int) -> bool:
        """Whether it has begun, and this step is behind its last one."""
        return self.begun and not self._ended and step >= self._end

    def end(self) -> None:
        """It is over."""
        self._ended = True

    def next_step(self, step: int) -> int | None:
        """The first step from this one on at which it may begin or must end; None: no such."""
        if not self.begun:
            earliest = max(step, self._earliest)
            return earliest if earliest < self._end else None
        return None if self._ended or self._end == math.inf else max(step, int(self._end))


def fault_functions(windows: Sequence[Window], step_ns: int) -> Mapping[Port, FaultFunction]:
    """For each connection that has faults, by target, all of them one after the other."""
    chains: dict[Port, list[FaultFunction]] = {}
    kinds: list[tuple[Port, str]] = []
    for window in windows:
        fault = window.fault
        key = (fault.target, fault.kind)
        draws = _Draws(fault.kind, str(fault.target), kinds.count(key), fault.seed)
        kinds.append(key)
        chains.setdefault(fault.target, []).append(_function(window, draws, step_ns))
    return {target: _in_turn(chain) for target, chain in chains.items()}


def _in_turn(functions: Sequence[FaultFunction]) -> FaultFunction:
    if len(functions) == 1:
        return functions[0]

    def act(value: float, step: int) -> float:
        for function in functions:
            value = function(value, step)
        return value

    return act


def _function(window: Window, draws: "_Draws", step_ns: int) -> FaultFunction:
    given = window.fault.parameters
    match window.fault.kind:
        case "stuck":
            return _Stuck(window, given.get("value"))
        case "dropout":
            return _Dropout(window, given["probability"], draws)
        case "delay":
            return _Delay(window, round(given["time"] * NANOSECONDS / step_ns))
        case "bias":
            bias = given["value"]
            return _at_once(window, lambda value, _: value + bias)
        case "noise":
            deviation = given["standard_deviation"]
            return _at_once(window, lambda value, step: value + deviation * draws.normal(step))
        case "saturation":
            low, high = given.get("low", -math.inf), given.get("high", math.inf)
            return _at_once(window, lambda value, _: min(max(value, low), high))
        case "quantisation":
            width = given["step"]
            return _at_once(window, lambda value, _: _quantised(value, width))


def _at_once(window: Window, change: FaultFunction) -> FaultFunction:
    """A fault without memory."""
    return lambda value, step: change(value, step) if window.acts(step) else value


def _quantised(value: float, width: float) -> float:
    count = value / width
    return round(count) * width if math.isfinite(count) else value


class _Stuck:
    """The given value, or the one of the first step in which it is asked."""

    def __init__(self, window: Window, value: float | None) -> None:
        self._window = window
        self._held = math.nan if value is None else float(value)
        self._since = math.inf if value is None else -math.inf

    def __call__(self, value: float, step: int) -> float:
        if not self._window.acts(step):
            return value
        if step <= self._since:
            self._since, self._held = step, value
        return self._held


class _Dropout:
    """Holds what got through in an earlier step where a value is lost; at first there is none."""

    def __init__(self, window: Window, probability: float, draws: "_Draws") -> None:
        self._window = window
        self._probability = probability
        self._draws = draws
        self._step = INITIAL - 1
        self._held: float | None = None
        self._passed: float | None = None

    def __call__(self, value: float, step: int) -> float:
        if step != self._step:
            self._step, self._held = step, self._passed
        if self._held is not None and self._lost(step):
            return self._held
        self._passed = value
        return value

    def _lost(self, step: int) -> bool:
        return self._window.acts(step) and self._draws.uniforms(step)[1] < self._probability


class _Delay:
    """The last value passed at least so many base steps ago; the first one where there is none."""

    def __init__(self, window: Window, steps: int) -> None:
        self._window = window
        self._steps = steps
        self._history: deque[tuple[int, float]] = deque()

    def __call__(self, value: float, step: int) -> float:
        history = self._history
        if history and history[-1][0] == step:
            history.pop()
        history.append((step, value))
        while len(history) > 1 and history[1][0] <= step - self._steps:
            history.popleft()
        return history[0][1] if self._window.acts(step) else value


class _Draws:
    """Random numbers that depend on what they are for and on the step number, on nothing else.

    Each is a hash (BLAKE2b) of both, as in a counter-based generator: there is no state to advance.
    Faults of one kind on one connection differ by their count.
    """

    def __init__(self, kind: str, target: str, count: int, seed: int) -> None:
        purpose = repr((kind, target, count, seed))
        self._purpose = hashlib.blake2b(purpose.encode(), digest_size=16)

    def uniforms(self, step: int) -> tuple[float, float]:
        """Two independent numbers, uniform in (0, 1] and in [0, 1)."""
        whole = self._purpose.copy()
        whole.update(step.to_bytes(8, "little", signed=True))
        digest = whole.digest()
        first, second = (int.from_bytes(half, "little") >> 11 for half in (digest[:8], digest[8:]))
        return (first + 1) * 2.0**-53, second * 2.0**-53

    def normal(self, step: int) -> float:
        """A standard normal number, after Box and Muller."""
        first, second = self.uniforms(step)
        return math.sqrt(-2.0 * math.log(first)) * math.cos(2.0 * math.pi * second)
