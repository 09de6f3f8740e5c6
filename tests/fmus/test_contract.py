"""What annotations come to: fields, who reaches whom, ranges, and what a declaration must have."""

from dataclasses import dataclass, make_dataclass
from enum import IntEnum
from math import inf, nan
from types import SimpleNamespace
from typing import Annotated, NamedTuple

import pytest
from block_variables import Group, Input, Output, Parameter, check
from grasp_cosim.fmu_export.contract import (
    Enumeration,
    build_params,
    declared,
    packer,
    unpacker,
    variables,
)

Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Inner(Group, name="inner"):
    on: Annotated[bool, Parameter("a switch")] = True
    bits: Annotated[int, Parameter("a whole number", low=1, high=9)] = 3
    rate: Annotated[Pair, Parameter("rates", unit="1/s", low=-2.0, high=3.0)] = (-0.5, 0.25)


@dataclass(frozen=True)
class Params:
    mass: Annotated[float, Parameter("m, a mass", unit="kg", low=0.5, high=7.0)] = 2.0
    inner: Inner = Inner()
    offset: Annotated[float, Parameter("from zero", unit="m", high=1.0, tunable=True)] = 0.0

    def __post_init__(self):
        check(self)


@dataclass(frozen=True)
class More(Params):
    free: Annotated[float, Parameter("without a range", unit="m")] = 0.0


class Inputs(NamedTuple):
    gap: Annotated[float, Input("a distance", unit="m", nominal=0.1)] = 0.3
    force: Annotated[Pair, Input("two forces", unit="N", nominal=5.0)] = (1.0, -1.0)
    armed: Annotated[tuple[bool, bool], Input("two switches")] = (False, True)


FROM_ALL = Output("from all forces", unit="N", nominal=2.0, depends_on={"force"})
FROM_OWN = Output("from its own", unit="m", nominal=3.0, depends_on={"armed", "force[j]"})
AT_FIRST = Output("a start", nominal=4.0, depends_on=set(), depends_initially_on={"gap"})


class Outputs(NamedTuple):
    both: Annotated[Pair, FROM_ALL]
    own: Annotated[Pair, FROM_OWN]
    late: Annotated[float, AT_FIRST]
    never: Annotated[bool, Output("from no input", depends_on=set())]


def block(params=Params, inputs=Inputs, outputs=Outputs):
    return SimpleNamespace(Params=params, Inputs=inputs, Outputs=outputs)


FIELDS = declared(block())
FOUND = {v.name: v for v in variables(FIELDS)}


def test_variables_in_the_order_of_declaration_and_their_starts():
    assert {name: v.start for name, v in FOUND.items()} == {
        "gap": 0.3, "force[1]": 1.0, "force[2]": -1.0, "armed[1]": False, "armed[2]": True,
        **dict.fromkeys(["both[1]", "both[2]", "own[1]", "own[2]", "late", "never"]),
        "mass": 2.0, "inner.on": True, "inner.bits": 3, "inner.rate[1]": -0.5,
        "inner.rate[2]": 0.25, "offset": 0.0,
    }  # fmt: skip
    assert [*FOUND] == [name for f in FIELDS for name in f.names]


def test_what_a_variable_holds():
    """Nominal is what is declared; for a parameter the size of its start, unless that is 0."""
    about = {
        "inner.rate[2]": (float, "parameter", "1/s", "fixed", (-2.0, 3.0), "rates", 0.5),
        "inner.bits": (int, "parameter", "", "fixed", (1, 9), "a whole number", None),
        "offset": (float, "parameter", "m", "tunable", (-inf, 1.0), "from zero", None),
        "gap": (float, "input", "m", "continuous", None, "a distance", 0.1),
        "armed[1]": (bool, "input", "", "discrete", None, "two switches", None),
        "both[1]": (float, "output", "N", "continuous", None, "from all forces", 2.0),
        "never": (bool, "output", "", "discrete", None, "from no input", None),
    }
    for name, expected in about.items():
        v = FOUND[name]
        found = v.kind, v.causality, v.unit, v.variability, v.limits, v.description, v.nominal
        assert found == expected


def test_feedthrough():
    """That in initialisation where it is declared, else the same; all parameters beside."""
    armed = ("armed[1]", "armed[2]")
    now = {
        **dict.fromkeys(["both[1]", "both[2]"], ("force[1]", "force[2]")),
        "own[1]": ("force[1]", *armed), "own[2]": ("force[2]", *armed), "late": (), "never": (),
    }  # fmt: skip
    outputs = [v for v in FOUND.values() if v.causality == "output"]
    parameters = tuple(name for name, v in FOUND.items() if v.causality == "parameter")
    assert {v.name: v.dependencies for v in outputs} == now
    initially = {n: (*names, *parameters) for n, names in (now | {"late": ("gap",)}).items()}
    assert {v.name: v.initial_dependencies for v in outputs} == initially


def test_to_and_from_the_list_of_values():
    u = packer(Inputs, FIELDS)([0.7, 1.5, 2.5, True, False, *range(50)])
    assert u == Inputs(0.7, (1.5, 2.5), (True, False))
    assert type(u) is Inputs
    y = Outputs((1.0, 2.0), (3.0, 4.0), 5.0, True)
    assert unpacker(FIELDS)(y) == [1.0, 2.0, 3.0, 4.0, 5.0, True]
    values = [*range(11), 3.0, False, 7, 0.1, 0.2, 0.5]
    assert build_params(block(), FIELDS, values) == Params(3.0, Inner(False, 7, (0.1, 0.2)), 0.5)
    with pytest.raises(ValueError, match=r"^inner\.bits = 0: must be from 1 to 9$"):
        build_params(block(), FIELDS, [*range(11), 3.0, False, 0, 0.1, 0.2, 0.5])


