"""The relay between real sockets on loopback: what comes out is what the fates say, and counts."""

import json
import re
import signal
import socket
import threading
from csv import DictReader
from dataclasses import asdict
from functools import partial

import pytest
from grasp_cosim import cli
from grasp_cosim.base.errors import InputError
from grasp_cosim.hil.relay import DIRECTIONS, MOST_CLIENTS, Conditions, Counters, Network, Relay
from support.processes import kept_port
from support.proxies import relaying, wait_until


class EchoPeer:
    """Echoes in a thread until the with statement ends; received holds (sender's port, data)."""

    def __init__(self, port=0):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", port))
        self.address = self.socket.getsockname()
        self.received = []
        self._thread = threading.Thread(target=self._echo)

    def _echo(self):
        while True:
            data, sender = self.socket.recvfrom(65_535)
            if sender == self.address:
                return
            self.received.append((sender[1], data))
            self.socket.sendto(data, sender)

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, kind, error, trace):
        self.socket.sendto(b"", self.address)
        self._thread.join()
        self.socket.close()


def client():
    """A socket on loopback whose recv() gives up in the end."""
    made = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    made.bind(("127.0.0.1", 0))
    made.settimeout(30.0)
    return made


NASTY = Conditions(jitter=0.002, loss=0.2, duplicate=0.2, reorder=0.2, reorder_by=0.005)


def settled(relay, requests):
    """Whether so many requests and all the replies to them have gone through, or been dropped."""
    request, reply = relay.counters.values()
    arrived = request.received == requests and reply.received == request.delivered
    return arrived and request.held == reply.held == 0


def delivered(relay, requests):
    """Whether so many requests have gone through."""
    return relay.counters["request"].delivered == requests


def test_what_gets_through_and_the_counters_are_those_of_the_fates():
    """Whatever the timing: requests by their content, replies by how many there were."""
    net, log, replies = Network(dict.fromkeys(DIRECTIONS, NASTY), seed=11), [], 0
    with (
        EchoPeer() as peer,
        relaying(peer.address, net, log=log.append) as relay,
        client() as mine,
    ):
        for upto in range(20, 320, 20):  # a few at a time
            for number in range(upto - 19, upto + 1):
                mine.sendto(b"%d" % number, relay.address)
            wait_until(partial(settled, relay, upto))
            while replies < relay.counters["reply"].delivered:
                replies += bool(mine.recv(100))
    fates = {n: net.fate("request", n) for n in range(1, 301)}
    order = [int(data) for _, data in peer.received]
    assert sorted(order) == [n for n, fate in fates.items() for _ in fate]
    expected = [*fates.values()], [net.fate("reply", n + 1) for n in range(len(order))]
    for (direction, counters), of in zip(relay.counters.items(), expected, strict=True):
        assert counters == Counters(
            received=len(of), delivered=sum(map(len, of)), lost=of.count(()),
            duplicated=sum(len(f) == 2 for f in of), reordered=counters.reordered,
        )  # fmt: skip
        told = [e.delay for e in log if e.direction == direction and e.delay is not None]
        assert told == [p.delay_ns / 1e9 for f in of for p in f]
    overtaken = sum(n < max(order[:i], default=0) for i, n in enumerate(order))
    assert relay.counters["request"].reordered == overtaken > 0


def test_a_peer_that_is_away_and_comes_back():
    """What nobody takes is lost on the way; the first datagram after the return gets through."""
    with kept_port() as port, relaying(("127.0.0.1", port)) as relay, client() as mine:
        with EchoPeer(port):
            mine.sendto(b"here", relay.address)
            assert mine.recv(100) == b"here"
        for number in range(2, 6):
            mine.sendto(b"away", relay.address)
            wait_until(partial(delivered, relay, number))
        with EchoPeer(port):
            mine.sendto(b"back", relay.address)
            assert mine.recv(100) == b"back"
    assert relay.counters["request"] == Counters(received=6, delivered=6)
    assert relay.counters["reply"] == Counters(received=2, delivered=2)


def test_clients_get_their_own_replies_and_the_one_silent_for_longest_is_forgotten():
    """The peer can tell them apart: one who comes back after many others is another to it."""
    with EchoPeer() as peer, relaying(peer.address) as relay, client() as one:
        for number in range(MOST_CLIENTS + 1):
            with client() as other:
                for mine, data in ((other, b"%d" % number), (one, b"one")):
                    mine.sendto(data, relay.address)
                    assert mine.recv(100) == data
        assert len(relay._clients) == MOST_CLIENTS
    ports = {
        data: {port for port, own in peer.received if own == data} for _, data in peer.received
    }
    assert len(ports) == MOST_CLIENTS + 2
    assert {len(found) for found in ports.values()} == {1}


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0"])
def test_it_does_not_relay_to_itself(host):
    with client() as mine:
        port = mine.getsockname()[1]
    with pytest.raises(InputError, match=f"127.0.0.1:{port}: is the relay itself; must be"):
        Relay(("127.0.0.1", port), host=host, port=port)


