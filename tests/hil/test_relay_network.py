"""The fates of datagrams, and what becomes of them: without sockets, at invented times."""

import math
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim.base.errors import InputError
from grasp_cosim.hil.network import DIRECTIONS, Conditions, Network, Outage
from grasp_cosim.hil.traffic import Counters, Traffic
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from support.marks import examples

QUICK = examples(100)
MANY = 20_000
MS = 1_000_000
FATES = [[], [], [2921135], [2356986], [22230371], [1515930], [22747737, 1062552], [22415540]]
"""Delays in ns of the first requests of seed 1."""

probabilities = st.floats(0.0, 1.0)
times = st.floats(0.0, 0.1)
conditions = st.builds(Conditions, times, times, probabilities, probabilities, probabilities, times)
networks = st.builds(
    lambda request, reply, seed, capacity: Network(
        {"request": request, "reply": reply}, seed=seed, capacity=capacity
    ),
    conditions, conditions, st.integers(0, 2**70), st.integers(1, 50),
)  # fmt: skip
arrivals = st.lists(st.tuples(st.sampled_from(DIRECTIONS), st.integers(0, 30 * MS)), max_size=60)
"""Direction, and ns since the arrival before."""


def network(seed=0, **request):
    """One that disturbs requests only."""
    return Network({"request": Conditions(**request), "reply": Conditions()}, seed=seed)


def relayed(net, arriving):
    """What was delivered (when, direction, number), the log, and the counters at the end.

    What is due is delivered before each arrival, and at the end, at the time when it is due.
    """
    log = []
    traffic = Traffic[None](net, log.append)
    delivered = []

    def deliver(until):
        while (due := traffic.next_due()) is not None and due <= until:
            held = traffic.take(due)
            assert held is not None
            assert held.data == b"%d" % held.number
            delivered.append((due, held.direction, held.number))
            traffic.settle(held, sent=True)

    now = 0
    counts = Counter()
    for direction, gap in arriving:
        deliver(now + gap)
        now += gap
        counts[direction] += 1
        traffic.receive(direction, b"%d" % counts[direction], None, now)
        check_sums(traffic.snapshot().values())
    deliver(math.inf)
    return delivered, log, traffic.snapshot()


def check_sums(counters):
    """Every datagram and every copy is in exactly one place."""
    for c in counters:
        assert c.dropped == c.lost + c.outage + c.overflow + c.unsent
        assert c.received + c.duplicated == c.delivered + c.dropped + c.held


def one_by_one(count, gap=MS):
    """So many requests, gap ns apart."""
    return [("request", gap)] * count


@QUICK
@given(networks, st.integers(1, 2**40), st.sampled_from(DIRECTIONS))
def test_a_fate_is_a_function_of_seed_direction_and_number(net, number, direction):
    for other in (number + 1, 1, number):
        net.fate(direction, other)
    again = Network(dict(net.conditions), net.outages, net.seed, 7)
    assert again.fate(direction, number) == net.fate(direction, number)


def test_fates_stay_what_they_were():
    """A seed in a report of today means the same next year."""
    net = network(1, delay=0.001, jitter=0.002, loss=0.3, duplicate=0.3, reorder=0.3)
    assert [[p.delay_ns for p in net.fate("request", n)] for n in range(1, 9)] == FATES


@QUICK
@given(networks, arrivals)
def test_what_arrives_in_between_and_when_changes_no_fate(net, arriving):
    """The log of requests alone, all at once, is that of requests among replies at any times."""
    roomy = replace(net, capacity=1000)
    requests = [d for d, _ in arriving].count("request")
    mixed = [e for e in relayed(roomy, arriving)[1] if e.direction == "request"]
    assert mixed == relayed(roomy, one_by_one(requests, 0))[1]


@QUICK
@given(networks, arrivals)
def test_deliveries_are_those_of_the_fates_in_the_order_of_due_times(net, arriving):
    roomy = replace(net, capacity=1000)
    delivered, _, counters = relayed(roomy, arriving)
    now, expected = 0, []
    counts = Counter()
    for direction, gap in arriving:
        now += gap
        counts[direction] += 1
        expected += [
            (now + p.delay_ns, direction, counts[direction])
            for p in net.fate(direction, counts[direction])
        ]
    assert delivered == sorted(expected, key=lambda d: d[0])  # stable: ties by arrival
    for direction, c in counters.items():
        numbers = [n for _, d, n in delivered if d == direction]
        fates = [net.fate(direction, n) for n in range(1, counts[direction] + 1)]
        late = sum(n < max(numbers[:i], default=0) for i, n in enumerate(numbers))
        assert c == Counters(
            received=counts[direction], delivered=len(numbers), lost=fates.count(()),
            duplicated=sum(len(f) == 2 for f in fates), reordered=late,
        )  # fmt: skip


def test_of_those_due_at_once_the_first_to_arrive_is_the_first_delivered():
    net = network(delay=0.001, duplicate=1.0)
    numbers = [n for _, _, n in relayed(net, one_by_one(5, 0))[0]]
    assert numbers == [1, 1, 2, 2, 3, 3, 4, 4, 5, 5]


