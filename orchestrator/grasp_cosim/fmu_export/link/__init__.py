"""The protocol between a proxy FMU and its peer, without sockets. To the byte: README.md.

A datagram is a header of 80 bytes, a body, and 32 of HMAC-SHA256 if a key is shared. The peer, the
bench's side of a session, judges requests, keeps the order and counts. Its caller does what an
Action says and sends what it gets: at most one datagram for each received, and none that is longer
than that while there is no session: who sends in another's name has nothing to gain by it.
"""

import hmac
import os
import re
import stat
import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from itertools import zip_longest
from math import inf, isfinite
from pathlib import Path
from typing import Any, Literal, NamedTuple

Kind = Literal["Real", "Integer", "Boolean"]
Causality = Literal["input", "parameter", "output"]

ORDER: tuple[Causality, ...] = ("input", "parameter", "output")
"""Requests carry inputs, then parameters; answers carry outputs."""


class LinkVariable(NamedTuple):
    """A variable as both sides must have it; `unit` is None where it has none."""

    name: str
    kind: Kind
    causality: Causality
    unit: str | None = None


class Limit(NamedTuple):
    """The range of a Real, and how fast it may change, per s: infinite where there is no limit."""

    low: float = -inf
    high: float = inf
    rate: float = inf

    @classmethod
    def read(cls, text: str) -> "Limit":
        """Read LOW:HIGH or LOW:HIGH:RATE, parts empty for none.

        ValueError where it is none, limits nothing, or leaves no number.
        """
        parts = text.split(":")
        must = f"{text!r}: must be LOW:HIGH or LOW:HIGH:RATE, as in -5:5:200, not all of them empty"
        if len(parts) not in (2, 3):
            raise ValueError(must)
        try:
            numbers = [float(part) if part.strip() else None for part in parts]
        except ValueError:
            raise ValueError(must) from None
        pairs = zip(numbers, cls(), strict=False)
        limit = cls(*(default if value is None else value for value, default in pairs))
        if limit == cls():
            raise ValueError(must)
        some_number = limit.low <= limit.high and limit.low < inf and limit.high > -inf
        if not (some_number and limit.rate > 0.0):
            raise ValueError(f"{text!r}: the lower limit must be below the upper, the rate over 0")
        return limit


class Signature:
    """The variables exchanged, in the order of the datagrams: inputs, parameters, outputs.

    A request carries the first two, an answer the last. The text has a line per variable, with
    causality, kind, unit or -, and name between tabs; the hash is 16 bytes of its SHA-256.
    ValueError where a name has a character that the text cannot hold, or comes twice.
    """

    def __init__(self, variables: Sequence[LinkVariable]) -> None:
        names = set()
        for v in variables:
            if set("\t\n\r\0") & set(f"{v.name}{v.unit or ''}"):
                must = "must be without tabs and line ends"
                raise ValueError(f"variable {v.name!r} [{v.unit}]: {must}")
            if v.name in names:
                raise ValueError(f"variable {v.name!r}: appears twice; must have one name each")
            names.add(v.name)
        self.variables = tuple(sorted(variables, key=lambda v: ORDER.index(v.causality)))
        self.request = tuple(v for v in self.variables if v.causality != "output")
        self.answer = self.variables[len(self.request) :]
        lines = ((v.causality, v.kind, v.unit or "-", v.name) for v in self.variables)
        self.text = "".join("\t".join(line) + "\n" for line in lines)
        self.hash = sha256(self.text.encode()).digest()[:16]

    def of(self, causality: Causality) -> tuple[LinkVariable, ...]:
        """Return the variables of a causality, in order."""
        return tuple(v for v in self.variables if v.causality == causality)

    def parts(self) -> list["Part"]:
        """Return the text in the parts that a HELLO can carry, each of whole lines."""
        text = self.text.encode()
        parts = [Part(0, len(text), b"")]
        for line in text.splitlines(keepends=True):
            last = parts[-1]
            if len(last.text) + len(line) <= LARGEST_PART:
                parts[-1] = last._replace(text=last.text + line)
            else:
                parts.append(Part(last.offset + len(last.text), len(text), line))
        return parts

    def difference(self, part: "Part") -> str:
        """Return the first variable that is another one in a part of a proxy's text, in words.

        Empty where all is equal so far and the proxy has more. The part may be any bytes.
        """
        own_lines = self.text.encode()[part.offset :].splitlines(keepends=True)
        if part.offset and self.text.encode()[part.offset - 1 : part.offset] != b"\n":
            own_lines = []
        proxy_lines = part.text.splitlines(keepends=True)
        is_last = part.offset + len(part.text) >= part.whole
        if not is_last:
            own_lines = own_lines[: len(proxy_lines)]
        pairs = zip_longest(proxy_lines, own_lines, fillvalue=b"no more")
        differ = (pair for pair in pairs if pair[0] != pair[1])
        different = next(differ, (b"no more", b"no more") if is_last else None)
        if different is None:
            return ""
        of_proxy, of_peer = (_ascii(line.strip(b"\n")).decode() for line in different)
        return f"the proxy has {of_proxy}, the peer {of_peer}"


