"""The variables that a proxy and its peer exchange: text, hash, and how two of them differ."""

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from typing import Literal, NamedTuple

Kind = Literal["Real", "Integer", "Boolean", "String"]
Causality = Literal["input", "parameter", "output"]

ORDER: tuple[Causality, ...] = ("input", "parameter", "output")
"""Requests carry inputs, then parameters; answers carry outputs."""

HASH_SIZE = 16

NAMED = 4
"""The most differences that are named in one line."""


class LinkVariable(NamedTuple):
    """A variable as both sides must have it; `unit` is None where it has none."""

    name: str
    kind: Kind
    causality: Causality
    unit: str | None = None


@dataclass(frozen=True)
class Signature:
    """The variables exchanged, in the order of the datagrams: inputs, parameters, outputs.

    ValueError where a name has a character that the text cannot hold, or comes twice.
    """

    variables: tuple[LinkVariable, ...]

    def __post_init__(self) -> None:
        ordered = tuple(v for causality in ORDER for v in self.of(causality))
        object.__setattr__(self, "variables", ordered)
        seen = set()
        for v in self.variables:
            if set("\t\n\r") & set(f"{v.name}{v.unit or ''}"):
                raise ValueError(
                    f"variable {v.name!r} [{v.unit}]: must be without tabs and line ends"
                )
            if v.name in seen:
                raise ValueError(f"variable {v.name!r}: is there twice; must have one name each")
            seen.add(v.name)

    @cached_property
    def text(self) -> str:
        """A line per variable: causality, kind, unit or -, and name, between tabs."""
        return "".join(
            f"{v.causality}\t{v.kind}\t{v.unit or '-'}\t{v.name}\n" for v in self.variables
        )

    @cached_property
    def hash(self) -> bytes:
        """The first 16 bytes of the SHA-256 of the text."""
        return hashed(self.text.encode())

    @cached_property
    def request(self) -> tuple[LinkVariable, ...]:
        """The variables that a request carries: inputs, then parameters."""
        return tuple(v for v in self.variables if v.causality != "output")

    @cached_property
    def answer(self) -> tuple[LinkVariable, ...]:
        """The variables that an answer carries: outputs."""
        return self.of("output")

    def of(self, causality: Causality) -> tuple[LinkVariable, ...]:
        """Return the variables of a causality, in order."""
        return tuple(v for v in self.variables if v.causality == causality)

    def difference(self, other: str) -> str:
        """Return the differences of another signature's text from this one, as half a line.

        It is empty where there are none. The other's text may be anything.
        """
        ours, theirs = _lines(self.text), _lines(other)
        found = [f"there is no {_words(ours[name])}" for name in ours if name not in theirs]
        found += [f"there is also {_words(theirs[name])}" for name in theirs if name not in ours]
        found += [
            f"{_words(theirs[name])}, must be {_words(ours[name])}"
            for name in ours
            if name in theirs and theirs[name] != ours[name]
        ]
        if not found and self.text != other:
            found = ["the variables are in another order"]
        more = [f"and {len(found) - NAMED} more"] if len(found) > NAMED else []
        return "; ".join([*found[:NAMED], *more])


def hashed(text: bytes) -> bytes:
    """Return the hash of a signature's text."""
    return sha256(text).digest()[:HASH_SIZE]


def _lines(text: str) -> dict[str, str]:
    return {line.rpartition("\t")[2]: line for line in text.splitlines()}


def _words(line: str) -> str:
    """Return a line in words: output gap[1], Real in m."""
    causality, kind, unit, name = [*line.split("\t", 3), "", "", ""][:4]
    return f"{causality} {name}, {kind}{'' if unit == '-' else f' in {unit}'}"