@QUICK
@given(networks, arrivals)
def test_never_more_under_way_than_there_is_room_for(net, arriving):
    """The sums hold after every arrival, too; the log says what there was no room for."""
    delivered, log, counters = relayed(net, arriving)
    check_sums(counters.values())
    fates = Counter(e.fate for e in log)
    assert fates["overflow"] == sum(c.overflow for c in counters.values())
    assert fates["passed"] + fates["held back"] == len(delivered)


def test_what_this_machine_refuses_to_send_is_counted():
    traffic = Traffic[str](network())
    traffic.receive("request", b"x", "somewhere", 5)
    held = traffic.take(5)
    assert held is not None
    assert (held.data, held.route) == (b"x", "somewhere")
    traffic.settle(held, sent=False)
    assert traffic.counters["request"] == Counters(received=1, unsent=1)


@pytest.mark.parametrize("probability", [0.01, 0.2, 0.9])
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
    net = network(2, reorder=0.1)
    delivered, log, counters = relayed(net, one_by_one(300))
    back = [e.number for e in log if e.fate == "held back"]
    assert 10 < len(back) < 60
    order = [n for _, _, n in delivered]
    assert sorted(order) == list(range(1, 301))
    overtaken = [n for i, n in enumerate(order) if max(order[:i], default=0) > n]
    assert counters["request"].reordered == len(overtaken)
    assert sorted(overtaken) == [
        n for n in back if not {*range(n + 1, min(n + 20, 301))} <= {*back}
    ]


def test_an_outage_by_numbers_of_requests():
    """Replies, too, from the arrival of request 3 until that of request 5."""
    net = Network(outages=(Outage(3, 5), Outage(7, 8)))
    both = [("request", 0), ("reply", 0)]
    delivered, log, counters = relayed(net, both * 8)
    assert [n for _, d, n in delivered if d == "request"] == [1, 2, 5, 6, 8]
    assert [n for _, d, n in delivered if d == "reply"] == [1, 2, 5, 6, 8]
    assert counters["request"] == counters["reply"] == Counters(received=8, delivered=5, outage=3)
    out = [e for e in log if e.fate == "outage"]
    assert [e.number for e in out] == [3, 3, 4, 4, 7, 7]
    assert {e.delay for e in out} == {None}


def test_an_outage_in_seconds_begins_at_the_first_datagram():
    net = Network(outages=(Outage(0.002, 0.004, "s"),))
    delivered, _, counters = relayed(net, one_by_one(6))
    assert [n for _, _, n in delivered] == [1, 2, 5, 6]
    assert counters["request"].outage == 2


def test_what_was_under_way_before_an_outage_arrives():
    net = replace(network(delay=0.0025), outages=(Outage(2, 6),))
    assert [n for _, _, n in relayed(net, one_by_one(6))[0]] == [1, 6]


def test_an_outage_takes_no_fate_away_from_those_after_it():
    net = network(4, jitter=0.001, loss=0.2)
    fine = relayed(net, one_by_one(100))[1]
    out = relayed(replace(net, outages=(Outage(20, 40),)), one_by_one(100))[1]
    assert [e for e in out if e.fate != "outage"] == [e for e in fine if not 20 <= e.number < 40]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"loss": 1.01}, "loss = 1.01: must be a probability, from 0 to 1"),
        ({"duplicate": -0.1}, "duplicate = -0.1: must be a probability, from 0 to 1"),
        ({"reorder": math.nan}, "reorder = nan: must be a probability, from 0 to 1"),
        ({"delay": -1e-3}, "delay = -0.001 s: must be from 0 to 1e+06 s"),
        ({"jitter": math.inf}, "jitter = inf s: must be from 0 to 1e+06 s"),
        ({"reorder_by": math.nan}, "reorder_by = nan s: must be from 0 to 1e+06 s"),
    ],
)
def test_wrong_conditions(wrong, said):
    with pytest.raises(InputError) as error:
        Conditions(**wrong)
    assert str(error.value) == said


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((0, 5), "0 until 5 requests: must begin at 1 or later, and end after that"),
        ((5, 5), "5 until 5 requests: must begin at 1 or later, and end after that"),
        ((2.5, 5), "2.5 until 5 requests: must be whole numbers"),
        ((2, 1, "s"), "2 until 1 s: must begin at 0 or later, and end after that"),
        ((0, math.inf, "s"), "0 until inf s: must begin at 0 or later, and end after that"),
        ((math.nan, 1, "s"), "nan until 1 s: must begin at 0 or later, and end after that"),
    ],
)
def test_wrong_outages(arguments, said):
    with pytest.raises(InputError) as error:
        Outage(*arguments)
    assert str(error.value) == f"outage from {said}"


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"seed": -1}, "seed = -1: must be a whole number, at least 0"),
        ({"seed": 0.5}, "seed = 0.5: must be a whole number, at least 0"),
        ({"capacity": 0}, "capacity = 0: must be a whole number, at least 1"),
    ],
)
def test_wrong_networks(wrong, said):
    with pytest.raises(InputError) as error:
        Network(**wrong)
    assert str(error.value) == said