def command(*arguments):
    """Run grasp-cosim relay in this process."""
    return cli.main(["relay", *arguments])


def test_the_command_relays_until_it_is_interrupted(capsys, monkeypatch):
    monkeypatch.setattr(Relay, "run", lambda _: signal.raise_signal(signal.SIGINT))
    assert command("0", "127.0.0.1:5501") == 0
    out, err = capsys.readouterr()
    assert re.fullmatch(r"relaying 127\.0\.0\.1:[1-9][0-9]* -> 127\.0\.0\.1:5501\n", err)
    assert [line.split() for line in out.splitlines()] == [
        [*asdict(Counters())], ["request", *"000000000"], ["reply", *"000000000"],
    ]  # fmt: skip
    assert command("0.0.0.0:0", "5501") == 0
    note, listening = capsys.readouterr().err.splitlines()
    where = listening.split()[1]
    assert where.startswith("0.0.0.0:")
    assert note == f"listening beyond this machine: whoever reaches {where} reaches 127.0.0.1:5501"


def test_its_log_is_that_of_the_fates_and_its_counters_are_those_of_the_log(
    tmp_path, capsys, monkeypatch
):
    """With each option; two requests do not get through as there is an outage."""
    path = tmp_path / "log.csv"

    def run(relay):
        for number in range(40):
            for direction in DIRECTIONS:
                relay._traffic.receive(direction, lambda: True, number)
        relay._traffic.send_due(10**9)
        signal.raise_signal(signal.SIGINT)

    monkeypatch.setattr(Relay, "run", run)
    chances = "--loss 0.3 --delay 0.001:0.003 --duplicate 0.3 --reorder 0.2 --seed 7 --outage 3:5"
    assert command("0", "5501", *chances.split(), "--log", str(path), "--json") == 0
    report = json.loads(capsys.readouterr().out)
    assert report.pop("listening").startswith("127.0.0.1:")
    assert [report.pop(k) for k in ("to", "seed")] == ["127.0.0.1:5501", 7]
    both = Conditions(0.001, 0.002, loss=0.3, duplicate=0.3, reorder=0.2)
    net = Network(dict.fromkeys(DIRECTIONS, both), seed=7)
    with path.open(newline="") as file:
        rows = list(DictReader(file))
    assert [*report] == [*DIRECTIONS]
    for direction, counts in report.items():
        of = [row for row in rows if row["direction"] == direction]
        expected = []
        for n in range(1, 41):
            fate = () if n in (3, 4) else net.fate(direction, n)
            expected += [str(p.delay_ns / 1e9) for p in fate] or [""]
        assert [row["delay"] for row in of] == expected
        assert (counts["received"], counts["outage"], counts["held"]) == (40, 2, 0)
        assert counts["lost"] == counts["dropped"] - 2 == sum(row["fate"] == "lost" for row in of)
        assert counts["duplicated"] == sum(row["copy"] == "1" for row in of)
        assert counts["delivered"] == sum(row["delay"] != "" for row in of)


DELAY = "must be S or FROM:TO, in s, the longer last"


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("0 1 --loss 1.5", "loss = 1.5: must be a probability, from 0 to 1"),
        ("0 1 --delay nan", "delay = nan s: must be from 0 to 1e+06 s"),
        ("0 1 --delay 2:1", f"--delay '2:1': {DELAY}"),
        ("0 1 --delay 1:2:3", f"--delay '1:2:3': {DELAY}"),
        ("0 1 --outage 5", "outage '5': must be FROM:UNTIL, in numbers of requests, as in 100:200"),
        ("0 1 --outage 1.5:2", "outage from 1.5 until 2.0 requests: must be whole numbers"),
        ("0 1 --outage 2s:1s", "outage from 2.0 until 1.0 s: must begin at 0 or later, and end"),
        ("0 1 --log {}/log.csv", "{}/log.csv: No such file or directory"),
        ("0 x", "TO 'x': must be HOST:PORT, as in 127.0.0.1:5501, or PORT"),
        ("127.0.0.1: 1", "LISTEN '127.0.0.1:': must be HOST:PORT, as in 127.0.0.1:5501, or PORT"),
        ("65536 1", "127.0.0.1:65536: port must be from 0 to 65535"),
        ("0 0", "127.0.0.1:0: port must be from 1 to 65535"),
        ("0 127.0.0.1:65536", "127.0.0.1:65536: port must be from 1 to 65535"),
        ("0 256.0.0.1:1", "256.0.0.1:1: no such host; must be an IPv4 address or a name that has"),
        ("0 1 --seed -1", "Invalid value for '--seed': -1"),
        ("", "Missing argument"),
    ],
)
def test_wrong_input_is_one_line(tmp_path, arguments, said, capsys):
    missing = tmp_path / "missing"
    assert command(*arguments.format(missing).split()) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith(f"grasp-cosim: {said.format(missing)}")
