"""The variables that a proxy and its peer exchange, and the datagrams that carry them.

A datagram is a header of 80 bytes, a body, and 32 of HMAC-SHA256 if a key is shared.
"""

import hmac
import os
import stat
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from io import StringIO
from itertools import zip_longest
from math import isfinite
from pathlib import Path
from typing import Any, Literal, NamedTuple

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
                must = "must be without tabs and line ends"
                raise ValueError(f"variable {v.name!r} [{v.unit}]: {must}")
            if v.name in seen:
                raise ValueError(f"variable {v.name!r}: appears twice; must have one name each")
            seen.add(v.name)

    @cached_property
    def text(self) -> str:
        """A line per variable: causality, kind, unit or -, and name, between tabs."""
        lines = ((v.causality, v.kind, v.unit or "-", v.name) for v in self.variables)
        return "".join("\t".join(line) + "\n" for line in lines)

    @cached_property
    def hash(self) -> bytes:
        """The first 16 bytes of the SHA-256 of the text."""
        return sha256(self.text.encode()).digest()[:HASH_SIZE]

    @cached_property
    def request(self) -> tuple[LinkVariable, ...]:
        """The variables that a request carries: inputs, then parameters."""
        return self.of("input") + self.of("parameter")

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


Value = float | int | bool | str
"""The value of a variable of FMI; texts are not exchanged."""

MAGIC, VERSION = b"GRSP", 2
HELLO, WELCOME, REFUSE, INITIALISE, STEP, OUTPUTS, END = range(1, 8)
"""Kinds of datagrams."""

OTHER_INTERFACE, BUSY, UNKNOWN, FAILED, OTHER_VERSION = range(1, 6)
"""The reasons why a peer refuses: codes of REFUSE."""

HEAD = struct.Struct(f"<4sHBB{HASH_SIZE}sQQQddqII")
TAG_SIZE = 32
LARGEST = 65_507
"""Bytes of a UDP datagram over IPv4."""
PORT = 5501
"""The default UDP port of a peer."""

SHORTEST_HELLO = 1024
"""Bytes of the body of a HELLO, at least, so that there is room for the reason in its answer."""
LONGEST_STEP = 3600.0
"""s that a STEP may ask for, so that no datagram keeps a bench busy for good."""

SMALLEST_KEY = 16
"""Bytes of a shared key, at least."""
LARGEST_KEY = 4096
"""Bytes of a key file, at most."""

MALFORMED, FORGED = "malformed", "forged"
"""The faults of a datagram: it is not of this protocol, or its tag is not that of the key."""

_TEXT = frozenset((*b"\t\r\n", *range(0x20, 0x7F)))

_KINDS: dict[str, tuple[str, type[Value], Callable[[Any], bool]]] = {
    "Real": ("d", float, isfinite),
    "Integer": ("q", int, lambda x: -(2**31) <= x < 2**31),
    "Boolean": ("Q", bool, lambda x: x <= 1),
}
"""By the kind of a variable: its code for struct, its type in Python, and what values are valid."""


class Message(NamedTuple):
    """A datagram taken apart, as in HEAD; times in s, but `sent` in ns of the proxy's clock."""

    kind: int
    code: int
    interface: bytes
    session: int
    cookie: int
    sequence: int
    time: float
    step: float
    sent: int
    body: bytes
    version: int = VERSION


class Sealer:
    """Packs and opens datagrams, with a shared key or without."""

    def __init__(self, key: bytes | None = None) -> None:
        """ValueError where the key is too short to be one."""
        if key is not None and len(key) < SMALLEST_KEY:
            raise ValueError(f"key of {len(key)} bytes: must have {SMALLEST_KEY} or more")
        self._key = key
        self._tag_size = TAG_SIZE if key else 0

    def pack(self, m: Message) -> bytes:
        """Return the datagram of a message; ValueError where it would be too large."""
        *fields, body, version = m
        datagram = HEAD.pack(MAGIC, version, *fields, len(body), 0) + body
        size = len(datagram) + self._tag_size
        if size > LARGEST:
            raise ValueError(f"datagram of {size} bytes: must be {LARGEST} at most")
        return datagram + hmac.digest(self._key, datagram, "sha256") if self._key else datagram

    def open(self, datagram: bytes) -> Message | str:
        """Return the message in a datagram of any version, or its fault: MALFORMED or FORGED."""
        end = len(datagram) - self._tag_size
        if end < HEAD.size or len(datagram) > LARGEST or not datagram.startswith(MAGIC):
            return MALFORMED
        if self._key is not None:
            tag = hmac.digest(self._key, datagram[:end], "sha256")
            if not hmac.compare_digest(tag, datagram[end:]):
                return FORGED
        _, version, *fields, size, zero = HEAD.unpack_from(datagram)
        m = Message._make((*fields, datagram[HEAD.size : end], version))
        known = HELLO <= m.kind <= END and isfinite(m.time + m.step)
        return m if known and size == len(m.body) and not zero else MALFORMED


class Codec:
    """Values of variables as a body: Real f64, Integer i64, Boolean u64."""

    def __init__(self, variables: Sequence[LinkVariable]) -> None:
        kinds = [_KINDS[v.kind] for v in variables]
        self._struct = struct.Struct("<" + "".join(code for code, *_ in kinds))
        self._kinds = [kind for _, kind, _ in kinds]
        self._valid = [valid for *_, valid in kinds]
        self.pack = self._struct.pack
        self.size = self._struct.size

    def unpack(self, body: bytes) -> list[Value] | None:
        """Return the values of a body; None where its size is wrong or a value is invalid.

        Invalid is a Real that is not finite, an Integer beyond 32 bits, a Boolean but 0 and 1.
        """
        if len(body) != self.size:
            return None
        values = self._struct.unpack(body)
        if not all(valid(x) for valid, x in zip(self._valid, values, strict=True)):
            return None
        return [kind(x) for kind, x in zip(self._kinds, values, strict=True)]


def read_key(path: Path) -> bytes:
    """Return the key in a file; ValueError where it is too short, or the file too long.

    A file of printable ASCII, tabs and line ends is text: line ends around it are not of the key.
    Of any other, such as random bytes, every byte is.
    """
    with path.open("rb") as file:
        data = file.read(LARGEST_KEY + 1)
    if len(data) > LARGEST_KEY:
        raise ValueError(f"file of more than {LARGEST_KEY} bytes: is not a key")
    is_text = all(byte in _TEXT for byte in data)
    key = data.strip(b"\r\n") if is_text else data
    Sealer(key)
    return key


def exposed(path: Path) -> str:
    """Say that others on this machine can read a key file, or write it; empty where they cannot."""
    mode = stat.S_IMODE(path.stat().st_mode)
    if os.name == "nt" or not mode & 0o077:
        return ""
    return f"{path}: others have access to this key, mode {mode:03o}; must be 600: chmod 600 {path}"


def check_size(signature: Signature) -> None:
    """ValueError where the variables do not fit into a datagram."""
    bodies = {
        "a request": (signature.request, 8 * len(signature.request)),
        "an answer": (signature.answer, 8 * len(signature.answer)),
        "a HELLO": (signature.variables, len(signature.text.encode())),
    }
    for name, (variables, size) in bodies.items():
        if (whole := HEAD.size + size + TAG_SIZE) > LARGEST:
            said = f"{name} with {len(variables)} variables has {whole} bytes"
            raise ValueError(f"{said}: must be {LARGEST} at most")
