"""Both ends of the connection: an FMU that is served, its proxy, and a proxy's side by hand."""

import socket
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Self

from grasp_cosim import cli
from grasp_cosim.hil.address import Address
from grasp_cosim.hil.network import Network
from grasp_cosim.hil.relay import Relay
from grasp_cosim.hil.served import ServedFmu, Service
from grasp_cosim.hil.server import Server
from grasp_cosim.hil.traffic import Log
from grasp_cosim.interface.read import read_interface
from grasp_fmus.link.client import Client, Verdict
from grasp_fmus.link.message import LARGEST, Value
from grasp_fmus.link.signature import Signature

Ask = Callable[[bytes], bytes | None]
"""Hands a datagram over; the answer, if there is one."""


class HandProxy:
    """Does what a proxy FMU does, without an FMU and without patience."""

    def __init__(self, signature: Signature, ask: Ask, key: bytes | None = None) -> None:
        self.client = Client(signature, key)
        self._ask = ask

    def begin(self, session: int, values: Sequence[Value], time: float = 0.0) -> list[Value]:
        """HELLO and INITIALISE; the outputs."""
        self._must(self.client.greet(session, 0))
        return self.initialise(time, values)

    def initialise(self, time: float, values: Sequence[Value]) -> list[Value]:
        return self._must(self.client.initialise(time, values, 0))

    def step(self, time: float, step: float, values: Sequence[Value]) -> list[Value]:
        return self._must(self.client.step(time, step, values, 0))

    def end(self) -> None:
        assert self._ask(self.client.end(0)) is None

    def _must(self, request: bytes) -> list[Value]:
        answer = self._ask(request)
        assert answer is not None
        verdict = self.client.receive(answer, 0)
        if verdict is Verdict.REFUSED:
            assert self.client.refusal is not None
            raise RuntimeError(self.client.refusal.text)
        assert verdict is Verdict.ANSWERED
        return self.client.outputs or []


class UdpAsk:
    """Over UDP on the loopback; an answer may take 30 s, the machine may be busy."""

    def __init__(self, address: tuple[str, int]) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(address)
        self._socket.settimeout(30.0)

    def __call__(self, datagram: bytes) -> bytes | None:
        self._socket.send(datagram)
        return None if datagram[6] == 7 else self._socket.recv(LARGEST)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._socket.close()


def wait_until(condition: Callable[[], bool]) -> None:
    """Until it holds, at most 30 s."""
    end = time.monotonic() + 30.0
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.001)


@contextmanager
def serving(
    fmu: Path, how: Service, address: tuple[str, int] = ("127.0.0.1", 0)
) -> Iterator[Server]:
    """A server in a thread, stopped in the end."""
    with Server(ServedFmu(read_interface(fmu), how), address) as server:
        thread = threading.Thread(target=server.serve)
        thread.start()
        try:
            yield server
        finally:
            server.stop()
            thread.join(30.0)
            assert not thread.is_alive()


@contextmanager
def relaying(
    peer: Address,
    network: Network | None = None,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    log: Log | None = None,
) -> Iterator[Relay]:
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


def build_proxy(fmu: Path, out: Path, port: int, *options: str) -> Path:
    """The proxy of an FMU, made by the command; it waits for an answer as long as it takes."""
    made = ["proxy", str(fmu), "-o", str(out), "--port", str(port), "--timeout", "30", *options]
    assert cli.main(made) == 0
    return out
