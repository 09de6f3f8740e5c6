"""The kinds of faults of a connection: what each makes of a value, and its parameters.

FAULTS is the one table of them; what a kind makes of a value: docs/reference/system_file.md.

At run time a fault gets each value that its connection passes, with units converted. It also gets
the number of the base step, INITIAL in initialisation mode, and whether the fault acts in it. Step
numbers never fall. Within a step it may be asked several times, as initialisation and iteration do:
only what came last counts for later steps, so that the same value at the same step number always
has the same result.

It never raises, since a compiled loop could not pass that on: what is not finite goes through and
is found where it is recorded.
"""

import hashlib
import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass
from typing import Any, NamedTuple

from ..base.errors import InputError
from .parts import Fault
from .times import LONGEST, NANOSECONDS, Time, in_seconds, seconds

INITIAL = -1
"""The step number of the exchanges in initialisation mode."""

Act = Callable[[float, int, bool], float]
"""Changes a value passed at a step number; the flag says if the fault acts."""

Parameters = Mapping[str, Any]


class Range(NamedTuple):
    """What a parameter of a fault must be; `above` if `low` is too low, `needed` if it must be."""

    must: str
    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    needed: bool = True


class Draws:
    """Random numbers that depend on what they are for and on the step number, on nothing else.

    Each is a hash (BLAKE2b) of both, as in a counter-based generator: there is no state to advance.
    Faults of one kind on one connection differ by their `count`.
    """

    def __init__(self, fault: Fault, count: int) -> None:
        purpose = repr((fault.kind, str(fault.target), count, fault.seed))
        self._purpose = hashlib.blake2b(purpose.encode(), digest_size=16)

    def uniforms(self, step: int) -> tuple[float, float]:
        """Return two independent numbers, uniform in (0, 1] and in [0, 1)."""
        generator = self._purpose.copy()
        generator.update(step.to_bytes(8, "little", signed=True))
        digest = generator.digest()
        first, second = (int.from_bytes(half, "little") >> 11 for half in (digest[:8], digest[8:]))
        return (first + 1) * 2.0**-53, second * 2.0**-53

    def normal(self, step: int) -> float:
        """Return a standard normal number, after Box and Muller."""
        first, second = self.uniforms(step)
        return math.sqrt(-2.0 * math.log(first)) * math.cos(2.0 * math.pi * second)


Start = Callable[[Parameters, Draws, Time], Act]
"""Makes a fault from its parameters, its random numbers and the base step in ns."""


class Remembering(ABC):
    """An Act that goes by what it has passed: memory is all of that."""

    memory: Sequence[Any] = ()

    def saved(self) -> Sequence[Any]:
        """The memory of now, for restore()."""
        return copy(self.memory)

    def restore(self, saved: Sequence[Any]) -> None:
        """Go back to what was saved."""
        self.memory = copy(saved)

    @abstractmethod
    def __call__(self, value: float, step: int, acts: bool) -> float:
        """As an Act."""


class _Stuck(Remembering):
    """The given value, or the one of the first step in which it is asked."""

    def __init__(self, parameters: Parameters, *_: object) -> None:
        since = -math.inf if "value" in parameters else math.inf
        self.memory = since, float(parameters.get("value", math.nan))

    def __call__(self, value: float, step: int, acts: bool) -> float:
        if not acts:
            return value
        if step <= self.memory[0]:
            self.memory = step, value
        stuck_at: float = self.memory[1]
        return stuck_at


class _Dropout(Remembering):
    """Hold what got through in an earlier step where a value is lost; at first there is none."""

    def __init__(self, parameters: Parameters, draws: Draws, _: Time) -> None:
        self._probability, self._draws = parameters["probability"], draws
        self.memory = INITIAL - 1, None, None

    def __call__(self, value: float, step: int, acts: bool) -> float:
        last, last_passed, passed = self.memory
        if step != last:
            last_passed = passed
        if last_passed is not None and acts and self._draws.uniforms(step)[1] < self._probability:
            value, next_passed = last_passed, passed
        else:
            next_passed = value
        self.memory = step, last_passed, next_passed
        return value


class _Delay(Remembering):
    """The last value passed at least so many base steps ago; the first one where there is none."""

    def __init__(self, parameters: Parameters, _: Draws, step_ns: Time) -> None:
        self._steps = round(parameters["time"] * NANOSECONDS / step_ns)
        self.memory: deque[tuple[int, float]] = deque()

    def __call__(self, value: float, step: int, acts: bool) -> float:
        history = self.memory
        if history and history[-1][0] == step:
            history.pop()
        history.append((step, value))
        while len(history) > 1 and history[1][0] <= step - self._steps:
            history.popleft()
        return history[0][1] if acts else value


