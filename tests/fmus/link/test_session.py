"""A session between client and peer, without any network: each datagram is handed over by hand."""

from itertools import count
from typing import Any

import pytest
from grasp_fmus.link.client import Client, Refusal, Verdict
from grasp_fmus.link.message import (
    END,
    FAILED,
    HELLO,
    INITIALISE,
    LONGEST_STEP,
    OTHER_INTERFACE,
    OUTPUTS,
    STEP,
    Codec,
    Message,
    Sealer,
    Value,
)
from grasp_fmus.link.peer import ALIVE, TOO_LONG, Peer, Request
from grasp_fmus.link.signature import LinkVariable, Signature
from hypothesis import given
from hypothesis import strategies as st

U = LinkVariable("u", "Real", "input", "m")
P = LinkVariable("p", "Boolean", "parameter")
Y = LinkVariable("y", "Real", "output", "N")
SIGNATURE = Signature((U, P, Y))
KEY = b"sixteen bytes...", b"another 16 bytes"
VALUES: list[Value] = [0.5, True]
T0 = 5 * ALIVE


class Bench:
    """A peer whose model puts out what comes in; its cookies are 1, 2, 3, ..."""

    def __init__(self, signature: Signature = SIGNATURE, key: bytes | None = None) -> None:
        self.peer = Peer(signature, key, count(1).__next__)
        self.done: list[Request] = []

    def answers(self, datagram: bytes, now: int = T0) -> bytes | None:
        action = self.peer.receive(datagram, now)
        if isinstance(action, Request):
            self.done.append(action)
            if action.kind == END:
                return None
            return self.peer.outputs([action.values[0]], action.time + action.step)
        return action


def begun(bench: Bench, client: Client | None = None, session: int = 99, now: int = T0) -> Client:
    """A client with a session on the bench that is about to step."""
    client = client or Client(SIGNATURE)
    assert heard(bench, client, client.greet(session, now), now) is Verdict.ANSWERED
    assert heard(bench, client, client.initialise(0.0, VALUES, now), now) is Verdict.ANSWERED
    return client


def heard(bench: Bench, client: Client, request: bytes, now: int = T0) -> Verdict:
    """The verdict on the answer, which there is."""
    answer = bench.answers(request, now)
    assert answer is not None
    return client.receive(answer, now)


def test_a_session_from_hello_to_end() -> None:
    bench = Bench()
    client = begun(bench)
    answer = bench.answers(client.step(0.0, 0.1, [2.0, False], T0 + 10))
    assert answer is not None
    assert client.receive(answer, T0 + 35) is Verdict.ANSWERED
    assert (client.outputs, client.outputs_time, client.round_trip) == ([2.0], 0.1, 25)
    assert bench.answers(client.end(T0)) is None
    assert bench.done == [
        Request(INITIALISE, 0.0, 0.0, VALUES, fresh=True),
        Request(STEP, 0.0, 0.1, [2.0, False], fresh=False),
        Request(END, 0.0, 0.0, [], fresh=False),
    ]
    assert not any(vars_of(client))


def vars_of(client: Client) -> list[int]:
    c = client.counters
    return [c.missed, c.late, c.out_of_order, c.duplicated, c.rejected, c.forged]


def test_only_the_first_initialise_sets_up_anew() -> None:
    bench = Bench()
    client = begun(bench)
    bench.answers(client.initialise(0.0, [3.0, True], T0))
    assert [r.fresh for r in bench.done] == [True, False]


def test_repeated_requests_are_answered_again_and_done_once() -> None:
    bench, client = Bench(), Client(SIGNATURE)
    hello = client.greet(99, T0)
    first, again = bench.answers(hello), bench.answers(hello)
    assert first == again != None  # noqa: E711 - both are there
    assert client.receive(first or b"", T0) is Verdict.ANSWERED
    assert client.receive(first or b"", T0) is Verdict.NOTHING
    request = client.initialise(0.0, VALUES, T0)
    assert bench.answers(request) == bench.answers(request)
    assert len(bench.done) == bench.peer.counters.repeated == 1
    assert not any(vars_of(client))


