"""The signature: order, text, hash, and what differs, in words."""

from hashlib import sha256

import pytest
from grasp_fmus.link.signature import LinkVariable, Signature

GAP = LinkVariable("gap", "Real", "input", "m")
REFLECTANCE = LinkVariable("reflectance", "Real", "parameter", "1")
INTENSITY = LinkVariable("intensity", "Real", "output", "V")
CONTACT = LinkVariable("contact", "Boolean", "output")

ONE = Signature((INTENSITY, GAP, CONTACT, REFLECTANCE))


def test_the_order_is_inputs_parameters_outputs_and_within_them_the_given_one() -> None:
    assert ONE.variables == (GAP, REFLECTANCE, INTENSITY, CONTACT)
    assert ONE.request == (GAP, REFLECTANCE)
    assert ONE.answer == (INTENSITY, CONTACT)


def test_text_and_hash() -> None:
    text = (
        "input\tReal\tm\tgap\nparameter\tReal\t1\treflectance\n"
        "output\tReal\tV\tintensity\noutput\tBoolean\t-\tcontact\n"
    )
    assert ONE.text == text
    assert ONE.hash == sha256(text.encode()).digest()[:16]


@pytest.mark.parametrize("name", ["a\tb", "a\nb", "a\rb"])
def test_a_name_that_the_text_cannot_hold_is_refused(name: str) -> None:
    with pytest.raises(ValueError, match="must be without tabs and line ends"):
        Signature((LinkVariable(name, "Real", "input"),))


def test_a_name_twice_is_refused() -> None:
    with pytest.raises(ValueError, match="'gap': is there twice"):
        Signature((GAP, GAP._replace(causality="output")))


@pytest.mark.parametrize(
    ("other", "words"),
    [
        ((GAP, REFLECTANCE, INTENSITY, CONTACT), ""),
        ((GAP, REFLECTANCE, INTENSITY), "there is no output contact, Boolean"),
        (
            (GAP, REFLECTANCE, INTENSITY, CONTACT, LinkVariable("x", "Integer", "output", "m")),
            "there is also output x, Integer in m",
        ),
        (
            (GAP._replace(unit="mm"), REFLECTANCE, INTENSITY, CONTACT),
            "input gap, Real in mm, must be input gap, Real in m",
        ),
        ((GAP, REFLECTANCE, CONTACT, INTENSITY), "the variables are in another order"),
    ],
)
def test_difference(other: tuple[LinkVariable, ...], words: str) -> None:
    assert ONE.difference(Signature(other).text) == words


def test_of_many_differences_four_are_named() -> None:
    assert Signature(()).difference(ONE.text).endswith("; there is also output contact, Boolean")
    many = tuple(LinkVariable(f"x{i}", "Real", "input") for i in range(6))
    assert Signature(many).difference("").endswith("input x3, Real; and 2 more")


@pytest.mark.parametrize("other", ["", "\n\n", "\t\t\t", "nonsense", "input\tReal", "\x00\ud7ff"])
def test_the_text_of_another_may_be_anything(other: str) -> None:
    assert ONE.difference(other)
