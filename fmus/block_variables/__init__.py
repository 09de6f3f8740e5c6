"""How a block declares its variables, and the one check of their ranges. Equations: fmus/README.md.

Standard library only: blocks import this package, and every FMU brings it along.
"""

from collections.abc import Collection
from dataclasses import KW_ONLY, dataclass
from functools import cache
from math import inf, isfinite
from typing import Any, get_type_hints

__all__ = ["Group", "Input", "Output", "Parameter", "check", "check_value"]


# Without eq: `typing` keeps each Annotated[...] by its arguments, for all copies of this module
# that are packed into the FMUs of one host, and asks equal ones for `==`.
@dataclass(frozen=True, slots=True, eq=False)
class Parameter:
    """A parameter, valid from `low` to `high`; `tunable` if it may change at run time.

    `unit` is one of SI, in FMI's way of writing it; empty for what has none.
    """

    description: str
    _: KW_ONLY
    unit: str = ""
    low: float = -inf
    high: float = inf
    tunable: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Input:
    """An input; `nominal` is the size that a real one usually has.

    `infinite` if inf is a value of it, as of a distance to nothing.
    """

    description: str
    _: KW_ONLY
    unit: str = ""
    nominal: float | None = None
    infinite: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Output:
    """An output; `depends_on` are the inputs that reach it without a step (direct feedthrough).

    Of arrays, "velocity[j]" is the element with the same index. `depends_initially_on` are the
    inputs that do so in initialisation mode, where the state itself is made from the inputs; left
    out, they are the same.
    """

    description: str
    _: KW_ONLY
    unit: str = ""
    nominal: float | None = None
    depends_on: Collection[str] | None = None
    depends_initially_on: Collection[str] | None = None


class Group:
    """Base of parameters that a block holds under the field `name`.

    A value outside its declared range raises ValueError, as it does in the block's own.
    """

    __slots__ = ()
    _group = ""

    def __init_subclass__(cls, name: str = "") -> None:
        if name:  # a dataclass with slots is made once more, without it
            cls._group = name

    def __post_init__(self) -> None:
        check(self, self._group)


def check(params: Any, group: str = "") -> None:
    """Raise ValueError, naming the parameter, where a number of `params` is out of its range.

    `group` is the name of the field under which the parameters of a block hold `params`.
    """
    for name, declared in _parameters(type(params)):  # type: ignore[arg-type]  # any type can be hashed
        value = getattr(params, name)
        label = f"{group}.{name}" if group else name
        for number in value if isinstance(value, tuple) else (value,):
            check_value(label, number, declared.unit, declared.low, declared.high)


def check_value(
    name: str, value: float, unit: str = "", low: float = -inf, high: float = inf
) -> None:
    """Raise ValueError unless `value` is a finite number from `low` to `high`."""
    if not (low <= value <= high and isfinite(value)):
        in_unit = f" {unit}" if unit else ""
        limited = (low, high) != (-inf, inf)
        valid = f"from {low:g} to {high:g}{in_unit}" if limited else "a finite number"
        raise ValueError(f"{name} = {value!r}{in_unit}: must be {valid}")


@cache
def _parameters(kind: type[Any]) -> list[tuple[str, Parameter]]:
    """Return the fields of `kind` that are declared as a Parameter; read once per class."""
    hints = get_type_hints(kind, include_extras=True)
    declarations = (
        (name, getattr(hint, "__metadata__", (None,))[0]) for name, hint in hints.items()
    )
    return [(name, declared) for name, declared in declarations if isinstance(declared, Parameter)]