class Part(NamedTuple):
    """A part of a proxy's signature: where it begins in the text and the size of all, in bytes."""

    offset: int
    whole: int
    text: bytes


def _ascii(words: bytes) -> bytes:
    """Return ? for each byte that is none of printable ASCII, and a space for a tab."""
    return re.sub(rb"[^ -~]", b"?", words.replace(b"\t", b" "))


Value = float | int | bool | str
"""The value of a variable of FMI; texts are not exchanged."""

MAGIC, VERSION = b"GRSP", 3
HELLO, WELCOME, REFUSE, INITIALISE, STEP, OUTPUTS, END = range(1, 8)
"""Kinds of datagrams."""

OTHER_INTERFACE, BUSY, UNKNOWN, FAILED, OTHER_VERSION, OTHER_NAME = range(1, 7)
"""The reasons why a peer refuses: codes of REFUSE."""

HEAD = struct.Struct("<4sHBB16sQQQddqII")
TAG_SIZE = 32
LARGEST = 65_507
"""Bytes of a UDP datagram over IPv4, which holds fewer than one over IPv6."""
PORT = 5501
"""The default UDP port of a peer."""

LARGEST_HANDSHAKE = 1200
"""Bytes of a HELLO and of its answer, at most: no network takes these apart."""
HELLO_SIZE = LARGEST_HANDSHAKE - HEAD.size - TAG_SIZE
"""Bytes of the body of a HELLO, always, so that there is space for the reason in its answer."""
NAME_SIZE, BUILD_SIZE = 64, 128
"""Bytes that a name and a build have in a body, of which one NUL or more is the end."""
HELLO_HEAD = struct.Struct(f"<{NAME_SIZE}sIIII")
"""What a HELLO begins with: name, offset, size of the part, size of the whole text, 0."""
LARGEST_PART = HELLO_SIZE - HELLO_HEAD.size
"""Bytes of a signature that a HELLO carries, at most."""
LARGEST_COUNT = 2**32 - 1
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
    """A datagram taken apart, as in HEAD; times in s, but `sent` in ns of the proxy's clock.

    `counted` is of INITIALISE and STEP the number of requests before it, back to the newest one
    whose answer the proxy has; of OUTPUTS the number of trips of the peer; else 0.
    """

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
    counted: int = 0


class Sealer:
    """Packs and opens datagrams, with a shared key or without.

    ValueError where the key is too short to be one.
    """

    def __init__(self, key: bytes | None = None) -> None:
        if key is not None and len(key) < SMALLEST_KEY:
            raise ValueError(f"key of {len(key)} bytes: must have {SMALLEST_KEY} or more")
        self._key = key
        self._tag_size = TAG_SIZE if key else 0

    def pack(self, m: Message) -> bytes:
        """Return the datagram of a message; ValueError where it would be too large."""
        *fields, body, version, count = m
        datagram = HEAD.pack(MAGIC, version, *fields, len(body), count) + body
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
        _, version, *fields, size, count = HEAD.unpack_from(datagram)
        m = Message._make((*fields, datagram[HEAD.size : end], version, count))
        is_known = HELLO <= m.kind <= END and isfinite(m.time + m.step)
        is_counted = not count or m.kind in (INITIALISE, STEP, OUTPUTS)
        return m if is_known and is_counted and size == len(m.body) else MALFORMED


def check_name(name: str) -> str:
    """Return the name of a peer; ValueError where a HELLO cannot carry it."""
    if len(name) >= NAME_SIZE or not all(" " <= c <= "~" for c in name):
        must = f"must be printable ASCII of {NAME_SIZE - 1} characters at most"
        raise ValueError(f"name {name!r}: {must}")
    return name


