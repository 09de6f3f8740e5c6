"""The declaration of a block, as a flat list of variables: as its slave and descriptions need it.

What a block is, and how its fields are declared: fmus/README.md.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, is_dataclass
from enum import IntEnum
from functools import cache
from itertools import count, islice
from math import inf
from typing import Any, Literal, NamedTuple, Protocol, get_args, get_origin, get_type_hints

from block_variables import Input, Output, Parameter, check_value

Scalar = float | bool | int | str
Causality = Literal["parameter", "input", "output"]

TYPES: dict[type[Scalar], str] = {float: "Real", bool: "Boolean", int: "Integer", str: "String"}
"""What FMI calls a kind of variable."""


class Enumeration(NamedTuple):
    """A type of whole numbers that have names: the items, in the order they are shown in."""

    name: str
    items: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class Variable:
    """A scalar variable; its value reference is its place among all.

    limits are what a host may set, and infinite says that inf is a value too; dependencies, by
    name, what reaches an output without a step, and in initialisation mode. To a relative one the
    offset of its unit does not apply.
    """

    name: str
    kind: type[Scalar]
    causality: Causality
    unit: str = ""
    start: Scalar | None = None
    variability: str = "continuous"
    limits: tuple[float, float] | None = None
    description: str = ""
    nominal: float | None = None
    relative: bool = False
    dependencies: tuple[str, ...] = ()
    initial_dependencies: tuple[str, ...] = ()
    enumeration: Enumeration | None = None
    infinite: bool = False

    @property
    def type(self) -> str:
        """What FMI calls its type."""
        return "Enumeration" if self.enumeration else TYPES[self.kind]

    @property
    def in_unit(self) -> str:
        """Its unit after a number, with a space before it; empty where it has none."""
        return f" {self.unit}" if self.unit else ""

    def check(self, value: Any) -> None:
        """Raise ValueError where it may not have this value; the limits of a text are its bytes."""
        low, high = self.limits or (-inf, inf)
        if self.infinite:
            if not value > -inf:  # or NaN
                must = "must be a finite number, or inf"
                raise ValueError(f"{self.name} = {value!r}{self.in_unit}: {must}")
        elif not isinstance(value, str):
            check_value(self.name, value, self.unit, low, high)
        elif not low <= len(value.encode()) <= high:
            valid = f"must have {low:g} to {high:g} bytes in UTF-8"
            raise ValueError(f"{self.name} = {value!r}: {valid}")


class Block(Protocol):
    """The shape of a block module.

    It may have LONGEST_STEP, in s, and check_inputs(p, u), which raises ValueError for inputs that
    the block cannot take, too.
    """

    Params: type[Any]
    Inputs: type[Any]
    Outputs: type[Any]

    def initial_state(self, p: Any, u: Any, /) -> Any:
        """State from Params and Inputs."""

    def step(self, p: Any, x: Any, u: Any, h: float, /) -> Any:
        """State h seconds later from Params, State and Inputs."""

    def outputs(self, p: Any, x: Any, u: Any, /) -> Any:
        """Outputs from Params, State and Inputs."""


@dataclass(frozen=True, slots=True)
class Field(Variable):
    """One field of a declaration: a scalar, or an array of size scalars, all alike.

    Its start has the shape of the field; dependencies are as the block declares them: "force[j]".
    """

    start: Any = None
    size: int | None = None

    @property
    def names(self) -> list[str]:
        """The names of its scalar variables, in FMI's structured naming convention."""
        name = self.name
        return [name] if self.size is None else [f"{name}[{i + 1}]" for i in range(self.size)]

    @property
    def starts(self) -> list[Any]:
        """The start values of its scalar variables; None where there is none."""
        return [self.start] if self.size is None else list(self.start or [None] * self.size)


def longest_step(block: Block) -> float:
    """The longest communication step in s that a block takes, its LONGEST_STEP; inf without one."""
    longest = getattr(block, "LONGEST_STEP", inf)
    if type(longest) not in (float, int) or not longest > 0.0:
        raise TypeError(f"LONGEST_STEP = {longest!r}: must be a positive number, in s")
    return float(longest)


def input_check(block: Block) -> Callable[[Any, Any], None] | None:
    """What raises ValueError for inputs that a block cannot take, its check_inputs(p, u)."""
    check: Callable[[Any, Any], None] | None = getattr(block, "check_inputs", None)
    return check


