"""An FMU that is served at a UDP port: it does what a proxy's requests say, or its own clock."""

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from hashlib import sha256
from math import ceil

from ..base.errors import InputError, SimulationError, nearest
from ..fmu_export.link import (
    END,
    INITIALISE,
    TOO_LONG,
    VERSION,
    Peer,
    Request,
)
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.values import parse_value
from ..system.times import NANOSECONDS, Time, in_seconds, nearest_time
from .driven_fmu import DrivenFmu
from .proxy_of_fmu import link_signature

MAX_BACKLOG_NS = 1_000_000_000
"""ns by which the FMU's own clock may be late; beyond that it goes on from now."""

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True)
class Service:
    """The way in which an FMU is served.

    `lockstep`: step on request; else by an own clock, in steps of the length that the proxy asks
    for. `watchdog_ns`: where no request told for so long that a newer answer had arrived, an FMU
    with an own clock trips: its inputs go to what `failsafe` says, else to their start values, and
    stay there until the next session. One that steps on request stands still anyhow. `key` is the
    one shared with the proxy, if any; `name` tells it from others of its interface. A session in
    which nothing new comes for `silence_ns` is over.
    """

    lockstep: bool = False
    watchdog_ns: int = 100_000_000
    failsafe: Mapping[str, Value] = field(default_factory=dict)
    key: bytes | None = None
    name: str = ""
    silence_ns: int = 30_000_000_000


COUNTS = ("sessions", "own_steps", "skipped", "watchdog", "failures")
"""The events that the peer of the protocol does not count: steps by the own clock, steps that were
left out as late, changes of the inputs to their failsafe values, and failures.
"""

DROPPED = {
    "forged": "without the right key was dropped",
    "malformed": "that is not of this protocol, or has another kind of key, was dropped",
    "other_version": f"of another protocol was refused: its version must be {VERSION}",
    "foreign": "of another interface was refused: its proxy must be made of the FMU served here",
    "unknown": "of an unknown session was refused: it began before this server did",
    "busy": "of another proxy was refused while a session is under way",
    "other_name": "of a proxy that wants another name was refused: the two ports may be swapped",
}
"""The line for the first datagram of a kind, by its counter."""


