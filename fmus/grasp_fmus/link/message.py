"""Packs and opens datagrams: a header of 80 bytes, a body, 32 of HMAC-SHA256 if a key is shared."""

import hmac
import os
import stat
import struct
from collections.abc import Sequence
from math import isfinite
from pathlib import Path
from typing import NamedTuple

from .signature import HASH_SIZE, LinkVariable, Signature

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

_CODES = {"Real": "d", "Integer": "q", "Boolean": "Q"}


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
        self._struct = struct.Struct("<" + "".join(_CODES[v.kind] for v in variables))
        self.pack = self._struct.pack
        self.size = self._struct.size
        self._reals = [i for i, v in enumerate(variables) if v.kind == "Real"]
        self._integers = [i for i, v in enumerate(variables) if v.kind == "Integer"]
        self._booleans = [i for i, v in enumerate(variables) if v.kind == "Boolean"]

    def unpack(self, body: bytes) -> list[Value] | None:
        """Return the values of a body; None where its size is wrong or a value is invalid.

        Invalid is a Real that is not finite, an Integer beyond 32 bits, a Boolean but 0 and 1.
        """
        if len(body) != self.size:
            return None
        values = list(self._struct.unpack(body))
        reals = [values[i] for i in self._reals]
        if not isfinite(sum(reals)) and not all(map(isfinite, reals)):
            return None
        for i in self._integers:
            if not -(2**31) <= values[i] < 2**31:
                return None
        for i in self._booleans:
            if values[i] > 1:
                return None
            values[i] = values[i] == 1
        return values


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
    numbers = {"a request": len(signature.request), "an answer": len(signature.answer)}
    sizes = {name: 8 * n for name, n in numbers.items()} | {"a HELLO": len(signature.text.encode())}
    for name, size in sizes.items():
        if (whole := HEAD.size + size + TAG_SIZE) > LARGEST:
            n = numbers.get(name, len(signature.variables))
            raise ValueError(
                f"{name} with {n} variables has {whole} bytes: must be {LARGEST} at most"
            )