def declared(block: Block) -> list[Field]:
    """The fields of a block: inputs, outputs, parameters, each in the order of declaration."""
    inputs = list(_fields(block.Inputs, "input", block.Inputs._field_defaults))
    outputs = list(_fields(block.Outputs, "output", {}))
    for f in outputs:
        valid = {i.name for i in inputs}
        valid |= {f"{i.name}[j]" for i in inputs if f.size and i.size == f.size}
        if unknown := {*f.dependencies, *f.initial_dependencies} - valid:
            valid_names = ", ".join(sorted(valid)) or "nothing, there are no inputs"
            raise TypeError(
                f"{f.name}: depends on {', '.join(sorted(unknown))}; valid: {valid_names}"
            )
    return [*inputs, *outputs, *_parameters(block.Params(), "")]


def variables(fields: list[Field]) -> list[Variable]:
    """The scalar variables of fields, in their order.

    At the start outputs depend on all parameters, and on the inputs that are declared.
    """
    inputs = [f for f in fields if f.causality == "input"]
    parameters = [name for f in fields if f.causality == "parameter" for name in f.names]

    def chosen(sources: tuple[str, ...], index: int) -> Iterator[str]:
        for f in inputs:
            if f.name in sources:
                yield from f.names
            elif f"{f.name}[j]" in sources:
                yield f.names[index]

    scalars = []
    for f in fields:
        always = parameters if f.causality == "output" else ()
        for index, (name, start) in enumerate(zip(f.names, f.starts, strict=True)):
            directly = tuple(chosen(f.dependencies, index))
            initially = *chosen(f.initial_dependencies, index), *always
            about = f.variability, f.limits, f.description, f.nominal, False, directly, initially
            last = f.enumeration, f.infinite
            scalars.append(Variable(name, f.kind, f.causality, f.unit, start, *about, *last))
    return scalars


def packer(cls: type[Any], fields: list[Field]) -> Callable[[list[Any]], Any]:
    """A function from the list of all values to Inputs, which stand at its beginning.

    Compiled for the shape of the block, as NamedTuple compiles its constructor: it runs every step.
    """
    items, _ = _shape(fields, "input", "v[{}]")
    return _compiled(f"(v): return new(cls, ({items}))", new=tuple.__new__, cls=cls)


def unpacker(fields: list[Field]) -> Callable[[Any], list[Any]]:
    """A function from Outputs to the list of their scalars, compiled like packer()."""
    items, scalars = _shape(fields, "output", "y{}")
    return _compiled(f"(y): ({items}) = y; return [{scalars}]")


def stepper(block: Block, fields: list[Field]) -> Callable[[Any, Any, Any, float], Any]:
    """A function from Params, State, Inputs and h to the next State, the list of the scalars of
    the Outputs then, and their sum: compiled like packer().
    """
    items, scalars = _shape(fields, "output", "y{}")
    total = scalars.replace(",", " +")
    return _compiled(
        f"(p, x, u, h): x = step(p, x, u, h); ({items}) = outputs(p, x, u); "
        f"return x, [{scalars}], {total} 0.0",
        step=block.step,
        outputs=block.outputs,
    )


def _shape(fields: list[Field], causality: Causality, name: str) -> tuple[str, str]:
    """Names for the scalars of a causality, numbered: in the shape of the fields, and in a row."""
    items, number = "", count()
    for f in fields:
        if f.causality != causality:
            continue
        names = "".join(f"{name.format(next(number))}, " for _ in f.names)
        items += names if f.size is None else f"({names}), "
    return items, "".join(f"{name.format(i)}, " for i in range(next(number)))


def _compiled(definition: str, **names: Any) -> Callable[..., Any]:
    exec(f"def function{definition}", names)  # noqa: S102 - written here, from the shape only
    function: Callable[..., Any] = names["function"]
    return function


def build_params(block: Block, fields: list[Field], values: list[Any]) -> Any:
    """Params from the list of all values; ValueError as the block raises it."""
    remaining = iter(values)
    by_name = {
        f.name: next(remaining) if f.size is None else (*islice(remaining, f.size),) for f in fields
    }
    return _build(block.Params, "", by_name)


