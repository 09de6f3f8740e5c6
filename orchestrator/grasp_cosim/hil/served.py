"""An FMU that is served at a UDP port: it does what a proxy's requests say, or its own clock."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from hashlib import sha256
from math import ceil, isclose, isfinite

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError, SimulationError, nearest
from ..fmi.instance import DISCARD, DUE, EARLY, EVENT, WARNING, Instance, clock_of, dtype
from ..fmi.process import load_here
from ..fmu_export.link import (
    END,
    INITIALISE,
    PORT,
    TOO_LONG,
    VERSION,
    LinkVariable,
    Peer,
    Request,
    Signature,
)
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.values import parse_value
from ..interface.variables import Variable
from ..master.step_completion import finish_step
from ..system.times import NANOSECONDS, Time, in_seconds, nearest_time
from .proxy_of_fmu import link_signature
from .rehearsal import Rehearsal, Rehearsed, end_at_once
from .sockets import Address, EventLoop, received, text

BACKLOG = 1_000_000_000
"""ns by which the FMU's own clock may be late; beyond that it goes on from now."""

DEFAULT_ADDRESS: Address = ("127.0.0.1", PORT)
"""The address that a proxy looks at if nobody says otherwise."""

ANOTHER = "another bench"
"""The name of the bench that takes the place of one, where that is rehearsed."""

MOST_LOST = 100_000
"""The most steps that are made up for at once."""

