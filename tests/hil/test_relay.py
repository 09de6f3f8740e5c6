"""The relay between real sockets on loopback: what comes out is what the fates say, and counts."""

import json
import re
import signal
import socket
import subprocess
import sys
import threading
from contextlib import ExitStack
from csv import DictReader
from dataclasses import asdict
from functools import partial

import pytest
from grasp_cosim import cli
from grasp_cosim.base.errors import InputError
from grasp_cosim.hil.network import DIRECTIONS, Conditions, Network, Outage
from grasp_cosim.hil.relay import Relay
from grasp_cosim.hil.traffic import Counters
from support.ports import kept_port
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


def both(conditions, seed=0, *outages):
    """The same in both directions."""
    return Network(dict.fromkeys(DIRECTIONS, conditions), outages, seed)


def converse(relay, count, at_once=20):
    """Send so many numbered requests, a few at a time; return the replies, in their order."""
    replies = []
    with client() as mine:
        for first in range(0, count, at_once):
            upto = min(first + at_once, count)
            for number in range(first, upto):
                mine.sendto(b"%d" % (number + 1), relay.address)
            wait_until(partial(settled, relay, upto))
            while len(replies) < relay.counters["reply"].delivered:
                replies.append(mine.recv(100))
    return replies


def settled(relay, requests):
    """Whether so many requests and all the replies to them have gone through, or been dropped."""
    request, reply = relay.counters.values()
    arrived = request.received == requests and reply.received == request.delivered
    return arrived and request.held == reply.held == 0


def delivered(relay, requests):
    """Whether so many requests have gone through."""
    return relay.counters["request"].delivered == requests


def test_an_undisturbed_network_passes_all_in_order():
    with EchoPeer() as peer, relaying(peer.address) as relay:
        assert converse(relay, 100) == [b"%d" % n for n in range(1, 101)]
        fine = Counters(received=100, delivered=100)
        assert relay.counters == {"request": fine, "reply": fine}


def test_what_gets_through_and_the_counters_are_those_of_the_fates():
    """Whatever the timing: requests by their content, replies by how many there were."""
    net = both(NASTY, 11)
    log = []
    with EchoPeer() as peer, relaying(peer.address, net, log=log.append) as relay:
        replies = converse(relay, 300)
    request, reply = relay.counters.values()
    fates = {n: net.fate("request", n) for n in range(1, 301)}
    arrived = sorted(int(data) for _, data in peer.received)
    assert arrived == [n for n, fate in fates.items() for _ in fate]
    expected = {
        "request": list(fates.values()),
        "reply": [net.fate("reply", n) for n in range(1, len(arrived) + 1)],
    }
    for direction, counters in relay.counters.items():
        of = expected[direction]
        assert counters == Counters(
            received=len(of), delivered=sum(map(len, of)), lost=of.count(()),
            duplicated=sum(len(f) == 2 for f in of), reordered=counters.reordered,
        )  # fmt: skip
        told = [e.delay for e in log if e.direction == direction and e.delay is not None]
        assert told == [p.delay_ns / 1e9 for f in of for p in f]
    assert len(replies) == reply.delivered
    order = [int(data) for _, data in peer.received]
    assert request.reordered == sum(n < max(order[:i], default=0) for i, n in enumerate(order))
    assert request.reordered > 0


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


def test_an_outage_in_the_middle():
    with EchoPeer() as peer, relaying(peer.address, both(Conditions(), 0, Outage(4, 8))) as relay:
        assert converse(relay, 10, at_once=1) == [b"1", b"2", b"3", b"8", b"9", b"10"]
    assert relay.counters["request"] == Counters(received=10, delivered=6, outage=4)


def test_clients_get_their_own_replies_and_the_peer_can_tell_them_apart():
    with EchoPeer() as peer, relaying(peer.address) as relay, client() as one, client() as other:
        for _ in range(3):
            one.sendto(b"one", relay.address)
            other.sendto(b"other", relay.address)
            assert one.recv(100) == b"one"
            assert other.recv(100) == b"other"
    assert len(peer.received) == 6
    assert len(set(peer.received)) == 2
    assert len({port for port, _ in peer.received}) == 2


def test_it_does_not_relay_to_itself():
    with client() as mine:
        port = mine.getsockname()[1]
    for host in ("127.0.0.1", "0.0.0.0"):
        with pytest.raises(InputError, match=f"127.0.0.1:{port}: is the relay itself; must be"):
            Relay(("127.0.0.1", port), host=host, port=port)


def test_a_port_that_is_taken():
    with EchoPeer() as peer, pytest.raises(InputError) as error:
        Relay(peer.address, port=peer.address[1])
    assert str(error.value) == (
        f"127.0.0.1:{peer.address[1]}: cannot listen there: Address already in use;"
        " must be an address of this machine and a free port, or 0"
    )


@pytest.fixture
def ended(monkeypatch):
    """A relay is interrupted as soon as it runs."""
    monkeypatch.setattr(Relay, "run", lambda _: signal.raise_signal(signal.SIGINT))


def command(*arguments):
    """Run grasp-cosim relay in this process."""
    return cli.main(["relay", *arguments])


@pytest.mark.usefixtures("ended")
def test_the_command_relays_until_it_is_interrupted(capsys):
    assert command("0", "127.0.0.1:5501") == 0
    out, err = capsys.readouterr()
    assert re.fullmatch(r"relaying 127\.0\.0\.1:[1-9][0-9]* -> 127\.0\.0\.1:5501\n", err)
    names, request, reply = out.splitlines()
    assert names.split() == list(asdict(Counters()))
    assert request.split() == ["request"] + ["0"] * 9
    assert reply.split() == ["reply"] + ["0"] * 9