def _build(cls: type[Any], above: str, values: dict[str, Any]) -> Any:
    arguments: dict[str, Any] = {}
    for name, kind in _types(cls).items():  # type: ignore[arg-type]  # any type can be hashed
        if hasattr(kind, "__dataclass_fields__"):
            arguments[name] = _build(kind, f"{above}{name}.", values)
        else:
            is_enum = isinstance(kind, type) and issubclass(kind, IntEnum)
            value = values[above + name]
            arguments[name] = kind(value) if is_enum else value
    return cls(**arguments)


_types = cache(get_type_hints)
"""Read once, as Params are made whenever one is set."""


def _parameters(params: Any, above: str) -> Iterator[Field]:
    for name, hint in get_type_hints(type(params), include_extras=True).items():
        value = getattr(params, name)
        if is_dataclass(value):
            yield from _parameters(value, f"{above}{name}.")
        else:
            yield _field(above + name, "parameter", hint, value)


def _fields(cls: type[Any], causality: Causality, starts: dict[str, Any]) -> Iterator[Field]:
    for name, hint in get_type_hints(cls, include_extras=True).items():
        yield _field(name, causality, hint, starts.get(name))


def _kind(name: str, causality: Causality, base: Any) -> type[Any]:
    items = set(get_args(base)) if get_origin(base) is tuple else {base}
    is_parameter = causality == "parameter"
    kinds: tuple[type[Any], ...] = (float, bool, int) if is_parameter else (float, bool)
    if len(items) == 1 and (kind := items.pop()) in kinds:
        return kind  # type: ignore[no-any-return]
    if is_parameter and isinstance(base, type) and issubclass(base, IntEnum):
        return base
    got = base.__name__ if isinstance(base, type) else base
    integer, enumeration = (", int", ", or an IntEnum") if is_parameter else ("", "")
    must = f"must be float, bool{integer}, a tuple of one of them{enumeration}"
    raise TypeError(f"{name} is {got}: {must}")


DECLARED = {
    "parameter": 'Parameter("meaning", unit="N")',
    "input": 'Input("meaning", unit="N", nominal=1.0)',
    "output": 'Output("meaning", unit="N", nominal=1.0, depends_on=set())',
}
"""How a variable is declared, by its causality: an example."""


def _field(name: str, causality: Causality, hint: Any, start: Any) -> Field:
    valid: type[Any] = {"parameter": Parameter, "input": Input, "output": Output}[causality]
    declared = getattr(hint, "__metadata__", (None,))[0]
    if not isinstance(declared, valid):
        raise TypeError(f"{name}: must be like Annotated[float, {DECLARED[causality]}]")
    base = get_args(hint)[0]
    size = len(get_args(base)) if get_origin(base) is tuple else None
    kind = _kind(name, causality, base)
    variability = "continuous" if kind is float else "discrete"
    limits = enumeration = nominal = None
    directly: tuple[str, ...] = ()
    initially = directly
    if isinstance(declared, Parameter):
        variability = "tunable" if declared.tunable else "fixed"
        if (declared.low, declared.high) != (-inf, inf):
            limits = (declared.low, declared.high)
        if kind is float:
            first = start[0] if size else start
            if not isinstance(first, float):
                raise TypeError(f"{name} = {start!r}: must be of type float")
            nominal = abs(first) or None
    elif kind is float:
        if declared.nominal is None:
            raise TypeError(f"{name}: must have a nominal value, nominal=...")
        nominal = float(declared.nominal)
    infinite = isinstance(declared, Input) and declared.infinite
    if isinstance(declared, Output):
        if declared.depends_on is None:
            must = "must have the inputs that reach it without a step, depends_on={...}"
            raise TypeError(f"{name}: {must}")
        later = declared.depends_initially_on
        directly = tuple(sorted(declared.depends_on))
        initially = directly if later is None else tuple(sorted(later))
    if issubclass(kind, IntEnum):
        items = tuple((member.name.lower(), int(member)) for member in kind)
        enumeration = Enumeration(kind.__name__, items)
        limits, kind, start = (min(kind), max(kind)), int, int(start)
    about = variability, limits, declared.description, nominal, False, directly, initially
    last = enumeration, infinite
    return Field(name, kind, causality, declared.unit, start, *about, *last, size)
