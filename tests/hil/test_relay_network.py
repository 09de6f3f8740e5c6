"""A bad network without sockets, at invented times: what becomes of each datagram, and counts."""

import math
from collections import Counter

import numpy as np
import pytest
from grasp_cosim.base.errors import InputError
from grasp_cosim.hil.relay import (
    DIRECTIONS,
    Conditions,
    Counters,
    Entry,
    Network,
    Outage,
    Traffic,
)
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from support.marks import examples

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
    st.sampled_from((1, 2, 5, 1000)),
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
            for c in traffic.snapshot().values():
                assert c.received + c.duplicated == c.delivered + c.dropped + c.held

    at = []
    for direction, gap, taken in arriving:
        now += gap
        send_until(now)
        numbers[direction] += 1

        def send(what=(direction, numbers[direction]), taken=taken):
            sent.append((at[-1], *what))
            return taken

        traffic.receive(direction, send, now)
    send_until(math.inf)
    return sent, log, traffic.snapshot()


def expected(net, arriving):
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
                room = len(waiting) < net.capacity
                waiting += [(now + delay, direction, number)] * room
                said = ("held back" if held_back else "passed") if room else "overflow"
                log.append(Entry(direction, number, copy, said, delay / 1e9 if room else None))
    return sent + sorted(waiting, key=lambda w: w[0]), log


@examples(200)
@given(networks, arrivals)
def test_what_is_sent_on_logged_and_counted_is_what_the_fates_say(net, arriving):
    """In the order of due times, of those due at once the first to arrive first."""
    sent, log, counters = relayed(net, arriving)
    assert (sent, log) == expected(net, arriving)
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


def test_fates_stay_what_they_were():
    """A seed in a report of today means the same next year, whatever was asked before."""
    net = network(1, delay=0.001, jitter=0.002, loss=0.3, duplicate=0.3, reorder=0.3)
    for _ in range(2):
        assert [[p.delay_ns for p in net.fate("request", n)] for n in range(1, 9)] == FATES
    assert Network().fate("request", 1) == ((0, False),)
    assert Network().capacity == 4096


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


def test_a_higher_loss_leaves_the_delays_of_the_others():
    few, more = (network(9, jitter=0.1, duplicate=0.3, loss=p) for p in (0.1, 0.5))
    for n in range(1, 500):
        assert more.fate("request", n) in ((), few.fate("request", n))


def test_held_back_is_overtaken():
    """20 ms by default: at 1 ms apart each is overtaken by those of the next 20 ms."""
    sent, log, _ = relayed(network(2, reorder=0.1), [("request", MS, True)] * 300)
    back = [e.number for e in log if e.fate == "held back"]
    assert 10 < len(back) < 60
    order = [n for _, _, n in sent]
    overtaken = [n for i, n in enumerate(order) if max(order[:i], default=0) > n]
    assert sorted(overtaken) == [
        n for n in back if not {*range(n + 1, min(n + 20, 301))} <= {*back}
    ]


@pytest.mark.parametrize(
    ("wrong", "arguments", "said"),
    [
        (Conditions, {"duplicate": -0.1}, "duplicate = -0.1: must be a probability, from 0 to 1"),
        (Conditions, {"reorder": math.nan}, "reorder = nan: must be a probability, from 0 to 1"),
        (Conditions, {"delay": -1e-3}, "delay = -0.001 s: must be from 0 to 1e+06 s"),
        (Conditions, {"jitter": math.inf}, "jitter = inf s: must be from 0 to 1e+06 s"),
        (Conditions, {"reorder_by": 1.1e6}, "reorder_by = 1100000.0 s: must be from 0 to 1e+06 s"),
        (Outage, {"start": 0, "until": 5}, "outage from 0 until 5 requests: must begin at 1 or la"),
        (Outage, {"start": 5, "until": 5}, "outage from 5 until 5 requests: must begin at 1 or la"),
        (Outage, {"start": 2.5, "until": 5}, "outage from 2.5 until 5 requests: must be whole num"),
        (
            Outage, {"start": 0, "until": math.inf, "by": "s"},
            "outage from 0 until inf s: must begin at 0 or later, and end after that",
        ),
        (Network, {"seed": 0.5}, "seed = 0.5: must be a whole number, at least 0"),
        (Network, {"capacity": 0}, "capacity = 0: must be a whole number, at least 1"),
    ],
)  # fmt: skip
def test_wrong_networks(wrong, arguments, said):
    with pytest.raises(InputError) as error:
        wrong(**arguments)
    assert str(error.value).startswith(said)
