"""Both ends of the connection: an FMU that is served, its proxy, and a proxy's side by hand."""

import socket
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

from grasp_cosim import cli
from grasp_cosim.fmu_export.link import (
    END,
    HELLO,
    INITIALISE,
    LARGEST,
    NAME_SIZE,
    OUTPUTS,
    REFUSE,
    STEP,
    WELCOME,
    Codec,
    Message,
    Sealer,
    pack_hello,
    unpack_text,
)
from grasp_cosim.hil.proxy_of_fmu import exchanged
from grasp_cosim.hil.relay import Relay
from grasp_cosim.hil.served import ServedFmu
from grasp_cosim.hil.server import Server

Ask = Callable[[bytes], bytes | None]
"""Hands a datagram over; the answer, if there is one."""


class RefusedError(Exception):
    """What a peer says in a REFUSE: its code, and its reason."""

    def __str__(self):
        return str(self.args[1])


class HandProxy:
    """Does what a proxy FMU does, without an FMU and without patience."""

    def __init__(self, signature, ask, key=None):
        self.signature = signature
        self.round = 0
        """What the header has as the time of sending."""
        self.outputs_time = 0.0
        self.trips = 0
        self.build = self.name = None
        self._ask = ask
        self._sealer = Sealer(key)
        self._codecs = Codec(signature.request), Codec(signature.answer)
        self._session = self._cookie = self._sequence = 0

    def hello(self, session, name="", part=0, **changed):
        """The HELLO that begins a session."""
        self._session, self._cookie, self._sequence = session, 0, 0
        body = pack_hello(name, self.signature.parts()[part])
        return self.pack(HELLO, **{"body": body, **changed})

    def request(self, kind, time, values, step=0.0, /, **changed):
        """The next INITIALISE or STEP."""
        self._sequence += 1
        body = self._codecs[0].pack(*values)
        plain = {"kind": kind, "time": time, "step": step, "body": body}
        return self.pack(**{**plain, **changed})

    def pack(self, kind, **changed):
        """A datagram of the session."""
        state = (self.signature.hash, self._session, self._cookie, self._sequence)
        plain = Message(kind, 0, *state, 0.0, 0.0, self.round, b"")
        return self._sealer.pack(plain._replace(**changed))

    def begin(self, session, values, time=0.0):
        """HELLO and INITIALISE; the outputs."""
        self.take(self._ask(self.hello(session)))
        return self.initialise(time, values)

    def initialise(self, time, values):
        return self.take(self._ask(self.request(INITIALISE, time, values)))

    def step(self, time, step, values):
        return self.take(self._ask(self.request(STEP, time, values, step)))

    def end(self):
        assert self._ask(self.pack(END)) is None

    def take(self, answer):
        """The outputs in an answer, if any; RefusedError where it refuses."""
        assert answer is not None
        m = self._sealer.open(answer)
        assert isinstance(m, Message), m
        assert (m.session, m.sequence, m.sent) == (self._session, self._sequence, self.round)
        if m.kind == REFUSE:
            raise RefusedError(m.code, m.body.decode())
        assert m.interface == self.signature.hash
        if m.kind == WELCOME:
            self._cookie = m.cookie
            self.name, self.build = map(unpack_text, (m.body[:NAME_SIZE], m.body[NAME_SIZE:]))
            return []
        assert (m.kind, m.cookie) == (OUTPUTS, self._cookie)
        self.outputs_time, self.trips = m.time, m.counted
        values = self._codecs[1].unpack(m.body)
        assert values is not None
        return values


class UdpAsk:
    """Over UDP on the loopback; an answer may take 30 s, the machine may be busy."""

    def __init__(self, address):
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(address)
        self._socket.settimeout(30.0)

    def __call__(self, datagram):
        self._socket.send(datagram)
        return None if datagram[6] == 7 else self._socket.recv(LARGEST)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._socket.close()


def wait_until(condition):
    """Until it holds, at most 30 s."""
    end = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.001)


def serving(fmu, how, address=("127.0.0.1", 0), rehearsed=None):
    """A server of an FMU in a thread, stopped in the end."""
    return serving_fmu(ServedFmu(exchanged(fmu), how), address, rehearsed)


@contextmanager
def serving_fmu(served, address=("127.0.0.1", 0), rehearsed=None):
    """The same of one that is ready to be served."""
    with Server(served, address, rehearsed=rehearsed) as server:
        thread = threading.Thread(target=server.serve)
        thread.start()
        try:
            yield server
        finally:
            server.stop()
            thread.join(30.0)
            assert not thread.is_alive()


@contextmanager
def relaying(peer, network=None, *, host="127.0.0.1", port=0, log=None):
    """A relay that runs in a thread of its own; whatever ends it is raised in the end."""
    with (
        Relay(peer, network, host=host, port=port, log=log) as relay,
        ThreadPoolExecutor(1, "relay") as pool,
    ):
        running = pool.submit(relay.run)
        try:
            yield relay
        finally:
            relay.stop()
            running.result()


ANY_PORT = 5005
"""For a proxy that gets its port before a run, so that its library is compiled once."""


def build_proxy(fmu, out, port, *options):
    """The proxy of an FMU, made by the command; it waits for an answer as long as it takes."""
    made = ["proxy", str(fmu), "-o", str(out), "--port", str(port), "--timeout", "30", *options]
    assert cli.main(made) == 0
    return out
