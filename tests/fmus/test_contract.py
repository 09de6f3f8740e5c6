"""What annotations come to: fields, who reaches whom, and what a declaration must have."""

from dataclasses import dataclass
from enum import IntEnum
from types import SimpleNamespace
from typing import Annotated, Any, NamedTuple

import pytest
from block_variables import Input, Output, Parameter
from grasp_fmus.contract import (
    Field,
    build_params,
    declared,
    packer,
    unpacker,
    variables,
)
from grasp_fmus.variable import Enumeration

Pair = tuple[float, float]


@dataclass(frozen=True)
class Inner:
    on: Annotated[bool, Parameter("a switch")] = True
    bits: Annotated[int, Parameter("a whole number", low=1, high=9)] = 3
    rate: Annotated[Pair, Parameter("rates", unit="1/s", low=-2.0, high=3.0)] = (-0.5, 0.25)

    def __post_init__(self) -> None:
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


def block(params: Any = Params, inputs: Any = Inputs, outputs: Any = Outputs) -> Any:
    return SimpleNamespace(Params=params, Inputs=inputs, Outputs=outputs)


FIELDS = declared(block())
BY_NAME = {".".join(f.path): f for f in FIELDS}
NAMES = [name for f in FIELDS for name in f.names]


def test_scalars_in_the_order_of_declaration() -> None:
    assert NAMES == [
        "gap", "force[1]", "force[2]", "armed[1]", "armed[2]",
        "both[1]", "both[2]", "own[1]", "own[2]", "late", "never",
        "mass", "inner.on", "inner.bits", "inner.rate[1]", "inner.rate[2]", "offset",
    ]  # fmt: skip


def test_what_a_field_holds() -> None:
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
    assert [name for name, f in BY_NAME.items() if f.tunable] == ["offset"]


def test_starts_are_the_defaults_and_outputs_have_none() -> None:
    assert [start for f in FIELDS for start in f.starts] == [
        0.3, 1.0, -1.0, False, True,
        None, None, None, None, None, None,
        2.0, True, 3, -0.5, 0.25, 0.0,
    ]  # fmt: skip


def test_nominal_values() -> None:
    """Declared for inputs and outputs; for a parameter the size of its start, unless that is 0."""
    real = {name: f.nominal for name, f in BY_NAME.items() if f.kind is float}
    assert real == {
        "gap": 0.1, "force": 5.0,
        "both": 2.0, "own": 3.0, "late": 4.0,
        "mass": 2.0, "inner.rate": 0.5, "offset": None,
    }  # fmt: skip
    assert {f.nominal for f in FIELDS if f.kind is not float} == {None}


def test_an_array_is_as_many_variables_as_it_has_elements() -> None:
    causalities = [v.causality for v in variables(FIELDS)]
    assert causalities == ["input"] * 5 + ["output"] * 6 + ["parameter"] * 6


def feedthrough(fields: list[Field], initially: bool) -> dict[str, list[str]]:
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


def test_feedthrough_while_stepping() -> None:
    assert feedthrough(FIELDS, initially=False) == {
        "both[1]": ["force[1]", "force[2]"],
        "both[2]": ["force[1]", "force[2]"],
        "own[1]": ["force[1]", "armed[1]", "armed[2]"],
        "own[2]": ["force[2]", "armed[1]", "armed[2]"],
        "late": [],
        "never": [],
    }


def test_feedthrough_in_initialisation() -> None:
    """That of the second set; where there is one only, the same as while stepping."""
    stepping = feedthrough(FIELDS, initially=False)
    assert feedthrough(FIELDS, initially=True) == {**stepping, "late": ["gap"]}


def test_inputs_and_outputs_to_and_from_the_list_of_values() -> None:
    values = [0.7, 1.5, 2.5, True, False, *range(50)]
    u = packer(Inputs, FIELDS)(values)
    assert u == Inputs(0.7, (1.5, 2.5), (True, False))
    assert type(u) is Inputs
    y = Outputs((1.0, 2.0), (3.0, 4.0), 5.0, True)
    assert unpacker(FIELDS)(y) == [1.0, 2.0, 3.0, 4.0, 5.0, True]