def _check_delay(place: str, parameters: Parameters, step_ns: Time) -> None:
    time = parameters["time"]
    count = round(time * NANOSECONDS / step_ns)
    if abs(count * step_ns - time * NANOSECONDS) > 1e-12 * time * NANOSECONDS:
        raise InputError(
            f"{place}: time = {time:.9g} s: must be a whole number of steps of "
            f"{seconds(step_ns)}; could be {in_seconds(max(1, count) * step_ns)!r} s"
        )


def _check_saturation(place: str, parameters: Parameters, _: Time) -> None:
    low, high = parameters.get("low"), parameters.get("high")
    if low is None and high is None:
        raise InputError(f"{place}: a saturation must have low, high or both")
    if low is not None and high is not None and not low < high:
        raise InputError(f"{place}: high = {high!r}: must be above low = {low!r}")


def _rounded(value: float, width: float) -> float:
    count = value / width
    return round(count) * width if math.isfinite(count) else value


Change = Callable[[float, Parameters, Draws, int], float]
"""What a fault without a memory makes of a value, at the number of a step."""


def _without_memory(change: Change) -> Start:
    """A fault that changes each value by its parameters, random numbers and the step number."""

    def start(parameters: Parameters, draws: Draws, _: Time) -> Act:
        return lambda value, step, acts: change(value, parameters, draws, step) if acts else value

    return start


def _biased(value: float, parameters: Parameters, _: Draws, __: int) -> float:
    """The value and a constant."""
    biased: float = value + parameters["value"]
    return biased


def _noisy(value: float, parameters: Parameters, draws: Draws, step: int) -> float:
    """The value and a random number of a normal distribution."""
    noisy: float = value + parameters["standard_deviation"] * draws.normal(step)
    return noisy


def _saturated(value: float, parameters: Parameters, _: Draws, __: int) -> float:
    """The value, but no lower than low and no higher than high."""
    saturated: float = min(
        max(value, parameters.get("low", value)), parameters.get("high", math.inf)
    )
    return saturated


def _quantised(value: float, parameters: Parameters, _: Draws, __: int) -> float:
    """The nearest whole number of steps of quantisation."""
    return _rounded(value, parameters["step"])


@dataclass(frozen=True, slots=True)
class FaultKind:
    """One kind of fault; check() is of parameters in their ranges, by each other and the step."""

    start: Start
    parameters: Mapping[str, Range | None]
    """The range of each; None where it is a value that the input takes, and may be left out."""
    discrete: bool = False
    """True if it makes sense for an Integer or a Boolean."""
    random: bool = False
    check: Callable[[str, Parameters, Time], None] = lambda *_: None


FINITE = Range("a finite number")
OPTIONAL = FINITE._replace(needed=False)
PROBABILITY = Range("a number from 0 to 1", 0.0, 1.0)
DEVIATION = Range("a finite number of at least 0", 0.0)
DURATION = Range(f"a number from 0 to {LONGEST:g}", 0.0, LONGEST)
WIDTH = Range("a finite number above 0", 0.0, above=True)

STUCK = FaultKind(_Stuck, {"value": None}, discrete=True)
DROPOUT = FaultKind(_Dropout, {"probability": PROBABILITY}, discrete=True, random=True)
BIAS = FaultKind(_without_memory(_biased), {"value": FINITE})
NOISE = FaultKind(_without_memory(_noisy), {"standard_deviation": DEVIATION}, random=True)
DELAY = FaultKind(_Delay, {"time": DURATION}, discrete=True, check=_check_delay)
SATURATION = FaultKind(
    _without_memory(_saturated), {"low": OPTIONAL, "high": OPTIONAL}, check=_check_saturation
)
QUANTISATION = FaultKind(_without_memory(_quantised), {"step": WIDTH})

FAULTS: Mapping[str, FaultKind] = {
    "stuck": STUCK,
    "dropout": DROPOUT,
    "bias": BIAS,
    "noise": NOISE,
    "delay": DELAY,
    "saturation": SATURATION,
    "quantisation": QUANTISATION,
}
"""The kinds of faults by name."""

RANDOM = tuple(name for name, kind in FAULTS.items() if kind.random)
