"""The relay: a bad network at invented times, then between real sockets on loopback.

What comes out, and what is counted, is what the fates say.
"""

import json
import math
import re
import signal
import socket
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from csv import DictReader
from dataclasses import asdict
from functools import partial
from unittest.mock import patch

import numpy as np
import pytest
from grasp_cosim import cli
from grasp_cosim.base.errors import InputError
from grasp_cosim.hil import traffic as traffic_module
from grasp_cosim.hil.network_conditions import DIRECTIONS, Conditions, Network, Outage, damaged
from grasp_cosim.hil.relay import MAX_CLIENTS, Relay
from grasp_cosim.hil.traffic import MAX_HELD, Counters, Entry, Traffic
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from support.marks import examples
from support.processes import kept_port
from support.proxies import relaying, wait_until

MANY = 20_000
MS = 1_000_000
FATES = [[], [], [2921135], [2356986], [22230371], [1515930], [22747737, 1062552], [22415540]]
"""Delays in ns of the first requests of seed 1."""

probabilities = st.floats(0.0, 1.0)
times = st.sampled_from((0.0, 0.001, 0.002)) | st.floats(0.0, 0.1)
gaps = st.integers(0, 5).map(lambda n: n * MS) | st.integers(0, 30 * MS)
conditions = st.builds(Conditions, times, times, probabilities, probabilities, probabilities, times)
outages = st.builds(
    lambda by, start, length: (
        Outage(start + 1, start + 1 + length)
        if by == "requests"
        else Outage(start / 1000, (start + length) / 1000, "s")
    ),
    st.sampled_from(("requests", "s")), st.integers(0, 20), st.integers(1, 20),
)  # fmt: skip
networks = st.builds(
    lambda request, reply, *rest: Network({"request": request, "reply": reply}, *rest),
    conditions, conditions, st.lists(outages, max_size=2).map(tuple), st.integers(0, 2**70),
)  # fmt: skip
arrivals = st.lists(st.tuples(st.sampled_from(DIRECTIONS), gaps, st.booleans()), max_size=60)
"""Direction, ns since the arrival before, and whether this machine will send it on."""


def network(seed=0, **request):
    """One that disturbs requests only."""
    return Network({"request": Conditions(**request), "reply": Conditions()}, seed=seed)


def relayed(net, arriving):
    """What was sent on (when, direction, number), the log, and the counters, at the end."""
    log, sent = [], []
    traffic = Traffic(net, log.append)
    now, numbers = 0, Counter()

    def send_until(end):
        while (due := traffic.next_due()) is not None and due <= end:
            at.append(due)
            traffic.send_due(due)
            for c in traffic.counters.values():
                assert c.received + c.duplicated == c.delivered + c.dropped + c.held

    at = []
    for direction, gap, taken in arriving:
        now += gap
        send_until(now)
        numbers[direction] += 1

        def send(_, what=(direction, numbers[direction]), taken=taken):
            sent.append((at[-1], *what))
            return taken

        traffic.receive(direction, b"", send, now)
    send_until(math.inf)
    return sent, log, traffic.counters


def expected(net, arriving, most):
    """The same by a list of what is under way, which is looked through at each arrival."""
    now, begin, seen, waiting, sent, log = 0, None, Counter(), [], [], []
    for direction, gap, _ in arriving:
        now += gap
        begin = now if begin is None else begin
        sent += sorted((w for w in waiting if w[0] <= now), key=lambda w: w[0])
        waiting = [w for w in waiting if w[0] > now]
        seen[direction] += 1
        number = seen[direction]
        place = {"requests": seen["request"], "s": (now - begin) / 1e9}
        fate = net.fate(direction, number)
        if any(o.start <= place[o.by] < o.until for o in net.outages):
            log.append(Entry(direction, number, 0, "outage", None))
        elif not fate:
            log.append(Entry(direction, number, 0, "lost", None))
        else:
            for copy, (delay, held_back) in enumerate(fate):
                room = len(waiting) < most
                waiting += [(now + delay, direction, number)] * room
                said = ("held back" if held_back else "passed") if room else "overflow"
                log.append(Entry(direction, number, copy, said, delay / 1e9 if room else None))
    return sent + sorted(waiting, key=lambda w: w[0]), log