def test_params_from_the_list_of_values() -> None:
    values = [*range(11), 3.0, False, 7, 0.1, 0.2, 0.5]
    assert build_params(block(), FIELDS, values) == Params(3.0, Inner(False, 7, (0.1, 0.2)), 0.5)


def test_what_the_block_refuses_is_passed_on() -> None:
    with pytest.raises(ValueError, match="rate too high"):
        build_params(block(), FIELDS, [*range(11), 3.0, False, 7, 1.5, 0.2, 0.5])


class BareInput(NamedTuple):
    force: float = 0.0


class BareOutput(NamedTuple):
    force: float


@dataclass(frozen=True)
class BareParameter:
    inner: Inner = Inner()
    force: float = 0.0


@dataclass(frozen=True)
class BareInside:
    @dataclass(frozen=True)
    class Layer:
        force: float = 0.0

    layer: Layer = Layer()


@pytest.mark.parametrize(
    ("parts", "name"),
    [
        ({"inputs": BareInput}, "force"),
        ({"outputs": BareOutput}, "force"),
        ({"params": BareParameter}, "force"),
        ({"params": BareInside}, "layer.force"),
    ],
)
def test_a_field_must_be_annotated(parts: dict[str, Any], name: str) -> None:
    with pytest.raises(TypeError, match=rf"^{name}: .*Annotated\["):
        declared(block(**parts))


class Unreached(NamedTuple):
    force: Annotated[float, Output("reached by who knows what", unit="N", nominal=1.0)]


class UnreachedSwitch(NamedTuple):
    force: Annotated[bool, Output("reached by who knows what")]


@pytest.mark.parametrize("outputs", [Unreached, UnreachedSwitch])
def test_an_output_must_say_what_reaches_it(outputs: Any) -> None:
    with pytest.raises(
        TypeError, match=r"^force: must have the inputs that reach it .*depends_on="
    ):
        declared(block(outputs=outputs))


class InputWithoutNominal(NamedTuple):
    force: Annotated[float, Input("how large?", unit="N")] = 1.0


class PairWithoutNominal(NamedTuple):
    force: Annotated[Pair, Input("how large?", unit="N")] = (1.0, 1.0)


class OutputWithoutNominal(NamedTuple):
    force: Annotated[float, Output("how large?", unit="N", depends_on=set())]


@pytest.mark.parametrize(
    "parts",
    [
        {"inputs": InputWithoutNominal},
        {"inputs": PairWithoutNominal},
        {"outputs": OutputWithoutNominal},
    ],
)
def test_a_real_input_or_output_must_have_a_nominal_value(parts: dict[str, Any]) -> None:
    with pytest.raises(TypeError, match=r"^force: must have a nominal value, nominal="):
        declared(block(**parts))


class Misspelt(NamedTuple):
    misspelt: Annotated[float, Output("", unit="m", nominal=1.0, depends_on={"gapp"})]


class NoPair(NamedTuple):
    own: Annotated[Pair, Output("", unit="m", nominal=1.0, depends_on={"gap[j]"})]


class NoSuchAtTheStart(NamedTuple):
    late: Annotated[
        float,
        Output("", unit="m", nominal=1.0, depends_on=set(), depends_initially_on={"force[1]"}),
    ]


@pytest.mark.parametrize(
    ("outputs", "message"),
    [
        (Misspelt, "misspelt: depends on gapp; valid: armed, force, gap$"),
        (NoPair, r"own: depends on gap\[j\]; valid: armed, armed\[j\], force, force\[j\], gap$"),
        (NoSuchAtTheStart, r"late: depends on force\[1\]; valid: armed, force, gap$"),
    ],
)
def test_an_output_can_only_depend_on_inputs_that_there_are(outputs: Any, message: str) -> None:
    with pytest.raises(TypeError, match=message):
        declared(block(outputs=outputs))


class NoInputs(NamedTuple):
    """A source."""


class Source(NamedTuple):
    level: Annotated[float, Output("", unit="m", nominal=1.0, depends_on=set())]


def test_a_block_may_have_no_inputs() -> None:
    fields = declared(block(inputs=NoInputs, outputs=Source))
    assert packer(NoInputs, fields)([None]) == NoInputs()
    assert feedthrough(fields, initially=True) == {"level": []}


