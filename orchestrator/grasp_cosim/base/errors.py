"""The two ways a simulation is refused or broken off."""

import re
import signal
from collections.abc import Iterable, Mapping, Sequence
from typing import Any


class InputError(Exception):
    """The input is wrong. The message is one line: what, where, the value, what would be valid.

    Example:
        >>> from grasp_cosim import InputError, grasp_system
        >>> try:
        ...     grasp_system().with_values({"plant.object_widht": 0.05})
        ... except InputError as error:
        ...     print(str(error).partition(":")[0])
        with_values plant.object_widht
    """


class SimulationError(Exception):
    """An FMU failed in a running simulation. The message is one line.

    Example:
        >>> from grasp_cosim import SimulationError, grasp_system, simulate
        >>> try:
        ...     result = simulate(grasp_system(), step=1e-3, stop=0.1)
        ... except SimulationError as error:
        ...     print(error)  # the component, the time and the reason
        >>> result.came_to_its_end
        True
    """

    result: Any = None
    """What was recorded until then, a recording.result.Result; None where there is nothing."""


class RunInterruptedError(KeyboardInterrupt):
    """Ctrl-C ended a run in good order: result is what was recorded, a recording.result.Result.

    Example:
        >>> from grasp_cosim import RunInterruptedError, grasp_system, simulate
        >>> try:
        ...     result = simulate(grasp_system(), step=1e-3, stop=0.1)
        ... except RunInterruptedError as interrupted:
        ...     result = interrupted.result  # the rows up to the interrupt
        >>> len(result.time)
        101
    """

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
    valid = [*dict.fromkeys(map(str, names))]
    if alike := _alike(str(name), valid):
        return f"did you mean {', '.join(alike)}?"
    if see and len(valid) > MAX_LISTED_IN_FULL:
        return f"valid: {choices(valid, MAX_LISTED_OF_MANY)}; {see} shows all"
    return f"valid: {choices(valid)}"


MAX_LISTED_IN_FULL, MAX_LISTED_OF_MANY = 8, 4
"""Of more names than the first, only the second many are named where all are listed elsewhere."""


def _alike(name: str, names: Sequence[str]) -> list[str]:
    """At most three names: those with all its words, else those spelt alike, else those that hold
    its last part.

    Behind a component or group that is known, "plant.", the rest must be alike.
    """
    from difflib import SequenceMatcher, get_close_matches

    head, dot, last = name.lower().rpartition(".")
    if len(last) < MIN_LENGTH_TO_COMPARE:
        return []
    mates = [candidate for candidate in names if candidate.lower().startswith(head + dot)]
    cut = len(head + dot) if mates else 0
    lower = {candidate[cut:].lower(): candidate for candidate in mates or names}
    spelt = name.lower()[cut:]
    if same_words := _with_all_words(spelt, lower):
        return same_words
    if close := get_close_matches(spelt, lower, 3):
        ratios = {candidate: SequenceMatcher(None, candidate, spelt).ratio() for candidate in close}
        least = max(ratios.values()) - SIMILARITY_TOLERANCE
        return [name for candidate, name in lower.items() if ratios.get(candidate, 0.0) > least]
    return [candidate for candidate in names if last in candidate.lower()][:3]


def _with_all_words(spelt: str, candidates: Mapping[str, str]) -> list[str]:
    """The candidates with all words of a name of several words, whatever their order.

    `contact_time` is `time_to_contact`. Those with the fewest words are the nearest.
    """
    words = set(_WORD.findall(spelt))
    if len(words) < 2 or spelt in candidates:
        return []
    counts = {
        name: len(_WORD.findall(candidate))
        for candidate, name in candidates.items()
        if words <= set(_WORD.findall(candidate))
    }
    fewest = min(counts.values(), default=0)
    return [name for name, count in counts.items() if count == fewest][:3]


_WORD = re.compile(r"[a-z]+")
"""A word of a name such as time_to_contact[1]."""

SIMILARITY_TOLERANCE = 0.05
"""How much less alike than the first the others may be, of 1."""

MIN_LENGTH_TO_COMPARE = 3
"""Letters of a name that may be misspelt; every "cm" is near to "m"."""


def choices(names: Iterable[object], limit: int = 24) -> str:
    """The valid choices as a readable list, cut where it gets long."""
    texts = [str(name) for name in names]
    remaining = f", ... ({len(texts) - limit} more)" if len(texts) > limit else ""
    return ", ".join(texts[:limit]) + remaining if texts else "none"
