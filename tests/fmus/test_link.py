"""The link without sockets: variables, datagrams and keys to the byte, and the bench's side."""

import hmac
import math
import struct
from hashlib import sha256

import pytest
from grasp_cosim.fmu_export import link
from grasp_cosim.fmu_export.link import (
    ALIVE,
    END,
    INITIALISE,
    STEP,
    VERSION,
    Codec,
    Limit,
    LinkVariable,
    Message,
    Peer,
    Request,
    Sealer,
    Signature,
)
from hypothesis import given
from hypothesis import strategies as st
from support.proxies import HandProxy, RefusedError

KEY, OTHER_KEY = b"sixteen bytes...", b"another 16 bytes"
HASH = b"0123456789abcdef"
EXAMPLE = Message(STEP, 0, HASH, 2**63 + 1, 7, 3, 0.25, 1e-3, -5, b"12345678", counted=2)

U = LinkVariable("u", "Real", "input", "m")
P = LinkVariable("p", "Boolean", "parameter")
Y = LinkVariable("y", "Real", "output", "N")
SIGNATURE = Signature((Y, U, P))
VALUES = [0.5, True]
ALL = [LinkVariable(kind, kind, "input") for kind in ("Real", "Integer", "Boolean")]

keyed = pytest.mark.parametrize("key", [None, KEY])
reals = st.floats(allow_nan=False, allow_infinity=False)
whole = st.integers(0, 2**64 - 1)
messages = st.builds(
    Message, st.integers(1, 7), st.integers(0, 255), st.binary(min_size=16, max_size=16),
    whole, whole, whole, st.floats(-1e300, 1e300), st.floats(-1e300, 1e300),
    st.integers(-(2**63), 2**63 - 1), st.binary(max_size=300), st.integers(0, 2**16 - 1),
    st.just(0),
)  # fmt: skip


# Datagrams


def test_the_bytes_are_those_of_the_card():
    datagram = Sealer().pack(EXAMPLE)
    assert datagram[:8] == b"GRSP\x03\x00\x05\x00"
    assert datagram[8:24] == HASH
    assert struct.unpack_from("<QQQ", datagram, 24) == (2**63 + 1, 7, 3)
    assert struct.unpack_from("<dd", datagram, 48) == (0.25, 1e-3)
    assert struct.unpack_from("<qII", datagram, 64) == (-5, 8, 2)
    assert datagram[80:] == b"12345678"
    assert Sealer(KEY).pack(EXAMPLE) == datagram + hmac.digest(KEY, datagram, "sha256")


@given(messages, st.sampled_from([None, KEY]))
def test_what_is_packed_is_opened(m, key):
    assert Sealer(key).open(Sealer(key).pack(m)) == m


@given(messages, st.integers(0), st.integers(1, 255))
def test_one_changed_byte_is_noticed_with_a_key(m, place, change):
    datagram = bytearray(Sealer(KEY).pack(m))
    datagram[place % len(datagram)] ^= change
    assert Sealer(KEY).open(bytes(datagram)) in (link.FORGED, link.MALFORMED)


def test_the_largest_datagram():
    body = bytes(link.LARGEST - 80)
    assert len(Sealer().pack(EXAMPLE._replace(body=body))) == link.LARGEST
    with pytest.raises(ValueError, match=r"65508 bytes: must be 65507 at most"):
        Sealer().pack(EXAMPLE._replace(body=body + b"\0"))
    with pytest.raises(ValueError, match=r"must be 65507 at most"):
        Sealer(KEY).pack(EXAMPLE._replace(body=body))


@given(reals, st.integers(-(2**31), 2**31 - 1), st.booleans())
def test_values_there_and_back(a, b, c):
    codec = Codec(ALL)
    body = codec.pack(a, b, c)
    assert len(body) == codec.size == 24
    assert repr(codec.unpack(body)) == repr([a, b, c])


def test_the_largest_reals_are_values_though_their_sum_is_not():
    codec = Codec([U, U])
    assert codec.unpack(codec.pack(1.7e308, 1.7e308)) == [1.7e308, 1.7e308]


# Keys

LINE_ENDS = (b"\n", b"\r\n", b" ", b"\xff")


@pytest.mark.parametrize(
    ("data", "key"),
    [
        (KEY + b"\n", KEY),
        (b" a key with spaces \r\n", b" a key with spaces "),
        *((data, data) for end in LINE_ENDS for data in (KEY + b"\0" + end, end + b"\xe9" + KEY)),
    ],
)
def test_a_key_is_read_without_the_line_end_if_it_is_text(tmp_path, data, key):
    """Every byte counts of one that is no text, and every space of one that is."""
    (tmp_path / "key").write_bytes(data)
    assert link.read_key(tmp_path / "key") == key


def test_a_key_has_16_bytes(tmp_path):
    (tmp_path / "key").write_bytes(b"fifteen bytes!!\n")
    with pytest.raises(ValueError, match="key of 15 bytes: must have 16 or more"):
        link.read_key(tmp_path / "key")