class NoInputs(NamedTuple):
    """A source."""


class Colour(IntEnum):
    RED = 1
    DARK_BLUE = 4


SWITCH, REACHED = Input("a switch"), Output("", unit="m", nominal=1.0, depends_on=set())


def put_in(hint):
    """A block with one input, x."""
    return {"inputs": NamedTuple("OneInput", [("x", hint)])}


def put_out(hint):
    """A block with one output, x."""
    return {"outputs": NamedTuple("OneOutput", [("x", hint)])}


def set_to(hint, value):
    """A block with one parameter, x."""
    return {"params": make_dataclass("OneParameter", [("x", hint, value)], frozen=True)}


def test_a_block_may_have_no_inputs():
    fields = declared(block(inputs=NoInputs, **put_out(Annotated[float, REACHED])))
    assert packer(NoInputs, fields)([None]) == NoInputs()
    assert variables(fields)[0].dependencies == ()


def test_an_int_enum_is_an_enumeration_and_the_block_gets_its_member():
    parts = set_to(Annotated[Colour, Parameter("a choice", tunable=True)], Colour.DARK_BLUE)
    fields = declared(block(**parts))
    variable = variables(fields)[-1]
    assert variable.enumeration == Enumeration("Colour", (("red", 1), ("dark_blue", 4)))
    assert (variable.type, variable.kind) == ("Enumeration", int)
    assert (variable.limits, variable.start) == ((1, 4), 4)
    rest = [None] * (len(variables(fields)) - 1)
    assert build_params(block(**parts), fields, [*rest, 1]) == parts["params"](Colour.RED)
    with pytest.raises(ValueError, match="3 is not a valid Colour"):
        build_params(block(**parts), fields, [*rest, 3])


# What is refused

LAYER = make_dataclass("Layer", [("x", float, 0.0)], frozen=True)
REAL = "must be float, bool, a tuple of one of them$"
WHOLE = "must be float, bool, int, a tuple of one of them, or an IntEnum$"
NOMINAL, REACHES = "must have a nominal value, nominal=", "must have the inputs that reach it"
PORT, LENGTH = Input("a distance", unit="m"), Parameter("a length", unit="m")

WRONG = [
    (put_out(float), r"x: .*Annotated\["),
    (set_to(LAYER, LAYER()), r"x\.x: .*Annotated\["),
    (put_in(Annotated[float, LENGTH]), r"x: .*Annotated\["),
    (put_out(Annotated[bool, Output("a switch")]), f"x: {REACHES}"),
    (put_in(Annotated[Pair, PORT]), f"x: {NOMINAL}"),
    (put_out(Annotated[float, Output("a force", depends_on=set())]), f"x: {NOMINAL}"),
    (put_in(Annotated[int, SWITCH]), f"x is int: {REAL}"),
    (put_in(Annotated[float | None, PORT]), rf"x is float \| None: {REAL}"),
    (put_in(Annotated[tuple[float, ...], PORT]), rf"x is tuple\[float, ...\]: {REAL}"),
    (put_in(Annotated[tuple[()], PORT]), rf"x is tuple\[\(\)\]: {REAL}"),
    (put_out(Annotated[Colour, REACHED]), f"x is Colour: {REAL}"),
    (put_out(Annotated[tuple[float, bool], REACHED]), rf"x is tuple\[float, bool\]: {REAL}"),
    (set_to(Annotated[tuple[Colour, Colour], LENGTH], (1, 1)), rf"x is tuple\[.*Colour\]: {WHOLE}"),
    (put_out(Annotated[Pair, Output("", nominal=1.0, depends_on={"gap[j]"})]),
     r"x: depends on gap\[j\]; valid: armed, armed\[j\], force, force\[j\], gap$"),
    (put_out(Annotated[float, Output("", nominal=1.0, depends_on=set(),
                                     depends_initially_on={"force[1]"})]),
     r"x: depends on force\[1\]; valid: armed, force, gap$"),
]  # fmt: skip


@pytest.mark.parametrize(("parts", "said"), WRONG)
def test_what_is_declared_wrong_is_said(parts, said):
    with pytest.raises(TypeError, match=f"^{said}"):
        declared(block(**parts))


@pytest.mark.parametrize(
    ("kind", "values", "said"),
    [
        (Inner, {"rate": (0.0, 3.5)}, "inner.rate = 3.5 1/s: must be from -2 to 3 1/s"),
        (Params, {"offset": 1.5}, "offset = 1.5 m: must be from -inf to 1 m"),
        (Params, {"offset": -inf}, "offset = -inf m: must be from -inf to 1 m"),
        (More, {"free": nan}, "free = nan m: must be a finite number"),
        (More, {"mass": 0.25}, "mass = 0.25 kg: must be from 0.5 to 7 kg"),
    ],
)
def test_a_value_out_of_its_range_is_one_line(kind, values, said):
    """Of what is declared in the class itself and in those it comes from."""
    with pytest.raises(ValueError, match=r".+") as caught:
        kind(**values)
    assert str(caught.value) == said


def test_both_ends_of_a_range_belong_to_it():
    assert Params(mass=0.5, offset=1.0).mass == Inner(bits=9).bits - 8.5


@pytest.mark.parametrize("wrong", [("kg",), {"nominal": 0.1}])
def test_all_but_the_meaning_goes_by_its_own_keyword(wrong):
    """A number or a set in a row says nothing; a misspelt keyword would be lost."""
    with pytest.raises(TypeError, match="argument"):
        Parameter("a mass", *wrong) if isinstance(wrong, tuple) else Parameter("a mass", **wrong)
