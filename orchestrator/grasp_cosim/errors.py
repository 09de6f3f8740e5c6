"""The two ways a simulation is refused or broken off."""

from collections.abc import Iterable
from typing import Any


class InputError(Exception):
    """The input is wrong. The message is one line: what, where, the value, what would be valid."""


class SimulationError(Exception):
    """An FMU failed in a running simulation. The message is one line."""

    result: Any = None
    """What was recorded until then, a recording.result.Result; None where there is nothing."""


def choices(names: Iterable[object], limit: int = 24) -> str:
    """The valid choices as a readable list, cut where it gets long."""
    listed = [str(name) for name in names]
    more = f", ... ({len(listed) - limit} more)" if len(listed) > limit else ""
    return ", ".join(listed[:limit]) + more if listed else "none"
