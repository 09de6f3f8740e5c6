"""The peer in Python, without any network: each datagram is handed over by hand.

That the peer in C does the same to the byte is in test_bench_header.py.
"""

import pytest
from grasp_fmus.link.message import (
    BUSY,
    END,
    FAILED,
    HEAD,
    HELLO,
    INITIALISE,
    LONGEST_STEP,
    OTHER_INTERFACE,
    OTHER_VERSION,
    OUTPUTS,
    STEP,
    TAG_SIZE,
    UNKNOWN,
    VERSION,
    LinkVariable,
    Message,
    Sealer,
    Signature,
)
from grasp_fmus.link.peer import ALIVE, TOO_LONG, Peer, Request
from hypothesis import given
from hypothesis import strategies as st
from support.proxies import HandProxy, RefusedError

U = LinkVariable("u", "Real", "input", "m")
P = LinkVariable("p", "Boolean", "parameter")
Y = LinkVariable("y", "Real", "output", "N")
SIGNATURE = Signature((U, P, Y))
KEY = b"sixteen bytes...", b"another 16 bytes"
VALUES = [0.5, True]


class Bench:
    """A peer whose model puts out what comes in, and its clock."""

    def __init__(self, key=None):
        self.peer = Peer(SIGNATURE, key)
        self.done = []
        self.now = 5 * ALIVE

    def __call__(self, datagram):
        action = self.peer.receive(datagram, self.now)
        if not isinstance(action, Request):
            return action
        self.done.append(action)
        if action.kind == END:
            return None
        return self.peer.outputs([action.values[0]], action.time + action.step)

    def proxy(self, signature=SIGNATURE, key=None):
        return HandProxy(signature, self, key)

    def begun(self, session=99):
        """A proxy that is about to step."""
        proxy = self.proxy()
        proxy.begin(session, VALUES)
        return proxy

    def counts(self):
        found = {name: getattr(self.peer.counters, name) for name in self.peer.counters.__slots__}
        return {name: n for name, n in found.items() if n}


def refused(call, *arguments):
    """Code and reason."""
    with pytest.raises(RefusedError) as error:
        call(*arguments)
    code, reason = error.value.args
    return code, reason


def test_a_session_from_hello_to_end():
    bench = Bench()
    proxy = bench.begun()
    proxy.initialise(0.0, [3.0, True])
    assert proxy.step(0.0, 0.1, [2.0, False]) == [2.0]
    assert proxy.outputs_time == 0.1
    proxy.end()
    assert bench.done == [
        Request(INITIALISE, 0.0, 0.0, VALUES, fresh=True),
        Request(INITIALISE, 0.0, 0.0, [3.0, True], fresh=False),
        Request(STEP, 0.0, 0.1, [2.0, False], fresh=False),
        Request(END, 0.0, 0.0, [], fresh=False),
    ]
    assert bench.counts() == {"steps": 1, "initialisations": 2}


def test_what_is_repeated_is_answered_again_and_done_once():
    bench = Bench()
    proxy = bench.proxy()
    hello = proxy.hello(99)
    welcome = bench(hello)
    assert welcome == bench(hello)
    proxy.take(welcome)
    request = proxy.request(INITIALISE, 0.0, VALUES)
    assert bench(request) == bench(request)
    step, overtaken = (proxy.request(STEP, 0.1 * k, VALUES, 0.1) for k in (1, 0))
    assert bench(step)
    assert bench(step) is None
    proxy._sequence = 1
    assert bench(proxy.pack(STEP, step=0.1, body=bytes(16))) is None
    assert bench(overtaken)
    once = dict.fromkeys(("initialisations", "repeated", "duplicated", "stale"), 1)
    assert bench.counts() == {**once, "steps": 2}


def test_a_live_session_keeps_others_away_until_it_is_silent():
    bench = Bench()
    first = bench.begun(session=1)
    bench.now += ALIVE - 1
    assert refused(bench.begun, 2) == (BUSY, "")
    recorded = first.request(STEP, 0.0, VALUES, 0.1)
    bench(recorded)
    for _ in range(4):  # which keeps nobody away, sent again
        bench.now += ALIVE // 4
        bench(recorded)
    for session in range(2, 500):  # a HELLO alone changes nothing
        bench(bench.proxy().hello(session))
    first.step(0.1, 0.1, VALUES)
    bench.now += ALIVE
    second = bench.begun(session=2)
    assert refused(first.step, 0.2, 0.1, VALUES) == (UNKNOWN, "")
    second.step(0.0, 0.1, VALUES)


def test_of_two_that_were_greeted_the_later_one_is_greeted_anew():
    bench = Bench()
    late = bench.proxy()
    late.take(bench(late.hello(2)))
    bench.begun(session=1).end()
    assert refused(late.initialise, 0.0, VALUES) == (UNKNOWN, "")
    late.begin(2, VALUES)