def pack_hello(name: str, part: Part) -> bytes:
    """Return the body of a HELLO: the name of the peer that is wanted, a part of the signature."""
    size = len(part.text)
    head = HELLO_HEAD.pack(name.encode("ascii"), part.offset, size, part.whole, 0)
    return (head + part.text).ljust(HELLO_SIZE, b"\0")


def unpack_hello(body: bytes) -> tuple[str, Part] | None:
    """Return name and part in the body of a HELLO; None where it is none."""
    if len(body) != HELLO_SIZE:
        return None
    name, offset, size, text_size, zero = HELLO_HEAD.unpack_from(body)
    text = unpack_text(name)
    if text is None or size > LARGEST_PART or zero:
        return None
    return text, Part(offset, text_size, body[HELLO_HEAD.size :][:size])


def unpack_text(padded: bytes) -> str | None:
    """Return a text with its NULs taken off; None where it is not printable ASCII with one NUL."""
    text = padded.rstrip(b"\0")
    if len(text) == len(padded) or re.search(rb"[^ -~]", text):
        return None
    return text.decode("ascii")


class Codec:
    """Values of variables as a body: Real f64, Integer i64, Boolean u64."""

    def __init__(self, variables: Sequence[LinkVariable]) -> None:
        self._kinds = [_KINDS[v.kind] for v in variables]
        self._struct = struct.Struct("<" + "".join(code for code, *_ in self._kinds))
        self.pack = self._struct.pack
        self.size = self._struct.size

    def unpack(self, body: bytes) -> list[Value] | None:
        """Return the values of a body; None where its size is wrong or a value is invalid.

        Invalid is a Real that is not finite, an Integer beyond 32 bits, a Boolean but 0 and 1.
        """
        if len(body) != self.size:
            return None
        pairs = [*zip(self._kinds, self._struct.unpack(body), strict=True)]
        if not all(valid(x) for (*_, valid), x in pairs):
            return None
        return [kind(x) for (_, kind, _), x in pairs]


def read_key(path: Path) -> bytes:
    """Return the key in a file; ValueError where it is too short, or the file too long.

    A file of printable ASCII, tabs and line ends is text: line ends around it are not of the key.
    Of any other, such as random bytes, every byte is.
    """
    with path.open("rb") as file:
        data = file.read(LARGEST_KEY + 1)
    if len(data) > LARGEST_KEY:
        raise ValueError(f"file of more than {LARGEST_KEY} bytes: is not a key")
    key = data.strip(b"\r\n") if _TEXT.issuperset(data) else data
    Sealer(key)
    return key


def exposed(path: Path) -> str:
    """Say that others on this machine can read a key file, or write it; empty where they cannot."""
    mode = stat.S_IMODE(path.stat().st_mode)
    if os.name == "nt" or not mode & 0o077:
        return ""
    return f"{path}: others have access to this key, mode {mode:03o}; must be 600: chmod 600 {path}"


def check_size(signature: Signature) -> None:
    """ValueError where the variables do not fit into a datagram, or one not into a HELLO."""
    for name, variables in (("a request", signature.request), ("an answer", signature.answer)):
        size = HEAD.size + 8 * len(variables) + TAG_SIZE
        if size > LARGEST:
            length = f"{name} with {len(variables)} variables has {size} bytes"
            raise ValueError(f"{length}: must be {LARGEST} at most")
    for line in signature.text.encode().splitlines(keepends=True):
        if len(line) > LARGEST_PART:
            length = f"variable {line[:40].decode(errors='replace')!r}...: its line has {len(line)}"
            raise ValueError(f"{length} bytes in a HELLO: must be {LARGEST_PART} at most")


ALIVE = 1_000_000_000
"""ns since its last request for which a session keeps others away."""

TOO_LONG = f"the step is too long: must be at most {LONGEST_STEP:g} s"
"""The reason why a STEP is not done."""

LARGEST_REASON = 1024
"""Bytes of what a REFUSE says in words."""


@dataclass(slots=True)
class PeerCounters:
    """Counts of the datagrams received, by their fate.

    `steps` and `initialisations`: done. `repeated`: answered again. `duplicated`: steps that had
    come already; `stale`: older than the last. `foreign`: of another interface or session;
    `other_version`: of the protocol. `malformed`: none of it, or with invalid values. `forged`:
    without the tag of the key. `busy`: while another session was under way. `other_name`: of a
    proxy that wants another peer.
    """

    steps: int = 0
    initialisations: int = 0
    repeated: int = 0
    duplicated: int = 0
    stale: int = 0
    foreign: int = 0
    other_version: int = 0
    malformed: int = 0
    forged: int = 0
    busy: int = 0
    other_name: int = 0


