"""A loop at a port: who is heard first, when it looks, and which addresses there are."""

import socket

import pytest
from grasp_cosim import InputError
from grasp_cosim.hil.sockets import EventLoop, connected, read_address, received, resolved, text

HOST = "127.0.0.1"


def looped(calls, rounds=1, due=lambda: 0):
    """A loop at a free port, the handlers of which note what they got, for so many rounds."""
    loop = EventLoop((HOST, 0), due, lambda now: calls.append("look"))
    loop.register(loop.port_socket, lambda: calls.append(received(loop.port_socket)[0]))
    return loop, lambda: calls.count("look") >= rounds


def test_the_port_is_heard_after_all_others(monkeypatch):
    """Also where the system names it first, or in any other order."""
    for reverse in (False, True):
        calls = []
        loop, done = looped(calls)
        with loop, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
            other.bind((HOST, 0))
            loop.register(other, lambda other=other, calls=calls: calls.append(received(other)[0]))
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
                for at in (loop.address, other.getsockname()):
                    sender.sendto(f"to {at[1]}".encode(), at)

            def both(readable, *rest, ready=(loop.port_socket, other), reverse=reverse):
                return [*(reversed(ready) if reverse else ready)], [], []

            monkeypatch.setattr("grasp_cosim.hil.sockets.select", both)
            loop.run(done)
            port = other.getsockname()[1]
        assert calls == [f"to {port}".encode(), f"to {loop.address[1]}".encode(), "look"]


def test_it_waits_until_something_is_due_or_comes(monkeypatch):
    waits, now = [], [1_000_000_000]
    monkeypatch.setattr(
        "grasp_cosim.hil.sockets.select", lambda *a: waits.append(a[3]) or ([],) * 3
    )
    monkeypatch.setattr("grasp_cosim.hil.sockets.time.monotonic_ns", lambda: now[0])
    for due in (1_500_000_000, 1_000_000_000, 0, None):
        calls = []
        loop, done = looped(calls, due=lambda due=due: due)
        with loop:
            loop.run(done)
    assert waits == [0.5, 0.0, 0.0, None]


def test_it_stops_when_it_is_told_and_only_then():
    calls = []
    loop, _ = looped(calls, due=lambda: None)
    with loop:
        for _ in range(3):
            loop.stop()
        loop.run()
    assert calls == []


IPV4 = (socket.AF_INET, socket.SOCK_DGRAM, 17, "", ("192.0.2.1", 5))
IPV6 = (socket.AF_INET6, socket.SOCK_DGRAM, 17, "", ("2001:db8::1", 5, 0, 0))


@pytest.mark.parametrize(
    ("candidates", "address"),
    [
        ([IPV4, IPV6], ("192.0.2.1", 5)),
        ([IPV6, IPV4], ("192.0.2.1", 5)),
        ([IPV6], ("2001:db8::1", 5)),
    ],
)
def test_a_name_stands_for_its_address_of_ipv4_if_it_has_one(monkeypatch, candidates, address):
    monkeypatch.setattr("socket.getaddrinfo", lambda *_: candidates)
    assert resolved("bench", 5) == address


@pytest.mark.parametrize(("port", "lowest", "good"), [
    (0, 0, True), (0, 1, False), (1, 1, True), (65_535, 1, True), (65_536, 1, False),
    (-1, 0, False),
])  # fmt: skip
def test_a_port_is_in_its_range(port, lowest, good):
    if good:
        assert resolved(HOST, port, lowest) == (HOST, port)
    else:
        with pytest.raises(
            InputError, match=rf"{HOST}:{port}: port must be from {lowest} to 65535"
        ):
            resolved(HOST, port, lowest)


@pytest.mark.parametrize("host", ["", "[]", "a b", "x" * 300])
def test_what_is_no_host_is_said(host):
    with pytest.raises(
        InputError, match="no such address; must be an IP address or a name that has on"
    ):
        resolved(host, 1)


@pytest.mark.parametrize("address", ["", "host:", ":5501", "host:123456", "5501x", "a b:x"])
def test_texts_that_are_no_addresses(address):
    with pytest.raises(InputError, match=r"^TO '.*': must be HOST:PORT, as in "):
        read_address("TO", address)


def test_a_port_that_is_taken_is_refused_and_an_answer_that_nobody_takes_is_none():
    loop, _ = looped([])
    with loop:
        assert text(loop.address) == f"{HOST}:{loop.address[1]}"
        with pytest.raises(InputError, match=f"{text(loop.address)}: cannot listen there: Address"):
            EventLoop(loop.address, lambda: None, lambda now: None)
        with connected(loop.address) as peer:
            assert received(peer) is None
            peer.send(b"x")
            assert received(loop.port_socket) == (b"x", peer.getsockname())
    with pytest.raises(InputError, match=r"255\.255\.255\.255:1: no way to the peer"):
        connected(("255.255.255.255", 1))
