"""Variables and datagrams to the byte, as the card has them; what is not one of them is none."""

import hmac
import math
import struct
from hashlib import sha256

import pytest
from grasp_fmus.link import message
from grasp_fmus.link.message import (
    Codec,
    LinkVariable,
    Message,
    Sealer,
    Signature,
    exposed,
    read_key,
)
from hypothesis import given
from hypothesis import strategies as st

KEY = bytes(range(16))
HASH = b"0123456789abcdef"
EXAMPLE = Message(message.STEP, 0, HASH, 2**63 + 1, 7, 3, 0.25, 1e-3, -5, b"12345678")

ALL = (
    LinkVariable("a", "Real", "input"),
    LinkVariable("b", "Integer", "input"),
    LinkVariable("c", "Boolean", "input"),
)

messages = st.builds(
    Message,
    st.integers(1, 7),
    st.integers(0, 255),
    st.binary(min_size=16, max_size=16),
    st.integers(0, 2**64 - 1),
    st.integers(0, 2**64 - 1),
    st.integers(0, 2**64 - 1),
    st.floats(-1e300, 1e300),
    st.floats(-1e300, 1e300),
    st.integers(-(2**63), 2**63 - 1),
    st.binary(max_size=300),
    st.integers(0, 2**16 - 1),
)


def test_the_bytes_are_those_of_the_card():
    datagram = Sealer().pack(EXAMPLE)
    assert datagram[:8] == b"GRSP\x02\x00\x05\x00"
    assert datagram[8:24] == HASH
    assert struct.unpack_from("<QQQ", datagram, 24) == (2**63 + 1, 7, 3)
    assert struct.unpack_from("<dd", datagram, 48) == (0.25, 1e-3)
    assert struct.unpack_from("<qII", datagram, 64) == (-5, 8, 0)
    assert datagram[80:] == b"12345678"
    assert Sealer(KEY).pack(EXAMPLE) == datagram + hmac.digest(KEY, datagram, "sha256")


@given(messages, st.sampled_from([None, KEY]))
def test_what_is_packed_is_opened(m, key):
    assert Sealer(key).open(Sealer(key).pack(m)) == m


@given(messages, st.integers(0), st.integers(1, 255))
def test_one_changed_byte_is_noticed_with_a_key(m, place, change):
    datagram = bytearray(Sealer(KEY).pack(m))
    datagram[place % len(datagram)] ^= change
    assert Sealer(KEY).open(bytes(datagram)) in (message.FORGED, message.MALFORMED)


@pytest.mark.parametrize(
    ("place", "data"),
    [
        (0, b"grsp"), (6, b"\x00"), (6, b"\x08"), (72, b"\x07"), (76, b"\x01"),
        *((at, struct.pack("<d", x)) for at in (48, 56) for x in (math.nan, math.inf, -math.inf)),
    ],
)  # fmt: skip
def test_malformed(place, data):
    datagram = bytearray(Sealer().pack(EXAMPLE))
    datagram[place : place + len(data)] = data
    assert Sealer().open(bytes(datagram)) == message.MALFORMED


def test_the_largest_datagram():
    body = bytes(message.LARGEST - 80)
    assert len(Sealer().pack(EXAMPLE._replace(body=body))) == message.LARGEST
    with pytest.raises(ValueError, match=r"65508 bytes: must be 65507 at most"):
        Sealer().pack(EXAMPLE._replace(body=body + b"\0"))
    with pytest.raises(ValueError, match=r"must be 65507 at most"):
        Sealer(KEY).pack(EXAMPLE._replace(body=body))


@given(
    st.floats(allow_nan=False, allow_infinity=False),
    st.integers(-(2**31), 2**31 - 1),
    st.booleans(),
)
def test_values_there_and_back(a, b, c):
    codec = Codec(ALL)
    body = codec.pack(a, b, c)
    assert len(body) == codec.size == 24
    back = codec.unpack(body)
    assert back == [a, b, c]
    assert [type(v) for v in back] == [float, int, bool]
    assert math.copysign(1.0, a) == math.copysign(1.0, float(back[0]))


