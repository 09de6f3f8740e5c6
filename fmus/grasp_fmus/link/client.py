"""The proxy's side of a session: makes requests, judges what comes back, counts. No sockets.

Times are ns of one monotonic clock of the proxy's, or s of simulation.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum, auto

from . import message
from .message import HEAD, LARGEST, TAG_SIZE, Codec, Message, Sealer, Value
from .signature import Signature, hashed

WINDOW = 4096
"""Requests back from the newest of which is known whether they were answered."""


class Verdict(Enum):
    """The meaning of a datagram for the request under way."""

    NOTHING = auto()
    """It is not the answer: go on waiting."""
    ANSWERED = auto()
    REFUSED = auto()
    """The reason is in Client.refusal."""


@dataclass(slots=True)
class Counters:
    """Counts of steps by their fate, and of all else that came.

    `missed`: steps without an answer in time. `late`: answers to steps that came after their step
    was given up; `out_of_order`: of these, those after the answer to a newer one, which were
    dropped. Every answer comes in time, late, or never: missed = late + never.
    `duplicated`: answers that had come already. `rejected`: datagrams that were not of this
    session. `forged`: of these, those without the tag of the key.
    """

    missed: int = 0
    late: int = 0
    out_of_order: int = 0
    duplicated: int = 0
    rejected: int = 0
    forged: int = 0


@dataclass(frozen=True, slots=True)
class Refusal:
    """The reason why the peer refused, as a code of REFUSE and in words.

    `cut`: the variables of the peer did not fit into an answer to so short a HELLO.
    """

    code: int
    text: str
    cut: bool = False


class Client:
    """One proxy. After greet() it has a session; a request is one of greet, initialise and step."""

    def __init__(self, signature: Signature, key: bytes | None = None) -> None:
        """ValueError where the key is too short."""
        self.signature = signature
        self.counters = Counters()
        self.refusal: Refusal | None = None
        self.outputs: list[Value] | None = None
        """The outputs of the newest answer; None before the first."""
        self.outputs_time = 0.0
        """The time that they belong to, in s."""
        self.round_trip = 0
        """The time between the newest answer and its request, in ns."""
        self._sealer = Sealer(key)
        self._request = Codec(signature.request)
        self._answer = Codec(signature.answer)
        self._session = self._cookie = 0
        self._sequence = self._first_step = self._newest = self._awaited = 0
        self._greeting = False
        self._seen = 0  # bit i: the request i before the last one was answered

    # Requests

    def greet(self, session: int, now: int, fill: int = 0) -> bytes:
        """Return HELLO, to begin a session of that number: a new one, 64 bits at random.

        `fill` are bytes by which it is longer, and as much longer an answer may be.
        """
        self._session, self._cookie = session, 0
        self._sequence = self._first_step = self._newest = self._seen = self._awaited = 0
        self._greeting = True
        self.refusal = None
        text = self.signature.text.encode()
        room = LARGEST - HEAD.size - TAG_SIZE - len(text)
        return self._pack(message.HELLO, now, text + bytes(min(fill, room)))

    def initialise(self, time: float, values: Sequence[Value], now: int) -> bytes:
        """Return INITIALISE with the values of inputs and parameters; `time` in s.

        ValueError where a string is too long.
        """
        return self._ask(message.INITIALISE, now, values, time)

    def step(self, time: float, step: float, values: Sequence[Value], now: int) -> bytes:
        """Return STEP from `time` over `step`, both in s, with `values`. To be sent once."""
        request = self._ask(message.STEP, now, values, time, step)
        self._first_step = self._first_step or self._sequence
        return request

    def end(self, now: int) -> bytes:
        """Return END; there is no answer to it."""
        return self._pack(message.END, now, b"")

    def miss(self) -> None:
        """Give up the step under way; its answer is late from now on."""
        self._awaited = 0
        self.counters.missed += 1

    def _ask(
        self, kind: int, now: int, values: Sequence[Value], time: float, step: float = 0.0
    ) -> bytes:
        body = self._request.pack(values)
        self._sequence += 1
        self._awaited = self._sequence
        self._seen = (self._seen << 1) & ((1 << WINDOW) - 1)
        return self._pack(kind, now, body, time, step)

    def _pack(
        self, kind: int, now: int, body: bytes, time: float = 0.0, step: float = 0.0
    ) -> bytes:
        fields = (kind, 0, self.signature.hash, self._session, self._cookie, self._sequence)
        return self._sealer.pack(Message(*fields, time, step, now, body))

    # Answers

    def receive(self, datagram: bytes, now: int) -> Verdict:
        """Return the verdict on a datagram, whatever it holds; `now` in ns."""
        m = self._sealer.open(datagram)
        if isinstance(m, str):
            self.counters.forged += m == message.FORGED
            return self._reject()
        if m.session != self._session:
            return self._reject()
        if m.kind == message.OUTPUTS and m.cookie == self._cookie and not self._greeting:
            return self._receive_outputs(m, now)
        if m.kind == message.WELCOME:
            return self._receive_welcome(m, now)
        if m.kind == message.REFUSE:
            return self._receive_refusal(m)
        return self._reject()

    def _reject(self) -> Verdict:
        self.counters.rejected += 1
        return Verdict.NOTHING

    def _receive_welcome(self, m: Message, now: int) -> Verdict:
        if m.interface != self.signature.hash or not m.cookie or m.body:
            return self._reject()
        if not self._greeting:  # the peer answers a repeated HELLO again
            return Verdict.NOTHING if m.cookie == self._cookie else self._reject()
        self._greeting = False
        self._cookie = m.cookie
        self.round_trip = now - m.sent
        return Verdict.ANSWERED

    def _receive_refusal(self, m: Message) -> Verdict:
        expected = m.sequence == (0 if self._greeting else self._awaited)
        if not expected or m.cookie != self._cookie or not (self._greeting or self._awaited):
            return self._reject()
        text = m.body.decode(errors="replace")
        cut = m.code == message.OTHER_INTERFACE and hashed(m.body) != m.interface
        other = "unnamed" if cut else self.signature.difference(text) or "unnamed"
        reasons = {
            message.OTHER_INTERFACE: f"the peer has another interface: {other}",
            message.BUSY: "the peer is busy with another proxy",
            message.UNKNOWN: "the peer does not know this session",
            message.FAILED: f"the peer failed: {' '.join(text.split())}",
        }
        if m.code not in reasons:
            return self._reject()
        self.refusal = Refusal(m.code, reasons[m.code], cut)
        return Verdict.REFUSED

    def _receive_outputs(self, m: Message, now: int) -> Verdict:
        back = self._sequence - m.sequence
        if m.interface != self.signature.hash or back < 0 or m.sequence < 1:
            return self._reject()
        values = self._answer.unpack(m.body)
        if values is None:
            return self._reject()
        if back >= WINDOW or self._seen >> back & 1:
            self.counters.duplicated += m.sequence >= self._first_step > 0
            return Verdict.NOTHING
        self._seen |= 1 << back
        awaited = m.sequence == self._awaited
        if not awaited and m.sequence >= self._first_step:
            self.counters.late += 1
            self.counters.out_of_order += m.sequence < self._newest
        if m.sequence > self._newest:
            self._newest = m.sequence
            self.outputs, self.outputs_time = values, m.time
            self.round_trip = now - m.sent
        if awaited:
            self._awaited = 0
        return Verdict.ANSWERED if awaited else Verdict.NOTHING