@pytest.mark.usefixtures("ended")
def test_listening_beyond_this_machine_is_said(capsys):
    assert command("0.0.0.0:0", "5501") == 0
    note, listening = capsys.readouterr().err.splitlines()
    where = listening.split()[1]
    assert where.startswith("0.0.0.0:")
    assert note == (
        f"listening beyond this machine: whoever reaches {where} reaches 127.0.0.1:5501"
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--loss", "1.5"], "loss = 1.5: must be a probability, from 0 to 1"),
        (["--delay", "nan"], "delay = nan s: must be from 0 to 1e+06 s"),
        (["--delay", "2:1"], "--delay '2:1': must be S or FROM:TO, in s, the longer last"),
        (["--delay", "1:2:3"], "--delay '1:2:3': must be S or FROM:TO, in s, the longer last"),
        (
            ["--outage", "5"],
            "outage '5': must be FROM:UNTIL, in numbers of requests, as in 100:200, or in s, as in "
            "0.5s:2s",
        ),
        (["--outage", "1.5:2"], "outage from 1.5 until 2.0 requests: must be whole numbers"),
        (
            ["--outage", "2s:1s"],
            "outage from 2.0 until 1.0 s: must begin at 0 or later, and end after that",
        ),
    ],
)
def test_wrong_input_is_one_line(arguments, said, capsys):
    assert command("0", "5501", *arguments) == 2
    assert capsys.readouterr() == ("", f"grasp-cosim: {said}\n")


@pytest.mark.parametrize(
    ("listen", "to", "said"),
    [
        ("0", "x", "TO 'x': must be HOST:PORT, as in 127.0.0.1:5501, or PORT"),
        ("127.0.0.1:", "5501", "LISTEN '127.0.0.1:': must be HOST:PORT, as in 127.0.0.1:5501, or "),
        ("65536", "5501", "127.0.0.1:65536: port must be from 0 to 65535"),
        ("0", "0", "127.0.0.1:0: port must be from 1 to 65535"),
        ("0", "127.0.0.1:65536", "127.0.0.1:65536: port must be from 1 to 65535"),
        ("0", "256.0.0.1:1", "256.0.0.1:1: no such host; must be an IPv4 address or a name that"),
    ],
)
def test_a_wrong_address_is_one_line(listen, to, said, capsys):
    assert command(listen, to) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith(f"grasp-cosim: {said}")


@pytest.mark.parametrize(
    "arguments",
    [[], ["0"], ["0", "1", "--seed", "-1"]],
)
def test_what_click_refuses_is_one_line(arguments, capsys):
    assert command(*arguments) == 2
    out, err = capsys.readouterr()
    assert not out
    assert len(err.splitlines()) == 1


def test_a_log_that_cannot_be_written(tmp_path, capsys):
    path = tmp_path / "missing" / "log.csv"
    assert command("0", "5501", "--log", str(path)) == 2
    assert capsys.readouterr().err == f"grasp-cosim: {path}: No such file or directory\n"


@pytest.fixture
def started(tmp_path):
    """Starts the command as a process; returns it and where it listens. Ends what is left."""
    with ExitStack() as stack:

        def start(*arguments):
            process = stack.enter_context(
                subprocess.Popen(
                    [sys.executable, "-m", "grasp_cosim", "relay", *arguments],
                    stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
                )
            )  # fmt: skip
            stack.callback(process.kill)
            assert process.stderr
            said = process.stderr.readline().split()
            assert said[0] == "relaying"
            host, port = said[1].split(":")
            return process, (host, int(port))

        yield start


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_it_with_counters_and_log(started, tmp_path):
    """As a process of its own: the log is that of the fates, the counters are those of the log."""
    path = tmp_path / "log.csv"
    chances = "--loss 0.3 --delay 0:0.002 --duplicate 0.3 --reorder 0.2 --seed 7"
    options = [*chances.split(), "--log", str(path), "--json"]
    conditions = Conditions(jitter=0.002, loss=0.3, duplicate=0.3, reorder=0.2)
    net = both(conditions, 7)
    with EchoPeer() as peer, client() as mine:
        to = f"127.0.0.1:{peer.address[1]}"
        process, address = started("0", to, *options)
        expected = 0
        for number in range(1, 41):
            mine.sendto(b"%d" % number, address)
            expected += len(net.fate("request", number))
        wait_until(lambda: len(peer.received) == expected)
        for number in range(1, expected + 1):
            for _ in net.fate("reply", number):
                mine.recv(100)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert (process.returncode, err) == (0, "")
    report = json.loads(out)
    assert {k: report.pop(k) for k in ("listening", "to", "seed")} == {
        "listening": f"127.0.0.1:{address[1]}", "to": to, "seed": 7,
    }  # fmt: skip
    assert list(report) == list(DIRECTIONS)
    with path.open(newline="") as file:
        rows = list(DictReader(file))
    for direction in DIRECTIONS:
        of = [row for row in rows if row["direction"] == direction]
        received = 40 if direction == "request" else expected
        assert [row["delay"] for row in of] == [
            delay
            for n in range(1, received + 1)
            for delay in ([str(p.delay_ns / 1e9) for p in net.fate(direction, n)] or [""])
        ]
        counts = report[direction]
        assert counts["received"] == len({row["number"] for row in of}) == received
        assert counts["lost"] == counts["dropped"] == sum(row["fate"] == "lost" for row in of)
        assert counts["duplicated"] == sum(row["copy"] == "1" for row in of)
        assert counts["delivered"] == sum(row["delay"] != "" for row in of)
        assert counts["held"] == 0
