"""When the faults of connections act, and what they make of the values that are passed.

Which kinds of faults there are: system/faults.py.
"""

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from ..system.faults import FAULTS, INITIAL, Act, Draws, Remembering
from ..system.parts import Fault, Port
from ..system.times import Time, first_step
from .occurrence import Occurrence

Cut = Callable[[float], float]
"""What becomes of a value that is passed where a connection is cut, for an analysis."""

NO_CUTS: Mapping[Port, Cut] = MappingProxyType({})


class Window:
    """The steps in which a fault acts. With a condition they are only known when it begins."""

    def __init__(self, fault: Fault, step_ns: Time, start_ns: Time = 0) -> None:
        self.fault = fault
        self._earliest = first_step(fault.start_ns, step_ns, start_ns)
        self._end: float = math.inf
        if fault.end_ns is not None:
            self._end = first_step(fault.end_ns, step_ns, start_ns)
        first: float = (self._earliest or INITIAL) if fault.when is None else math.inf
        self.acting = False, first
        """Whether it has begun, and from which step on it acts."""

    def acts(self, step: int) -> bool:
        """Return True if the fault acts on the values passed in this step."""
        return self.acting[1] <= step < self._end

    def occurrences(self, place: str) -> list[Occurrence]:
        """Its beginning, and its end where it has one."""
        name = f"{self.fault.target}: {self.fault.kind}"

        def begin(step: int) -> Sequence[str]:
            self.acting = True, min(self.acting[1], step)
            return [f"{name} begins"]

        absence = f"{place} did not begin: {name}"
        occurrences = [Occurrence(self._earliest, self._end, 1, self.fault.when, begin, absence)]
        if self._end < math.inf:
            line = f"{name} ends"

            def end(_: int) -> Sequence[str]:
                has_begun = self.acting[0]
                return [line] if has_begun else []

            occurrences.append(Occurrence(int(self._end), math.inf, 1, None, end))
        return occurrences


class FaultFunction:
    """Changes a value passed at a step number: the faults of a connection, one after the other.

    A cut of that connection comes after them.
    """

    def __init__(self, cut: Cut | None) -> None:
        self._cut = cut
        self._chain: list[tuple[Act, Window]] = []

    def add(self, act: Act, window: Window) -> None:
        """Add a fault to the end."""
        self._chain.append((act, window))

    def __call__(self, value: float, step: int) -> float:
        """What becomes of the value."""
        for act, window in self._chain:
            value = act(value, step, window.acts(step))
        return self._cut(value) if self._cut else value

    def saved(self) -> list[tuple[Any, ...]]:
        """When the faults began, and what they remember, for restore()."""
        return [
            (window.acting, act.saved() if isinstance(act, Remembering) else None)
            for act, window in self._chain
        ]

    def restore(self, saved: list[tuple[Any, ...]]) -> None:
        """Go back to what was saved."""
        for (act, window), (acting, memory) in zip(self._chain, saved, strict=True):
            window.acting = acting
            if isinstance(act, Remembering):
                act.restore(memory)


def fault_functions(
    windows: Sequence[Window], step_ns: Time, cuts: Mapping[Port, Cut] = NO_CUTS
) -> Mapping[Port, FaultFunction]:
    """Return for each connection that has faults or a cut, by target, all of them in turn."""
    targets = dict.fromkeys([*(window.fault.target for window in windows), *cuts])
    functions = {target: FaultFunction(cuts.get(target)) for target in targets}
    kinds: Counter[tuple[Port, str]] = Counter()
    for window in windows:
        fault, key = window.fault, (window.fault.target, window.fault.kind)
        act = FAULTS[fault.kind].start(fault.parameters, Draws(fault, kinds[key]), step_ns)
        functions[fault.target].add(act, window)
        kinds[key] += 1
    return functions