@pytest.mark.parametrize(("mode", "said"), [(0o600, ""), (0o640, "640"), (0o604, "604")])
def test_a_key_that_others_can_read_is_said_to_be_so(tmp_path, mode, said):
    path = tmp_path / "key"
    path.write_bytes(KEY)
    path.chmod(mode)
    line = f"{path}: others have access to this key, mode {said}; must be 600: chmod 600 {path}"
    assert link.exposed(path) == (line if said else "")


# The signature


def test_text_and_hash_are_those_of_the_card():
    text = "input\tReal\tm\tu\nparameter\tBoolean\t-\tp\noutput\tReal\tN\ty\n"
    assert (SIGNATURE.text, SIGNATURE.hash) == (text, sha256(text.encode()).digest()[:16])
    assert (SIGNATURE.request, SIGNATURE.answer) == ((U, P), (Y,))


@pytest.mark.parametrize(
    ("proxy", "difference"),
    [
        ((U, Y), "the proxy has output Real N y, the peer parameter Boolean - p"),
        ((U, P), "the proxy has no more, the peer output Real N y"),
        ((U._replace(unit="mm"), P, Y), "the proxy has input Real mm u, the peer input Real m u"),
        ((U, P, Y, Y._replace(name="z")), "the proxy has output Real N z, the peer no more"),
    ],
)
def test_the_first_difference_is_named(proxy, difference):
    (part,) = Signature(proxy).parts()
    assert SIGNATURE.difference(part) == difference


@pytest.mark.parametrize(
    ("variables", "reason"),
    [
        ((U, U._replace(causality="output")), "variable 'u': appears twice"),
        ((U._replace(name="a\tb"),), r"variable 'a\\tb' \[m\]: must be without tabs"),
        ((U._replace(unit="m\n"),), r"\[m\n\]: must be without tabs and line ends"),
    ],
)
def test_what_the_text_cannot_hold(variables, reason):
    with pytest.raises(ValueError, match=reason):
        Signature(variables)


def many(count, last="N"):
    """A signature too long for one HELLO."""
    names = (f"contact_force_of_finger[{i}]" for i in range(count))
    inputs = [LinkVariable(name, "Real", "input", "N") for name in names]
    return Signature((*inputs[:-1], inputs[-1]._replace(unit=last)))


@keyed
@pytest.mark.parametrize("last", ["N", "mN"])
def test_a_long_signature_is_compared_in_parts_of_1200_bytes(key, last):
    """Equal parts get an empty reason; the last one names the difference, or that there is more."""
    peer, theirs = Peer(many(101), key), many(100 if last == "N" else 101, last)
    proxy = HandProxy(theirs, lambda datagram: peer.receive(datagram, 0), key)
    parts = range(len(theirs.parts()))
    hellos = [proxy.hello(1, part=i) for i in parts]
    assert [len(hello) for hello in hellos] == [1168 + (32 if key else 0)] * len(parts)
    reasons = [refused(proxy.take, peer.receive(hello, 0)) for hello in hellos]
    differ = {
        "N": "the proxy has no more, the peer input Real N contact_force_of_finger[100]",
        "mN": "the proxy has input Real mN contact_force_of_finger[100], "
        "the peer input Real N contact_force_of_finger[100]",
    }
    expected = [*[""] * (len(parts) - 1), differ[last]]
    assert len(parts) > 3
    assert reasons == [(link.OTHER_INTERFACE, reason) for reason in expected]


def test_a_line_that_no_hello_holds():
    long = Signature((U._replace(name="x" * 1200),))
    with pytest.raises(ValueError, match=r"bytes in a HELLO: must be 1008 at most"):
        link.check_size(long)


@pytest.mark.parametrize(
    ("text", "limit"),
    [
        ("-5:5:200", (-5.0, 5.0, 200.0)),
        (":1", (-math.inf, 1.0, math.inf)),
        ("0::", (0.0, math.inf, math.inf)),
    ],
)
def test_limits_as_texts(text, limit):
    assert Limit.read(text) == limit


@pytest.mark.parametrize(
    "text",
    ["5", "1:2:3:4", "a:1", "2:1", "0:1:0", "nan:1", "::", "-inf:inf", "inf:inf", ":-inf"],
)
def test_texts_that_are_no_limits(text):
    with pytest.raises(ValueError, match="must be"):
        Limit.read(text)


# Sessions; whatever is sent in them, again or damaged: test_bench_header.py


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


def test_a_live_session_keeps_others_away_until_it_is_silent():
    bench = Bench()
    first = bench.begun(session=1)
    bench.now += ALIVE - 1
    assert refused(bench.begun, 2) == (link.BUSY, "")
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
    assert refused(first.step, 0.2, 0.1, VALUES) == (link.UNKNOWN, "")
    second.step(0.0, 0.1, VALUES)


