"""The bench's side of a session: judges requests, keeps the order, counts. No sockets.

The caller does what an Action says and sends what it gets: at most one datagram for each received,
and none that is longer than that while there is no session: who sends in another's name has nothing
to gain by it.
"""

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass
from secrets import randbits
from typing import NamedTuple

from . import message
from .message import Codec, Message, Sealer, Value
from .signature import Signature

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
    come already; `stale`: steps older than the last. `foreign`: of another interface, or of a
    session that is not known. `malformed`: no datagram of this protocol, or with invalid values.
    `forged`: without the tag of the key. `busy`: HELLOs while another session was under way.
    """

    steps: int = 0
    initialisations: int = 0
    repeated: int = 0
    duplicated: int = 0
    stale: int = 0
    foreign: int = 0
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
        self,
        signature: Signature,
        key: bytes | None = None,
        cookie: Callable[[], int] = lambda: randbits(64) or 1,
    ) -> None:
        """`cookie` makes numbers from 1 to 2**64 - 1 that nobody can guess.

        ValueError where the key is too short.
        """
        self.signature = signature
        self.counters = PeerCounters()
        self._sealer = Sealer(key)
        self._request = Codec(signature.request)
        self._answer = Codec(signature.answer)
        self._make_cookie = cookie
        self._greeted: OrderedDict[int, int] = OrderedDict()  # cookies by session
        self._live: tuple[int, int] | None = None  # session and cookie
        self._heard = 0
        self._last: Message | None = None
        self._last_answer: bytes | None = None
        self._refused: tuple[int, int, int] | None = None  # the request that failed, for its repeat
        self._reason = b""  # why it failed
        self._stepping = False

    @property
    def in_session(self) -> bool:
        """True from the first INITIALISE of a session to its end."""
        return self._live is not None

    def receive(self, datagram: bytes, now: int) -> Action:
        """Return what to do about a datagram; `now` in ns of a monotonic clock."""
        m = self._sealer.open(datagram)
        if isinstance(m, str):
            return self._drop("forged" if m == message.FORGED else "malformed")
        if m.kind == message.HELLO:
            return self._hello(m, now)
        if m.kind not in (message.INITIALISE, message.STEP, message.END):
            return self._drop("malformed")
        if m.interface != self.signature.hash:
            return self._drop("foreign")
        return self._in_session(m, now)

    def outputs(self, values: list[Value], time: float) -> bytes:
        """Return the answer to the last request: outputs, and the time in s they belong to."""
        assert self._last is not None  # noqa: S101 - there is a request to answer
        body = self._answer.pack(values)
        self._last_answer = self._pack(self._last, message.OUTPUTS, 0, body, time)
        return self._last_answer

    def failed(self, reason: str) -> bytes:
        """Return the answer to the last request where it cannot be done; end the session."""
        m = self._last
        assert m is not None  # noqa: S101 - there is a request to answer
        self._reason = reason.encode()[:LARGEST_REASON]
        self._over()
        self._refused = m.session, m.cookie, m.sequence
        return self._pack(m, message.REFUSE, message.FAILED, self._reason)

    def _drop(self, counter: str) -> Action:
        setattr(self.counters, counter, getattr(self.counters, counter) + 1)
        return None

    def _busy(self, session: int, now: int) -> bool:
        other = self._live is not None and self._live[0] != session
        return other and now - self._heard < ALIVE

    def _hello(self, m: Message, now: int) -> Action:
        if m.sequence or m.cookie:
            return self._drop("malformed")
        if m.interface != self.signature.hash:
            self.counters.foreign += 1
            fits = self.signature.text.encode()[: len(m.body)]
            return self._pack(m, message.REFUSE, message.OTHER_INTERFACE, fits)
        if m.body.rstrip(b"\0") != self.signature.text.encode():
            return self._drop("malformed")
        if self._busy(m.session, now):
            self.counters.busy += 1
            return self._pack(m, message.REFUSE, message.BUSY)
        if self._live is not None and self._live[0] == m.session:
            cookie = self._live[1]
        else:
            cookie = self._greeted.get(m.session) or self._make_cookie()
            self._greeted[m.session] = cookie
            if len(self._greeted) > 64:  # that have not yet begun
                self._greeted.popitem(last=False)
        return self._pack(m._replace(cookie=cookie), message.WELCOME)

    def _in_session(self, m: Message, now: int) -> Action:
        if self._live != (m.session, m.cookie):
            return self._begin(m, now)
        if m.kind == message.END:
            self._over()
            return Request(message.END, m.time, 0.0, [], fresh=False)
        last = self._last.sequence if self._last else 0
        if m.sequence < last:
            return self._drop("stale")
        if m.sequence == last:
            if m.kind == message.STEP or self._last_answer is None:
                return self._drop("duplicated")
            self.counters.repeated += 1
            return self._last_answer
        return self._do(m, now, fresh=False)

    def _begin(self, m: Message, now: int) -> Action:
        """Make the session of the first INITIALISE the one under way."""
        if m.kind == message.INITIALISE and self._refused == (m.session, m.cookie, m.sequence):
            self.counters.repeated += 1
            return self._pack(m, message.REFUSE, message.FAILED, self._reason[: len(m.body)])
        if self._greeted.get(m.session) != m.cookie or m.kind != message.INITIALISE:
            self.counters.foreign += 1
            end = m.kind == message.END
            return None if end else self._pack(m, message.REFUSE, message.UNKNOWN)
        if self._busy(m.session, now):
            self.counters.busy += 1
            return self._pack(m, message.REFUSE, message.BUSY)
        request = self._do(m, now, fresh=True)
        if isinstance(request, Request):
            del self._greeted[m.session]
            self._live, self._stepping = (m.session, m.cookie), False
        return request

    def _do(self, m: Message, now: int, fresh: bool) -> Action:
        values = self._request.unpack(m.body)
        too_late = m.kind == message.INITIALISE and self._stepping and not fresh
        if values is None or too_late or (m.kind == message.STEP) != (m.step > 0.0):
            return self._drop("malformed")
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

    def _pack(
        self, m: Message, kind: int, code: int = 0, body: bytes = b"", time: float = 0.0
    ) -> bytes:
        """Return an answer to the request `m`."""
        fields = (kind, code, self.signature.hash, m.session, m.cookie, m.sequence)
        return self._sealer.pack(Message(*fields, time, 0.0, m.sent, body))
