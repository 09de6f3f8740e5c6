"""The signature of the variables exchanged: its text, its hash, and what differs."""

from hashlib import sha256

import pytest
from grasp_fmus.link.message import LinkVariable, Signature

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