@examples(200)
@given(networks, arrivals, st.sampled_from((1, 2, 5, 1000)))
def test_what_is_sent_on_logged_and_counted_is_what_the_fates_say(net, arriving, most):
    """In the order of due times, of those due at once the first to arrive first."""
    with patch.object(traffic_module, "MAX_HELD", most):
        sent, log, counters = relayed(net, arriving)
    assert (sent, log) == expected(net, arriving, most)
    for direction, c in counters.items():
        taken = [t for d, _, t in arriving if d == direction]
        through = [n for _, d, n in sent if d == direction and taken[n - 1]]
        fates = Counter(e.fate for e in log if e.direction == direction)
        assert c == Counters(
            received=len(taken), delivered=len(through), lost=fates["lost"],
            outage=fates["outage"], overflow=fates["overflow"],
            duplicated=sum(e.copy for e in log if e.direction == direction),
            unsent=sum(d == direction and not taken[n - 1] for _, d, n in sent),
            reordered=sum(n < max(through[:i], default=0) for i, n in enumerate(through)),
        )  # fmt: skip
        assert c.dropped == c.lost + c.outage + c.overflow + c.unsent


def test_each_direction_has_conditions_and_outages_of_its_own():
    """Half a link: requests arrive, answers do not from 0.5 s on, nor in between."""
    conditions = {"request": Conditions(loss=0.5), "reply": Conditions()}
    outages = (Outage(0.5, math.inf, "s", "reply"), Outage(0.1, 0.2, "s", "reply"))
    net = Network(conditions, outages, 3)
    arriving = [(d, 10_000_000, True) for _ in range(50) for d in DIRECTIONS]
    sent, log, counters = relayed(net, arriving)
    assert counters["request"].outage == 0
    assert 10 < counters["request"].lost < 40
    assert counters["reply"].lost == 0
    through = [e.number for e in log if e.direction == "reply" and e.fate == "passed"]
    assert through == [n for n in range(1, 51) if not 0.1 <= 0.02 * n - 0.01 < 0.2 and n < 26]
    assert len(sent) == counters["request"].delivered + counters["reply"].delivered


def test_a_datagram_that_is_corrupted_has_another_bit():
    """Always the same one for the same seed."""
    net = Network({"request": Conditions(corrupt=0.4), "reply": Conditions()}, seed=2)
    data = bytes(range(20))
    traffic, through = Traffic(net), []
    for number in range(1, 201):
        traffic.receive("request", data, lambda d: through.append(d) or True, number)
        traffic.receive("reply", data, lambda d: d == data, number)
    traffic.send_due(1000)
    wrong = [int.from_bytes(bytes(a ^ b for a, b in zip(d, data, strict=True))) for d in through]
    assert all(bits.bit_count() <= 1 for bits in wrong)
    assert traffic.counters["request"].corrupted == sum(bits > 0 for bits in wrong) > 60
    assert len({*wrong}) > 40
    assert (traffic.counters["reply"].corrupted, traffic.counters["reply"].unsent) == (0, 0)
    again = [damaged(data, net.damage("request", n)) for n in range(1, 201)]
    assert again == through


@pytest.mark.parametrize(
    ("text", "outage"),
    [
        ("100:200", Outage(100, 200)),
        ("0.5s:2s", Outage(0.5, 2.0, "s")),
        ("answers:0.9s:", Outage(0.9, math.inf, "s", "reply")),
        ("requests:3:", Outage(3, math.inf, "requests", "request")),
    ],
)
def test_outages_as_texts(text, outage):
    assert Outage.read(text) == outage


def test_fates_stay_what_they_were():
    """A seed in a report of today means the same next year, whatever was asked before."""
    net = network(1, delay=0.001, jitter=0.002, loss=0.3, duplicate=0.3, reorder=0.3)
    for _ in range(2):
        assert [[p.delay_ns for p in net.fate("request", n)] for n in range(1, 9)] == FATES
    assert Network().fate("request", 1) == ((0, False),)
    assert network(reorder=1.0).fate("request", 1) == ((20 * MS, True),)