class Colour(IntEnum):
    RED = 1
    DARK_BLUE = 4


@dataclass(frozen=True)
class Coloured:
    colour: Annotated[Colour, Parameter("a choice", tunable=True)] = Colour.DARK_BLUE


def test_an_int_enum_is_an_enumeration() -> None:
    (field,) = (f for f in declared(block(params=Coloured)) if f.causality == "parameter")
    assert field.enumeration == Enumeration("Colour", (("red", 1), ("dark_blue", 4)))
    assert (field.kind, field.limits, field.starts) == (int, (1, 4), [4])
    (variable,) = (v for v in variables([field]))
    assert (variable.type, variable.kind) == ("Enumeration", int)


class Choice(NamedTuple):
    colour: Annotated[Colour, Input("a choice")] = Colour.RED


class WholeNumber(NamedTuple):
    number: Annotated[int, Input("a number")] = 1


class WholeNumbers(NamedTuple):
    number: Annotated[tuple[int, int], Input("two numbers")] = (1, 2)


class Chosen(NamedTuple):
    colour: Annotated[Colour, Output("a choice", depends_on=set())]


class Optional(NamedTuple):
    gap: Annotated[float | None, Input("a distance", unit="m", nominal=0.1)] = None


class Mixed(NamedTuple):
    both: Annotated[
        tuple[float, bool],
        Output("a distance, and whether it is one", unit="m", nominal=0.1, depends_on=set()),
    ]


class AnyNumber(NamedTuple):
    gap: Annotated[tuple[float, ...], Input("distances", unit="m", nominal=0.1)] = ()


class NoNumber(NamedTuple):
    gap: Annotated[tuple[()], Input("distances", unit="m", nominal=0.1)] = ()


@dataclass(frozen=True)
class Colours:
    colours: Annotated[tuple[Colour, Colour], Parameter("two choices")] = (Colour.RED, Colour.RED)


@dataclass(frozen=True)
class OptionalParameter:
    mass: Annotated[float | None, Parameter("a mass", unit="kg", low=0.5, high=7.0)] = None


@dataclass(frozen=True)
class Text:
    title: Annotated[str, Parameter("a text")] = ""


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ({"inputs": Choice}, "colour is Colour: "),
        ({"inputs": WholeNumber}, "number is int: "),
        ({"inputs": WholeNumbers}, r"number is tuple\[int, int\]: "),
        ({"outputs": Chosen}, "colour is Colour: "),
        ({"inputs": Optional}, r"gap is float \| None: "),
        ({"outputs": Mixed}, r"both is tuple\[float, bool\]: "),
        ({"inputs": AnyNumber}, r"gap is tuple\[float, ...\]: "),
        ({"inputs": NoNumber}, r"gap is tuple\[\(\)\]: "),
    ],
)
def test_an_input_or_output_is_real_or_boolean(parts: dict[str, Any], message: str) -> None:
    with pytest.raises(TypeError, match=f"^{message}must be float, bool, a tuple of one of them$"):
        declared(block(**parts))


@pytest.mark.parametrize(
    ("params", "message"),
    [
        (Colours, r"colours is tuple\[.*Colour, .*Colour\]: "),
        (OptionalParameter, r"mass is float \| None: "),
        (Text, "title is str: "),
    ],
)
def test_a_parameter_may_be_a_whole_number_or_a_choice_as_well(params: Any, message: str) -> None:
    valid = "must be float, bool, int, a tuple of one of them, or an IntEnum"
    with pytest.raises(TypeError, match=f"^{message}{valid}$"):
        declared(block(params=params))


def test_the_block_gets_the_member_of_an_enumeration() -> None:
    fields = declared(block(params=Coloured))
    values = [None] * (len([n for f in fields for n in f.names]) - 1)
    assert build_params(block(params=Coloured), fields, [*values, 1]) == Coloured(Colour.RED)


def test_a_number_between_the_items_is_refused_by_the_block() -> None:
    fields = declared(block(params=Coloured))
    values = [None] * (len([n for f in fields for n in f.names]) - 1)
    with pytest.raises(ValueError, match="3 is not a valid Colour"):
        build_params(block(params=Coloured), fields, [*values, 3])