def test_a_duplicated_step_is_done_once_and_not_answered_again() -> None:
    bench = Bench()
    client = begun(bench)
    request = client.step(0.0, 0.1, VALUES, T0)
    assert bench.answers(request)
    assert bench.answers(request) is None
    assert bench.peer.counters.duplicated == 1


def test_a_step_overtaken_by_the_next_is_dropped() -> None:
    bench = Bench()
    client = begun(bench)
    first, second = client.step(0.0, 0.1, VALUES, T0), client.step(0.1, 0.1, VALUES, T0)
    assert bench.answers(second)
    assert bench.answers(first) is None
    assert bench.peer.counters.stale == 1
    assert [r.time for r in bench.done if r.kind == STEP] == [0.1]


def test_late_duplicated_and_overtaken_answers_are_counted() -> None:
    bench = Bench()
    client = begun(bench)
    answers = []
    for k in range(3):
        answers.append(bench.answers(client.step(0.1 * k, 0.1, [float(k), True], T0)) or b"")
        client.miss()
    request = client.step(0.3, 0.1, [3.0, True], T0)
    assert client.receive(answers[1], T0) is Verdict.NOTHING  # late, but the newest
    assert client.outputs == [1.0]
    assert client.receive(answers[0], T0) is Verdict.NOTHING  # overtaken
    assert client.receive(answers[1], T0) is Verdict.NOTHING  # again
    assert client.outputs == [1.0]
    assert client.receive(bench.answers(request) or b"", T0) is Verdict.ANSWERED
    assert client.receive(answers[2], T0) is Verdict.NOTHING
    c = client.counters
    assert (c.missed, c.late, c.out_of_order, c.duplicated, c.rejected) == (3, 3, 2, 1, 0)
    assert client.outputs == [3.0]


def test_an_answer_from_the_future_is_rejected() -> None:
    bench = Bench()
    client = begun(bench)
    answer = Sealer().open(bench.answers(client.step(0.0, 0.1, VALUES, T0)) or b"")
    assert isinstance(answer, Message)
    assert client.receive(Sealer().pack(answer._replace(sequence=9)), T0) is Verdict.NOTHING
    assert client.counters.rejected == 1


def test_another_interface_is_refused_and_the_difference_named() -> None:
    bench = Bench(Signature((U, P, Y._replace(unit="mN"))))
    client = Client(SIGNATURE)
    assert heard(bench, client, client.greet(1, T0)) is Verdict.REFUSED
    assert client.refusal == Refusal(
        OTHER_INTERFACE, "the peer has another interface: unnamed", cut=True
    )  # the text of the bench is longer than ours by one byte
    assert heard(bench, client, client.greet(2, T0, fill=1)) is Verdict.REFUSED
    assert client.refusal == Refusal(
        OTHER_INTERFACE,
        "the peer has another interface: output y, Real in mN, must be output y, Real in N",
    )
    assert bench.peer.counters.foreign == 2


def test_a_live_session_keeps_others_away_until_it_is_silent() -> None:
    bench = Bench()
    first = begun(bench, session=1)
    second = Client(SIGNATURE)
    refusal = bench.answers(second.greet(2, T0), T0 + ALIVE - 1)
    assert second.receive(refusal or b"", T0) is Verdict.REFUSED
    assert second.refusal is not None
    assert second.refusal.text == "the peer is busy with another proxy"
    begun(bench, second, session=3, now=T0 + ALIVE)
    assert heard(bench, first, first.step(0.0, 0.1, VALUES, T0)) is Verdict.REFUSED
    assert first.refusal is not None
    assert first.refusal.text == "the peer does not know this session"


def test_a_silent_session_is_taken_over_only_by_who_has_the_key() -> None:
    bench = Bench(key=KEY[0])
    ours = begun(bench, Client(SIGNATURE, KEY[0]), 1)
    later = T0 + 100 * ALIVE
    for key in (None, KEY[1]):
        other = Client(SIGNATURE, key)
        assert bench.answers(other.greet(2, later), later) is None
    assert heard(bench, ours, ours.step(0.0, 0.1, VALUES, later), later) is Verdict.ANSWERED
    begun(bench, Client(SIGNATURE, KEY[0]), 3, later + ALIVE)


