"""The server of a live page: on loopback only, behind a random token, with few clients.

GET TOKEN/ is the page, TOKEN/history the rows so far, TOKEN/events server-sent events; POST
TOKEN/set asks for a value. Nothing else is served, and nothing to another origin.
"""

from __future__ import annotations

import json
import secrets
import socket
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import TimeoutError as StillWaiting
from contextlib import suppress
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any, Protocol

from ..base.errors import InputError, SimulationError
from ..interface.values import Given
from ..master.requests import Answer

LOOPBACK = "127.0.0.1"

MAX_CLIENTS = 8
"""So many pages may follow a run."""

MAX_CONNECTIONS = 32
"""So many requests may be answered at a time, those of the pages among them."""

MAX_BODY = 4096
"""Bytes of a request for a value."""

PATIENCE = 5.0
"""s that a connection may neither send nor take anything."""

ANSWER_WITHIN = 30.0
"""s that a request waits for the next communication point."""

GRACE, QUIET, LOOK = 3.0, 0.4, 0.02
"""s after the end of a run in which pages may still take its last rows, at most; s without any
request after which they have them; s between two looks at that.
"""

POLICY = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
"""What a page may load: nothing from elsewhere."""


class Source(Protocol):
    """What is served."""

    def page(self) -> str:
        """The page."""

    def history(self) -> bytes:
        """The rows so far."""

    def frames(self, goes_on: Callable[[], bool]) -> Iterator[str]:
        """What a client gets, as it can take it: texts of JSON. It ends with the run."""

    def set(self, name: str, value: Given, within: float) -> Answer:
        """Set a variable. InputError, SimulationError, or concurrent.futures.TimeoutError."""


@dataclass(frozen=True, slots=True)
class _Reply:
    status: int
    body: bytes
    kind: str = "text/plain; charset=utf-8"


