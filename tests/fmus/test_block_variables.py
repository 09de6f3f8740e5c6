"""The declaration of a block's variables, and the one check of their ranges."""

from dataclasses import dataclass
from math import inf, nan
from typing import Annotated

import pytest
from block_variables import Group, Input, Output, Parameter, check


@dataclass(frozen=True)
class Inner:
    rate: Annotated[tuple[float, float], Parameter("rates", unit="1/s", low=-2.0, high=3.0)] = (
        -0.5,
        0.25,
    )

    def __post_init__(self):
        check(self, "inner")


@dataclass(frozen=True, slots=True)
class Slotted(Group, name="slotted"):
    share: Annotated[float, Parameter("a share", low=0.0, high=1.0)] = 0.5


@dataclass(frozen=True)
class Open(Group, name="open"):
    share: Annotated[float, Parameter("a share", low=0.0, high=1.0)] = 0.5


@dataclass(frozen=True)
class Params:
    inner: Inner = Inner()
    on: Annotated[bool, Parameter("a switch")] = True
    bits: Annotated[int, Parameter("a whole number", low=1, high=9)] = 3
    offset: Annotated[float, Parameter("from zero", unit="m", high=1.0)] = 0.0
    free: Annotated[float, Parameter("without a range", unit="m")] = 0.0

    def __post_init__(self):
        check(self)


@dataclass(frozen=True)
class More(Params):
    mass: Annotated[float, Parameter("a mass", unit="kg", low=0.5, high=7.0)] = 2.0


@pytest.mark.parametrize(
    ("kind", "values", "said"),
    [
        (Inner, {"rate": (0.0, 3.5)}, "inner.rate = 3.5 1/s: must be from -2 to 3 1/s"),
        (Slotted, {"share": 2.0}, "slotted.share = 2.0: must be from 0 to 1"),
        (Open, {"share": nan}, "open.share = nan: must be from 0 to 1"),
        (Params, {"bits": 10}, "bits = 10: must be from 1 to 9"),
        (Params, {"offset": 1.5}, "offset = 1.5 m: must be from -inf to 1 m"),
        (Params, {"offset": -inf}, "offset = -inf m: must be from -inf to 1 m"),
        (Params, {"free": nan}, "free = nan m: must be a finite number"),
        (Params, {"free": inf}, "free = inf m: must be a finite number"),
        (More, {"mass": 0.25}, "mass = 0.25 kg: must be from 0.5 to 7 kg"),
        (More, {"bits": 0}, "bits = 0: must be from 1 to 9"),
    ],
)
def test_a_value_out_of_its_range_is_one_line(kind, values, said):
    """Of what is declared in the class itself and in those it comes from."""
    with pytest.raises(ValueError, match=r".+") as caught:
        kind(**values)
    assert str(caught.value) == said


@pytest.mark.parametrize("bits", [1, 9])
@pytest.mark.parametrize("offset", [-1e300, 1.0])
def test_both_ends_of_a_range_belong_to_it(bits, offset):
    assert Params(bits=bits, offset=offset, on=False).bits == bits


@pytest.mark.parametrize(
    "declared",
    [
        lambda: Parameter("a mass", "kg"),  # type: ignore[call-arg]
        lambda: Input("a gap", "m", 0.1),  # type: ignore[call-arg]
        lambda: Output("a gap", "m", 0.1, ("gap",)),  # type: ignore[call-arg]
        lambda: Input("a gap", low=0.0),  # type: ignore[call-arg]
        lambda: Parameter("a gap", nominal=0.1),  # type: ignore[call-arg]
    ],
)
def test_all_but_the_meaning_goes_by_its_own_keyword(declared):
    """A number or a set in a row says nothing; a misspelt keyword would be lost."""
    with pytest.raises(TypeError, match="argument"):
        declared()
