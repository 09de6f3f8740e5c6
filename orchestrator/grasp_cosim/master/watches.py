"""What a run watches after each step: its limits, and whether a lost peer is back."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from ..interface.interface import Interface
from ..recording.proxies import BACK
from ..recording.recorded_run import Trip
from ..system.conditions import compared
from ..system.description import System
from ..system.parts import RELATIONS, Limit, Port
from ..system.times import in_seconds, seconds
from . import loop
from .exchanged import states_of_proxies


@dataclass(frozen=True, slots=True)
class Watch:
    """A condition of the table: of a limit, or that the peer of a component is back."""

    limit: Limit | None
    component: str
    unit: str | None
    number: int


class Watches:
    """The conditions of one run as the loop's table, and what came of them."""

    def __init__(
        self, system: System, interfaces: Mapping[str, Interface], slots: Mapping[Port, int]
    ) -> None:
        self._system, self._slots = system, slots
        self.log: list[str] = []
        self._first: dict[int, tuple[int, float]] = {}  # by limit: step and value
        rows: list[Sequence[float]] = []
        self.entries: list[Watch] = []
        for number, limit in enumerate(system.limits):
            port, change, constant = compared(system, limit.when)
            variable = interfaces[port.component].by_name[port.variable]
            relation = RELATIONS.index(limit.when.relation)
            rows.append((slots[port], relation, constant, change.factor, change.offset, 1.0, 0.0))
            unit = variable.unit if port == limit.when.port else None
            self.entries.append(Watch(limit, port.component, unit, number))
        for port in system.once(states_of_proxies):
            rows.append((slots[port], RELATIONS.index("=="), float(BACK), 1.0, 0.0, 1.0, 0.0))
            self.entries.append(Watch(None, port.component, None, len(self.entries)))
        self.table: npt.NDArray[np.float64] = np.array(rows, np.float64).reshape(-1, loop.HELD + 1)

    def at_start(self, values: npt.NDArray[np.float64]) -> str | None:
        """Look at the limits before the first step; why the run is to be aborted there, if so."""
        reasons = [
            self.note(i, 0, values)
            for i, watch in enumerate(self.entries)
            if watch.limit and loop.holds(self.table[i], values)
        ]
        return next((reason for reason in reasons if reason), None)

    def note(self, i: int, step: int, values: npt.NDArray[np.float64]) -> str | None:
        """Take note that a limit is exceeded at a communication point; why the run ends, if so."""
        watch = self.entries[i]
        assert watch.limit is not None  # noqa: S101 - those of proxies are not noted
        row = self.table[i]
        value = float(row[loop.FACTOR] * values[int(row[loop.SLOT])] + row[loop.OFFSET])
        self._first[i] = step, value
        value_text = f"{value:.6g}{f' {watch.unit}' if watch.unit else ''}"
        time = seconds(self._system.time_ns(step))
        self.log.append(
            f"t = {time}: limits[{watch.number}]: {watch.limit.when}: it is {value_text}"
        )
        if watch.limit.then == "warn":
            return None
        return (
            f"{self._system.name}: limits[{watch.number}]: {watch.limit.when} at t = {time}, it is "
            f"{value_text}: the run was aborted"
        )

    def saved(self) -> tuple[Any, ...]:
        """What came of them until now, for restore()."""
        return self.table.copy(), [*self.log], dict(self._first)

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what was saved."""
        self.table[:], log, first = saved
        self.log, self._first = [*log], dict(first)

    def arm(self) -> None:
        """Look for peers that are back once more."""
        for i, watch in enumerate(self.entries):
            if watch.limit is None:
                self.table[i][loop.ARMED] = 1.0

    def trips(self) -> tuple[Trip, ...]:
        """The limits that were exceeded until now."""
        found = []
        for i, (step, value) in sorted(self._first.items()):
            limit = self.entries[i].limit
            assert limit is not None  # noqa: S101 - as in note()
            first, steps_held = (
                in_seconds(self._system.time_ns(step)),
                int(self.table[i][loop.HELD]),
            )
            found.append(Trip(str(limit.when), limit.then, first, value, steps_held))
        return tuple(found)