def test_a_recorded_session_cannot_be_played_again():
    bench = Bench(KEY[0])
    proxy = bench.proxy(key=KEY[0])
    recorded = [proxy.hello(99)]
    proxy.take(bench(recorded[0]))
    recorded += [proxy.request(INITIALISE, 0.0, VALUES), proxy.request(STEP, 0.0, VALUES, 0.1)]
    for datagram in recorded[1:]:
        assert bench(datagram)
    done = list(bench.done)
    for datagram in recorded:  # while it is under way
        bench(datagram)
    proxy.end()
    bench.now += 5 * ALIVE
    for datagram in recorded:  # and after its end
        bench(datagram)
    assert bench.done[:-1] == done


@pytest.mark.parametrize(
    ("keys", "counter"),
    [((KEY[0], KEY[1]), "forged"), ((KEY[0], None), "forged"), ((None, KEY[0]), "malformed")],
)
def test_without_the_key_there_is_no_answer(keys, counter):
    bench = Bench(keys[0])
    assert bench(bench.proxy(key=keys[1]).hello(1)) is None
    assert bench.counts() == {counter: 1}


@pytest.mark.parametrize("key", [None, KEY[0]])
def test_another_version_or_interface_is_refused_with_its_reason(key):
    bench = Bench(key)
    proxy = bench.proxy(key=key)
    answer = bench(proxy.hello(1, version=VERSION + 1)) or b""
    opened = Sealer(key).open(answer)
    assert isinstance(opened, Message)
    assert (opened.code, opened.version) == (OTHER_VERSION, VERSION)
    assert len(answer) == HEAD.size + (TAG_SIZE if key else 0)
    other = bench.proxy(Signature((U._replace(name="µ"), Y)), key)
    reason = "the proxy has input Real m ?, the peer input Real m u"
    assert refused(other.begin, 2, [0.0]) == (OTHER_INTERFACE, reason)
    assert bench.counts() == {"foreign": 1, "other_version": 1}


def test_a_failure_ends_the_session_and_says_why_until_it_was_heard():
    bench = Bench()
    proxy = bench.proxy()
    proxy.take(bench(proxy.hello(1)))
    request = proxy.request(INITIALISE, 0.0, VALUES)
    assert isinstance(bench.peer.receive(request, bench.now), Request)
    refusal = bench.peer.failed("no power, " * 200)
    assert refused(proxy.take, refusal) == (FAILED, ("no power, " * 200)[:1024])
    again = bench(request) or b""
    assert len(again) == len(request)
    assert refused(proxy.take, again) == (FAILED, "no power, no pow")
    assert bench.counts() == {"initialisations": 1, "repeated": 1}
    assert refused(proxy.initialise, 0.0, VALUES) == (UNKNOWN, "")


BAD = {
    "malformed": (
        *({"kind": kind} for kind in (INITIALISE, OUTPUTS, HELLO)),
        *({"step": step} for step in (0.0, -1.0)),
        *({"body": body} for body in (b"", b"\xff" * 16)),
    ),
    "other_version": ({"version": 1},),
    "foreign": (
        {"session": 1}, {"cookie": 7}, {"interface": bytes(16)}, {"kind": END, "session": 1},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("counter", "spoil"), [(c, s) for c, bad in BAD.items() for s in bad])
def test_a_bad_step_is_dropped_and_the_next_one_served(counter, spoil):
    bench = Bench()
    proxy = bench.begun()
    proxy.step(0.0, 0.1, VALUES)
    bench(proxy.request(STEP, 0.1, VALUES, 0.1, **spoil))
    assert len(bench.done) == 2
    assert bench.counts()[counter] == 1
    proxy.step(0.2, 0.1, VALUES)


@pytest.mark.parametrize("step", [LONGEST_STEP * 1.001, 1e300])
def test_a_step_that_is_too_long_is_refused_and_not_done(step):
    bench = Bench()
    assert refused(bench.begun().step, 0.0, step, VALUES) == (FAILED, TOO_LONG)
    assert not bench.peer.in_session
    assert "steps" not in bench.counts()
    bench.begun(session=100).step(0.0, LONGEST_STEP, VALUES)


SMALL = st.integers(0, 3)
HASHES = st.sampled_from([SIGNATURE.hash, bytes(16)])
NUMBERS = (st.integers(0, 8), st.integers(0, 255), HASHES, SMALL, SMALL, SMALL)
ZEROS = (st.just(0.0), st.just(0.0), st.just(0))


@given(st.builds(Message, *NUMBERS, *ZEROS, st.binary(max_size=200), SMALL))
@pytest.mark.parametrize("key", [None, KEY[0]])
def test_without_a_session_no_answer_is_longer_than_its_request(key, m):
    bench = Bench(key)
    request = Sealer(key).pack(m)
    assert len(bench(request) or b"") <= len(request)
    assert bench.done == []