@pytest.mark.parametrize(
    ("place", "bad"),
    [
        (0, struct.pack("<d", math.nan)), (0, struct.pack("<d", -math.inf)),
        (8, struct.pack("<q", 2**31)), (8, struct.pack("<q", -(2**31) - 1)),
        (16, struct.pack("<Q", 2)), (24, b"\0"), (17, b""), (8, b""), (0, b""),
    ],
)  # fmt: skip
def test_what_is_no_value(place, bad):
    """A body that holds one, or has another size."""
    body = bytearray(Codec(ALL).pack(1.0, 1, True))
    body[place : place + len(bad) if bad else None] = bad
    assert Codec(ALL).unpack(bytes(body)) is None


def test_the_largest_reals_are_values_though_their_sum_is_not():
    codec = Codec(ALL[:1] * 2)
    assert codec.unpack(codec.pack(1.7e308, 1.7e308)) == [1.7e308, 1.7e308]


LINE_ENDS = (b"\n", b"\r\n", b" ", b"\t", b"\0", b"\xff")


@pytest.mark.parametrize(
    ("data", "key"),
    [
        (KEY.hex().encode() + b"\n", KEY.hex().encode()),
        (b" a key with spaces \n", b" a key with spaces "),
        *((data, data) for end in LINE_ENDS for data in (KEY + b"\0" + end, end + b"\xe9" + KEY)),
    ],
)
def test_a_key_is_read_without_the_line_end_if_it_is_text(tmp_path, data, key):
    """Every byte counts of one that is no text, and every space of one that is."""
    (tmp_path / "key").write_bytes(data)
    assert read_key(tmp_path / "key") == key


def test_a_key_has_16_bytes(tmp_path):
    (tmp_path / "key").write_bytes(b"fifteen bytes!!\n")
    with pytest.raises(ValueError, match="key of 15 bytes: must have 16 or more"):
        read_key(tmp_path / "key")


@pytest.mark.parametrize(
    ("mode", "said"), [(0o600, ""), (0o400, ""), (0o640, "640"), (0o604, "604")]
)
def test_a_key_that_others_can_read_is_said_to_be_so(tmp_path, mode, said):
    path = tmp_path / "key"
    path.write_bytes(KEY)
    path.chmod(mode)
    line = f"{path}: others have access to this key, mode {said}; must be 600: chmod 600 {path}"
    assert exposed(path) == (line if said else "")


# The signature

GAP = LinkVariable("gap", "Real", "input", "m")
GAIN = LinkVariable("gain", "Real", "parameter", "1")
OUT = LinkVariable("intensity", "Real", "output", "V")
SENSOR = Signature((OUT, GAP, GAIN))


def test_text_and_hash_are_those_of_the_card():
    assert SENSOR.text == (
        "input\tReal\tm\tgap\nparameter\tReal\t1\tgain\noutput\tReal\tV\tintensity\n"
    )
    assert SENSOR.hash == sha256(SENSOR.text.encode()).digest()[:16]
    assert Signature((LinkVariable("b", "Boolean", "input"),)).text == "input\tBoolean\t-\tb\n"
    assert (SENSOR.request, SENSOR.answer) == ((GAP, GAIN), (OUT,))


@pytest.mark.parametrize(
    ("proxy", "difference"),
    [
        ((GAP, OUT),
         "the proxy has output Real V intensity, the peer parameter Real 1 gain"),
        ((GAP, GAIN), "the proxy has no more, the peer output Real V intensity"),
        ((GAP._replace(unit="mm"), GAIN, OUT),
         "the proxy has input Real mm gap, the peer input Real m gap"),
        ((GAP, GAIN, OUT, OUT._replace(name="y", kind="Boolean", unit=None)),
         "the proxy has output Boolean - y, the peer no more"),
    ],
)  # fmt: skip
def test_the_first_difference_is_named(proxy, difference):
    assert SENSOR.difference(Signature(proxy).text.encode() + bytes(9)) == difference


@pytest.mark.parametrize(
    ("variables", "reason"),
    [
        ((GAP, GAP._replace(causality="output")), "variable 'gap': appears twice"),
        ((GAP._replace(name="a\tb"),), r"variable 'a\\tb' \[m\]: must be without tabs"),
        ((GAP._replace(unit="m\n"),), r"\[m\n\]: must be without tabs and line ends"),
    ],
)
def test_what_the_text_cannot_hold(variables, reason):
    with pytest.raises(ValueError, match=reason):
        Signature(variables)