class LiveServer(ThreadingHTTPServer):
    """Serves one source, from threads that all end with close()."""

    daemon_threads = False
    block_on_close = True
    request_queue_size = MAX_CONNECTIONS

    def __init__(self, source: Source, port: int = 0) -> None:
        """Listen at a port, 0 for any that is free. InputError where it is not."""
        self.source = source
        self.token = secrets.token_urlsafe(16)
        self.closing = threading.Event()
        self._connections = threading.BoundedSemaphore(MAX_CONNECTIONS)
        self.clients = threading.BoundedSemaphore(MAX_CLIENTS)
        self._open: set[socket.socket] = set()
        self._had_clients = False
        self._lock = threading.Lock()
        try:
            super().__init__((LOOPBACK, port), _Handler)
        except OSError as error:
            raise InputError(
                f"live: port {port}: {error.strerror}; must be one that is free"
            ) from error
        self._thread = threading.Thread(
            target=self.serve_forever, kwargs={"poll_interval": 0.1}, name="live server"
        )

    @property
    def port(self) -> int:
        """The port."""
        return int(self.server_address[1])

    @property
    def address(self) -> str:
        """The address of the page."""
        return f"http://{LOOPBACK}:{self.port}/{self.token}/"

    @property
    def hosts(self) -> tuple[str, ...]:
        """What a request may call this server."""
        return tuple(f"{name}:{self.port}" for name in (LOOPBACK, "localhost"))

    def server_bind(self) -> None:
        """As of TCPServer: that of HTTPServer looks up the name of this machine."""
        self.socket.bind(self.server_address)
        self.server_address = self.socket.getsockname()
        self.server_name, self.server_port = LOOPBACK, self.port

    def note_client(self) -> None:
        """Take note that a page follows the run."""
        self._had_clients = True

    def start(self) -> None:
        """Begin to serve."""
        self._thread.start()

    def close(self) -> None:
        """Give clients the time to take what is left, then end all threads."""
        quiet = 0.0 if self._had_clients else QUIET
        waited = 0.0
        while quiet < QUIET and waited < GRACE:
            self.closing.wait(LOOK)
            waited += LOOK
            quiet = 0.0 if self._open else quiet + LOOK
        self.closing.set()
        self.shutdown()
        self._thread.join()
        with self._lock:
            for connection in self._open:
                with suppress(OSError):
                    connection.shutdown(socket.SHUT_RDWR)
        self.server_close()

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answer a request in a thread, unless there are too many."""
        if not self._connections.acquire(blocking=False):
            self.shutdown_request(request)
            return
        with self._lock:
            self._open.add(request)
        super().process_request(request, client_address)

    def process_request_thread(self, request: Any, client_address: Any) -> None:
        """Answer it, in its thread."""
        try:
            super().process_request_thread(request, client_address)
        finally:
            with self._lock:
                self._open.discard(request)
            self._connections.release()

    def handle_error(self, request: Any, client_address: Any) -> None:
        """A client that goes away is no error; anything else is told."""
        import sys

        if not isinstance(sys.exception(), OSError):
            super().handle_error(request, client_address)


class _Handler(BaseHTTPRequestHandler):
    """One request; the connection ends with its answer."""

    server: LiveServer
    timeout = PATIENCE
    server_version, sys_version = "grasp-cosim", ""

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002 - that of the base class
        """Nothing: the run has the terminal."""

    def do_GET(self) -> None:
        """The page, the rows so far, or events."""
        place, refusal = self._place()
        if refusal:
            self._send(refusal)
        elif place == "":
            self._send(_Reply(200, self.server.source.page().encode(), "text/html; charset=utf-8"))
        elif place == "history":
            self._send(_Reply(200, self.server.source.history(), "application/octet-stream"))
        elif place == "events":
            self._stream()
        else:
            self._send(_text(404, "no such place"))

    def do_POST(self) -> None:
        """A value that is to be set."""
        place, refusal = self._place()
        if refusal or place != "set":
            self._send(refusal or _text(404, "no such place"))
            return
        self._send(self._set())

    def _place(self) -> tuple[str, _Reply | None]:
        """What a request asks for behind the token, or how it is refused."""
        host, origin = self.headers.get("Host", ""), self.headers.get("Origin")
        if host not in self.server.hosts:
            return "", _text(403, "wrong host")
        if origin is not None and origin not in [f"http://{h}" for h in self.server.hosts]:
            return "", _text(403, "wrong origin")
        token, slash, place = self.path.removeprefix("/").partition("/")
        if not slash or not secrets.compare_digest(token.encode(), self.server.token.encode()):
            return "", _text(404, "no such place")
        return place, None

    def _stream(self) -> None:
        """Events until the run ends, or the client goes."""
        clients = self.server.clients
        if not clients.acquire(blocking=False):
            self._send(_text(503, f"{MAX_CLIENTS} pages follow this run already"))
            return
        self.server.note_client()
        try:
            self._head(200, "text/event-stream; charset=utf-8")
            goes_on = self.server.closing
            for frame in self.server.source.frames(lambda: not goes_on.is_set()):
                self.wfile.write(f"data: {frame}\n\n".encode())
        finally:
            clients.release()

    def _set(self) -> _Reply:
        """What comes of a request for a value."""
        length = self.headers.get("Content-Length", "")
        if not length.isdecimal() or int(length) > MAX_BODY:
            return _text(413, f"must have at most {MAX_BODY} bytes")
        if self.headers.get_content_type() != "application/json":
            return _text(415, "must be JSON")
        try:
            asked = json.loads(self.rfile.read(int(length)), parse_constant=_refused_constant)
        except (ValueError, RecursionError):
            return _json(400, {"error": "is not JSON"})
        if not isinstance(asked, dict) or asked.keys() != {"name", "value"}:
            return _json(400, {"error": "must have name and value"})
        name, value = asked["name"], asked["value"]
        if not isinstance(name, str) or not isinstance(value, str | int | float):
            return _json(400, {"error": "must be a name and a value"})
        try:
            answer = self.server.source.set(name, value, ANSWER_WITHIN)
        except (InputError, SimulationError) as error:
            return _json(422, {"error": str(error)})
        except StillWaiting:
            return _json(504, {"error": f"set: {name}: waits for its communication point"})
        return _json(200, {"value": answer.value, "line": answer.line})

    def _send(self, reply: _Reply) -> None:
        self._head(reply.status, reply.kind, len(reply.body))
        self.wfile.write(reply.body)

    def _head(self, status: int, kind: str, length: int | None = None) -> None:
        self.send_response(status)
        self.send_header("Content-Type", kind)
        if length is not None:
            self.send_header("Content-Length", str(length))
        self.send_header("Cache-Control", "no-store")
        self.send_header("Content-Security-Policy", POLICY)
        self.send_header("Referrer-Policy", "no-referrer")
        self.send_header("X-Content-Type-Options", "nosniff")
        self.end_headers()


def _text(status: int, line: str) -> _Reply:
    return _Reply(status, f"{line}\n".encode())


def _json(status: int, content: dict[str, Any]) -> _Reply:
    return _Reply(status, json.dumps(content).encode(), "application/json")


def _refused_constant(name: str) -> float:
    """JSON has neither NaN nor Infinity."""
    raise ValueError(name)