def test_a_recorded_session_cannot_be_played_again():
    bench = Bench(KEY)
    proxy = bench.proxy(key=KEY)
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


def test_a_peer_takes_a_proxy_that_wants_its_name_or_any_and_says_who_it_is():
    peer = Peer(SIGNATURE, name="sensor_1", build="0123abcd")
    proxy = HandProxy(SIGNATURE, lambda datagram: peer.receive(datagram, 0))
    for name in ("", "sensor_1"):
        assert proxy.take(peer.receive(proxy.hello(1, name), 0)) == []
        assert (proxy.name, proxy.build) == ("sensor_1", "0123abcd")
    other = refused(proxy.take, peer.receive(proxy.hello(1, "sensor_2"), 0))
    assert other == (link.OTHER_NAME, "the peer is sensor_1, the proxy wants sensor_2")
    assert peer.counters.other_name == 1
    unnamed = Peer(SIGNATURE)
    assert proxy.take(unnamed.receive(proxy.hello(1, "sensor_2"), 0)) == []


@pytest.mark.parametrize("name", ["µ", "x" * 64, "a\nb"])
def test_names_that_are_none(name):
    with pytest.raises(ValueError, match=r"must be printable ASCII of 63 characters at most"):
        Peer(SIGNATURE, name=name)


def test_what_tells_of_newer_answers_is_what_acknowledges():
    """Requests that come while no answers arrive do not; nor do those sent again."""
    bench = Bench()
    proxy = bench.begun()
    seen = []
    for count in (0, 0, 1, 2, 3, 1, 0):
        bench.now += 1
        bench(proxy.request(STEP, 0.0, VALUES, 0.1, counted=count))
        seen.append(bench.peer.acknowledged_at == bench.now)
    assert seen == [True, True, False, False, False, True, True]
    assert bench(proxy.request(STEP, 0.0, VALUES, 0.1, counted=9)) is None  # more than there were
    assert bench.counts()["malformed"] == 1


def test_trips_are_told_until_another_session_begins():
    bench = Bench()
    proxy = bench.begun()
    bench.peer.trip()
    for _ in range(2):
        proxy.step(0.0, 0.1, VALUES)
        assert proxy.trips == 1
    proxy.end()
    proxy.begin(7, VALUES)
    assert proxy.trips == 0


def test_a_silent_session_is_over():
    bench = Bench()
    proxy = bench.begun()
    assert not bench.peer.expire(bench.now + 9, 10)
    assert bench.peer.expire(bench.now + 10, 10)
    assert not bench.peer.in_session
    assert refused(proxy.step, 0.0, 0.1, VALUES) == (link.UNKNOWN, "")


@keyed
def test_another_version_or_interface_is_refused_with_its_reason(key):
    bench = Bench(key)
    proxy = bench.proxy(key=key)
    answer = bench(proxy.hello(1, version=VERSION + 1)) or b""
    opened = Sealer(key).open(answer)
    assert isinstance(opened, Message)
    assert (opened.code, opened.version) == (link.OTHER_VERSION, VERSION)
    assert len(answer) == link.HEAD.size + (link.TAG_SIZE if key else 0)
    other = bench.proxy(Signature((U._replace(name="µ"), Y)), key)
    reason = "the proxy has input Real m ??, the peer input Real m u"
    assert refused(other.begin, 2, [0.0]) == (link.OTHER_INTERFACE, reason)
    assert bench.counts() == {"foreign": 1, "other_version": 1}


def test_a_failure_ends_the_session_and_says_why_until_it_was_heard():
    bench = Bench()
    proxy = bench.proxy()
    proxy.take(bench(proxy.hello(1)))
    request = proxy.request(INITIALISE, 0.0, VALUES)
    assert isinstance(bench.peer.receive(request, bench.now), Request)
    refusal = bench.peer.failed("no power, " * 200)
    assert refused(proxy.take, refusal) == (link.FAILED, ("no power, " * 200)[:1024])
    again = bench(request) or b""
    assert len(again) == len(request)
    assert refused(proxy.take, again) == (link.FAILED, "no power, no pow")
    assert bench.counts() == {"initialisations": 1, "repeated": 1}
    assert refused(proxy.initialise, 0.0, VALUES) == (link.UNKNOWN, "")


SMALL = st.integers(0, 3)
HASHES = st.sampled_from([SIGNATURE.hash, bytes(16)])
NUMBERS = (st.integers(0, 8), st.integers(0, 255), HASHES, SMALL, SMALL, SMALL)
ZEROS = (st.just(0.0), st.just(0.0), st.just(0))


@given(st.builds(Message, *NUMBERS, *ZEROS, st.binary(max_size=200), SMALL, st.just(0)))
@keyed
def test_without_a_session_no_answer_is_longer_than_its_request(key, m):
    bench = Bench(key)
    request = Sealer(key).pack(m)
    assert len(bench(request) or b"") <= len(request)
    assert bench.done == []
