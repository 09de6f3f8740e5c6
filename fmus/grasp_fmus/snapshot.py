"""Turns the whole state of a slave into bytes and back. To the byte: States in fmus/README.md."""

import struct
from collections.abc import Iterator
from hashlib import blake2b
from typing import Any, NamedTuple

MAGIC = b"graspFMU"
HEAD = 40


class Snapshot(NamedTuple):
    """The state of a slave at a moment: everything else follows from it."""

    phase: int
    time: float
    settable: tuple[Any, ...]
    """The values of inputs and parameters."""
    state: Any
    """The state of the block."""


def to_bytes(snapshot: Snapshot, content: str) -> bytes:
    """Return the bytes of a snapshot of the FMU with the content hash `content`."""
    numbers = [snapshot.phase, snapshot.time, *snapshot.settable, *_scalars(snapshot.state)]
    payload = struct.pack(f"<{len(numbers)}d", *numbers)
    return MAGIC + content.encode() + _checksum(content, payload) + payload


def from_bytes(data: bytes, content: str, like: Snapshot) -> Snapshot:
    """Return the snapshot that these bytes hold, in the shape of the snapshot `like`.

    ValueError says what is wrong with them.
    """
    if data[:8] != MAGIC:
        raise ValueError(f"state of {len(data)} bytes: must begin with {MAGIC!r}")
    if data[8:24] != content.encode():
        origin = data[8:24].decode("ascii", "replace")
        raise ValueError(f"state of the FMU with content {origin}: must be of this one, {content}")
    count = 2 + len(like.settable) + len(list(_scalars(like.state)))
    if len(data) != HEAD + 8 * count:
        raise ValueError(f"state of {len(data)} bytes: must have {HEAD + 8 * count}")
    payload = data[HEAD:]
    if data[24:HEAD] != _checksum(content, payload):
        raise ValueError("state with a wrong check sum: must be as it was written")
    numbers = iter(struct.unpack(f"<{count}d", payload))
    return Snapshot(
        int(next(numbers)),
        next(numbers),
        tuple(type(v)(next(numbers)) for v in like.settable),
        _shaped(like.state, numbers),
    )


def _checksum(content: str, payload: bytes) -> bytes:
    return blake2b(content.encode() + payload, digest_size=16).digest()


def _scalars(value: Any) -> Iterator[float]:
    if isinstance(value, tuple):
        for item in value:
            yield from _scalars(item)
    else:
        yield value


def _shaped(like: Any, numbers: Iterator[float]) -> Any:
    if not isinstance(like, tuple):
        return type(like)(next(numbers))
    items = [_shaped(item, numbers) for item in like]
    return tuple(items) if type(like) is tuple else type(like)(*items)
