"""The variables that a proxy and its peer exchange: text, hash, and how two of them differ."""

from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from io import StringIO
from itertools import zip_longest
from typing import Literal, NamedTuple

Kind = Literal["Real", "Integer", "Boolean"]
Causality = Literal["input", "parameter", "output"]

ORDER: tuple[Causality, ...] = ("input", "parameter", "output")
"""Requests carry inputs, then parameters; answers carry outputs."""

HASH_SIZE = 16


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
            if set("\t\n\r\0") & set(f"{v.name}{v.unit or ''}"):
                raise ValueError(
                    f"variable {v.name!r} [{v.unit}]: must be without tabs and line ends"
                )
            if v.name in seen:
                raise ValueError(f"variable {v.name!r}: appears twice; must have one name each")
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
        return sha256(self.text.encode()).digest()[:HASH_SIZE]

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

    def difference(self, proxy: bytes) -> str:
        """Return the first variable that is another one in a proxy's text, whatever that is."""
        theirs = proxy.partition(b"\0")[0].decode(errors="replace")
        pairs = zip_longest(StringIO(theirs), StringIO(self.text), fillvalue="no more")
        first, own = next((pair for pair in pairs if pair[0] != pair[1]), ("no more", "no more"))
        return f"the proxy has {first}, the peer {own}".replace("\t", " ").replace("\n", "")