class Request(NamedTuple):
    """A request to carry out: INITIALISE, STEP or END; times in s.

    `values` are inputs, then parameters. With `fresh` a session begins: set the model up again.
    """

    kind: int
    time: float
    step: float
    values: list[Value]
    fresh: bool


Action = Request | bytes | None
"""A Request to do and to answer with outputs() or failed(); a datagram to send; or nothing."""


class Peer:
    """One bench. It serves one session at a time.

    A named peer takes a proxy only that wants this name, or any; `build` says what runs there.
    `random` are bytes that nobody can guess, which cookies are made of; by default drawn.
    ValueError where the key is too short, or where name or build are none.
    """

    def __init__(
        self,
        signature: Signature,
        key: bytes | None = None,
        random: bytes | None = None,
        name: str = "",
        build: str = "",
    ) -> None:
        self.signature = signature
        self.name = check_name(name)
        self._welcome = struct.pack(f"{NAME_SIZE}s{BUILD_SIZE}s", name.encode(), _build(build))
        self.counters = PeerCounters()
        self.trips = 0
        """How often the safe state was entered in this session: latched, the inputs stay so."""
        self.acknowledged_at = 0
        """When a request last told that a newer answer had arrived, in ns of the caller's clock."""
        self._acknowledged = 0
        self.unknown = 0
        """Of the foreign datagrams, those of a session that is not known."""
        self._sealer = Sealer(key)
        self._request, self._answer = Codec(signature.request), Codec(signature.answer)
        self._random = random or os.urandom(16)
        self._begun = 0  # sessions
        self._live: tuple[int, int] | None = None  # session and cookie
        self.heard_at = 0
        """When something new came last, in ns of the caller's clock."""
        self._last: Message | None = None
        self._last_answer: bytes | None = None
        self._refused: tuple[int, int, int] | None = None  # the request that failed, for its repeat
        self._reason = ""  # why it failed

    def trip(self) -> None:
        """Latch the safe state until the next session begins: every answer tells of it."""
        self.trips += 1

    def expire(self, time_ns: int, silence: int) -> bool:
        """End the session where nothing new came for so many ns; True where that is so."""
        over = self.in_session and time_ns - self.heard_at >= silence
        if over:
            self._live = self._last = None
        return over

    @property
    def in_session(self) -> bool:
        """True from the first INITIALISE of a session to its end."""
        return self._live is not None

    def receive(self, datagram: bytes, time_ns: int) -> Action:
        """Return what to do about a datagram; the time is that of a monotonic clock."""
        m = self._sealer.open(datagram)
        if isinstance(m, str):
            return self._count(m)
        if m.kind not in (HELLO, INITIALISE, STEP, END):
            return self._count(MALFORMED)
        if m.version != VERSION:
            answer = self._refuse(m, OTHER_VERSION) if m.kind == HELLO else None
            return self._count("other_version", answer)
        if m.kind == HELLO:
            return self._hello(m, time_ns)
        if m.interface != self.signature.hash:
            return self._count("foreign")
        return self._in_session(m, time_ns)

    def outputs(self, values: list[Value], time: float) -> bytes:
        """Return the answer to the last request: outputs, and the time in s they belong to."""
        assert self._last is not None  # noqa: S101 - there is a request to answer
        body = self._answer.pack(*values)
        self._last_answer = self._pack(self._last, OUTPUTS, 0, body, time, self.trips)
        return self._last_answer

    def failed(self, reason: str) -> bytes:
        """Return the answer to the last request where it cannot be done; end the session."""
        m = self._last
        assert m is not None  # noqa: S101 - there is a request to answer
        self._live = self._last = None
        self._refused, self._reason = (m.session, m.cookie, m.sequence), reason
        return self._refuse(m, FAILED, reason)

    def _count(self, counter: str, answer: Action = None) -> Action:
        setattr(self.counters, counter, getattr(self.counters, counter) + 1)
        return answer

    def _busy(self, session: int, time_ns: int) -> bool:
        is_other = self._live is not None and self._live[0] != session
        return is_other and time_ns - self.heard_at < ALIVE

    def _hello(self, m: Message, time_ns: int) -> Action:
        hello = unpack_hello(m.body)
        if m.sequence or m.cookie or hello is None:
            return self._count(MALFORMED)
        name, part = hello
        if m.interface != self.signature.hash:
            reason = self.signature.difference(part)
            return self._count("foreign", self._refuse(m, OTHER_INTERFACE, reason))
        if name and self.name and name != self.name:
            reason = f"the peer is {self.name}, the proxy wants {name}"
            return self._count("other_name", self._refuse(m, OTHER_NAME, reason))
        if self._busy(m.session, time_ns):
            return self._count("busy", self._refuse(m, BUSY))
        session, cookie = self._live or (None, 0)
        cookie = cookie if session == m.session else self._cookie(m.session)
        return self._pack(m._replace(cookie=cookie), WELCOME, body=self._welcome)

    def _cookie(self, session: int) -> int:
        """That of a session that may begin now: another one once any session has begun."""
        numbers = session.to_bytes(8, "little") + self._begun.to_bytes(8, "little")
        digest = hmac.digest(self._random, numbers, "sha256")
        return int.from_bytes(digest[:8], "little") | 1

    def _in_session(self, m: Message, time_ns: int) -> Action:
        if self._live != (m.session, m.cookie):
            return self._begin(m, time_ns)
        if m.kind == END:
            self._live = self._last = None
            return Request(END, m.time, 0.0, [], fresh=False)
        last = self._last.sequence if self._last else 0
        if m.sequence < last:
            return self._count("stale")
        if m.sequence > last:
            return self._do(m, time_ns, fresh=False)
        if m.kind == STEP or self._last_answer is None:
            return self._count("duplicated")
        return self._count("repeated", self._last_answer)

    def _begin(self, m: Message, time_ns: int) -> Action:
        """Make the session of the first INITIALISE the one under way."""
        begins = m.kind == INITIALISE
        if begins and self._refused == (m.session, m.cookie, m.sequence):
            refusal = self._refuse(m, FAILED, self._reason, len(m.body))
            return self._count("repeated", refusal)
        if begins and self._busy(m.session, time_ns):
            return self._count("busy", self._refuse(m, BUSY))
        if not begins or m.cookie != self._cookie(m.session):
            self.unknown += 1
            return self._count("foreign", None if m.kind == END else self._refuse(m, UNKNOWN))
        request = self._do(m, time_ns, fresh=True)
        if isinstance(request, Request):
            self._live = m.session, m.cookie
            self._begun += 1
        return request

    def _do(self, m: Message, time_ns: int, fresh: bool) -> Action:
        values = self._request.unpack(m.body)
        stepping = not fresh and self._last is not None and self._last.kind == STEP
        too_late = m.kind == INITIALISE and stepping
        lost = m.counted >= m.sequence  # more than there were
        if values is None or too_late or lost or (m.kind == STEP) != (m.step > 0.0):
            return self._count(MALFORMED)
        if fresh:
            self.trips = self._acknowledged = 0
        acknowledged = m.sequence - 1 - m.counted
        if fresh or acknowledged > self._acknowledged:
            self._acknowledged, self.acknowledged_at = acknowledged, time_ns
        # Only what is new counts as heard: who repeats a recorded datagram keeps nobody away
        self.heard_at = time_ns
        self._last, self._last_answer, self._refused = m, None, None
        if m.step > LONGEST_STEP:
            return self.failed(TOO_LONG)
        counter = "steps" if m.kind == STEP else "initialisations"
        return self._count(counter, Request(m.kind, m.time, m.step, values, fresh))

    def _refuse(self, m: Message, code: int, reason: str = "", max_size: int = LARGEST) -> bytes:
        words = _ascii(reason.encode(errors="replace"))[: min(max_size, LARGEST_REASON)]
        return self._pack(m, REFUSE, code, words)

    def _pack(
        self,
        m: Message,
        kind: int,
        code: int = 0,
        body: bytes = b"",
        time: float = 0.0,
        count: int = 0,
    ) -> bytes:
        """Return an answer to the request `m`."""
        fields = (kind, code, self.signature.hash, m.session, m.cookie, m.sequence)
        return self._sealer.pack(Message(*fields, time, 0.0, m.sent, body, counted=count))


def _build(build: str) -> bytes:
    """What a WELCOME has as the build; ValueError where it does not fit."""
    if len(build) >= BUILD_SIZE or not all(" " <= c <= "~" for c in build):
        must = f"must be printable ASCII of {BUILD_SIZE - 1} characters at most"
        raise ValueError(f"build {build!r}: {must}")
    return build.encode()