class ServedFmu:
    """One FMU that answers datagrams. Times are in ns of a monotonic clock. Close it."""

    def __init__(
        self, interface: Interface, service: Service = Service(), say: Say = lambda _: None
    ) -> None:
        """Try the FMU out; `say` gets a line for whatever happens.

        InputError where the FMU cannot be served so, SimulationError where it cannot be set up.
        """
        signature, self.notes = link_signature(interface)
        self._counts = dict.fromkeys(COUNTS, 0)
        self._service, self._say = service, say
        self._signature = signature
        self._build = sha256(interface.path.read_bytes()).hexdigest()
        try:
            self.peer = self._new_peer()
        except ValueError as error:
            raise InputError(str(error)) from error
        self._failsafe = _failsafe(interface, self.peer, service.failsafe)
        self._fmu = DrivenFmu(interface, signature)
        self._values: list[Value] = []
        self._in_session = False
        self._deadline: Time | None = None  # of the next own step, exact
        self._step_ns: Time = 0
        self._watching = False  # the watchdog, from the first step until it has tripped
        self._own_failure = ""
        self._unreported = dict(DROPPED)

    def _new_peer(self) -> Peer:
        service = self._service
        return Peer(self._signature, service.key, name=service.name, build=self._build)

    def close(self) -> None:
        """End the session under way, and free the FMU."""
        self._end("the server is closed")

    def counters(self) -> dict[str, int]:
        """The numbers of what was done and of what was received, by name."""
        return {**self._counts, **asdict(self.peer.counters)}

    def due(self) -> int | None:
        """Return when `look` has something to do next; None: not before the next datagram."""
        moments: list[int] = []
        if self._deadline is not None:
            moments.append(ceil(self._deadline))
        if self._watching:
            moments.append(self.peer.acknowledged_at + self._service.watchdog_ns)
        if self.peer.in_session:
            moments.append(self.peer.heard_at + self._service.silence_ns)
        return min(moments, default=None)

    def answer(self, datagram: bytes, source: str, now_ns: int) -> bytes | None:
        """Do what a datagram says, whatever it holds; return what to send back to its source."""
        action = self.peer.receive(datagram, now_ns)
        if not isinstance(action, Request):
            self._report_dropped(source)
            if self._in_session and not self.peer.in_session:
                self._counts["failures"] += 1
                self._end(TOO_LONG)
            return action
        if action.kind == END:
            self._end("the proxy ended the session")
            return None
        if action.fresh:
            self._end("another session takes its place")
            self._in_session = True
            self._say(f"a session of {source} begins at t = {action.time:.9g} s")
        try:
            self._carry_out(action, now_ns)
            return self.peer.outputs(self._fmu.outputs(), self._fmu.time)
        except (InputError, SimulationError, ValueError) as error:
            self._counts["failures"] += 1
            self._end(str(error))
            return self.peer.failed(str(error))

    def _report_dropped(self, source: str) -> None:
        """Tell once of each kind that was dropped, for who looks for the reason of a silence."""
        counts = {**asdict(self.peer.counters), "unknown": self.peer.unknown}
        counts["foreign"] -= self.peer.unknown
        for counter in [c for c in self._unreported if counts[c]]:
            self._say(f"a datagram from {source} {self._unreported.pop(counter)}")

    def _carry_out(self, request: Request, now_ns: int) -> None:
        """Do what a request says; SimulationError or InputError where that fails."""
        if self._own_failure:
            raise SimulationError(self._own_failure)
        if request.kind == INITIALISE:
            self._values = request.values
            self._fmu.initialise(request.time, request.values, request.fresh)
        elif self._service.lockstep:
            self._fmu.step(request.time, request.step, request.values)
        else:
            if request.step * NANOSECONDS < 1.0:
                raise SimulationError(
                    f"step of {request.step!r} s: must be 1 ns or more, to be the own step"
                )
            if not self.peer.trips:
                self._values = request.values
                self._watching = True
                self._fmu.set(request.values)
            if self._deadline is None:
                self._step_ns = nearest_time(request.step)
                self._deadline = now_ns + self._step_ns

    def look(self, now_ns: int) -> None:
        """Do what is due by the own clock."""
        try:
            if self._watching and now_ns - self.peer.acknowledged_at >= self._service.watchdog_ns:
                silence = self._service.watchdog_ns / NANOSECONDS
                self.trip(f"no request for {silence:g} s that told of an answer")
            if self._deadline is not None and now_ns >= self._deadline:
                self._fmu.advance(self._fmu.time, in_seconds(self._step_ns))
                self._counts["own_steps"] += 1
                self._deadline += self._step_ns
                if now_ns - self._deadline > MAX_BACKLOG_NS:
                    skipped = int((now_ns - self._deadline) // self._step_ns)
                    self._counts["skipped"] += skipped
                    self._deadline += skipped * self._step_ns
        except (InputError, SimulationError) as error:
            self._own_failure = str(error)
            self._say(self._own_failure)
            self._deadline, self._watching = None, False
        if self.peer.expire(now_ns, self._service.silence_ns):
            self._end(f"nothing came for {self._service.silence_ns / NANOSECONDS:g} s")

    def trip(self, reason: str) -> None:
        """Put the inputs to their failsafe values, where they stay until the next session."""
        self._watching = False
        self._counts["watchdog"] += 1
        self.peer.trip()
        self._say(f"{reason}: the inputs are at their failsafe values until the next session")
        for i, value in self._failsafe.items():
            self._values[i] = value
        self._fmu.set(self._values)

    def forget(self, name: str | None = None) -> None:
        """Be as one that was started again, which knows no session; what was counted stays so.

        With a name it is another bench.
        """
        old_peer = self.peer
        if name is not None:
            self._service = replace(self._service, name=name)
        self.peer = self._new_peer()
        self.peer.counters, self.peer.unknown = old_peer.counters, old_peer.unknown
        self._end("the server is as new" if name is None else f"the server is now {name}")

    def break_off(self, reason: str) -> None:
        """Have every request of the session fail."""
        self._own_failure = reason
        self._deadline, self._watching = None, False

    def _end(self, reason: str) -> None:
        """End the session, if there is one, and free the FMU."""
        was_in_session, self._in_session = self._in_session, False
        self._deadline, self._watching = None, False
        self._own_failure = ""
        self._fmu.close()
        if was_in_session:
            self._counts["sessions"] += 1
            self._say(f"the session is over at t = {self._fmu.time:.9g} s: {reason}")


def _failsafe(interface: Interface, peer: Peer, values: Mapping[str, Value]) -> dict[int, Value]:
    """The values that the watchdog sets, by their place in a request."""
    places = {v.name: i for i, v in enumerate(peer.signature.of("input"))}
    for name in values:
        if name not in places:
            valid = nearest(name, places, interface.listing)
            raise InputError(f"failsafe {name}: no such input of {interface.path.name}; {valid}")
    zero: dict[str, Value] = {"Real": 0.0, "Integer": 0, "Boolean": False}
    failsafe: dict[int, Value] = {}
    for name, place in places.items():
        variable = interface.by_name[name]
        start = zero[variable.kind] if variable.start is None else variable.start
        value = values.get(name, start)
        failsafe[place] = parse_value(interface, f"failsafe {name}", name, value, text=True)
    return failsafe