def test_a_hello_alone_does_not_disturb_a_session() -> None:
    bench = Bench()
    client = begun(bench, now=T0)
    for session in range(1000):
        bench.answers(Client(SIGNATURE).greet(session, T0), T0 + 2 * ALIVE)
    answer = bench.answers(client.step(0.0, 0.1, VALUES, T0), T0 + 3 * ALIVE)
    assert client.receive(answer or b"", T0) is Verdict.ANSWERED


def test_a_recorded_session_cannot_be_played_again() -> None:
    bench = Bench(key=KEY[0])
    client = Client(SIGNATURE, KEY[0])
    recorded = [client.greet(99, T0)]
    client.receive(bench.answers(recorded[0]) or b"", T0)
    recorded.append(client.initialise(0.0, VALUES, T0))
    client.receive(bench.answers(recorded[1]) or b"", T0)
    recorded.append(client.step(0.0, 0.1, VALUES, T0))
    client.receive(bench.answers(recorded[2]) or b"", T0)
    done = list(bench.done)
    for datagram in recorded:  # while it is under way
        bench.answers(datagram)
    bench.answers(client.end(T0))
    for datagram in recorded:  # and after its end
        bench.answers(datagram, T0 + 5 * ALIVE)
    assert bench.done[:-1] == done
    assert bench.done[-1].kind == END


@pytest.mark.parametrize("keys", [(KEY[0], KEY[1]), (KEY[0], None), (None, KEY[0])])
def test_without_the_key_there_is_no_answer(keys: tuple[bytes | None, bytes | None]) -> None:
    bench, client = Bench(key=keys[0]), Client(SIGNATURE, keys[1])
    assert bench.answers(client.greet(1, T0)) is None
    assert bench.peer.counters.forged + bench.peer.counters.malformed == 1


def test_an_answer_without_the_key_is_rejected() -> None:
    bench, client = Bench(), Client(SIGNATURE, KEY[0])
    welcome = Bench().answers(Client(SIGNATURE).greet(1, T0)) or b""
    client.greet(1, T0)
    assert client.receive(welcome + bytes(32), T0) is Verdict.NOTHING
    assert (client.counters.rejected, client.counters.forged) == (1, 1)
    assert bench.done == []


def test_a_failure_ends_the_session_and_says_why() -> None:
    bench = Bench()
    client = begun(bench)
    request = client.step(0.0, 0.1, VALUES, T0)
    assert isinstance(bench.peer.receive(request, T0), Request)
    refusal = bench.peer.failed("plant: no\n power")
    assert client.receive(refusal, T0) is Verdict.REFUSED
    assert client.refusal is not None
    assert client.refusal.text == "the peer failed: plant: no power"
    assert heard(bench, client, client.step(0.1, 0.1, VALUES, T0)) is Verdict.REFUSED


@pytest.mark.parametrize(
    "spoil",
    [
        {"body": b""},
        {"step": 0.0},
        {"step": -1.0},
        {"kind": INITIALISE},
        {"kind": OUTPUTS},
        {"body": b"\xff" * 16},
    ],
)
def test_a_malformed_step_is_dropped_and_the_next_one_served(spoil: dict[str, Any]) -> None:
    bench = Bench()
    client = begun(bench)
    bench.answers(client.step(0.0, 0.1, VALUES, T0))
    m = Sealer().open(client.step(0.1, 0.1, VALUES, T0))
    assert isinstance(m, Message)
    assert bench.answers(Sealer().pack(m._replace(**spoil))) is None
    assert bench.peer.counters.malformed == 1
    answer = bench.answers(client.step(0.2, 0.1, VALUES, T0))
    assert client.receive(answer or b"", T0) is Verdict.ANSWERED


def test_a_foreign_session_or_interface_is_dropped() -> None:
    bench = Bench()
    client = begun(bench)
    m = Sealer().open(client.step(0.0, 0.1, VALUES, T0))
    assert isinstance(m, Message)
    spoilt: list[dict[str, Any]] = [{"session": 1}, {"cookie": 77}, {"interface": bytes(16)}]
    for spoil in spoilt:
        bench.answers(Sealer().pack(m._replace(**spoil)))
    assert bench.peer.counters.foreign == 3
    assert bench.answers(Sealer().pack(m))


