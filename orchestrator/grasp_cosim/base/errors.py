"""The two ways a simulation is refused or broken off."""

import signal
from collections.abc import Iterable, Sequence
from typing import Any


class InputError(Exception):
    """The input is wrong. The message is one line: what, where, the value, what would be valid."""


class SimulationError(Exception):
    """An FMU failed in a running simulation. The message is one line."""

    result: Any = None
    """What was recorded until then, a recording.result.Result; None where there is nothing."""


class RunInterruptedError(KeyboardInterrupt):
    """Ctrl-C ended a run in good order: result is what was recorded, a recording.result.Result."""

    def __init__(self, result: Any) -> None:
        super().__init__("the run was interrupted; what was recorded is the result of this error")
        self.result = result


class UnknownNameError(KeyError):
    """A mapping has no such name among its names of a kind; the message has the nearest ones."""

    def __str__(self) -> str:
        """Worked out when it is read: most are caught."""
        name, names, kind = self.args
        return f"{name!r}: no such {kind}; {nearest(str(name), names)}"


def reason(error: Exception) -> str:
    """The text of an error, without the number and the file that an OSError puts around it."""
    return getattr(error, "strerror", None) or str(error)


def ended(code: int) -> str:
    """How a process came to its end: "ended with exit code 1", "ended with signal SIGSEGV"."""
    how = f"signal {signal.Signals(-code).name}" if code < 0 else f"exit code {code}"
    return f"ended with {how}"


def nearest(name: object, names: Iterable[object], see: str = "") -> str:
    """The names that look like one: "did you mean a, b?"; where none does, "valid: ...".

    These are all names, or where `see` says where all of them are listed, the first few of many.
    """
    listed = [*dict.fromkeys(map(str, names))]
    if found := _alike(str(name), listed):
        return f"did you mean {', '.join(found)}?"
    if see and len(listed) > MANY:
        return f"valid: {choices(listed, FEW)}; {see} shows all"
    return f"valid: {choices(listed)}"


MANY, FEW = 8, 4
"""Of more names than MANY, only a FEW are named where all are listed elsewhere."""


def _alike(name: str, names: Sequence[str]) -> list[str]:
    """At most three names: those spelt alike, else those that hold its last part.

    Behind a component or group that is known, "plant.", what follows must be alike.
    """
    from difflib import SequenceMatcher, get_close_matches

    head, dot, last = name.lower().rpartition(".")
    if len(last) < SHORTEST:
        return []
    mates = [known for known in names if known.lower().startswith(head + dot)]
    cut = len(head + dot) if mates else 0
    lower = {known[cut:].lower(): known for known in mates or names}
    spelt = name.lower()[cut:]
    if close := get_close_matches(spelt, lower, 3):
        ratios = {known: SequenceMatcher(None, known, spelt).ratio() for known in close}
        least = max(ratios.values()) - ABOUT
        return [name for known, name in lower.items() if ratios.get(known, 0.0) > least]
    return [known for known in names if last in known.lower()][:3]


ABOUT = 0.05
"""How much less alike than the first the others may be, of 1."""

SHORTEST = 3
"""Letters of a name that may be misspelt; every "cm" is near to "m"."""


def choices(names: Iterable[object], limit: int = 24) -> str:
    """The valid choices as a readable list, cut where it gets long."""
    listed = [str(name) for name in names]
    more = f", ... ({len(listed) - limit} more)" if len(listed) > limit else ""
    return ", ".join(listed[:limit]) + more if listed else "none"
