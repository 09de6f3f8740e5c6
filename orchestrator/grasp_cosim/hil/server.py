"""An FMU that is served at a UDP port."""

import time

from grasp_fmus.link.message import PORT

from ..base.errors import InputError
from .address import Address, text
from .event_loop import EventLoop, received
from .served import Say, ServedFmu

DEFAULT_ADDRESS: Address = ("127.0.0.1", PORT)
"""The address that a proxy looks at if nobody says otherwise."""


class Server(EventLoop):
    """Serves an FMU, which it closes in the end."""

    def __init__(
        self, fmu: ServedFmu, address: Address = ("127.0.0.1", 0), say: Say = lambda _: None
    ) -> None:
        """Bind the port, 0 for any that is free; InputError where that is not possible."""
        self.fmu = fmu
        self._say = say
        fmu.over = self.over
        try:
            super().__init__(address, fmu.due, fmu.look)
        except InputError:
            fmu.close()
            raise
        self._stack.callback(fmu.close)
        self.register(self.port_socket, self._receive)

    def serve(self, sessions: int | None = None, duration_ns: int | None = None) -> None:
        """Serve until `stop`, or for so many sessions or so long."""
        served = self.fmu.counts
        self.run(duration_ns, lambda: sessions is not None and served.sessions >= sessions)

    def _receive(self) -> None:
        """Take one datagram: after it the clock is looked at again."""
        found = received(self.port_socket)
        if found is None:  # an answer found nobody
            return
        datagram, source = found
        answer = self.fmu.answer(datagram, text(source), time.monotonic_ns())
        try:
            if answer is not None:
                self.port_socket.sendto(answer, source)
        except OSError as error:  # to the proxy it is a lost datagram
            self._say(f"{text(source)}: not sent: {error.strerror or error}")