def test_sessions_that_never_begin_do_not_fill_the_memory() -> None:
    bench = Bench()
    for session in range(10_000):
        bench.answers(Client(SIGNATURE).greet(session, T0))
    assert len(bench.peer._greeted) == 64


def test_the_reason_of_a_failure_is_told_again_where_it_was_lost() -> None:
    bench, client = Bench(), Client(SIGNATURE)
    heard(bench, client, client.greet(1, T0))
    request = client.initialise(0.0, VALUES, T0)
    assert isinstance(bench.peer.receive(request, T0), Request)
    refusal = bench.peer.failed("no power")
    assert bench.answers(request) == refusal
    assert bench.peer.counters.repeated == 1
    later = client.initialise(0.0, VALUES, T0)
    assert heard(bench, client, later) is Verdict.REFUSED
    assert client.refusal is not None
    assert client.refusal.text == "the peer does not know this session"


def test_a_recorded_step_sent_again_and_again_keeps_nobody_away() -> None:
    bench = Bench()
    client = begun(bench, session=1)
    request = client.step(0.0, 0.1, VALUES, T0)
    for later in range(0, 3 * ALIVE, ALIVE // 4):
        bench.answers(request, T0 + later)
    begun(bench, session=2, now=T0 + 2 * ALIVE)


def test_a_hello_that_is_longer_is_welcome() -> None:
    bench, client = Bench(), Client(SIGNATURE)
    assert heard(bench, client, client.greet(1, T0, fill=100)) is Verdict.ANSWERED
    wrong = Message(HELLO, 0, SIGNATURE.hash, 2, 0, 0, 0.0, 0.0, 0, SIGNATURE.text.encode() + b"x")
    assert bench.answers(Sealer().pack(wrong)) is None
    assert bench.peer.counters.malformed == 1


@pytest.mark.parametrize("step", [LONGEST_STEP * 1.001, 1e300])
def test_a_step_that_is_too_long_is_refused_and_not_done(step: float) -> None:
    bench = Bench()
    client = begun(bench)
    assert heard(bench, client, client.step(0.0, step, VALUES, T0)) is Verdict.REFUSED
    assert client.refusal == Refusal(FAILED, f"the peer failed: {TOO_LONG}")
    assert not bench.peer.in_session
    assert bench.peer.counters.steps == 0
    begun(bench, session=100)
    assert bench.peer.in_session


def test_the_longest_step_is_done() -> None:
    bench = Bench()
    client = begun(bench)
    assert heard(bench, client, client.step(0.0, LONGEST_STEP, VALUES, T0)) is Verdict.ANSWERED


ANY_HEAD = st.builds(
    Message,
    kind=st.integers(0, 8),
    code=st.integers(0, 5),
    interface=st.sampled_from([SIGNATURE.hash, bytes(16)]),
    session=st.integers(0, 3),
    cookie=st.integers(0, 3),
    sequence=st.integers(0, 2),
    time=st.floats(width=64),
    step=st.floats(width=64) | st.just(0.0),
    sent=st.integers(0, 9),
    body=st.binary(max_size=40)
    | st.just(SIGNATURE.text.encode())
    | st.just(SIGNATURE.text.encode() + bytes(9))
    | st.just(Codec(SIGNATURE.request).pack(VALUES)),
)
REASON = "the motor is hot, and so is all that stands beside it"


@pytest.mark.parametrize("key", [None, KEY[0]])
@given(sent=st.lists(st.one_of(ANY_HEAD, ANY_HEAD, st.binary(max_size=200)), max_size=30))
def test_without_a_session_no_answer_is_longer_than_its_request(
    key: bytes | None, sent: list[Message | bytes]
) -> None:
    """Whatever comes, and from whomever: also where the model fails at every INITIALISE."""
    peer, sealer = Peer(SIGNATURE, key, count(1).__next__), Sealer(key)
    for each in sent:
        request = each if isinstance(each, bytes) else sealer.pack(each)
        before = peer.in_session
        action = peer.receive(request, T0)
        if isinstance(action, Request):
            if action.kind != END:
                peer.failed(REASON)
        elif action is not None and not before:
            assert len(action) <= len(request)
