"""JSON becomes typed data, or one line says what is wrong, where, and what would be valid."""

import re
from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Annotated, Any, Literal, TypedDict

import pytest
from grasp_cosim import InputError
from grasp_cosim.base.typed_json import Decoder, Text, Valid, json_in


class Name:
    def __init__(self, text):
        self.text = text


def name_of(text):
    if not text.isupper():
        raise ValueError(text)
    return Name(text)


@dataclass(frozen=True)
class Inner:
    rate: float
    inner: "Inner | None" = None

    def __post_init__(self):
        if self.rate == 0.0:
            raise InputError("rate = 0.0: must not be 0")


class Known(TypedDict, total=False):
    size: Annotated[int, Valid("a number above 2", lambda value: value > 2)]


@dataclass(frozen=True)
class Everything:
    count: int
    scheme: Literal["a", "b"] = "a"
    time: int | Fraction = 0
    samples: Sequence[float] = ()
    places: Sequence[int] = ()
    flags: tuple[bool, ...] = ()
    logging: bool | tuple[str, ...] = False
    inner: Inner | None = None
    by_name: Mapping[Name, float | None] | None = None
    known: Known | None = None
    anything: Any = None


DECODER = Decoder({Name: Text("a name in capitals", name_of)})


def decoded(**entries):
    return DECODER.decoded(Everything, "file", {"count": 1, **entries})


def test_each_type_is_decoded():
    assert decoded(time=3).time == 3
    assert decoded(time="1/3").time == Fraction(1, 3)
    assert decoded(samples=[1, 2.5]).samples == array("d", [1.0, 2.5])
    assert decoded(places=[1, 2]).places == array("q", [1, 2])
    assert decoded(flags=[True]).flags == (True,)
    assert decoded(logging=["all"]).logging == ("all",)
    assert decoded(logging=True).logging is True
    assert decoded(inner={"rate": 1, "inner": {"rate": 2.0}}).inner == Inner(1, Inner(2.0))
    assert decoded(known={"size": 3, "later": []}).known == {"size": 3, "later": []}
    assert decoded(anything={"a": [None]}).anything == {"a": [None]}
    ((name, value),) = decoded(by_name={"A": None}).by_name.items()
    assert (name.text, value) == ("A", None)


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ({"count": True}, "file: count = True; must be a whole number"),
        ({"count": 1.0}, "file: count = 1.0; must be a whole number"),
        ({"schem": "a"}, "file: unknown entry 'schem'; did you mean scheme?"),
        ({"scheme": "c"}, "file: scheme = 'c'; must be one of a, b"),
        ({"scheme": []}, "file: scheme = []; must be one of a, b"),
        ({"time": "1/0"}, "file: time = '1/0'; must be a whole number or a fraction in a string"),
        ({"samples": [1.0, "x"]}, "file: samples[1] = 'x'; must be a number"),
        ({"samples": 1.0}, "file: samples = 1.0; must be a list"),
        ({"flags": [1]}, "file: flags[0] = 1; must be true or false"),
        ({"logging": None}, "file: logging = None; must be true or false or a list"),
        ({"inner": []}, "file: inner = []; must be a JSON object or null"),
        ({"inner": {}}, "file: inner: no entry 'rate'; must have one"),
        ({"inner": {"rate": 0.0}}, "file: inner: rate = 0.0: must not be 0"),
        ({"inner": {"rate": 1.0, "inner": {"rate": "x"}}}, "file: inner: inner: rate = 'x'; must"),
        ({"by_name": {"a": 1.0}}, "file: by_name = 'a'; must be a name in capitals"),
        ({"by_name": {"A": "x"}}, "file: by_name: A = 'x'; must be a number or null"),
        ({"known": {"size": 2}}, "file: known: size = 2; must be a number above 2"),
        ({"count": "x" * 99}, f"file: count = '{'x' * 59}...; must be a whole number"),
    ],
)
def test_what_does_not_fit_is_one_line(entries, message):
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        decoded(**entries)


def test_a_required_entry_of_a_typed_dict():
    class Needs(TypedDict):
        a: int

    with pytest.raises(InputError, match=r"^file: no entry 'a'; must have one$"):
        DECODER.decoded(Needs, "file", {})


@pytest.mark.parametrize("text", ["{", b"\xff", "[" * 100_000])
def test_no_json(text):
    with pytest.raises(InputError, match=r"^file: is damaged, not JSON in UTF-8: "):
        json_in("file", text)


def test_json_deeper_than_the_stack():
    value = None
    for _ in range(5000):
        value = {"rate": 1.0, "inner": value}
    with pytest.raises(InputError, match=r"^file: "):
        DECODER.decoded(Inner, "file", value)
