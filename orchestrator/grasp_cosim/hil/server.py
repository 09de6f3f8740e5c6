"""A server at a UDP port, which a proxy of its FMU finds there."""

import time

from ..fmu_export.link import PORT
from .rehearsal import Rehearsal, Rehearsed, end_at_once
from .served import Say, ServedFmu
from .sockets import Address, EventLoop, received, text

DEFAULT_ADDRESS: Address = ("127.0.0.1", PORT)
"""The address that a proxy looks at if nobody says otherwise."""

REPLACING_BENCH = "another bench"
"""The name of the bench that takes the place of one, where that is rehearsed."""


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
        super().__init__(address, self._next_due, self._look)
        self._stack.callback(fmu.close)
        self.register(self.port_socket, self._receive)

    def serve(self, sessions: int | None = None) -> None:
        """Serve until `stop`, or so many sessions."""
        self.run(lambda: sessions is not None and self.fmu.counters()["sessions"] >= sessions)

    def _next_due(self) -> int | None:
        if self._rehearsal.happened == "stop":
            return None
        moments = (self.fmu.due(), self._rehearsal.due(self.fmu.peer.in_session))
        return min((m for m in moments if m is not None), default=None)

    def _look(self, now_ns: int) -> None:
        """Have the failure that is due happen, and do what is due by the FMU's own clock."""
        failure = self._rehearsal.happens(now_ns, self.fmu.peer.in_session)
        if failure:
            self._say(f"as --fault says: {failure}")
        if failure == "kill":
            end_at_once()
        elif failure in ("restart", "replace"):
            self.fmu.forget(REPLACING_BENCH if failure == "replace" else None)
        elif failure == "trip":
            self.fmu.trip("as --fault says")
        elif failure == "fail":
            self.fmu.break_off("the model failed, as --fault says")
        if self._rehearsal.happened != "stop":
            self.fmu.look(now_ns)

    def _receive(self) -> None:
        """Take one datagram: after it the clock is looked at again."""
        message = received(self.port_socket)
        if message is None or self._rehearsal.happened in ("stop", "deaf"):
            return  # None: an answer found nobody
        datagram, source = message
        now_ns, steps = time.monotonic_ns(), self.fmu.peer.counters.steps
        answer = self.fmu.answer(datagram, text(source), now_ns)
        if self.fmu.peer.counters.steps > steps:
            self._rehearsal.note_step(now_ns)
        try:
            if answer is not None and self._rehearsal.happened != "mute":
                self.port_socket.sendto(answer, source)
        except OSError as error:  # to the proxy it is a lost datagram
            self._say(f"{text(source)}: not sent: {error.strerror or error}")
