"""The two ways a simulation is refused or broken off."""

from collections.abc import Iterable
from typing import Any


class InputError(Exception):
    """The input is wrong. The message is one line: what, where, the value, what would be valid."""


class SimulationError(Exception):
    """An FMU failed in a running simulation. The message is one line."""

    result: Any = None
    """What was recorded until then, a recording.result.Result; None where there is nothing."""


class UnknownNameError(KeyError):
    """A mapping has no such name among its names of a kind; the message has the nearest ones."""

    def __str__(self) -> str:
        """Worked out when it is read: most are caught."""
        name, names, kind = self.args
        return f"{name!r}: no such {kind}; {nearest(str(name), names)}"


def nearest(name: str, names: Iterable[str]) -> str:
    """The names that look like one: "did you mean a, b?"; all where none does: "valid: ..."."""
    from difflib import get_close_matches

    listed = [*names]
    lower = {known.lower(): known for known in listed}
    found = [lower[close] for close in get_close_matches(name.lower(), lower, 3)]
    return f"did you mean {', '.join(found)}?" if found else f"valid: {choices(listed)}"


def choices(names: Iterable[object], limit: int = 24) -> str:
    """The valid choices as a readable list, cut where it gets long."""
    listed = [str(name) for name in names]
    more = f", ... ({len(listed) - limit} more)" if len(listed) > limit else ""
    return ", ".join(listed[:limit]) + more if listed else "none"
