"""Clients of a live page: one request by hand, a stream of events, and a run that they follow."""

import http.client
import json
import struct
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from urllib.parse import urlsplit

import numpy as np
from grasp_cosim import simulate
from grasp_cosim.live.live_page import LivePage

WITHIN = 60
"""s after which a client gives up: much longer than anything takes."""

LONG = 600.0
"""s of a run that a client ends."""


def request(address, place="", method="GET", body=None, **headers):
    """The status and the body of a place below an address."""
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=WITHIN)
    try:
        connection.request(method, parts.path + place, body, headers)
        response = connection.getresponse()
        return response.status, response.read()
    finally:
        connection.close()


def ask(address, name, value, **headers):
    """The status and the answer to a request for a value."""
    body = json.dumps({"name": name, "value": value})
    headers = {"Content-Type": "application/json", **headers}
    status, answer = request(address, "set", "POST", body, **headers)
    return status, json.loads(answer)


def history(address):
    """The number of the next pair, and the rows, of a live page."""
    status, body = request(address, "history")
    assert status == 200
    count, width = struct.unpack("<2d", body[:16])
    return int(count), np.frombuffer(body[16:]).reshape(-1, int(width))


@contextmanager
def following(address):
    """The frames of a page's stream of events, one after the other."""
    parts = urlsplit(address)
    connection = http.client.HTTPConnection(parts.hostname, parts.port, timeout=WITHIN)
    connection.request("GET", parts.path + "events")
    response = connection.getresponse()
    assert (response.status, response.getheader("Cache-Control")) == (200, "no-store")

    def frames():
        for line in response:
            if line.startswith(b"data: "):
                yield json.loads(line.removeprefix(b"data: "))

    try:
        yield frames()
    finally:
        connection.close()


def followed(system, act, **options):
    """What a client does while a long run goes on, which it ends: the result, and what it returns.

    `act` gets the live page.
    """
    halt, page = threading.Event(), LivePage(system)
    with ThreadPoolExecutor(1) as pool, page:

        def client():
            try:
                return act(page)
            finally:
                halt.set()

        outcome = pool.submit(client)
        result = simulate(
            page.system, stop=LONG, listeners=[page.feed], requests=page.requests, halt=halt,
            note=page.note, **{"realtime": True, **options},
        )  # fmt: skip
    return result, outcome.result(WITHIN)