@pytest.mark.parametrize("probability", [0.01, 0.9])
@pytest.mark.parametrize("direction", DIRECTIONS)
def test_frequencies_are_those_asked_for(probability, direction):
    """Losses, copies and datagrams held back, each within what a binomial count allows."""
    p = probability
    asked = Conditions(loss=p, duplicate=p, reorder=p)
    net = Network(dict.fromkeys(DIRECTIONS, asked), seed=3)
    fates = [net.fate(direction, n) for n in range(1, MANY + 1)]
    through = [f for f in fates if f]
    for count, of in (
        (fates.count(()), MANY),
        (sum(len(f) == 2 for f in through), len(through)),
        (sum(f[0].held_back for f in through), len(through)),
    ):
        assert stats.binomtest(count, of, p).pvalue > 1e-3
    lost = np.array([not f for f in fates])
    runs = np.count_nonzero(lost[1:] != lost[:-1])  # neighbours are independent
    assert stats.binomtest(int(runs), MANY - 1, 2 * p * (1 - p)).pvalue > 1e-3


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"duplicate": -0.1}, "duplicate = -0.1: must be a probability, from 0 to 1"),
        ({"reorder": math.nan}, "reorder = nan: must be a probability, from 0 to 1"),
        ({"jitter": -1e-3}, "jitter = -0.001 s: must be from 0 to 1e+06 s"),
        ({"reorder_by": 1.1e6}, "reorder_by = 1100000.0 s: must be from 0 to 1e+06 s"),
        ({"start": 0, "until": 5}, "outage from 0 until 5 requests: must begin at 1 or later"),
        ({"start": 5, "until": 5}, "outage from 5 until 5 requests: must begin at 1 or later"),
        (
            {"start": -1, "until": math.inf, "by": "s"},
            "outage from -1 until inf s: must begin at 0",
        ),
        ({"seed": 0.5}, "seed = 0.5: must be a whole number, at least 0"),
    ],
)
def test_a_wrong_network_is_one_line(wrong, said):
    kind = Network if "seed" in wrong else Outage if "start" in wrong else Conditions
    with pytest.raises(InputError) as error:
        kind(**wrong)
    assert str(error.value).startswith(said)


# ------------------------------------------------------------------------- between sockets


