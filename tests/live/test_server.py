"""What a live page's server gives to whom: nothing without the token, nothing to another origin."""

import http.client
import json
import socket
import threading
from urllib.parse import urlsplit

import pytest
from grasp_cosim import InputError
from grasp_cosim.live import server as live_server
from grasp_cosim.live.server import MAX_BODY, MAX_CLIENTS, MAX_CONNECTIONS, LiveServer
from grasp_cosim.master.requests import Answer
from live.clients import WITHIN, ask, following, request


class Source:
    """Serves little, and remembers what it was asked for."""

    def __init__(self):
        self.asked, self.end, self.size = [], threading.Event(), 10

    def page(self):
        return "<p>page</p>"

    def history(self):
        return b"rows"

    def frames(self, goes_on):
        while goes_on() and not self.end.is_set():
            yield json.dumps({"text": "x" * self.size})
        yield json.dumps({"last": True})

    def set(self, name, value, within):
        self.asked.append((name, value))
        if value == "refused":
            raise InputError(f"set: {name}: must not be")
        if value == "late":
            raise TimeoutError
        return Answer(0.5, value, f"t = 0.5 s: {name} = {value}")


@pytest.fixture
def served():
    """A source and its server, which has ended at the end, with all its threads."""
    before = threading.active_count()
    source = Source()
    server = LiveServer(source)
    server.start()
    yield source, server
    source.end.set()
    server.close()
    assert threading.active_count() == before


def test_it_serves_a_page_on_loopback_only(served):
    _, server = served
    assert server.server_address[0] == "127.0.0.1"
    assert server.address == f"http://127.0.0.1:{server.port}/{server.token}/"
    assert len(server.token) >= 20
    assert request(server.address) == (200, b"<p>page</p>")
    assert request(server.address, "history") == (200, b"rows")
    assert request(server.address, Host=f"localhost:{server.port}")[0] == 200


def test_two_servers_have_two_tokens_and_two_ports(served):
    other = LiveServer(Source())
    assert (other.token, other.port) != (served[1].token, served[1].port)
    with pytest.raises(InputError, match=rf"^live: port {other.port}: .*; must be one that is fre"):
        LiveServer(Source(), other.port)
    other.server_close()


@pytest.mark.parametrize(
    ("path", "status"),
    [
        ("/", 404), ("/wrong/", 404), ("/{}", 404), ("/{}x/", 404), ("/{}/nothing", 404),
        ("/{}/../", 404), ("/{}/history/", 404), ("/{}/set", 404),
        ("/%C3%A9/", 404), ("/{}/", 200),
    ],
)  # fmt: skip
def test_a_wrong_token_or_place_is_not_found(served, path, status):
    _, server = served
    base = f"http://127.0.0.1:{server.port}"
    assert request(base, path.format(server.token))[0] == status


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "127.0.0.1:1", "localhost", ""])
def test_a_wrong_host_is_refused_as_of_a_name_that_was_rebound(served, host):
    source, server = served
    assert request(server.address, Host=host)[0] == 403
    assert ask(server.address, "a", 1.0, Host=f"localhost:{server.port}")[0] == 200
    assert len(source.asked) == 1


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "https://127.0.0.1:{}", ""])
def test_another_origin_is_refused(served, origin):
    source, server = served
    wrong = origin.format(server.port)
    body = json.dumps({"name": "a", "value": 1.0})
    headers = {"Content-Type": "application/json", "Origin": wrong}
    assert request(server.address, "set", "POST", body, **headers)[0] == 403
    assert request(server.address, Origin=wrong)[0] == 403
    assert source.asked == []
    for own in ("127.0.0.1", "localhost"):
        assert ask(server.address, "a", 1.0, Origin=f"http://{own}:{server.port}")[0] == 200


def test_a_value_is_asked_for_and_its_refusal_told(served):
    source, server = served
    done = ask(server.address, "a.p", 0.25)
    assert done == (200, {"value": 0.25, "line": "t = 0.5 s: a.p = 0.25"})
    assert ask(server.address, "a.p", "refused") == (422, {"error": "set: a.p: must not be"})
    assert ask(server.address, "a.p", "late")[0] == 504
    assert source.asked == [("a.p", 0.25), ("a.p", "refused"), ("a.p", "late")]


