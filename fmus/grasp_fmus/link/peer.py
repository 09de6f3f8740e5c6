"""The bench's side of a session: judges requests, keeps the order, counts. No sockets.

The caller does what an Action says and sends what it gets: at most one datagram for each received,
and none that is longer than that while there is no session: who sends in another's name has nothing
to gain by it.
"""

import hmac
from dataclasses import dataclass
from secrets import token_bytes
from typing import NamedTuple

from . import message
from .message import LARGEST, Codec, Message, Sealer, Signature, Value

ALIVE = 1_000_000_000
"""ns since its last request for which a session keeps others away."""

TOO_LONG = f"the step is too long: must be at most {message.LONGEST_STEP:g} s"
"""The reason why a STEP is not done."""

LARGEST_REASON = 1024
"""Bytes of what a REFUSE says in words."""


@dataclass(slots=True)
class PeerCounters:
    """Counts of the datagrams received, by their fate.

    `steps` and `initialisations`: done. `repeated`: answered again. `duplicated`: steps that had
    come already; `stale`: older than the last. `foreign`: of another interface or session;
    `other_version`: of the protocol. `malformed`: none of it, or with invalid values. `forged`:
    without the tag of the key. `busy`: while another session was under way.
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


class Request(NamedTuple):
    """A request to carry out: INITIALISE, STEP or END; times in s.

    `values` are inputs, then parameters. With `fresh` a session begins: set the model up anew.
    """

    kind: int
    time: float
    step: float
    values: list[Value]
    fresh: bool


Action = Request | bytes | None
"""A Request to do and to answer with outputs() or failed(); a datagram to send; or nothing."""


class Peer:
    """One bench. It serves one session at a time."""

    def __init__(
        self, signature: Signature, key: bytes | None = None, random: bytes | None = None
    ) -> None:
        """`random` are bytes that nobody can guess, which cookies are made of; by default drawn.

        ValueError where the key is too short.
        """
        self.signature = signature
        self.counters = PeerCounters()
        self.unknown = 0
        """Of the foreign datagrams, those of a session that is not known."""
        self._sealer = Sealer(key)
        self._request = Codec(signature.request)
        self._answer = Codec(signature.answer)
        self._random = random or token_bytes(16)
        self._begun = 0  # sessions
        self._live: tuple[int, int] | None = None  # session and cookie
        self._heard = 0
        self._last: Message | None = None
        self._last_answer: bytes | None = None
        self._refused: tuple[int, int, int] | None = None  # the request that failed, for its repeat
        self._reason = ""  # why it failed
        self._stepping = False

    @property
    def in_session(self) -> bool:
        """True from the first INITIALISE of a session to its end."""
        return self._live is not None

    def receive(self, datagram: bytes, now: int) -> Action:
        """Return what to do about a datagram; `now` in ns of a monotonic clock."""
        m = self._sealer.open(datagram)
        if isinstance(m, str):
            return self._count(m)
        if m.kind not in (message.HELLO, message.INITIALISE, message.STEP, message.END):
            return self._count(message.MALFORMED)
        if m.version != message.VERSION:
            self._count("other_version")
            return self._refuse(m, message.OTHER_VERSION) if m.kind == message.HELLO else None
        if m.kind == message.HELLO:
            return self._hello(m, now)
        if m.interface != self.signature.hash:
            return self._count("foreign")
        return self._in_session(m, now)

    def outputs(self, values: list[Value], time: float) -> bytes:
        """Return the answer to the last request: outputs, and the time in s they belong to."""
        assert self._last is not None  # noqa: S101 - there is a request to answer
        body = self._answer.pack(*values)
        self._last_answer = self._pack(self._last, message.OUTPUTS, 0, body, time)
        return self._last_answer

    def failed(self, reason: str) -> bytes:
        """Return the answer to the last request where it cannot be done; end the session."""
        m = self._last
        assert m is not None  # noqa: S101 - there is a request to answer
        self._reason = reason
        self._over()
        self._refused = m.session, m.cookie, m.sequence
        return self._refuse(m, message.FAILED, self._reason)

    def _count(self, counter: str) -> Action:
        setattr(self.counters, counter, getattr(self.counters, counter) + 1)
        return None

    def _busy(self, session: int, now: int) -> bool:
        other = self._live is not None and self._live[0] != session
        return other and now - self._heard < ALIVE

    def _hello(self, m: Message, now: int) -> Action:
        if m.sequence or m.cookie:
            return self._count("malformed")
        if m.interface != self.signature.hash:
            self._count("foreign")
            reason = self.signature.difference(m.body)
            return self._refuse(m, message.OTHER_INTERFACE, reason, len(m.body))
        if self._busy(m.session, now):
            self._count("busy")
            return self._refuse(m, message.BUSY)
        session, cookie = self._live or (None, 0)
        cookie = cookie if session == m.session else self._cookie(m.session)
        return self._pack(m._replace(cookie=cookie), message.WELCOME)

    def _cookie(self, session: int) -> int:
        """That of a session that may begin now: another one once any session has begun."""
        numbers = session.to_bytes(8, "little") + self._begun.to_bytes(8, "little")
        made = hmac.digest(self._random, numbers, "sha256")
        return int.from_bytes(made[:8], "little") | 1

    def _in_session(self, m: Message, now: int) -> Action:
        if self._live != (m.session, m.cookie):
            return self._begin(m, now)
        if m.kind == message.END:
            self._over()
            return Request(message.END, m.time, 0.0, [], fresh=False)
        last = self._last.sequence if self._last else 0
        if m.sequence < last:
            return self._count("stale")
        if m.sequence == last:
            if m.kind == message.STEP or self._last_answer is None:
                return self._count("duplicated")
            self._count("repeated")
            return self._last_answer
        return self._do(m, now, fresh=False)

    def _begin(self, m: Message, now: int) -> Action:
        """Make the session of the first INITIALISE the one under way."""
        if m.kind == message.INITIALISE and self._refused == (m.session, m.cookie, m.sequence):
            self._count("repeated")
            return self._refuse(m, message.FAILED, self._reason, len(m.body))
        if m.kind == message.END:
            self.unknown += 1
            return self._count("foreign")
        if m.kind == message.INITIALISE and self._busy(m.session, now):
            self._count("busy")
            return self._refuse(m, message.BUSY)
        if m.kind != message.INITIALISE or m.cookie != self._cookie(m.session):
            self.unknown += 1
            self._count("foreign")
            return self._refuse(m, message.UNKNOWN)
        request = self._do(m, now, fresh=True)
        if isinstance(request, Request):
            self._live, self._stepping = (m.session, m.cookie), False
            self._begun += 1
        return request

    def _do(self, m: Message, now: int, fresh: bool) -> Action:
        values = self._request.unpack(m.body)
        too_late = m.kind == message.INITIALISE and self._stepping and not fresh
        if values is None or too_late or (m.kind == message.STEP) != (m.step > 0.0):
            return self._count("malformed")
        # Only what is new counts as heard: who repeats a recorded datagram keeps nobody away
        self._heard = now
        self._last, self._last_answer, self._refused = m, None, None
        if m.step > message.LONGEST_STEP:
            return self.failed(TOO_LONG)
        if m.kind == message.STEP:
            self._stepping = True
            self.counters.steps += 1
        else:
            self.counters.initialisations += 1
        return Request(m.kind, m.time, m.step, values, fresh)

    def _over(self) -> None:
        self._live, self._last, self._stepping = None, None, False

    def _refuse(self, m: Message, code: int, reason: str = "", most: int = LARGEST) -> bytes:
        words = reason.encode("ascii", "replace")[: min(most, LARGEST_REASON)]
        return self._pack(m, message.REFUSE, code, words)

    def _pack(
        self, m: Message, kind: int, code: int = 0, body: bytes = b"", time: float = 0.0
    ) -> bytes:
        """Return an answer to the request `m`."""
        fields = (kind, code, self.signature.hash, m.session, m.cookie, m.sequence)
        return self._sealer.pack(Message(*fields, time, 0.0, m.sent, body))
