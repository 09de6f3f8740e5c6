"""What annotations come to: fields, who reaches whom, and what a declaration must have."""

from dataclasses import dataclass, make_dataclass
from enum import IntEnum
from types import SimpleNamespace
from typing import Annotated, NamedTuple

import pytest
from block_variables import Input, Output, Parameter
from grasp_fmus.contract import (
    Enumeration,
    build_params,
    declared,
    packer,
    unpacker,
    variables,
)

Pair = tuple[float, float]


@dataclass(frozen=True)
class Inner:
    on: Annotated[bool, Parameter("a switch")] = True
    bits: Annotated[int, Parameter("a whole number", low=1, high=9)] = 3
    rate: Annotated[Pair, Parameter("rates", unit="1/s", low=-2.0, high=3.0)] = (-0.5, 0.25)

    def __post_init__(self):
        if self.rate[0] > 1.0:
            raise ValueError("rate too high")


@dataclass(frozen=True)
class Params:
    mass: Annotated[float, Parameter("m, a mass", unit="kg", low=0.5, high=7.0)] = 2.0
    inner: Inner = Inner()
    offset: Annotated[float, Parameter("from zero", unit="m", low=-1.0, high=1.0, tunable=True)] = (
        0.0
    )


class Inputs(NamedTuple):
    gap: Annotated[float, Input("a distance", unit="m", nominal=0.1)] = 0.3
    force: Annotated[Pair, Input("two forces", unit="N", nominal=5.0)] = (1.0, -1.0)
    armed: Annotated[tuple[bool, bool], Input("two switches")] = (False, True)


class Outputs(NamedTuple):
    both: Annotated[Pair, Output("from all forces", unit="N", nominal=2.0, depends_on={"force"})]
    own: Annotated[
        Pair, Output("from its own force", unit="m", nominal=3.0, depends_on={"armed", "force[j]"})
    ]
    late: Annotated[
        float,
        Output(
            "only at the start",
            unit="m",
            nominal=4.0,
            depends_on=set(),
            depends_initially_on={"gap"},
        ),
    ]
    never: Annotated[bool, Output("from no input", depends_on=set())]


def block(params=Params, inputs=Inputs, outputs=Outputs):
    return SimpleNamespace(Params=params, Inputs=inputs, Outputs=outputs)


FIELDS = declared(block())
BY_NAME = {f.name: f for f in FIELDS}
NAMES = [name for f in FIELDS for name in f.names]


def test_scalars_in_the_order_of_declaration():
    assert NAMES == [
        "gap", "force[1]", "force[2]", "armed[1]", "armed[2]",
        "both[1]", "both[2]", "own[1]", "own[2]", "late", "never",
        "mass", "inner.on", "inner.bits", "inner.rate[1]", "inner.rate[2]", "offset",
    ]  # fmt: skip


def test_what_a_field_holds():
    rate = BY_NAME["inner.rate"]
    assert (rate.causality, rate.kind, rate.size) == ("parameter", float, 2)
    assert (rate.unit, rate.description, rate.limits) == ("1/s", "rates", (-2.0, 3.0))
    bits = BY_NAME["inner.bits"]
    assert (bits.kind, bits.limits, bits.variability) == (int, (1, 9), "fixed")
    armed = BY_NAME["armed"]
    assert (armed.causality, armed.kind, armed.size) == ("input", bool, 2)
    never = BY_NAME["never"]
    assert (never.causality, never.kind, never.size) == ("output", bool, None)
    assert (BY_NAME["gap"].limits, armed.limits) == (None, None)
    assert [name for name, f in BY_NAME.items() if f.variability == "tunable"] == ["offset"]


def test_starts_are_the_defaults_and_outputs_have_none():
    assert [start for f in FIELDS for start in f.starts] == [
        0.3, 1.0, -1.0, False, True,
        None, None, None, None, None, None,
        2.0, True, 3, -0.5, 0.25, 0.0,
    ]  # fmt: skip


def test_nominal_values():
    """Declared for inputs and outputs; for a parameter the size of its start, unless that is 0."""
    real = {name: f.nominal for name, f in BY_NAME.items() if f.kind is float}
    assert real == {
        "gap": 0.1, "force": 5.0,
        "both": 2.0, "own": 3.0, "late": 4.0,
        "mass": 2.0, "inner.rate": 0.5, "offset": None,
    }  # fmt: skip
    assert {f.nominal for f in FIELDS if f.kind is not float} == {None}


def feedthrough(fields, initially):
    """The inputs that reach each output without a step, by name, as its variable has them."""
    found = variables(fields)
    inputs = {v.name for v in found if v.causality == "input"}
    return {
        v.name: [
            name
            for name in (v.initial_dependencies if initially else v.dependencies)
            if name in inputs
        ]
        for v in found
        if v.causality == "output"
    }


def test_feedthrough_while_stepping():
    assert feedthrough(FIELDS, initially=False) == {
        "both[1]": ["force[1]", "force[2]"],
        "both[2]": ["force[1]", "force[2]"],
        "own[1]": ["force[1]", "armed[1]", "armed[2]"],
        "own[2]": ["force[2]", "armed[1]", "armed[2]"],
        "late": [],
        "never": [],
    }


def test_feedthrough_in_initialisation():
    """That of the second set; where there is one only, the same as while stepping."""
    stepping = feedthrough(FIELDS, initially=False)
    assert feedthrough(FIELDS, initially=True) == {**stepping, "late": ["gap"]}


