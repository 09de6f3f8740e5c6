"""Client and peer over a channel that loses, repeats and swaps datagrams as hypothesis likes."""

from itertools import count

from grasp_fmus.link.client import Client, Verdict
from grasp_fmus.link.message import STEP
from grasp_fmus.link.peer import Peer, Request
from grasp_fmus.link.signature import LinkVariable, Signature
from hypothesis import given
from hypothesis import strategies as st

SIGNATURE = Signature((LinkVariable("u", "Real", "input"), LinkVariable("y", "Real", "output")))

fates = st.lists(st.sampled_from(["pass", "lose", "repeat", "hold"]), min_size=2, max_size=2)


@given(st.lists(fates, max_size=60), st.data())
def test_every_answer_is_in_time_late_or_lost_and_every_step_is_done_once(
    steps: list[list[str]], data: st.DataObject
) -> None:
    peer, client = Peer(SIGNATURE, None, count(1).__next__), Client(SIGNATURE)
    times: list[float] = []

    def serve(datagram: bytes) -> list[bytes]:
        action = peer.receive(datagram, 0)
        if isinstance(action, Request):
            if action.kind == STEP:
                times.append(action.time)
            return [peer.outputs([action.values[0]], action.time)]
        return [action] if action else []

    (welcome,) = serve(client.greet(1, 0))
    assert client.receive(welcome, 0) is Verdict.ANSWERED
    (answer,) = serve(client.initialise(0.0, [0.0], 0))
    assert client.receive(answer, 0) is Verdict.ANSWERED
    held: list[bytes] = []
    answers, in_time, repeated = 0, 0, 0
    for k, (there, back) in enumerate(steps, 1):
        request = client.step(float(k), 1.0, [float(k)], 0)
        arriving = {"lose": 0, "hold": 0, "repeat": 2, "pass": 1}[there]
        replies = [reply for _ in range(arriving) for reply in serve(request)]
        assert len(replies) == min(arriving, 1)
        answers += len(replies)
        if back == "repeat":
            replies *= 2
            repeated += len(replies) // 2
        if back == "lose":
            answers -= len(replies)
            replies = []
        if back == "hold":
            held += replies
            replies = []
        verdicts = [client.receive(reply, 0) for reply in replies]
        if Verdict.ANSWERED in verdicts:
            in_time += 1
            assert client.outputs == [float(k)]
        else:
            client.miss()
        place: int = data.draw(st.integers(0, 2 * len(held)))
        if place < len(held):
            client.receive(held.pop(place), 0)
    for reply in held:
        client.receive(reply, 0)
    c = client.counters
    assert c.missed + in_time == len(steps)
    assert c.missed - c.late == len(steps) - answers
    assert c.duplicated == repeated
    assert c.rejected == 0
    assert times == sorted(set(times))
    assert peer.counters.steps == len(times)