@contextmanager
def echoing(port=0):
    """A peer that echoes: its address, and what it received, as (sender's port, data)."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer, ThreadPoolExecutor(1) as pool:
        peer.bind(("127.0.0.1", port))
        address, heard = peer.getsockname(), []

        def echo():
            while (found := peer.recvfrom(65_535))[1] != address:
                heard.append((found[1][1], found[0]))
                peer.sendto(*found)

        pool.submit(echo)
        try:
            yield address, heard
        finally:
            peer.sendto(b"", address)


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
        echoing() as (peer, heard),
        relaying(peer, net, log=log.append) as relay,
        client() as mine,
    ):
        for upto in range(20, 320, 20):  # a few at a time
            for number in range(upto - 19, upto + 1):
                mine.sendto(b"%d" % number, relay.address)
            wait_until(partial(settled, relay, upto))
            while replies < relay.counters["reply"].delivered:
                replies += bool(mine.recv(100))
    fates = {n: net.fate("request", n) for n in range(1, 301)}
    order = [int(data) for _, data in heard]
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
        with echoing(port):
            mine.sendto(b"here", relay.address)
            assert mine.recv(100) == b"here"
        for number in range(2, 6):
            mine.sendto(b"away", relay.address)
            wait_until(partial(delivered, relay, number))
        with echoing(port):
            mine.sendto(b"back", relay.address)
            assert mine.recv(100) == b"back"
    assert relay.counters["request"] == Counters(received=6, delivered=6)
    assert relay.counters["reply"] == Counters(received=2, delivered=2)


def test_clients_get_their_own_replies_and_the_one_silent_for_longest_is_forgotten():
    """The peer can tell them apart: one who comes back after many others is another to it."""
    with echoing() as (peer, heard), relaying(peer) as relay, client() as one:
        for number in range(MAX_CLIENTS + 1):
            with client() as other:
                for mine, data in ((other, b"%d" % number), (one, b"one")):
                    mine.sendto(data, relay.address)
                    assert mine.recv(100) == data
        assert len(relay._clients) == MAX_CLIENTS
    ports = {data: {port for port, own in heard if own == data} for _, data in heard}
    assert len(ports) == MAX_CLIENTS + 2
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
        [*asdict(Counters())], ["request", *"0000000000"], ["reply", *"0000000000"],
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
                relay._traffic.receive(direction, b"", lambda _: True, number)
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


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ("0 1 --loss 1.5", "loss = 1.5: must be a probability, from 0 to 1"),
        ("0 1 --delay nan", "delay = nan s: must be from 0 to 1e+06 s"),
        ("0 1 --delay 2:1", "--delay '2:1': must be S or FROM:TO, in s, the longer last"),
        ("0 1 --requests loss=2", "loss = 2.0: must be a probability, from 0 to 1"),
        (
            "0 1 --answers lost=0.1",
            "--answers lost=0.1: must be delay, loss, duplicate,",
        ),
        ("0 1 --answers loss", "--answers 'loss': must be like loss=0.1,delay=0.001"),
        ("0 1 --corrupt 2", "corrupt = 2.0: must be a probability, from 0 to 1"),
        ("0 1 --outage 5", "outage '5': must be FROM:UNTIL, in numbers of requests, as in 100:200"),
        ("0 1 --outage 1.5:2", "outage from 1.5 until 2.0 requests: must be whole numbers"),
        ("0 1 --outage 2s:1s", "outage from 2.0 until 1.0 s: must begin at 0 or later, and end"),
        ("0 1 --log {}/log.csv", "{}/log.csv: No such file or directory"),
        ("0 x", "TO 'x': must be HOST:PORT, as in 127.0.0.1:5501 or [::1]:5501, or PORT"),
        ("65536 1", "127.0.0.1:65536: port must be from 0 to 65535"),
        ("0 127.0.0.1:65536", "127.0.0.1:65536: port must be from 1 to 65535"),
        ("0 256.0.0.1:1", "256.0.0.1:1: no such address; must be an IP address or a name that has"),
        ("0 1 --seed -1", "Invalid value for '--seed': -1"),
    ],
)
def test_wrong_input_is_one_line(tmp_path, arguments, said, capsys):
    missing = tmp_path / "missing"
    assert command(*arguments.format(missing).split()) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith(f"grasp-cosim: {said.format(missing)}")


@pytest.mark.parametrize("counted", [(0, 0, 0, 0), (1, 2, 3, 4), (0, 5, 7, 0), (3, 0, 0, 2)])
def test_what_is_dropped_is_all_that_does_not_get_through(counted):
    lost, outage, overflow, unsent = counted
    counters = Counters(9, 9, 9, 9, 9, lost, outage, overflow, unsent, 9)
    assert counters.dropped == sum(counted)


def test_of_more_than_can_be_under_way_the_newest_are_dropped():
    traffic, sent = Traffic(Network(dict.fromkeys(DIRECTIONS, Conditions(delay=1.0)))), []
    for number in range(MAX_HELD + 3):
        traffic.receive("request", str(number).encode(), lambda d: sent.append(d) or True, 0)
    counters = traffic.counters["request"]
    assert (counters.held, counters.overflow, counters.received) == (MAX_HELD, 3, MAX_HELD + 3)
    assert traffic.next_due() == 10**9
    traffic.send_due(10**9 - 1)
    assert sent == []
    traffic.send_due(10**9)
    assert sent == [str(number).encode() for number in range(MAX_HELD)]
    assert (traffic.next_due(), counters.held, counters.delivered) == (None, 0, MAX_HELD)


@pytest.mark.parametrize(("start", "until"), [(1.5, 2.0), (1.0, 2.5), (0.5, math.inf)])
def test_requests_are_counted_in_whole_numbers(start, until):
    with pytest.raises(InputError, match=r"^outage from .* requests: must be whole numbers$"):
        Outage(start, until)
    assert Outage(start, until, "s").until == until
    assert Outage(1.0, math.inf).is_of("request", 10**9, 0.0)