def test_inputs_and_outputs_to_and_from_the_list_of_values():
    values = [0.7, 1.5, 2.5, True, False, *range(50)]
    u = packer(Inputs, FIELDS)(values)
    assert u == Inputs(0.7, (1.5, 2.5), (True, False))
    assert type(u) is Inputs
    y = Outputs((1.0, 2.0), (3.0, 4.0), 5.0, True)
    assert unpacker(FIELDS)(y) == [1.0, 2.0, 3.0, 4.0, 5.0, True]


def test_params_from_the_list_of_values():
    values = [*range(11), 3.0, False, 7, 0.1, 0.2, 0.5]
    assert build_params(block(), FIELDS, values) == Params(3.0, Inner(False, 7, (0.1, 0.2)), 0.5)


def test_what_the_block_refuses_is_passed_on():
    with pytest.raises(ValueError, match="rate too high"):
        build_params(block(), FIELDS, [*range(11), 3.0, False, 7, 1.5, 0.2, 0.5])


# What is refused

SWITCH = Input("a switch")
REACHED = Output("a distance", unit="m", nominal=1.0, depends_on=set())


def put_in(hint):
    """A block with one input, x."""
    return {"inputs": NamedTuple("OneInput", [("x", hint)])}


def put_out(hint):
    """A block with one output, x."""
    return {"outputs": NamedTuple("OneOutput", [("x", hint)])}


def set_to(hint, value):
    """A block with one parameter, x."""
    return {"params": make_dataclass("OneParameter", [("x", hint, value)], frozen=True)}


class Colour(IntEnum):
    RED = 1
    DARK_BLUE = 4


LAYER = make_dataclass("Layer", [("x", float, 0.0)], frozen=True)
REAL = "must be float, bool, a tuple of one of them$"
WHOLE = "must be float, bool, int, a tuple of one of them, or an IntEnum$"
NOMINAL, REACHES = "must have a nominal value, nominal=", "must have the inputs that reach it"
PORT, LENGTH = Input("a distance", unit="m"), Parameter("a length", unit="m")

WRONG = [
    (put_in(float), r"x: .*Annotated\["),
    (put_out(float), r"x: .*Annotated\["),
    (set_to(float, 0.0), r"x: .*Annotated\["),
    (set_to(LAYER, LAYER()), r"x\.x: .*Annotated\["),
    (put_in(Annotated[float, LENGTH]), r"x: .*Annotated\["),
    (put_out(Annotated[bool, Output("a switch")]), f"x: {REACHES}"),
    (put_out(Annotated[float, Output("a force", unit="N", nominal=1.0)]), f"x: {REACHES}"),
    (put_in(Annotated[float, PORT]), f"x: {NOMINAL}"),
    (put_in(Annotated[Pair, PORT]), f"x: {NOMINAL}"),
    (put_out(Annotated[float, Output("a force", depends_on=set())]), f"x: {NOMINAL}"),
    (put_in(Annotated[Colour, SWITCH]), f"x is Colour: {REAL}"),
    (put_in(Annotated[int, SWITCH]), f"x is int: {REAL}"),
    (put_in(Annotated[tuple[int, int], SWITCH]), rf"x is tuple\[int, int\]: {REAL}"),
    (put_in(Annotated[float | None, PORT]), rf"x is float \| None: {REAL}"),
    (put_in(Annotated[tuple[float, ...], PORT]), rf"x is tuple\[float, ...\]: {REAL}"),
    (put_in(Annotated[tuple[()], PORT]), rf"x is tuple\[\(\)\]: {REAL}"),
    (put_out(Annotated[Colour, REACHED]), f"x is Colour: {REAL}"),
    (put_out(Annotated[tuple[float, bool], REACHED]), rf"x is tuple\[float, bool\]: {REAL}"),
    (set_to(Annotated[tuple[Colour, Colour], LENGTH], (1, 1)), rf"x is tuple\[.*Colour\]: {WHOLE}"),
    (set_to(Annotated[float | None, LENGTH], None), rf"x is float \| None: {WHOLE}"),
    (set_to(Annotated[str, LENGTH], ""), f"x is str: {WHOLE}"),
    (put_out(Annotated[float, Output("", nominal=1.0, depends_on={"gapp"})]),
     "x: depends on gapp; valid: armed, force, gap$"),
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


# Shapes of their own


class NoInputs(NamedTuple):
    """A source."""


def test_a_block_may_have_no_inputs():
    fields = declared(block(inputs=NoInputs, **put_out(Annotated[float, REACHED])))
    assert packer(NoInputs, fields)([None]) == NoInputs()
    assert feedthrough(fields, initially=True) == {"x": []}


def test_an_int_enum_is_an_enumeration_and_the_block_gets_its_member():
    parts = set_to(Annotated[Colour, Parameter("a choice", tunable=True)], Colour.DARK_BLUE)
    fields = declared(block(**parts))
    *others, field = fields
    assert field.enumeration == Enumeration("Colour", (("red", 1), ("dark_blue", 4)))
    assert (field.kind, field.limits, field.starts) == (int, (1, 4), [4])
    (variable,) = variables([field])
    assert (variable.type, variable.kind) == ("Enumeration", int)
    rest = [None for f in others for _ in f.names]
    assert build_params(block(**parts), fields, [*rest, 1]) == parts["params"](Colour.RED)
    with pytest.raises(ValueError, match="3 is not a valid Colour"):
        build_params(block(**parts), fields, [*rest, 3])