@pytest.mark.parametrize(
    ("body", "kind", "status"),
    [
        ("{}", "application/json", 400),
        ("not JSON", "application/json", 400),
        ("[" * 4000, "application/json", 400),
        ('{"name": "a", "value": NaN}', "application/json", 400),
        ('{"name": "a", "value": null}', "application/json", 400),
        ('{"name": "a", "value": [1]}', "application/json", 400),
        ('{"name": 1, "value": 1}', "application/json", 400),
        ('{"name": "a", "value": 1, "more": 1}', "application/json", 400),
        ('{"name": "a", "value": 1}', "text/plain", 415),
        ('{"name": "a", "value": 1}', "application/x-www-form-urlencoded", 415),
        (" " * (MAX_BODY + 1), "application/json", 413),
    ],
)
def test_anything_else_than_a_short_object_is_refused(served, body, kind, status):
    source, server = served
    headers = {"Content-Type": kind}
    assert request(server.address, "set", "POST", body, **headers)[0] == status
    assert source.asked == []


@pytest.mark.parametrize("length", ["-1", "1e3", "", "9" * 30])
def test_a_length_that_is_none_is_refused_without_reading(served, length):
    _, server = served
    with socket.create_connection(("127.0.0.1", server.port), WITHIN) as client:
        client.sendall(
            f"POST /{server.token}/set HTTP/1.0\r\nHost: {server.hosts[0]}\r\n"
            f"Content-Type: application/json\r\nContent-Length: {length}\r\n\r\n".encode()
        )
        assert client.recv(100).split()[1] == b"413"


def test_other_methods_and_places_to_post_to_are_refused(served):
    _, server = served
    for method in ("PUT", "DELETE", "HEAD", "OPTIONS"):
        assert request(server.address, method=method)[0] == 501
    headers = {"Content-Type": "application/json"}
    assert request(server.address, "", "POST", "{}", **headers)[0] == 404


def test_a_page_may_load_nothing_from_elsewhere(served):
    _, server = served
    parts = urlsplit(server.address)
    connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=WITHIN)
    connection.request("GET", parts.path)
    answer = connection.getresponse()
    policy = answer.getheader("Content-Security-Policy")
    assert policy.startswith("default-src 'none';")
    assert "connect-src 'self'" in policy
    assert "frame-ancestors 'none'" in policy
    assert (answer.getheader("Referrer-Policy"), answer.version) == ("no-referrer", 10)
    answer.read()
    connection.close()


def test_so_many_pages_may_follow_and_no_more(served):
    source, server = served
    streams = [following(server.address) for _ in range(MAX_CLIENTS)]
    for stream in streams:
        assert "text" in next(stream.__enter__())
    status, text = request(server.address, "events")
    assert (status, text) == (503, f"{MAX_CLIENTS} pages follow this run already\n".encode())
    assert request(server.address)[0] == 200
    source.end.set()
    for stream in streams:
        stream.__exit__(None, None, None)


def test_connections_that_ask_for_nothing_are_bounded_and_end(served, monkeypatch):
    _, server = served
    idle = [socket.create_connection(("127.0.0.1", server.port)) for _ in range(MAX_CONNECTIONS)]
    with socket.create_connection(("127.0.0.1", server.port), WITHIN) as one_more:
        assert one_more.recv(1) == b""
    for connection in idle:
        connection.close()


def test_a_client_that_takes_nothing_holds_up_neither_others_nor_the_end(monkeypatch):
    monkeypatch.setattr(live_server, "GRACE", 0.1)
    before = threading.active_count()
    source = Source()
    source.size = 1_000_000
    server = LiveServer(source)
    server.start()
    with socket.create_connection(("127.0.0.1", server.port)) as slow:
        head = f"GET /{server.token}/events HTTP/1.0\r\nHost: {server.hosts[0]}\r\n\r\n"
        slow.sendall(head.encode())
        assert slow.recv(15) == b"HTTP/1.0 200 OK"
        with following(server.address) as frames:
            assert len(next(frames)["text"]) == source.size
            assert len(next(frames)["text"]) == source.size
        server.close()
        assert threading.active_count() == before