TOLERANCE = 1e-9
"""s by which a request's time may differ from the model's; relative to the time it is 1e-12."""

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
"""The events that the peer of the protocol does not count: steps by the own clock, those that it
left out, being too late, how often the inputs were put to their failsafe values, and what failed.
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
            self.peer = self._made_peer()
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
        self._unsaid = dict(DROPPED)

    def _made_peer(self) -> Peer:
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

    def answer(self, datagram: bytes, source: str, now: int) -> bytes | None:
        """Do what a datagram says, whatever it holds; return what to send back to its source."""
        action = self.peer.receive(datagram, now)
        if not isinstance(action, Request):
            self._say_what_is_dropped(source)
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
            self._do(action, now)
            return self.peer.outputs(self._fmu.outputs(), self._fmu.time)
        except (InputError, SimulationError, ValueError) as error:
            self._counts["failures"] += 1
            self._end(str(error))
            return self.peer.failed(str(error))

    def _say_what_is_dropped(self, source: str) -> None:
        """The first time only: whoever looks for the reason of a silence looks here."""
        counts = {**asdict(self.peer.counters), "unknown": self.peer.unknown}
        counts["foreign"] -= self.peer.unknown
        for counter in [c for c in self._unsaid if counts[c]]:
            self._say(f"a datagram from {source} {self._unsaid.pop(counter)}")

    def _do(self, request: Request, now: int) -> None:
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
                self._deadline = now + self._step_ns

    def look(self, now: int) -> None:
        """Do what is due by the own clock."""
        try:
            if self._watching and now - self.peer.acknowledged_at >= self._service.watchdog_ns:
                silence = self._service.watchdog_ns / NANOSECONDS
                self.trip(f"no request for {silence:g} s that told of an answer")
            if self._deadline is not None and now >= self._deadline:
                self._fmu.advance(self._fmu.time, in_seconds(self._step_ns))
                self._counts["own_steps"] += 1
                self._deadline += self._step_ns
                if now - self._deadline > BACKLOG:
                    skipped = int((now - self._deadline) // self._step_ns)
                    self._counts["skipped"] += skipped
                    self._deadline += skipped * self._step_ns
        except (InputError, SimulationError) as error:
            self._own_failure = str(error)
            self._say(self._own_failure)
            self._deadline, self._watching = None, False
        if self.peer.expire(now, self._service.silence_ns):
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
        """Be as one that was started anew, which knows no session; what was counted stays so.

        With a name it is another bench.
        """
        before = self.peer
        if name is not None:
            self._service = replace(self._service, name=name)
        self.peer = self._made_peer()
        self.peer.counters, self.peer.unknown = before.counters, before.unknown
        self._end("the server is as new" if name is None else f"the server is now {name}")

    def break_off(self, reason: str) -> None:
        """Have every request of the session fail."""
        self._own_failure = reason
        self._deadline, self._watching = None, False

    def _end(self, reason: str) -> None:
        was_one, self._in_session = self._in_session, False
        self._deadline, self._watching = None, False
        self._own_failure = ""
        self._fmu.close()
        if was_one:
            self._counts["sessions"] += 1
            self._say(f"the session is over at t = {self._fmu.time:.9g} s: {reason}")


def _failsafe(interface: Interface, peer: Peer, values: Mapping[str, Value]) -> dict[int, Value]:
    """The values that the watchdog sets, by their place in a request."""
    places = {v.name: i for i, v in enumerate(peer.signature.of("input"))}
    for name in values:
        if name not in places:
            said = f"failsafe {name}: no such input of {interface.path.name}"
            raise InputError(f"{said}; {nearest(name, places, interface.listing)}")
    zero: dict[str, Value] = {"Real": 0.0, "Integer": 0, "Boolean": False}
    found: dict[int, Value] = {}
    for name, place in places.items():
        start = interface.by_name[name].start
        chosen = values.get(name, zero[interface.by_name[name].kind] if start is None else start)
        found[place] = parse_value(interface, f"failsafe {name}", name, chosen, text=True)
    return found


class Server(EventLoop):
    """Serves an FMU, which it closes in the end; `rehearsed` is a failure that it is to show."""

    def __init__(
        self,
        fmu: ServedFmu,
        address: Address = ("127.0.0.1", 0),
        say: Say = lambda _: None,
        rehearsed: Rehearsed | None = None,
    ) -> None:
        """Bind the port, 0 for any that is free; InputError where that is not possible."""
        self.fmu = fmu
        self._say = say
        self._rehearsal = Rehearsal(rehearsed)
        super().__init__(address, self._next, self._look_now)
        self._stack.callback(fmu.close)
        self.register(self.port_socket, self._receive)

    def serve(self, sessions: int | None = None) -> None:
        """Serve until `stop`, or so many sessions."""
        self.run(lambda: sessions is not None and self.fmu.counters()["sessions"] >= sessions)

    def _next(self) -> int | None:
        if self._rehearsal.happened == "stop":
            return None
        moments = (self.fmu.due(), self._rehearsal.due(self.fmu.peer.in_session))
        return min((m for m in moments if m is not None), default=None)

    def _look_now(self, now: int) -> None:
        failure = self._rehearsal.happens(now, self.fmu.peer.in_session)
        if failure:
            self._say(f"as --fault says: {failure}")
        if failure == "kill":
            end_at_once()
        elif failure in ("restart", "replace"):
            self.fmu.forget(ANOTHER if failure == "replace" else None)
        elif failure == "trip":
            self.fmu.trip("as --fault says")
        elif failure == "fail":
            self.fmu.break_off("the model failed, as --fault says")
        if self._rehearsal.happened != "stop":
            self.fmu.look(now)

    def _receive(self) -> None:
        """Take one datagram: after it the clock is looked at again."""
        found = received(self.port_socket)
        if found is None or self._rehearsal.happened in ("stop", "deaf"):
            return  # None: an answer found nobody
        datagram, source = found
        now, steps = time.monotonic_ns(), self.fmu.peer.counters.steps
        answer = self.fmu.answer(datagram, text(source), now)
        if self.fmu.peer.counters.steps > steps:
            self._rehearsal.note_step(now)
        try:
            if answer is not None and self._rehearsal.happened != "mute":
                self.port_socket.sendto(answer, source)
        except OSError as error:  # to the proxy it is a lost datagram
            self._say(f"{text(source)}: not sent: {error.strerror or error}")


class DrivenFmu:
    """One FMU with at most one instance. Close it.

    SimulationError or InputError where the FMU fails; it must then be set up anew.
    """

    def __init__(self, interface: Interface, signature: Signature) -> None:
        """Make an instance and free it: rather now than in the first session."""
        self.interface = interface
        self.time = 0.0
        self._signature = signature
        self._outputs = [interface.by_name[v.name] for v in signature.answer]
        self._booleans = [i for i, v in enumerate(signature.answer) if v.kind == "Boolean"]
        self._first_parameter = len(signature.of("input"))
        self._instance: Instance | None = None
        self._stepping = False
        self._values: list[Value] = []
        self._clock = clock_of(0.0, 0.0)
        self._steppers: dict[float, Callable[[], int]] = {}
        load_here(interface.identifier, interface).close()

    def initialise(self, time: float, values: Sequence[Value], fresh: bool) -> None:
        """Set `values` in initialisation mode, with `fresh` of a new instance, from `time` in s."""
        if not fresh and self._instance:
            self._set_changed(values)
            return
        self.close()
        self._instance = instance = load_here(self.interface.identifier, self.interface)
        starts = {v.name: x for v, x in zip(self._signature.request, values, strict=True)}
        instance.enter_initialization(starts, None, time)
        self._values, self.time = list(values), time
        self._inputs = _bound(instance, "set", self._signature.of("input"))
        self._answer = _bound(instance, "get", self._signature.answer)
        self._steppers = {}

    def step(self, time: float, step: float, values: Sequence[Value]) -> None:
        """Step from `time` over `step`, both in s, with these values.

        What is missing before `time` is made up for first, in steps of the same length.
        """
        self.set(values)
        self._catch_up(time, step)
        self.advance(time, step)

    def set(self, values: Sequence[Value]) -> None:
        """Set inputs, and the parameters that are not what they were; initialisation is over."""
        instance = self._required()
        if not self._stepping:
            instance.exit_initialization()
            if self.interface.event_mode:
                instance.enter_step_mode()
            self._stepping = True
        for places, data, call in self._inputs:
            data[:] = [values[i] for i in places]
            if (status := call()) > WARNING:
                raise instance.failure(status, 0.0)
        if values[self._first_parameter :] != self._values[self._first_parameter :]:
            self._set_changed(values, self._first_parameter)

    def advance(self, time: float, step: float) -> None:
        """Advance by `step` from `time`, both in s, with the values as they are."""
        instance = self._required()
        self._clock[:] = clock_of(time, time + step)
        if step not in self._steppers:
            self._steppers = {step: instance.stepper(self._clock, step).python}
        status = self._steppers[step]()
        if status in (DISCARD, EARLY, EVENT, DUE):
            ended = finish_step(instance, status, time, time + step)
            if ended is not None:
                raise SimulationError(
                    f"{self.interface.path.name} asked for the end of the simulation at "
                    f"t = {ended:.9g} s"
                )
        elif status > WARNING:
            raise instance.failure(status, time)
        self.time = time + step

    def outputs(self) -> list[Value]:
        """Return the outputs now, in the order of the signature."""
        instance = self._required()
        values = self._get(instance) if self._stepping else instance.get(self._outputs)
        if isfinite(sum(values)):  # type: ignore[arg-type]  # none is a text
            return values
        for v, value in zip(self._outputs, values, strict=True):
            if isinstance(value, float) and not isfinite(value):
                raise SimulationError(
                    f"{self.interface.path.name}: {v.name} = {value} at t = {self.time:.9g} s: "
                    "must be finite"
                )
        return values

    def close(self) -> None:
        """End and free the instance."""
        instance, self._instance, self._stepping = self._instance, None, False
        if instance is not None:
            instance.close()

    def _required(self) -> Instance:
        if self._instance is None:
            raise SimulationError(f"{self.interface.path.name}: stepped before it was initialised")
        return self._instance

    def _get(self, instance: Instance) -> list[Value]:
        values: list[Value] = [0.0] * len(self._outputs)
        for places, data, call in self._answer:
            if (status := call()) > WARNING:
                raise instance.failure(status, 0.0)
            for i, value in zip(places, data.tolist(), strict=True):
                values[i] = value
        for i in self._booleans:
            values[i] = bool(values[i])
        return values

    def _set_changed(self, values: Sequence[Value], first: int = 0) -> None:
        pairs = zip(self._signature.request, self._values, values, strict=True)
        changed = [
            (self.interface.by_name[v.name], new)
            for v, old, new in [*pairs][first:]
            if (type(old), old) != (type(new), new)
        ]
        self._values = list(values)
        if changed:
            self._required().set([v for v, _ in changed], [new for _, new in changed])

    def _catch_up(self, time: float, step: float) -> None:
        if isclose(time, self.time, rel_tol=1e-12, abs_tol=TOLERANCE):
            return
        begin, missing = self.time, (time - self.time) / step
        if not 0.0 < missing <= MOST_LOST:
            raise SimulationError(
                f"{self.interface.path.name}: step from {time:.9g} s: must be from "
                f"{begin:.9g} s, or at most {MOST_LOST} steps later"
            )
        whole = int(missing + 0.5) if abs(missing - round(missing)) < 1e-3 else int(missing) + 1
        for k in range(whole):
            at = begin + k * step
            after = time if k == whole - 1 else begin + (k + 1) * step
            self.advance(at, after - at)


Bound = tuple[list[int], npt.NDArray[np.generic], Callable[[], int]]
"""Places in a list of values, and the call that passes them, of one FMI type, by an array."""


def _bound(instance: Instance, action: str, variables: Sequence[LinkVariable]) -> list[Bound]:
    """The calls that pass these variables, in a quarter of the time of Instance.get and set."""
    by_type: dict[str, dict[int, Variable]] = {}
    for place, v in enumerate(variables):
        variable = instance.interface.by_name[v.name]
        by_type.setdefault(variable.type, {})[place] = variable
    calls = []
    for fmi_type, found in by_type.items():
        data = np.zeros(len(found), dtype(instance.interface.version, fmi_type))
        call = instance.transfer(action, list(found.values()), data).python
        calls.append((list(found), data, call))
    return calls
